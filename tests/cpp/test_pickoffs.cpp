// Known pick-offs: the correction of measurements, and a controller behind it.
#include "follow.hpp"
#include "made.hpp"
#include "scalars.hpp"

#include "fracgyro/controllers/conventional.hpp"
#include "fracgyro/controllers/pid.hpp"
#include "fracgyro/controllers/sliding_mode.hpp"
#include "fracgyro/hardware/guard.hpp"
#include "fracgyro/plant/imperfections.hpp"
#include "fracgyro/sim/guarded_controller.hpp"

#include <cmath>
#include <vector>

namespace fracgyro::testing {
namespace {

using Joint = SlidingModeController<double, LinearSurface, JointAdaptation>;
template <class C, bool positions_only, bool filtered, bool triggered>
using Known = typename ForDevice<C, positions_only, filtered, triggered, true>::Type;
static_assert(std::is_same_v<ForDevice<Joint, false, false, false, false>::Type, Joint>);
static_assert(std::is_same_v<Known<Pid<double>, true, false, false>, Corrected<Observing<Pid<double>>>>);
static_assert(std::is_same_v<Known<Pid<double>, true, true, true>, Corrected<Filtered<Triggered<Pid<double>>, false>>>);
static_assert(Resumable<Corrected<Joint>> && KnowsForce<Corrected<Joint>> == KnowsForce<Joint>);
static_assert(KnowsForce<Corrected<Observing<Pid<double>>>> && !KnowsForce<Corrected<Pid<double>>>);

constexpr AxesParams axes{.gain_error = {0.125, -0.25}, .misalignment = 0.3};

TEST(Pickoffs, WhatADeviceWithTheseAxesMeasuresIsBroughtBack) {
    const auto device = Imperfections::prepare({.pickoff = axes});
    const auto c = Pickoffs<double>::prepare({.pickoffs = axes});
    EXPECT_TRUE(c.on);
    const Motion<double> motion{.position = {0.7, -0.2}, .velocity = {-30.0, 11.0}};
    const Motion<double> seen{.position = device.pickoff(motion.position), .velocity = device.pickoff(motion.velocity)};
    EXPECT_GT(std::fabs(seen.position.x() - 0.7), 0.01);
    const Motion<double> found = Pickoffs<double>::correct(c, seen);
    EXPECT_NEAR(found.position.x(), 0.7, 1e-15);
    EXPECT_NEAR(found.position.y(), -0.2, 1e-15);
    EXPECT_NEAR(found.velocity.x(), -30.0, 1e-13);
    EXPECT_NEAR(found.velocity.y(), 11.0, 1e-13);
}

TEST(Pickoffs, GainsComeBeforeTheTurn) {
    const auto c = Pickoffs<double>::prepare({.pickoffs = {.gain_error = {1.0, 0.0}, .misalignment = pi / 2}});
    const Vec2<double> found = c.map(Vec2<double>{2.0, 3.0});  // [1, 3] along axes turned to +y and -x
    EXPECT_NEAR(found.x(), -3.0, 1e-15);
    EXPECT_NEAR(found.y(), 1.0, 1e-15);
}

template <class C>
void expect_its_controller() {
    auto a = CaseOf<typename C::Params>::in_noise();
    a.common.observer_bandwidth = 300.0;
    Loop<C> plain(a);
    Loop<Corrected<C>> corrected(a);
    for (int n = 0; n < 200; ++n) {
        const bool missing = n % 13 == 5;
        plain.step({}, missing);
        corrected.step({}, missing);
        ASSERT_EQ(plain.signals.force.x(), corrected.signals.force.x()) << n;
        ASSERT_EQ(plain.signals.force.y(), corrected.signals.force.y()) << n;
    }
}
TEST(Corrected, WithoutErrorsItIsItsControllerBitForBit) {
    expect_its_controller<Pid<double>>();
    expect_its_controller<Observing<Pid<double>>>();
    expect_its_controller<Joint>();
}

// The controller of a known type, and the one behind a table of functions and the guard.
template <class T, bool positions_only, bool filtered, bool triggered>
void expect_erased() {
    auto a = CaseOf<typename Pid<T>::Params>();
    a.common.force_limit = 1000.0;
    a.common.pickoffs = axes;
    a.common.observer_bandwidth = positions_only ? 300.0 : 0.0;
    a.common.filter.bandwidth = filtered ? 40.0 : 0.0;
    a.common.filter.assumed = {.force_noise = 1.0, .position_noise = noise, .velocity_noise = noise};
    a.common.trigger = {.threshold = triggered ? 5.0 : 0.0};
    using C = Guard<Known<Pid<T>, positions_only, filtered, triggered>>;
    const auto c = C::prepare(a.law, a.common);
    typename C::State state{};
    const auto make = [&] { return make_guarded(make_controller<T>(ControllerParams{a.law}, a.common), a.common); };
    auto erased = make();
    for (int n = 0; n < 200; ++n) {
        if (n == 100) {
            std::vector<unsigned char> bytes(erased->saved_size());
            erased->save(bytes.data());
            erased = make();
            ASSERT_TRUE(erased->restore(bytes.data(), bytes.size()));
        }
        const double x = std::sin(0.01 * n), y = std::cos(0.01 * n);
        const Motion<double> motion{.position = {x, y}, .velocity = {10.0 * y, -10.0 * x}};
        C::step(state, c, {cast<T>(motion.position), cast<T>(motion.velocity)});
        const Vec2<double> found = erased->step(motion);
        ASSERT_EQ(number(state.force.x()), found.x()) << n;
        ASSERT_EQ(number(state.force.y()), found.y()) << n;
    }
}
TEST(Corrected, TheErasedControllerHasTheSameBits) {
    expect_erased<double, false, false, false>();
    expect_erased<double, true, false, false>();
    expect_erased<double, true, true, true>();
    expect_erased<float, false, true, false>();
}

}  // namespace
}  // namespace fracgyro::testing
