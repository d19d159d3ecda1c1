// Controllers of the comparison other than the paper's: theoretical closed-loop properties, and results computed by
// hand.
#include "dual_mass.hpp"
#include "paper.hpp"
#include "scalars.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <utility>

namespace fracgyro::testing {
namespace {

// Means over the second half.
struct Settled {
    double rate = 0.0, quadrature = 0.0, amplitude = 0.0, frequency = 0.0, sense = 0.0;
};
template <class C>
Settled settled(const DeviceSetupOf<typename C::Params>& s) {
    Settled sum{};
    double count = 0.0;
    run_device_loop<C>(s, [&](const auto& at) {
        if (at.step > s.steps / 2) {
            const auto& report = at.signals.report;
            sum.rate += report.rate;
            sum.quadrature += report.quadrature;
            sum.amplitude += report.amplitude;
            sum.frequency += report.frequency;
            sum.sense = std::max(sum.sense, std::abs(at.motion.position.y()));
            count += 1.0;
        }
    });
    return {sum.rate / count, sum.quadrature / count, sum.amplitude / count, sum.frequency / count, sum.sense};
}
Settled rebalanced(const Gyro& gyro) {
    const RebalanceParams p{.loop = conventional_loops(gyro.declared), .bandwidth = 2.0 * pi * 200.0 / omega};
    return settled<ForceRebalance<double>>(setup_of(gyro, p));
}

// The hold weakens the requested force by sinc(ωh/2), so more force is requested.
TEST(ForceRebalance, TheHoldAddsItsSquareOver24ToTheScaleFactor) {
    const Settled found = rebalanced({.rate = rate_300});
    EXPECT_NEAR(found.rate / rate_300 - 1.0, h * h / 24.0, 0.01 * h * h / 24.0);
    EXPECT_NEAR(found.amplitude, 1.0, 1e-6);
    EXPECT_LT(found.sense, 1e-6);
    EXPECT_NEAR(found.quadrature / rate_300, 0.0, 1e-6);
}
TEST(ForceRebalance, AHiddenDelayCostsItsCosineAndADeclaredOneNothing) {
    const double hold = h * h / 24.0, cosine = std::cos(h) - 1.0;
    EXPECT_NEAR(rebalanced({.rate = rate_300, .delay = 1}).rate / rate_300 - 1.0, cosine + hold,
                0.01 * std::abs(cosine));
    EXPECT_NEAR(rebalanced({.rate = rate_300, .delay = 1, .declared = 1}).rate / rate_300 - 1.0, hold, 0.01 * hold);
}
TEST(ForceRebalance, QuadratureLeaksByTheSineOfAHiddenDelayOnly) {
    const Settled ideal = rebalanced({.quadrature = rate_300}), late = rebalanced({.quadrature = rate_300, .delay = 1});
    EXPECT_NEAR(ideal.rate / rate_300, 0.0, 1e-6);
    EXPECT_NEAR(std::abs(ideal.quadrature) / rate_300, 1.0, 0.001);
    EXPECT_NEAR(std::abs(late.rate) / rate_300, std::sin(h), 0.01 * std::sin(h));
}
TEST(ForceRebalance, ACouplingOfTheDampersIsTakenForARate) {
    EXPECT_NEAR(rebalanced({.damping = rate_300}).rate / rate_300, 1.0, 0.01);
}
TEST(ForceRebalance, TheDriveStartsFromAThousandthOfItsAmplitudeOffItsPhase) {
    const Settled found = rebalanced({.rate = rate_300, .from_rest = true});
    EXPECT_NEAR(found.amplitude, 1.0, 1e-5);
    EXPECT_NEAR(found.frequency, 1.0, 1e-6);
    EXPECT_NEAR(found.rate / rate_300 - 1.0, h * h / 24.0, 2e-6);
}
TEST(OpenLoop, ReadsTheRateFromTheSwingOfTheSenseAxis) {
    const Settled found = settled<OpenLoop<double>>(setup_of({.rate = rate_300}, conventional_loops(0)));
    EXPECT_NEAR(found.rate / rate_300, 1.0, 0.01);
    EXPECT_GT(found.sense, 0.01);
    // The output is Y δ: an error of the assumed stiffness changes the scale by dδ/δ.
    auto stiffer = setup_of({.rate = rate_300}, conventional_loops(0));
    stiffer.plant.stiffness_deviation = {0.0, 0.0, 0.0027};  // for a split kyy - kxx of 0.0272
    EXPECT_NEAR(settled<OpenLoop<double>>(stiffer).rate / found.rate, 0.0272 / 0.0299, 0.01);
}

TEST(DisturbanceRejection, FindsTheRateInWhatItsModelLacksAndTheModelTakesTheQuadratureOut) {
    const double unit = 2.0 * pi / omega;
    const auto rate_of = [&](const Gyro& gyro, bool model) {
        const DisturbanceRejectionParams p{.natural_frequency = 0.05,
                                           .extended_observer = 10.0,
                                           .rate_bandwidth = 100.0 * unit,
                                           .nominal_model = model};
        auto s = setup_of(gyro, p);
        s.common.reference.amplitude = {1.0, 0.0};
        double sum = 0.0, count = 0.0;
        run_device_loop<DisturbanceRejection<double>>(s, [&](const auto& at) {
            if (at.step > s.steps / 2) {
                sum += at.signals.report.rate;
                count += 1.0;
            }
        });
        return sum / count;
    };
    EXPECT_NEAR(rate_of({.rate = rate_300}, true) / rate_300, 1.0, 0.01);
    // Without it the plant's own force on y is canceled late, so y moves.
    EXPECT_NEAR(rate_of({.rate = rate_300}, false) / rate_300, 1.0, 0.15);
    EXPECT_NEAR(rate_of({.quadrature = rate_300}, true) / rate_300, 0.0, 0.01);
}

// On the reference, with a known plant: the error of controllers whose theory predicts it stays at the error of the
// hold.
template <class C>
double largest_error(typename C::Params params, double step) {
    DeviceSetupOf<typename C::Params> s{};
    s.controller = params;
    s.common = {.step = step};
    s.common.reference = {.amplitude = {1.0, 1.2}, .frequency = {4.17 / 3.0, 5.11 / 3.0}, .phase = {0.0, pi / 2}};
    s.common.nominal = {.damping = {0.01, 0.002, 0.01}, .stiffness = {2.0, 0.4, 3.0}, .rate = 0.1};
    s.plant = {.damping = {0.01, 0.002, 0.01}, .stiffness = {2.0, 0.4, 3.0}, .rate = 0.1};
    s.plant.initial_position = {0.0, 1.2};
    s.plant.initial_velocity = {4.17 / 3.0, 0.0};
    s.steps = static_cast<std::int64_t>(8.0 / step);
    double largest = 0.0;
    run_device_loop<C>(s, [&](const auto& at) {
        largest = std::max({largest, std::abs(at.signals.error.value.x()), std::abs(at.signals.error.value.y())});
    });
    return largest;
}
template <class C>
void expect_order(const typename C::Params& params, double factor, double order) {
    const double coarse = largest_error<C>(params, 1e-3), fine = largest_error<C>(params, 5e-4);
    EXPECT_LT(coarse, factor * 1e-6);
    EXPECT_NEAR(std::log2(coarse / fine), order, 0.15);
}
template <class C>
void expect_second_order(const typename C::Params& params, double factor) {
    expect_order<C>(params, factor, 2.0);
}
TEST(OnTheReference, WithThePlantKnownTheErrorIsThatOfTheHeldForce) {
    expect_second_order<ParkHorowitz<double>>({.velocity_gain = 10.0, .adaptation = {.adaptive = false}}, 2.0);
    expect_second_order<LeastSquaresPid<double>>({.pid = {.natural_frequency = 20.0, .integral_frequency = 0.0}}, 0.1);
    expect_second_order<SuperTwisting<double>>(
        {.surface_gain = 20.0, .twisting_gain = 0.0, .integral_gain = 0.0, .adaptation = {.adaptive = false}}, 1.0);
    // Its loop is faster with a shorter step, and knows the velocity that the held force leaves.
    expect_order<Lqg<double>>({.feedback = {.loop_bandwidth = 0.1}, .datasheet = {1e-4, 1e-6, 1e-6, 0}}, 0.001, 3.0);
}

// The same equations in complex numbers and the C library's functions, with which the vector demodulator must agree.
template <bool rebalanced>
class InComplexNumbers {
public:
    using Complex = std::complex<double>;
    struct Answer {
        Complex force, speed, excess;  // x as real, y as imaginary part
    };

    double bandwidth = 0.02, limit = 3.0;
    ConventionalParams p{.pll_bandwidth = 0.3,
                         .amplitude_bandwidth = 0.05,
                         .amplitude_integral = 0.4,
                         .demodulation_bandwidth = 0.7,
                         .output_bandwidth = 0.25};
    Common common{.step = 0.1, .force_limit = limit};
    Complex oscillator, drive, sense, held;
    double detuning = 0.0, force = 0.0, offset = 0.0, rate = 0.0, quadrature = 0.0;

    InComplexNumbers() {
        p.datasheet.delay = 1;
        common.reference = {.amplitude = {1.5, 1.0}, .frequency = {2.0, 2.1}, .phase = {0.7, 0.0}};
        common.nominal = {.damping = {0.01, 0.0, 0.06}, .stiffness = {4.0, 0.0, 4.7}};
        oscillator = std::polar(1.0, 0.7);
    }
    auto params() const {
        if constexpr (rebalanced) {
            return RebalanceParams{.loop = p, .bandwidth = bandwidth};
        } else {
            return p;
        }
    }

    Answer step(double x, double y, bool measured) {
        const Complex j{0.0, 1.0};
        const double step = common.step, w = 2.0, wanted_amplitude = 1.5, known = w + offset;
        Answer found{};
        if (measured) {
            for (auto [phasor, z] : {std::pair{&drive, x}, std::pair{&sense, y}}) {
                const double missed = z - (*phasor * oscillator).real();
                *phasor += 2.0 * p.demodulation_bandwidth * step * missed * std::conj(oscillator);
            }
            found.speed = {-known * (drive * oscillator).imag(), -known * (sense * oscillator).imag()};
        }
        const double a = -drive.imag(), b = drive.real(), size = std::abs(drive);
        const double phase = a > 0.0 ? b / size : std::copysign(1.0, b), most = 0.1 * w, pll = p.pll_bandwidth;
        detuning = std::clamp(detuning + step * pll * pll * phase, -most, most);
        offset = std::clamp(detuning + 1.4 * pll * phase, -most, most);
        const double now = w + offset, gain = 2.0 * w * p.amplitude_bandwidth;

        const double lacks = wanted_amplitude - size, wanted = gain * lacks + force;
        const double acts = std::clamp(wanted, 0.0, limit);
        if ((wanted - acts) * lacks <= 0.0) {
            force = std::clamp(force + step * gain * p.amplitude_integral * lacks, 0.0, limit);
        }
        const Complex ahead = oscillator * std::exp(j * now * step * 1.5);
        found.force = acts * ahead.real();
        found.excess = wanted - acts;

        Complex coupling;
        if (rebalanced) {
            coupling = 2.0 * now * j * (-bandwidth * sense - held);
            const double asked = (coupling * ahead).real(), answered = std::clamp(asked, -limit, limit);
            if (asked == answered) {
                held += 0.25 * bandwidth * bandwidth * step * sense;
            }
            found.force += j * answered;
            found.excess += j * (asked - answered);
        } else {
            const double split = (4.7 - now * now) / (2.0 * now);
            coupling = -2.0 * now * j * (0.03 - j * split) * sense;
        }
        if (limit == std::numeric_limits<double>::infinity()) {
            found.excess = 0.0;
        }
        const double passes = 1.0 - std::exp(-p.output_bandwidth * step);
        rate += passes * (coupling.real() / (2.0 * now * wanted_amplitude) - rate);
        quadrature += passes * (coupling.imag() / (2.0 * now * wanted_amplitude) - quadrature);
        oscillator *= std::exp(j * now * step);
        return found;
    }
    void start_over(bool keep_estimates) {
        drive = sense = held = force = 0.0;
        if (!keep_estimates) {
            detuning = offset = rate = quadrature = 0.0;
        }
    }
};

template <bool rebalanced>
void expect_the_same_as_in_complex_numbers(double limit, double bandwidth) {
    using C = ConventionalGyroscope<double, rebalanced>;
    InComplexNumbers<rebalanced> expected;
    expected.limit = expected.common.force_limit = limit;
    expected.bandwidth = bandwidth;
    const auto c = C::prepare(expected.params(), expected.common);
    typename C::State state{};
    const double near = 1e-9;
    for (int n = 0; n < 900; ++n) {
        if (n == 300 || n == 600) {
            C::start_over(state, n == 300);
            expected.start_over(n == 300);
        }
        const double t = 0.1 * n, x = std::min(0.02 * n, 1.3) * std::cos(2.13 * t + 0.2), y = 0.4 * std::sin(2.05 * t);
        const Sample<double> missing{.value = {0.5, -0.25}, .derivative = {2.0, 4.0}};
        const bool measured = n % 50 != 49;
        const auto report = C::report(state, c);
        EXPECT_NEAR(report.rate, expected.rate, near) << n;
        EXPECT_NEAR(report.quadrature, expected.quadrature, near) << n;
        EXPECT_NEAR(report.amplitude, std::abs(expected.drive), near) << n;
        EXPECT_NEAR(report.frequency, 2.0 + expected.offset, near) << n;
        const auto signals = C::step(state, c, {.position = {x, y}, .velocity = {}}, measured ? nullptr : &missing);
        const auto answer = expected.step(x, y, measured);
        const auto& r = signals.reference;
        const Vec2<double> position = measured ? Vec2<double>{x, y} - r.position : missing.value;
        const Vec2<double> velocity =
            measured ? Vec2<double>{answer.speed.real(), answer.speed.imag()} - r.velocity : missing.derivative;
        expect_near(signals.error.value, position, near);
        expect_near(signals.error.derivative, velocity, near);
        expect_near(signals.force, {answer.force.real(), answer.force.imag()}, near);
        expect_near(signals.excess, {answer.excess.real(), answer.excess.imag()}, near);
        ASSERT_FALSE(::testing::Test::HasFailure()) << n;
    }
}
TEST(ForceRebalance, IsTheSameInComplexNumbers) {
    expect_the_same_as_in_complex_numbers<true>(std::numeric_limits<double>::infinity(), 0.02);
    expect_the_same_as_in_complex_numbers<true>(0.2, 0.3);
}
TEST(OpenLoop, IsTheSameInComplexNumbers) {
    expect_the_same_as_in_complex_numbers<false>(std::numeric_limits<double>::infinity(), 0.0);
    expect_the_same_as_in_complex_numbers<false>(0.2, 0.0);
}

// By hand: a = 3, b = 0.5, γ₁ = 2, γ₂ = 1.5, e = (1, -4), ė = (4, 1).
template <class T>
class ByHand : public ::testing::Test {};
TYPED_TEST_SUITE(ByHand, Scalars, ScalarNames);

TYPED_TEST(ByHand, TheNonsingularSurfaceAndItsForce) {
    using T = TypeParam;
    using C = NonsingularTerminal<T>;
    Common common{.step = 0.125};
    common.reference.amplitude = {0.0, 0.0};
    const NonsingularTerminalParams p{.position_gain = 3.0,
                                      .velocity_gain = 0.5,
                                      .position_exponent = 2.0,
                                      .velocity_exponent = 1.5,
                                      .reaching_gain = 2.0,
                                      .switching_gain = 10.0,
                                      .reaching_exponent = 0.0,
                                      .layer_thickness = 16.0,
                                      .adaptation = {.adaptive = false}};
    typename C::State state{};
    const auto signals =
        C::step(state, C::prepare(p, common), {.position = vec2<T>(1.0, -4.0), .velocity = vec2<T>(4.0, 1.0)});
    // s = e + 3 |e| e + 0.5 |ė|^1.5
    expect_near(signals.report.sliding, {1.0 + 3.0 + 4.0, -4.0 - 48.0 + 0.5}, 1e-5);
    // |ė|^0.5 (1 + 6 |e|)/0.75; 2 s; 10 within ±1 of s/16
    expect_near(signals.force, {-2.0 * 7.0 / 0.75 - 16.0 - 5.0, -25.0 / 0.75 + 103.0 + 10.0}, 1e-4);
}

TYPED_TEST(ByHand, TheIntegralOfASuperTwistStaysWithinTheForceLimit) {
    using T = TypeParam;
    using C = SuperTwisting<T>;
    for (const double limit : {3.0, std::numeric_limits<double>::infinity()}) {
        Common common{.step = 0.125, .force_limit = limit};
        common.reference.amplitude = {0.0, 0.0};
        const SuperTwistingParams p{.integral_gain = 80.0, .adaptation = {.adaptive = false}};
        typename C::State state{};
        C::step(state, C::prepare(p, common), {.position = vec2<T>(0.0001, -0.0001), .velocity = {}});
        const double expected = std::min(limit, 0.125 * 80.0);
        expect_near(state.integral, {-expected, expected}, 1e-6);
    }
}
TEST(NonsingularTerminal, LearnsFromItsSurfaceTimesTheSlopeOfTheVelocity) {
    using C = NonsingularTerminal<double>;
    Common common{.step = 0.125};
    common.reference.amplitude = {0.0, 0.0};
    const NonsingularTerminalParams p{
        .position_gain = 3.0, .velocity_gain = 0.5, .position_exponent = 2.0, .velocity_exponent = 1.5};
    const auto c = C::prepare(p, common);
    const Motion<double> motion{.position = {1.0, -4.0}, .velocity = {4.0, 1.0}};
    C::State state{}, expected{};
    C::step(state, c, motion);
    // b γ₂ |ė|^½ s, with the surface of the test above
    C::Base::learn(expected.base, c.base, motion, {0.75 * 2.0 * 8.0, 0.75 * -51.5});
    const auto found = C::report(state, c), wanted = C::report(expected, c);
    expect_near(found.stiffness, wanted.stiffness, 1e-9);
    expect_near(found.damping, wanted.damping, 1e-9);
    EXPECT_NEAR(found.rate, wanted.rate, 1e-9);
    EXPECT_GT(std::abs(wanted.rate - C::report({}, c).rate), 1e-3);
}
TEST(LeastSquaresPid, LearnsNothingAcrossAMissingSample) {
    using C = LeastSquaresPid<double>;
    Common common{.step = 0.05};
    common.nominal = {.damping = {0.01, 0.0, 0.01}, .stiffness = {1.0, 0.0, 1.1}};
    const auto c = C::prepare({}, common);
    const auto at = [](double t) {
        return Motion<double>{.position = {std::cos(t), std::sin(1.1 * t)}, .velocity = {-std::sin(t), std::cos(t)}};
    };
    C::State state{};
    for (int n = 0; n < 50; ++n) {
        C::step(state, c, at(0.05 * n));
    }
    C::State rested = state;
    C::Learning::rest(rested.learning);
    const Sample<double> missing{};
    C::step(state, c, at(2.5), &missing);
    const C::Report before = C::report(state, c);
    for (C::State* each : {&state, &rested}) {
        C::Learning::update(each->learning, c.learning, at(2.55), {}, {}, {0.3, -0.2});
    }
    const C::Report found = C::report(state, c), wanted = C::report(rested, c);
    EXPECT_EQ(found.rate, wanted.rate);
    expect_near(found.stiffness, wanted.stiffness, 0.0);
    EXPECT_EQ(before.rate, wanted.rate);  // one sample brings no difference
}

}  // namespace
}  // namespace fracgyro::testing
