// Modes of operation, by closed forms: drift against the angle, gains, lock-in to the dampers, reversals.
#include "modes.hpp"
#include "scalars.hpp"

#include "fracgyro/plant/duffing.hpp"

#include <algorithm>

namespace fracgyro::testing {
namespace {

constexpr double fast = 200.0 * deg_s, split = 0.5e-4;  // the rotation; the relative split, 0.5 Hz

using Angle = WholeAngle<double>;
DeviceSetupOf<WholeAngleParams> equal_axes() {
    auto s = disc(angle_loops(), fast);
    s.plant.damping = {2.0 * decay, 0.0, 2.0 * decay};
    return s;
}
DeviceSetupOf<WholeAngleParams> split_axes() {
    auto s = equal_axes();
    s.plant.stiffness = along_axis(1.0, split, 0.7);
    return s;
}
double axis_of(const Turn& turn) { return 0.5 * std::atan2(-turn.cos2, turn.sin2); }

// ½Δ(1/τ) = 162.000 deg/h here. The demodulator's lag 1/μ takes ϑ̇/(μτ) of the angle: the drive's force is late.
TEST(WholeAngle, DriftsByTheDampersAtTwiceItsAngleAndReadsTheAngleWithoutAnError) {
    const Turn turn = whole_turn<Angle>(disc(angle_loops(), fast), fast);
    EXPECT_NEAR(drift / deg_h, 162.0, 1e-3);
    EXPECT_NEAR(turn.second() / deg_h, 162.0, 0.05);
    EXPECT_NEAR(axis_of(turn), damping_axis, 2e-4);
    EXPECT_NEAR(turn.rate / fast, 1.0 / (0.2 / decay), 5e-8);
    EXPECT_LT(turn.fourth() / deg_h, 0.02);
}
// Its part at twice the angle lags by the gain control, as much to either side.
TEST(WholeAngle, ReportsADecayThatShowsTheDampers) {
    double axis = 0.0;
    for (const double rate : {fast, -fast}) {
        const Turn turn = whole_turn<Angle>(disc(angle_loops(), rate), fast);
        EXPECT_NEAR(turn.decay_mean / decay, 1.0, 2e-4);
        EXPECT_NEAR(std::hypot(turn.decay_cos2, turn.decay_sin2) / drift, 1.0, 2e-3);
        axis += 0.25 * std::atan2(turn.decay_sin2, turn.decay_cos2);
    }
    EXPECT_NEAR(axis, damping_axis, 2e-4);
}
TEST(WholeAngle, CancelsADriftThatItIsGiven) {
    auto s = disc(angle_loops(), fast);
    s.controller.damping_compensation = drift;
    s.controller.damping_axis = damping_axis;
    EXPECT_LT(whole_turn<Angle>(s, fast).second() / deg_h, 0.07);
}
// -2(Δω/w)², and as much at 4ϑ.
TEST(WholeAngle, LosesByASplitWhatTheQuadratureLoopIsLate) {
    const double lost = 2.0 * split * split / (0.005 * 0.005);
    const Turn turn = whole_turn<Angle>(split_axes(), fast);
    EXPECT_NEAR(turn.rate / fast, lost, 0.04 * lost);
    EXPECT_NEAR(turn.fourth() / fast, lost, 0.04 * lost);
    EXPECT_LT(turn.second() / deg_h, 0.3);
}
TEST(WholeAngle, TurnsAHiddenDelaysPhaseTimesTheSplitIntoADriftAndADeclaredOneIntoNothing) {
    auto s = split_axes();
    s.device.delay = 1;
    const double expected = 0.5 * split * std::sin(step);
    EXPECT_NEAR(expected / deg_h, 16193.0, 1.0);
    EXPECT_NEAR(whole_turn<Angle>(s, fast).second(), expected, 0.004 * expected);
    s.controller.loop.datasheet.delay = 1;
    const Turn turn = whole_turn<Angle>(s, fast);
    EXPECT_LT(turn.second() / deg_h, 0.3);
    // The mean over half a period keeps the ripple at twice the frequency out: nothing depends on the delay.
    EXPECT_NEAR(turn.rate / fast, whole_turn<Angle>(split_axes(), fast).rate / fast, 1e-6);
}
// Seen and pushed at 2ϑ: rate (g - g²/2), and ½g/τ.
TEST(WholeAngle, TakesAnErrorOfAGainForADrift) {
    constexpr double g = 0.01;
    auto seen = equal_axes(), pushed = equal_axes();
    seen.device.pickoff.gain_error = {0.0, g};
    pushed.device.force.gain_error = {0.0, g};
    EXPECT_NEAR(whole_turn<Angle>(seen, fast).second() / (fast * (g - 0.5 * g * g)), 1.0, 5e-4);
    EXPECT_NEAR(whole_turn<Angle>(pushed, fast).second() / (0.5 * g * decay), 1.0, 0.01);
}
// The hold weakens the force; the dampers take p²/(2v²) of the mean over time, the drive's lag the rest.
TEST(WholeAngle, TurnsByForcesAtTheVirtualRate) {
    const double v = 100.0 * deg_s, hold = step * step / 24.0, less = 0.5 * drift * drift / (v * v) + decay / 0.2;
    double both = 0.0;
    for (const double rate : {v, -v}) {
        auto s = disc(angle_loops(), 0.0);
        s.controller.virtual_rate = rate;
        const Turn turn = whole_turn<Angle>(s, v);
        EXPECT_NEAR(turn.rate / rate - 1.0, -hold - less, 1e-6);
        EXPECT_NEAR(turn.second() / deg_h, 162.0, 0.3);
        both += turn.rate;
    }
    EXPECT_LT(std::abs(both) / v, 1e-7);
}
// The same dampers at a quality factor of 2000: p is 1000 times as large.
DeviceSetupOf<WholeAngleParams> heavily_damped(double rate_over_drift, double start) {
    const double more = 0.5 / 2000.0;
    auto s = disc(angle_loops(), rate_over_drift * 0.05 * more, start);
    s.controller.start_angle = start;
    s.plant.damping = along_axis(2.0 * more, 0.1 * more, damping_axis);
    return s;
}
TEST(WholeAngle, RestsWhereTheDampersHoldASlowRotation) {
    for (const double share : {0.5, 0.9, -0.5}) {
        const double rest = damping_axis + 0.5 * (pi - std::asin(share));
        auto s = heavily_damped(share, rest);
        s.steps = 900'000;
        double last = 0.0;
        run_device_loop<Angle>(s, [&](const auto& at) { last = at.signals.report.angle; });
        EXPECT_NEAR(last, rest, 1e-9) << share;
        // From elsewhere it goes there, by e^(-2p cos 2(ϑ - ϑ_τ) t).
        auto off = heavily_damped(share, rest + 0.03);
        off.steps = s.steps;
        double first = 0.0;
        run_device_loop<Angle>(off, [&](const auto& at) {
            first = at.step == 100'000 ? at.signals.report.angle - rest : first;
            last = at.signals.report.angle - rest;
        });
        const double slope = 2.0 * 0.05 * (0.5 / 2000.0) * std::sqrt(1.0 - share * share), time = 800'000 * step;
        EXPECT_NEAR(last / first, std::exp(-slope * time), 0.02) << share;
    }
}
TEST(WholeAngle, IsSlowedDownByTheDampersIfItIsFasterThanTheirDrift) {
    const double late = 0.5 / 2000.0 / 0.2;  // 1/(μτ)
    for (const double share : {2.0, 1.25}) {
        const auto s = heavily_damped(share, 0.0);
        const double expected = std::sqrt(share * share - 1.0) * 0.05 * (0.5 / 2000.0) * (1.0 - late);
        const double mean = s.plant.rate - whole_turn<Angle>(s, expected).rate;
        EXPECT_NEAR(mean, expected, 1e-4 * expected) << share;
    }
}

// An ellipse that no force straightens, on springs that harden alike in all directions: its line turns at
// (2/3) 2πΔf b/a, which is 839.8 deg/h.
TEST(WholeAngle, TurnsWithAnEllipseOnAQuarticPotential) {
    constexpr double shift = 1e-4, ratio = 9.72e-4, kappa = 8.0 / 3.0 * shift;  // 1 Hz; b/a
    const auto s = disc(angle_loops(), 0.0);
    WholeAngleParams p = angle_loops();
    p.quadrature_bandwidth = 1e-9;
    const auto c = Angle::prepare(p, s.common);
    Angle::State state{};
    Duffing::Params springs{.cubic_stiffness = {kappa, kappa}, .cubic_coupling = kappa};
    springs.linear.stiffness = {1.0, 0.0, 1.0};
    springs.linear.initial_position = {0.0, ratio};
    springs.linear.initial_velocity = {1.0, 0.0};
    const auto plant = Duffing::prepare(springs, step);
    Duffing::State motion = Duffing::start(springs);
    double first = 0.0, last = 0.0;
    for (int n = 0; n <= 300'000; ++n) {
        const auto signals = Angle::step(state, c, Duffing::motion(motion));
        Duffing::step(motion, plant, signals.force, {}, {});
        (n == 100'000 ? first : last) = signals.report.angle;
    }
    const double expected = 2.0 / 3.0 * shift * ratio;
    EXPECT_NEAR(expected / deg_h, 839.8, 0.1);
    EXPECT_NEAR((last - first) / (200'000 * step) / expected, 1.0, 0.005);
}

// A line that turns at 1 deg/s: 1.4e-8 rad a step, which no number near 1 in single precision can hold.
template <class T>
class SlowLine : public ::testing::Test {};
TYPED_TEST_SUITE(SlowLine, Scalars, ScalarNames);
TYPED_TEST(SlowLine, IsFollowedInAnyPrecision) {
    using T = TypeParam;
    using C = WholeAngle<T>;
    const double rate = deg_s, start = 0.6;
    const auto s = disc(angle_loops(), rate, start);
    WholeAngleParams p = angle_loops();
    p.start_angle = start;
    const auto c = C::prepare(p, s.common);
    typename C::State state{};
    double seen = 0.0, first = 0.0, last = 0.0;
    for (int n = 0; n < 200'000; ++n) {
        const double t = n * step, angle = start - rate * t;
        const double x = std::cos(angle) * std::sin(t), y = std::sin(angle) * std::sin(t);
        const auto report = C::step(state, c, {.position = vec2<T>(x, y), .velocity = {}}).report;
        (n == 100'000 ? first : last) = number(report.angle);
        seen += n > 100'000 ? number(report.rate) : 0.0;
    }
    const double late = rate / 0.2, near = 4e-8 + 20.0 * epsilon<T>;
    EXPECT_NEAR(first, start - rate * 100'000 * step + late, near);
    EXPECT_NEAR(last, start - rate * 199'999 * step + late, near);
    EXPECT_NEAR(seen / 99'999 / rate, 1.0, 0.005);
}

// Half a turn takes .9 s, and p is 162 deg/h: a whole-angle gyroscope would rest at 81.
TEST(VirtualRotation, ReadsASlowRateWithoutTheDampersDriftAndTheErrorOfItsOwnScale) {
    using C = VirtualRotation<double>;
    const double rate = 0.5 * drift;
    VirtualRotationParams p{.angle = angle_loops(), .turns = 0.5};
    p.angle.virtual_rate = fast;
    auto s = disc(p, rate);
    s.steps = 3'600'000;
    VirtualRotationReport<double> last{};
    int turned = 0;
    double before = 0.0;
    run_device_loop<C>(s, [&](const auto& at) {
        const auto& report = at.signals.report;
        turned += report.scale_error != before ? 1 : 0;
        before = report.scale_error;
        last = report;
    });
    EXPECT_EQ(turned, 1);  // after the second and the third way; the first is not used
    EXPECT_NEAR(last.rate / deg_h, 81.0, 0.05);
    EXPECT_NEAR(last.scale_error, -step * step / 24.0 - decay / 0.2, 1e-6);
}
TEST(VirtualRotation, ReversesEvenIfTheRotationHoldsItsLine) {
    using C = VirtualRotation<double>;
    VirtualRotationParams p{.angle = angle_loops(), .turns = 0.001};
    p.angle.virtual_rate = fast;
    auto s = disc(p, fast);  // to one side the line rests
    s.steps = 60'000;
    double least = 0.0, most = 0.0;
    run_device_loop<C>(s, [&](const auto& at) {
        least = std::min(least, at.signals.report.angle);
        most = std::max(most, at.signals.report.angle);
    });
    EXPECT_LT(least, -0.9 * 0.001 * 2.0 * pi);  // turned back at twice the rate
    EXPECT_LT(most, 2e-3);
}

ModeReversalParams reversal(double interval, double settling) {
    return {.held = {.loop = conventional_loops(0), .bandwidth = 2.0 * pi * 200.0 / omega},
            .interval = interval,
            .settling = settling};
}
struct Reversed {
    double rate = 0.0, bias = 0.0, amplitude = 0.0, frequency = 0.0;
};
Reversed reversed(const Vec2<double>& pickoff, const Vec2<double>& force, double rate = 0.0) {
    constexpr double one = rate_300 / 300.0;
    auto s = setup_of({.rate = rate * one, .damping = one}, reversal(2400.0, 1500.0));
    s.device.pickoff.gain_error = pickoff;
    s.device.force.gain_error = force;
    s.steps = 2 * 48'000 - 1;
    ModeReversalReport<double> last{};
    run_device_loop<ModeReversal<double>>(s, [&](const auto& at) { last = at.signals.report; });
    s.steps += 1;
    run_device_loop<ModeReversal<double>>(s, [&](const auto& at) { last = at.signals.report; });
    return {last.rate / one, last.bias / one, last.amplitude, last.frequency};
}
// A bias of 1 deg/s: ½dxy (s₀ - s₉₀)/2 is left, where s are the gains of the pick-off that is read and the force on the
// axis that is driven.
TEST(ModeReversal, TakesTheDampersBiasAwayAsFarAsTheGainsAreEqual) {
    const Reversed equal = reversed({0.0, 0.0}, {0.0, 0.0});
    EXPECT_NEAR(equal.rate, 0.0, 2e-5);
    EXPECT_NEAR(equal.bias, 1.0, 0.001);
    EXPECT_NEAR(reversed({0.0, 0.01}, {0.0, 0.0}).rate, 0.005, 1e-4);
    EXPECT_NEAR(reversed({0.0, 0.01}, {0.0, -0.004}).rate, 0.007, 1e-4);
}

// 53 Hz apart: each axis gets back the frequency that was found for it.
TEST(ModeReversal, KeepsTheFrequencyOfEachAxis) {
    using C = ModeReversal<double>;
    const auto s = setup_of({}, reversal(2400.0, 1500.0));
    const auto c = C::prepare(s.controller, s.common);
    const auto plant = Gyroscope<double>::prepare(s.plant, h);
    C::State state{};
    auto motion = Gyroscope<double>::start(s.plant);
    const auto run_to = [&](std::uint64_t step) {
        while (C::steps(state) < step) {
            Gyroscope<double>::step(motion, plant, C::step(state, c, motion).force, {});
        }
        return state.held.loop.detuning;
    };
    EXPECT_NEAR(run_to(48'000), 0.0, 1e-4);
    EXPECT_NEAR(run_to(96'000), 0.0135, 1e-4);
    EXPECT_NEAR(run_to(96'001), 0.0, 1e-4);
    EXPECT_NEAR(run_to(144'001), 0.0135, 1e-4);
}
// Swung by 90° in .9 s, as a disc that rings for a minute cannot be stopped: the bias is p sin 2ϑ_τ, 91.5 deg/h.
TEST(ModeReversal, SwingsAVibrationThatCannotBeStopped) {
    const double rate = 10.0 * deg_s, bias = drift * std::sin(2.0 * damping_axis),
                 read = rate * (1.0 + step * step / 24.0);
    ModeReversalParams p{.held = {.loop = angle_loops().loop, .bandwidth = 0.02},
                         .interval = 5000.0,
                         .settling = 3000.0,
                         .swing_rate = 100.0 * deg_s};
    auto s = disc(p, rate);
    const std::int64_t interval = 100'000, swing = std::llround(0.5 * pi / (100.0 * deg_s) / step);
    s.steps = 2 * interval + swing;
    double first = 0.0, angle = 0.0, amplitude = 1.0;
    ModeReversalReport<double> last{};
    run_device_loop<ModeReversal<double>>(s, [&](const auto& at) {
        const auto& report = at.signals.report;
        first = at.step == interval ? report.rate : first;
        angle = at.step == interval + swing / 2 ? report.angle : angle;
        amplitude = at.step > interval ? std::min(amplitude, report.amplitude) : amplitude;
        last = report;
    });
    EXPECT_NEAR((first - read - bias) / deg_h, 0.0, 0.5);
    EXPECT_NEAR((last.rate - read) / deg_h, 0.0, 0.5);
    EXPECT_NEAR(last.bias / bias, 1.0, 0.005);
    EXPECT_NEAR(angle, 0.25 * pi, 1e-4);
    EXPECT_NEAR(last.angle, 0.5 * pi, 1e-4);
    EXPECT_GT(amplitude, 0.999);
}
TEST(ModeReversal, HasNoBiasWhereItStartsOnTheDampersAxis) {
    ModeReversalParams p{.held = {.loop = angle_loops().loop, .bandwidth = 0.02}, .interval = 1e6};
    p.start_angle = damping_axis;
    auto s = disc(p, 0.0, damping_axis);
    s.steps = 100'000;
    double last = 0.0;
    run_device_loop<ModeReversal<double>>(s, [&](const auto& at) { last = at.signals.report.rate; });
    EXPECT_NEAR(last / deg_h, 0.0, 0.05);
}
TEST(ModeReversal, StartsOverWithTheMeansOfBothAnglesOrWithout) {
    using C = ModeReversal<double>;
    C::State state{};
    state.place = 17;
    state.read = 5;
    state.sum = state.sum + 3.0;
    state.first = 4.0;
    state.other = 2.0;
    state.known = 2.0;
    state.kept = {0.5, 0.25};
    state.rate = 3.0;
    state.bias = 1.0;
    const auto numbers = [&] {
        return std::array{state.first,    state.other, state.known, state.kept.x(),
                          state.kept.y(), state.rate,  state.bias};
    };
    const auto before = numbers();
    C::start_over(state, true);
    EXPECT_EQ(numbers(), before);
    EXPECT_EQ(state.place, 17U);
    EXPECT_EQ(state.read, 0U);
    EXPECT_EQ(state.sum.value, 0.0);
    C::start_over(state, false);
    EXPECT_EQ(numbers(), decltype(before){});
    EXPECT_EQ(state.place, 17U);
}
TEST(ModeReversal, KnowsAPlaceThatItsCycleLacks) {
    using C = ModeReversal<double>;
    const auto s = disc(reversal(5.0, 1.0), 0.0);
    const auto c = C::prepare(s.controller, s.common);
    C::State state{};
    state.place = 199;
    EXPECT_TRUE(C::sound(state, c));
    state.place = 200;
    EXPECT_FALSE(C::sound(state, c));
    state.place = 0;
    state.read = 101;
    EXPECT_FALSE(C::sound(state, c));
}

}  // namespace
}  // namespace fracgyro::testing
