// Restoring a state from external bytes.
#include "paper.hpp"

#include "fracgyro/estimation/composite.hpp"
#include "fracgyro/hardware/guard.hpp"
#include "fracgyro/sim/metrics.hpp"
#include "fracgyro/hardware/observer.hpp"
#include "fracgyro/core/saved.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

namespace fracgyro::testing {
namespace {

TEST(Checksum, IsThatOfTheStandardAndGoesOnWhereItEnded) {
    EXPECT_EQ(checksum("123456789", 9), 0xCBF43926U);  // the check value of CRC-32
    EXPECT_EQ(checksum("6789", 4, checksum("12345", 5)), 0xCBF43926U);
}

using Paper = SlidingModeController<double, FractionalFastTerminalSurface>;

template <class Controller>
typename Controller::State after_ten_samples(const typename Controller::Coefficients& c) {
    typename Controller::State state{};
    for (int n = 0; n < 10; ++n) {
        Controller::step(state, c, {.position = {0.5, 0.25}, .velocity = {0.0, 0.1}});
    }
    return state;
}

TEST(ASavedState, ComesBackAndNotWhenABitOfItIsFlippedOrAByteIsMissing) {
    const auto c = prepared<Paper>(paper(100));
    const Paper::State state = after_ten_samples<Paper>(c);
    std::vector<unsigned char> bytes(Saved<Paper::State>::size);
    Saved<Paper::State>::write(state, bytes.data());
    Paper::State read{};
    EXPECT_FALSE(Saved<Paper::State>::read(bytes.data(), bytes.size() - 1, read));
    for (std::size_t at = 0; at < bytes.size(); at += 13) {
        bytes[at] ^= 8;
        EXPECT_FALSE(Saved<Paper::State>::read(bytes.data(), bytes.size(), read));
        bytes[at] ^= 8;
    }
    EXPECT_EQ(read.reference.steps, 0U) << "what is refused changes nothing";
    ASSERT_TRUE(Saved<Paper::State>::read(bytes.data(), bytes.size(), read));
    EXPECT_EQ(read.reference.steps, 10U);
}

template <class Switch>
void expect_sound_but_for(Switch& a, const auto& is_sound) {
    const Switch before = a;
    EXPECT_TRUE(is_sound());
    reinterpret_cast<unsigned char&>(a) = 2;
    EXPECT_FALSE(is_sound());
    a = before;
}

TEST(ASoundState, HasNoMorePairsThanThereAreAndSwitchesThatAreOnOrOff) {
    auto setup = paper(100);
    setup.common.observer_bandwidth = 300.0;
    using Observed = Observing<SlidingModeController<double, FractionalFastTerminalSurface, CompositeAdaptation>>;
    using Guarded = Guard<Observed>;
    const auto c = prepared<Guarded>(setup);
    Guarded::State state{.controller = after_ten_samples<Observed>(c.controller)};
    const auto is_sound = [&] { return Guarded::sound(state, c); };
    auto& surface = state.controller.controller.surface;
    const std::size_t pairs = c.controller.controller.surface.first.fractional.pairs;
    ASSERT_GT(surface.onset_pairs, 0U);
    EXPECT_TRUE(is_sound());
    surface.onset_pairs = pairs + 1;
    EXPECT_FALSE(is_sound());
    surface.onset_pairs = pairs;
    EXPECT_TRUE(is_sound());
    surface.onset_pairs = 0;
    EXPECT_TRUE(is_sound());
    expect_sound_but_for(surface.started, is_sound);
    expect_sound_but_for(state.going, is_sound);
    expect_sound_but_for(state.plausibility.settled, is_sound);
    expect_sound_but_for(state.plausibility.doubted, is_sound);
    expect_sound_but_for(state.controller.observer.started, is_sound);
    expect_sound_but_for(state.controller.controller.adaptation.measured, is_sound);
    for (int status = 0; status < 256; ++status) {
        state.status = static_cast<Status>(status);
        EXPECT_EQ(is_sound(), status <= 7 && status != 5) << status;
    }
}

TEST(APhase, IsDefinedForEveryAngle) {
    const auto phase = [](double radians) { return phase_of(radians); };
    constexpr double turn = 6.28318530717958647693;
    EXPECT_EQ(phase(0.25 * turn), std::uint64_t{1} << 62);
    EXPECT_EQ(phase(0.75 * turn), std::uint64_t{3} << 62);
    EXPECT_EQ(phase(-0.25 * turn), std::uint64_t{3} << 62);
    EXPECT_EQ(phase(1024.25 * turn), std::uint64_t{1} << 62);
    for (const double far : {1e18, 1e19, 1e300, std::numeric_limits<double>::max()}) {
        EXPECT_EQ(phase(far), 0U) << "beyond 2^52 turns a double has no fraction of one";
        EXPECT_EQ(phase(-far), 0U);
    }
    EXPECT_EQ(phase(std::numeric_limits<double>::infinity()), 0U);
    EXPECT_EQ(phase(std::numeric_limits<double>::quiet_NaN()), 0U);
}

TEST(Chattering, IsThatOfTheSecondDifferencesAndNeedsThreeSamples) {
    fracgyro::Setup setup;
    setup.steps = 40;
    const MetricsTotals totals{.steady = {.force = {12.0, 3.0}}, .second_difference = {4.0, 1.0}};
    const auto chattering = [&](std::int64_t samples) {
        return metric_values(MetricsParams{.transient = 0.0}, setup, totals, CommonReport{}, 0.0, samples)
            .chattering.x();
    };
    EXPECT_TRUE(std::isnan(chattering(2)));
    EXPECT_EQ(chattering(3), 1.0);  // 4/1 over 12/3
    EXPECT_EQ(chattering(4), std::sqrt(2.0 / 3.0));
}

TEST(TheSteadyWindow, BeginsWithinTheRunOrRightAfterItWhateverTheTransient) {
    fracgyro::Setup setup;
    setup.common.step = 0.25;
    setup.steps = 40;
    const auto first = [&](double transient) { return first_steady_sample({.transient = transient}, setup); };
    EXPECT_EQ(first(0.0), 0);
    EXPECT_EQ(first(0.25), 1);
    EXPECT_EQ(first(0.3), 2);
    EXPECT_EQ(first(10.0), 40);
    EXPECT_EQ(first(10.1), 41);
    EXPECT_EQ(first(1e300), 41);
    EXPECT_EQ(first(std::numeric_limits<double>::infinity()), 41);
    EXPECT_EQ(first(std::numeric_limits<double>::quiet_NaN()), 0);
}

}  // namespace
}  // namespace fracgyro::testing
