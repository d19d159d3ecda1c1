// Prescribed performance: the equations, the course of the bound, and that a bound that is left costs nothing more.
#include "follow.hpp"
#include "scalars.hpp"

#include "fracgyro/controllers/prescribed.hpp"

#include <algorithm>
#include <cmath>

namespace fracgyro::testing {
namespace {

using Law = PrescribedParams;

Law unlearned(Law law) {
    law.adaptation.adaptive = false;
    return law;
}

template <class T>
class PrescribedOf : public ::testing::Test {
protected:
    using C = Prescribed<T>;

    // A free mass, known as such, which is to come to 0.
    void prepare(const Law& law, double limit = std::numeric_limits<double>::infinity()) {
        c = C::prepare(law, {.step = h, .reference = {.amplitude = {0.0, 0.0}}, .force_limit = limit});
        state = {};
    }
    auto step(double position, double velocity = 0.0) {
        const Vec2<T> none{};
        return C::step(state, c,
                       {.position = vec2<T>(position, 0.0) + none, .velocity = vec2<T>(velocity, 0.0) + none});
    }
    double force(double position, double velocity) { return number(step(position, velocity).force.x()); }

    typename C::Coefficients c{};
    typename C::State state{};
    double tolerance = std::is_same_v<T, float> ? 1e-5 : 1e-10;
};
TYPED_TEST_SUITE(PrescribedOf, Scalars, ScalarNames);

TYPED_TEST(PrescribedOf, ItsForceIsThatOfTheEquationsAtHalfTheBound) {
    // ρ = 1, H = ½ and ξ = ½ ln 3, so that ε = 1 and B = ¾ ξ; ρ shrinks at the rate 2 (1 - ½) = 1.
    const double xi = 0.5 * std::log(3.0), four = std::pow(2.0, 0.75), barrier = 0.75 * xi;
    this->prepare(unlearned({.bound_final = 0.5,
                             .bound_rate = 2.0,
                             .barrier_scale = xi,
                             .barrier_root = four * 0.1,
                             .barrier_cube = 4.0 * 0.2,
                             .damper_root = four * 3.0,
                             .damper_cube = 4.0 * 5.0,
                             .damper = 10.0}));
    // φ = 0.3, of the slope ½ 0.1 + 3 0.2 over ε; ė + e = ½.
    const double z = 0.5 + barrier * 0.3, turns = 0.5 - 0.65 * 0.5 + xi * (0.75 + 2.0 * 0.5 * 0.5) * 0.3;
    const double damps = 10.0 * z + 3.0 * std::sqrt(z) + 5.0 * z * z * z;
    EXPECT_NEAR(this->force(0.5, 0.0), turns - 1.0 / barrier - damps, 30.0 * this->tolerance);
}

TYPED_TEST(PrescribedOf, ItsForceHasTheDerivativeOfTheVelocityThatItFollows) {
    const double xi = 0.7, tau = 3.0, last = 0.2, cube = 0.3, h_of_bound = std::exp(-tau * h);
    this->prepare(unlearned({.bound_final = last,
                             .bound_rate = tau,
                             .barrier_scale = xi,
                             .barrier_root = 0.0,
                             .barrier_cube = 4.0 * cube,
                             .damper_root = 0.0,
                             .damper_cube = 0.0,
                             .damper = 0.0}));
    this->step(0.0);
    const double rho = last + (1.0 - last) * h_of_bound, shrinks = -tau * (rho - last);
    const auto epsilon = [&](double e, double r) { return std::log((r + e) / (r - e)) / (2.0 * xi); };
    const auto barrier = [&](double e, double r) { return xi * r * (1.0 - e * e / (r * r)); };
    const auto alpha = [&](double e, double r) {
        return -tau * (1.0 - last / r) * e - barrier(e, r) * cube * std::pow(epsilon(e, r), 3.0);
    };
    const double e = -0.6, rate = 0.4, small = 1e-5;
    const double turns =
        (alpha(e + small * rate, rho + small * shrinks) - alpha(e - small * rate, rho - small * shrinks)) /
        (2.0 * small);
    EXPECT_NEAR(this->force(e, rate), turns - epsilon(e, rho) / barrier(e, rho), 1e-8 + 10.0 * this->tolerance);
}

TYPED_TEST(PrescribedOf, TheBoundBeginsBeyondTheErrorAndTakesItsCourse) {
    for (const double start : {0.5, 2.0}) {
        this->prepare(unlearned({.bound_final = 0.25, .bound_rate = 100.0}));
        const double first = std::max(1.0, 1.2 * start);
        for (int n = 0; n < 30; ++n) {
            const auto report = this->step(n == 0 ? start : 0.0).report;
            const double bound = 0.25 + (first - 0.25) * std::exp(-0.1 * n);
            EXPECT_NEAR(number(report.error_bound.x()), bound, this->tolerance);
            EXPECT_NEAR(number(report.error_bound.y()), 0.25 + 0.75 * std::exp(-0.1 * n), this->tolerance);
            EXPECT_NEAR(number(report.frequency.x()), 1.0 / (0.5 * bound), 10.0 * this->tolerance);
            EXPECT_EQ(number(report.left), 0.0);
            EXPECT_EQ(number(report.widened), 0.0);
        }
    }
}

TYPED_TEST(PrescribedOf, OneBadSampleWidensTheBoundOfItsAxisUntilItHasShrunkAgain) {
    this->prepare(unlearned({.bound_final = 0.25, .bound_rate = 100.0}));
    this->step(0.0);
    auto report = this->step(5.0).report;
    EXPECT_NEAR(number(report.error_bound.x()), 1.2 * 5.0, this->tolerance);
    EXPECT_NEAR(number(report.error_bound.y()), 0.25 + 0.75 * std::exp(-0.1), this->tolerance);
    report = this->step(0.0).report;
    // The spring is that of the course.
    EXPECT_NEAR(number(report.frequency.x()), 1.0 / (0.5 * (0.25 + 0.75 * std::exp(-0.2))), 10.0 * this->tolerance);
    EXPECT_EQ(number(report.left), 1.0);
    EXPECT_EQ(number(report.widened), 1.0);
    EXPECT_NEAR(number(report.error_bound.x()), 0.25 + 5.75 * std::exp(-0.1), 10.0 * this->tolerance);
}

TYPED_TEST(PrescribedOf, AtTheForceLimitTheBoundKeepsItsDistance) {
    this->prepare(unlearned({.bound_final = 0.1, .bound_rate = 100.0}), 10.0);
    double bound = 1.0;
    for (int n = 0; n < 20; ++n) {
        const auto signals = this->step(0.5);
        EXPECT_EQ(number(signals.force.x()), -10.0);
        EXPECT_NEAR(number(signals.report.error_bound.x()), bound, this->tolerance) << n;
        bound = std::max(0.1 + (bound - 0.1) * std::exp(-0.1), 1.2 * 0.5);
    }
    EXPECT_EQ(number(this->state.left), 1.0);  // the course went on, below the error
}

TYPED_TEST(PrescribedOf, SampledItIsNoStifferThanAStepAllows) {
    // ξ is raised to 2h/ρ_∞, and at the edge of the bound the force grows by 1/(2h) for each ε.
    this->prepare(unlearned({.bound_start = 0.1,
                             .bound_final = 0.1,
                             .barrier_scale = 1e-9,
                             .barrier_root = 0.0,
                             .barrier_cube = 0.0,
                             .damper_root = 0.0,
                             .damper_cube = 0.0,
                             .damper = 0.0}));
    EXPECT_NEAR(number(this->step(0.0).report.frequency.x()), 0.5 / h, 500.0 * this->tolerance);
    const double xi = 2.0 * h / 0.1, epsilon = std::log(1.9 / 0.1) / (2.0 * xi);
    EXPECT_NEAR(this->force(0.09, 0.0), -epsilon / (2.0 * h), 1e5 * this->tolerance);
}

TYPED_TEST(PrescribedOf, NoDamperTakesMoreThanTheSpeedInAStep) {
    this->prepare(unlearned({.bound_final = 1.0,
                             .barrier_root = 0.0,
                             .barrier_cube = 0.0,
                             .damper_root = 1e9,
                             .damper_cube = 1e9,
                             .damper = 1e9}));
    EXPECT_NEAR(this->force(0.0, 0.25), -0.25 / h, 1000.0 * this->tolerance);
}

TYPED_TEST(PrescribedOf, WithoutASampleNothingIsLearnedOrWidenedAndTheBoundShrinks) {
    using C = Prescribed<TypeParam>;
    this->prepare({.bound_final = 0.25, .bound_rate = 100.0});
    this->step(0.5, 1.0);
    const auto learned = [&] { return number(this->state.base.adaptation.deviation.stiffness.xx()); };
    const double before = learned();
    EXPECT_NE(before, 0.0);
    const Sample<TypeParam> assumed{.value = vec2<TypeParam>(9.0, 9.0)};
    C::step(this->state, this->c, {}, &assumed);
    EXPECT_EQ(learned(), before);
    EXPECT_NEAR(number(this->step(0.0).report.error_bound.x()), 0.25 + 0.75 * std::exp(-0.2), this->tolerance);
    EXPECT_EQ(number(this->state.left), 0.0);
    C::start_over(this->state, true);
    EXPECT_EQ(learned(), before);
    EXPECT_NEAR(number(this->step(3.0).report.error_bound.x()), 3.6, 10.0 * this->tolerance);
    C::start_over(this->state, false);
    EXPECT_EQ(learned(), 0.0);
}

TYPED_TEST(PrescribedOf, AFunnelHasGainsThatGrowTowardsBothBounds) {
    // ρ = 1: k_e = 1/(ξ (1 - ½)) and k_v = 10 (4 ½)/(4 - 3).
    this->prepare(unlearned({.shape = BarrierShape::funnel,
                             .bound_final = 0.5,
                             .bound_rate = 2.0,
                             .barrier_scale = 0.25,
                             .damper = 10.0,
                             .velocity_bound = 4.0}));
    EXPECT_NEAR(number(this->step(0.5, 3.0).report.frequency.x()), 4.0, this->tolerance);
    this->prepare(unlearned({.shape = BarrierShape::funnel,
                             .bound_final = 0.5,
                             .bound_rate = 2.0,
                             .barrier_scale = 0.25,
                             .damper = 10.0,
                             .velocity_bound = 4.0}));
    EXPECT_NEAR(this->force(0.5, -3.0), -(8.0 * 8.0) * 0.5 + 20.0 * 3.0, 30.0 * this->tolerance);
}

TYPED_TEST(PrescribedOf, BeyondItsBoundsAFunnelHasTheGainsThatAStepBears) {
    const Law law = unlearned({.shape = BarrierShape::funnel, .bound_final = 0.5, .barrier_scale = 1e-9});
    this->prepare(law);
    // The bound was widened to 1.2 |e|.
    EXPECT_NEAR(this->force(2.0, 0.0), -0.25 / (h * h) * 2.0, 1e6 * this->tolerance);
    this->prepare(law);
    EXPECT_NEAR(this->force(0.0, 1e3), -0.8 / h * 1e3, 1e6 * this->tolerance);
    Law undamped = law;
    undamped.damper = 0.0;
    this->prepare(undamped);
    EXPECT_EQ(this->force(0.0, 1e3), 0.0);
}

TYPED_TEST(PrescribedOf, AFunnelThatWasLeftKeepsItsSpring) {
    this->prepare(
        unlearned({.shape = BarrierShape::funnel, .bound_final = 0.25, .bound_rate = 100.0, .barrier_scale = 2.0}));
    this->step(0.0);
    this->step(5.0);
    const double bound = 0.25 + 5.75 * std::exp(-0.1), course = 0.25 + 0.75 * std::exp(-0.2);
    const double gain = 1.0 / (2.0 * course * (1.0 - 0.1 / bound));
    EXPECT_NEAR(this->force(0.1, 0.0), -gain * gain * 0.1, this->tolerance);
    EXPECT_EQ(number(this->state.left), 1.0);
}

// -- In noise, on the paper's plant, known within 5 %

struct Kept {
    double error = 0.0, share = 0.0, left = 0.0;
};
Kept run(const Law& law, Vec2<double> start) {
    auto a = CaseOf<Law>::in_noise();
    a.law = unlearned(law);
    a.common.force_limit = 1000.0;
    a.plant.initial_position = start;
    Loop<Prescribed<double>, decltype(a)> loop(a);
    Kept found{};
    for (int n = 0; n < 4000; ++n) {
        const Vec2<double> error = absolute(loop.step());
        const Vec2<double>& bound = loop.signals.report.error_bound;
        found.share = std::max({found.share, error.x() / bound.x(), error.y() / bound.y()});
        found.error = n < 3000 ? 0.0 : std::max({found.error, error.x(), error.y()});
    }
    found.left = loop.state.left;
    return found;
}

TEST(Prescribed, AFeasibleBoundIsKeptFromEveryStart) {
    for (const double bound : {1e-2, 1e-3}) {
        for (int n = 0; n < 10; ++n) {
            const Vec2<double> start{std::cos(0.7 * n), 1.0 + std::sin(1.3 * n)};
            const Kept found = run({.bound_final = bound, .barrier_scale = 1.0 / (200.0 * bound)}, start);
            EXPECT_LT(found.share, 1.0) << bound << ' ' << n;
            EXPECT_EQ(found.left, 0.0) << bound << ' ' << n;
        }
    }
}

TEST(Prescribed, AFeasibleFunnelIsKeptFromEveryStart) {
    for (int n = 0; n < 10; ++n) {
        const Vec2<double> start{std::cos(0.7 * n), 1.0 + std::sin(1.3 * n)};
        const Kept found = run({.shape = BarrierShape::funnel, .barrier_scale = 1.0 / (200.0 * 0.01)}, start);
        EXPECT_LT(found.share, 1.0) << n;
        EXPECT_EQ(found.left, 0.0) << n;
    }
}

TEST(Prescribed, ABoundBelowTheErrorOfItsSpringIsLeftAndWidenedAndControlIsKept) {
    // 5 % of the stiffness over 200².
    const Kept found = run({.bound_final = 1e-4, .barrier_scale = 1.0 / (200.0 * 1e-4)}, {0.5, 0.5});
    EXPECT_EQ(found.left, 1.0);
    EXPECT_LT(found.error, 1e-3);
}

}  // namespace
}  // namespace fracgyro::testing
