// Terms that published laws add to the linear surface: closed forms on a free mass that is known as such.
#include "scalars.hpp"

#include "fracgyro/controllers/sliding_mode.hpp"

#include <cmath>
#include <limits>

namespace fracgyro::testing {
namespace {

constexpr double lambda = 3.0, kappa = 10.0;

template <class T>
class LinearTermOf : public ::testing::Test {
protected:
    using C = SlidingModeController<T, LinearSurface>;

    // u = r̈ - drift - κ s, whatever ‖s‖, for a free mass.
    void prepare(const LinearTermParams& more, double step = 1e-3, ReferenceParams reference = {.amplitude = {}},
                 double limit = std::numeric_limits<double>::infinity()) {
        SlidingModeParams p{};
        p.surface.fractional_gain = {lambda, lambda};
        p.surface.linear = more;
        p.control.layer_thickness = 1e6;
        p.adaptation.adaptive = false;
        p.adaptation.initial_bound = {kappa * 1e6, 0.0, 0.0};
        c = C::prepare(p, {.step = step, .reference = reference, .force_limit = limit});
        state = {};
        motion = {};
        h = step;
    }
    auto step(double disturbance = 0.0) {
        const auto signals = C::step(state, c, motion);
        const Vec2<T> acts = signals.force + vec2<T>(disturbance, -disturbance);
        motion.position = motion.position + T(h) * (motion.velocity + T(0.5 * h) * acts);
        motion.velocity = motion.velocity + T(h) * acts;
        return signals;
    }
    double run(int steps, double disturbance = 0.0) {
        for (int n = 0; n < steps; ++n) {
            step(disturbance);
        }
        return number(motion.position.x());
    }
    auto miss(const Sample<T>& assumed = {}) { return C::step(state, c, {}, &assumed); }

    typename C::Coefficients c{};
    typename C::State state{};
    Motion<T> motion{};
    double h = 1e-3;
    double tolerance = std::is_same_v<T, float> ? 2e-5 : 1e-12;
};
TYPED_TEST_SUITE(LinearTermOf, Scalars, ScalarNames);

// ė = -λ e + s, ds/dt = -c_z e - κ s
TYPED_TEST(LinearTermOf, CouplingIsTheTermThatBacksteppingHas) {
    this->prepare({.coupling = 50.0});
    this->motion = {.position = vec2<TypeParam>(1, 2), .velocity = vec2<TypeParam>(-2, 1)};
    const auto signals = this->step();
    expect_near(signals.report.surface, {1, 7}, this->tolerance);
    expect_near(signals.force, {lambda * 2 - 10 - 50, -lambda - 70 - 100}, 100 * this->tolerance);
    this->prepare({.coupling = 50.0}, 2e-4);
    this->motion = {.position = vec2<TypeParam>(1, 0), .velocity = vec2<TypeParam>(-lambda, 0)};  // s = 0
    const double mean = 0.5 * (lambda + kappa), turns = std::sqrt(50.0 - std::pow(0.5 * (kappa - lambda), 2));
    const double t = 0.3, decay = std::exp(-mean * t), within = 0.5 * (kappa - lambda) / turns;
    const double exact = decay * (std::cos(turns * t) + within * std::sin(turns * t));
    EXPECT_NEAR(this->run(1500), exact, 2e-3);
}

// Within the layer a PID: u = -(λ + κ) ė - (λᵢ + κ λ) e - κ λᵢ ∫e
TYPED_TEST(LinearTermOf, TheIntegralMakesItAPid) {
    this->prepare({.integral = 8.0});
    this->motion = {.position = vec2<TypeParam>(0.5, 0)};
    double sum = 0.0;
    for (int n = 0; n < 300; ++n) {
        const double e = number(this->motion.position.x()), rate = number(this->motion.velocity.x());
        const double force = number(this->step(5.0).force.x());
        const double pid = -(lambda + kappa) * rate - (8.0 + kappa * lambda) * e - kappa * 8.0 * sum;
        ASSERT_NEAR(force, pid, 100 * this->tolerance) << n;
        sum += 1e-3 * e;
    }
    EXPECT_NEAR(this->run(20'000, 5.0), 0.0, 1e-4);
    this->prepare({});
    EXPECT_NEAR(this->run(20'000, 5.0), 5.0 / (kappa * lambda), 1e-4);
}

TYPED_TEST(LinearTermOf, TheIntegralRestsWhereItWouldWindUpAndWithoutASample) {
    const auto after = [&](double position, double velocity) {
        this->prepare({.integral = 8.0}, 1e-3, {.amplitude = {}}, 10.0);
        this->motion = {.position = vec2<TypeParam>(position, 0), .velocity = vec2<TypeParam>(velocity, 0)};
        this->step();
        return number(this->state.surface.integral.x());
    };
    EXPECT_EQ(after(1.0, 0.0), 0.0);            // u = -38, beyond the limit by more of the same
    EXPECT_NEAR(after(1.0, -4.0), 1e-3, 1e-9);  // u = 14: more of it lowers the force
    EXPECT_NEAR(after(0.1, 0.0), 1e-4, 1e-9);   // u = -3.8
    const double before = number(this->state.surface.integral.x());
    this->miss({.value = vec2<TypeParam>(0.2, 0.2)});
    EXPECT_EQ(number(this->state.surface.integral.x()), before);
    TestFixture::C::start_over(this->state, true);
    EXPECT_EQ(number(this->state.surface.integral.x()), 0.0);
}

// ė + λ e = s(0) e^(-a t) from the first step on
TYPED_TEST(LinearTermOf, TheStartIsOnTheSurface) {
    const double a = 1.5;
    this->prepare({.start_rate = a}, 2e-4);
    this->motion = {.position = vec2<TypeParam>(1, -1), .velocity = vec2<TypeParam>(2, 0)};
    const auto first = this->step();
    expect_equal(first.report.surface, {0, 0});
    // The mean over the step of d/dt (s(0) e^(-a t)).
    const double moves = 5.0 * (1.0 - std::exp(-a * 2e-4)) / 2e-4;
    EXPECT_NEAR(number(first.force.x()), -lambda * 2.0 - moves, std::fmax(1e-9, 200 * this->tolerance));
    for (int n = 1; n < 5000; ++n) {
        ASSERT_NEAR(number(this->step().report.surface.x()), 0.0, 1e-3) << n;
    }
    const double e = std::exp(-lambda), s = std::exp(-a);
    EXPECT_NEAR(number(this->motion.position.x()), e + 5.0 * (s - e) / (lambda - a), 1e-3);
    EXPECT_NEAR(number(this->state.surface.start.x()), 5.0 * s, 5e-3 * s);
}

TYPED_TEST(LinearTermOf, TheStartIsThatOfTheFirstMeasuredSample) {
    this->prepare({.start_rate = 2.0});
    this->miss();
    this->motion = {.position = vec2<TypeParam>(1, 0)};
    expect_equal(this->step().report.surface, {0, 0});
    this->miss({.value = vec2<TypeParam>(5, 0)});  // time continues
    EXPECT_NEAR(number(this->state.surface.start.x()), lambda * std::exp(-2.0 * 2e-3), 1e-6);
    TestFixture::C::start_over(this->state, true);
    this->motion = {.position = vec2<TypeParam>(0, 2)};
    expect_equal(this->step().report.surface, {0, 0});
}

// α = ṙ - λ e follows the motion of the reference.
TYPED_TEST(LinearTermOf, TheFilterDecaysExactlyAndNeedsNoAcceleration) {
    using Term = LinearTerm<TypeParam>;
    const double tau = 0.02;
    SurfaceParams p{};
    p.fractional_gain = {lambda, lambda};
    p.linear.filter = tau;
    const auto c = Term::prepare(p, 1e-3, 1.0);
    typename Term::State state{};
    SurfaceInput<TypeParam> input{
        .reference = {.velocity = vec2<TypeParam>(1, 0), .acceleration = vec2<TypeParam>(7, 9)}};
    const Sample<TypeParam> none{};
    const auto point = [&] {
        const auto found = Term::evaluate(state, c, none, input);
        Term::advance(state, c, none, input, {});
        return found;
    };
    expect_equal(point().s, {0, 0});
    input.reference.velocity = vec2<TypeParam>(1.5, -2);
    const double rate = (1.0 - std::exp(-1e-3 / tau)) / 1e-3;
    for (int n = 0; n < 40; ++n) {
        const double left = std::exp(-1e-3 * n / tau);
        const auto found = point();
        expect_near(found.s, {0.5 * left, -2.0 * left}, 10 * this->tolerance);
        // The acceleration of the reference leaves the force by it.
        expect_near(found.drift, {7.0 - 0.5 * rate * left, 9.0 + 2.0 * rate * left}, 100 * this->tolerance);
    }
    // Along a ramp the derivative of the lag is that of the ramp, and s is late by τ of it.
    for (int n = 0; n < 400; ++n) {
        input.reference.velocity = input.reference.velocity + vec2<TypeParam>(4e-3, 0);
        point();
    }
    input.reference.velocity = input.reference.velocity + vec2<TypeParam>(4e-3, 0);
    const auto late = point();
    EXPECT_NEAR(number(late.drift.x()), 7.0 - 4.0, 2e3 * this->tolerance);
    EXPECT_NEAR(number(late.s.x()), 4.0 / rate, 100 * this->tolerance);
}

TYPED_TEST(LinearTermOf, TheDynamicSurfaceTracksWithTheErrorOfItsLag) {
    using T = TypeParam;
    const ReferenceParams reference{.amplitude = {1.0, 1.0}, .frequency = {2.0, 2.0}};
    const auto error = [&](double tau) {
        this->prepare({.filter = tau}, 1e-3, reference);
        this->motion = {.velocity = vec2<T>(2, 2)};
        double largest = 0.0;
        for (int n = 0; n < 8000; ++n) {
            const double e = number(this->step().error.value.x());
            largest = n < 4000 ? 0.0 : std::fmax(largest, std::fabs(e));
        }
        return largest;
    };
    // jω e = α̂ - ṙ = (ṙ - λ e)/(1 + jωτ) - ṙ, and a sample more of lag than τ has half a step.
    const auto lag = [](double tau) {
        const double w = 2.0, late = 1e-3 / (1.0 - std::exp(-1e-3 / tau));
        return w * w * late / std::hypot(lambda - w * w * late, w);
    };
    EXPECT_NEAR(error(0.01), lag(0.01), 0.01 * lag(0.01));
    EXPECT_NEAR(error(0.05), lag(0.05), 0.01 * lag(0.05));
}

TYPED_TEST(LinearTermOf, OnlyASwitchOfZeroOrOneIsSound) {
    using C = typename TestFixture::C;
    this->prepare({});
    EXPECT_TRUE(C::sound(this->state, this->c));
    reinterpret_cast<unsigned char&>(this->state.surface.started) = 2;
    EXPECT_FALSE(C::sound(this->state, this->c));
}

}  // namespace
}  // namespace fracgyro::testing
