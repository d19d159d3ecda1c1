#include "scalars.hpp"

#include "fracgyro/plant/disturbance.hpp"
#include "fracgyro/plant/gyroscope.hpp"

#include <cmath>
#include <numbers>

namespace fracgyro::testing {
namespace {

// The paper's gyroscope, eq. (48), turning ten times as fast, with parameters that the controller does not know.
GyroscopeParams gyroscope() {
    return {.damping = {0.01, 0.002, 0.01},
            .stiffness = {355.3, 70.99, 532.9},
            .damping_deviation = {0.3, 0.1, 0.2},
            .stiffness_deviation = {5.0, -3.0, 7.0},
            .rate = 1.0,
            .initial_position = {0.5, -0.3},
            .initial_velocity = {2.0, 1.0}};
}

Motion<double> derivative(const GyroscopeParams& p, const Motion<double>& at, Vec2<double> force) {
    const Vec2<double> q = at.position;
    const Vec2<double> v = at.velocity;
    const Vec2<double> coriolis{-2.0 * p.rate * v.y(), 2.0 * p.rate * v.x()};
    return {.position = v,
            .velocity =
                force - (p.damping + p.damping_deviation) * v - coriolis - (p.stiffness + p.stiffness_deviation) * q};
}

Motion<double> moved(const Motion<double>& from, double h, const Motion<double>& rate) {
    return {.position = from.position + h * rate.position, .velocity = from.velocity + h * rate.velocity};
}

// One classical Runge-Kutta step.
Motion<double> runge_kutta(const GyroscopeParams& p, const Motion<double>& at, Vec2<double> force, double h) {
    const auto k1 = derivative(p, at, force);
    const auto k2 = derivative(p, moved(at, h / 2.0, k1), force);
    const auto k3 = derivative(p, moved(at, h / 2.0, k2), force);
    const auto k4 = derivative(p, moved(at, h, k3), force);
    return moved(moved(moved(moved(at, h / 6.0, k1), h / 3.0, k2), h / 3.0, k3), h / 6.0, k4);
}

template <class T>
class ExactStep : public ::testing::Test {
protected:
    static void expect_motion(const Motion<T>& got, const Motion<double>& wanted, double tolerance) {
        expect_near(got.position, wanted.position, tolerance);
        expect_near(got.velocity, wanted.velocity, tolerance);
    }
};
TYPED_TEST_SUITE(ExactStep, Scalars, ScalarNames);

TYPED_TEST(ExactStep, OneExactStepEqualsManyTinyRungeKuttaSteps) {
    const GyroscopeParams p = gyroscope();
    const Vec2<double> force{30.0, -50.0};
    for (const double step : {1e-3, 0.1, 1.5}) {
        Motion<TypeParam> got = Gyroscope<TypeParam>::start(p);
        Gyroscope<TypeParam>::step(got, Gyroscope<TypeParam>::prepare(p, step), vec2<TypeParam>(force.x(), force.y()));
        Motion<double> wanted = Gyroscope<double>::start(p);
        constexpr int parts = 20'000;
        for (int i = 0; i < parts; ++i) {
            wanted = runge_kutta(p, wanted, force, step / parts);
        }
        TestFixture::expect_motion(got, wanted, 1e-10 + 1e2 * epsilon<TypeParam>);
    }
}

TYPED_TEST(ExactStep, UndampedAndUncoupledAxesOscillateAtTheirOwnFrequencies) {
    const GyroscopeParams p{
        .stiffness = {4.0, 0.0, 9.0}, .initial_position = {1.0, 0.0}, .initial_velocity = {0.0, 3.0}};
    const double step = std::numbers::pi / 100.0;
    const auto c = Gyroscope<TypeParam>::prepare(p, step);
    Motion<TypeParam> motion = Gyroscope<TypeParam>::start(p);
    for (int n = 0; n < 1000; ++n) {
        const double t = n * step;
        TestFixture::expect_motion(motion,
                                   {.position = {std::cos(2.0 * t), std::sin(3.0 * t)},
                                    .velocity = {-2.0 * std::sin(2.0 * t), 3.0 * std::cos(3.0 * t)}},
                                   4e3 * epsilon<TypeParam>);
        Gyroscope<TypeParam>::step(motion, c, {});
    }
}

TYPED_TEST(ExactStep, AConstantForceHoldsTheMassWhereTheSpringBalancesIt) {
    // [[3, 1], [1, 2]] (1, 2)ᵀ = (5, 5)ᵀ
    const GyroscopeParams p{
        .damping = {1.0, 0.0, 1.0}, .stiffness = {3.0, 1.0, 2.0}, .rate = 0.5, .initial_position = {1.0, 2.0}};
    const auto c = Gyroscope<TypeParam>::prepare(p, 0.25);
    Motion<TypeParam> motion = Gyroscope<TypeParam>::start(p);
    for (int n = 0; n < 100; ++n) {
        Gyroscope<TypeParam>::step(motion, c, vec2<TypeParam>(5, 5));
    }
    TestFixture::expect_motion(motion, {.position = {1.0, 2.0}}, 1e2 * epsilon<TypeParam>);
}

TYPED_TEST(ExactStep, RotationAloneTurnsTheVelocityWithoutChangingItsSize) {
    // v̇ = -2Ω v: v turns clockwise, at twice the rate.
    const GyroscopeParams p{.rate = 0.5, .initial_velocity = {1.0, 0.0}};
    const auto c = Gyroscope<TypeParam>::prepare(p, std::numbers::pi / 2.0);
    Motion<TypeParam> motion = Gyroscope<TypeParam>::start(p);
    Gyroscope<TypeParam>::step(motion, c, {});
    expect_near(motion.velocity, {0.0, -1.0}, 4.0 * epsilon<TypeParam>);
    expect_near(motion.position, {1.0, -1.0}, 4.0 * epsilon<TypeParam>);
}

TYPED_TEST(ExactStep, TwoHalfStepsEqualOne) {
    const GyroscopeParams p = gyroscope();
    const auto force = vec2<TypeParam>(30, -50);
    for (const double step : {1e-4, 1e-2, 1.0}) {
        Motion<TypeParam> once = Gyroscope<TypeParam>::start(p);
        Gyroscope<TypeParam>::step(once, Gyroscope<TypeParam>::prepare(p, step), force);
        Motion<TypeParam> twice = Gyroscope<TypeParam>::start(p);
        const auto half = Gyroscope<TypeParam>::prepare(p, step / 2.0);
        Gyroscope<TypeParam>::step(twice, half, force);
        Gyroscope<TypeParam>::step(twice, half, force);
        TestFixture::expect_motion(once,
                                   {.position = {number(twice.position.x()), number(twice.position.y())},
                                    .velocity = {number(twice.velocity.x()), number(twice.velocity.y())}},
                                   4e2 * epsilon<TypeParam>);
    }
}

TEST(SineDisturbance, IsItsFormulaOnEachAxis) {
    constexpr double step = 1e-3;
    Disturbance disturbance(
        {.kind = DisturbanceKind::sine, .amplitude = {2.0, 3.0}, .frequency = {5.0, 7.0}, .phase = {0.5, -1.0}}, step);
    std::array<Vec2<double>, 3000> drawn{};
    disturbance.fill(0, drawn);
    for (std::size_t n = 0; n < drawn.size(); ++n) {
        const double t = static_cast<double>(n) * step;
        expect_near(drawn[n], {2.0 * std::sin(5.0 * t + 0.5), 3.0 * std::sin(7.0 * t - 1.0)}, 1e-12);
    }
}

TEST(DisturbanceTerms, AddUpFromTheirStartToTheirEnd) {
    const DisturbanceTerm step{.kind = TermKind::step, .start = 2.5, .end = 6.0, .amplitude = {1.0, -2.0}};
    const DisturbanceTerm pulse{.kind = TermKind::pulse, .start = 4.0, .amplitude = {3.0, 0.0}, .width = 4.0};
    const DisturbanceTerm table{.kind = TermKind::table,
                                .start = 1.0,
                                .places = {0.0, 2.0, 3.0},
                                .x_values = {0.0, 4.0, 4.0},
                                .y_values = {1.0, 1.0, 0.0}};
    std::array<Vec2<double>, 10> d{};
    Disturbance({.terms = {step, pulse, table}}, 1.0).fill(0, d);
    const double half = std::sqrt(0.5);
    const std::array<Vec2<double>, 10> expected{{{0.0, 0.0},
                                                 {0.0, 1.0},
                                                 {2.0, 1.0},
                                                 {5.0, -1.0},
                                                 {5.0, -2.0},
                                                 {1.0 + 3.0 * half, -2.0},
                                                 {3.0, 0.0},
                                                 {3.0 * half, 0.0},
                                                 {0.0, 0.0},
                                                 {0.0, 0.0}}};
    for (std::size_t n = 0; n < d.size(); ++n) {
        expect_near(d[n], {expected[n].x(), expected[n].y()}, 1e-14);
    }
}

TEST(Tones, HaveThePowerOfTheirSpectrum) {
    const auto power = [](std::vector<double> frequencies, std::vector<double> densities) {
        return Tones::power(frequencies, densities);
    };
    EXPECT_DOUBLE_EQ(power({0.0, 10.0}, {2.0, 2.0}), 20.0);
    EXPECT_NEAR(power({1.0, 10.0}, {1.0, 100.0}), 333.0, 1e-10);
    EXPECT_NEAR(power({1.0, 10.0, 100.0}, {1.0, 0.1, 0.01}), std::log(100.0), 1e-12);
    EXPECT_NEAR(power({1.0, 10.0}, {1.0, 0.1 * (1.0 + 1e-6)}), std::log(10.0) * (1.0 + 0.5e-6), 1e-11);
    EXPECT_EQ(power({1.0, 10.0}, {0.0, 0.0}), 0.0);
}

TEST(Tones, HaveTheSameBitsWhicheverPartIsDrawn) {
    const DisturbanceTerm vibration{
        .kind = TermKind::vibration, .places = {1.0, 100.0}, .x_values = {1.0, 0.5}, .y_values = {2.0, 2.0}};
    const Disturbance disturbance({.seed = 3, .terms = {vibration}}, 1e-2);
    std::array<Vec2<double>, 400> whole{}, parts{};
    disturbance.fill(0, whole);
    for (std::size_t done = 0; done < parts.size(); done += 16) {
        disturbance.fill(static_cast<std::int64_t>(done), std::span(parts).subspan(done, 16));
    }
    for (std::size_t n = 0; n < whole.size(); ++n) {
        EXPECT_EQ(whole[n].x(), parts[n].x());
        EXPECT_EQ(whole[n].y(), parts[n].y());
    }
}

}  // namespace
}  // namespace fracgyro::testing
