// Controllers with feedforward of the nominal plant: PID, and super-twisting, for which its sign matters.
#include "paper.hpp"
#include "scalars.hpp"

#include <cmath>

namespace fracgyro::testing {
namespace {

constexpr double h = 0.125;  // powers of two and small integers: expected values are exact

template <Scalar T>
Motion<T> motion(double x, double y, double vx = 0.0, double vy = 0.0) {
    return {.position = vec2<T>(x, y), .velocity = vec2<T>(vx, vy)};
}

// Holds (0, 0).
Common at_rest() {
    Common common{.step = h};
    common.reference.amplitude = {0.0, 0.0};
    return common;
}

template <class T>
class Following : public ::testing::Test {};
TYPED_TEST_SUITE(Following, Scalars, ScalarNames);

TYPED_TEST(Following, TheFeedforwardIsTheForceThatTheNominalPlantNeedsOnTheReference) {
    using T = TypeParam;
    const PlantModel<double> nominal{.damping = {1.0, 2.0, 3.0}, .stiffness = {4.0, 5.0, 6.0}, .rate = 0.5};
    const auto c = Feedforward<T>::prepare(nominal);
    const auto force = [&](const ReferencePoint<T>& r) { return Feedforward<T>::force(c, r); };
    const auto one = vec2<T>(1.0, 0.0), other = vec2<T>(0.0, 1.0);
    expect_equal(force({.position = one}), {4.0, 5.0});
    expect_equal(force({.position = other}), {5.0, 6.0});
    expect_equal(force({.velocity = one}), {1.0, 2.0 + 1.0});  // Coriolis: 2 Ωz (-vy, vx)
    expect_equal(force({.velocity = other}), {2.0 - 1.0, 3.0});
    expect_equal(force({.acceleration = vec2<T>(7.0, 8.0)}), {7.0, 8.0});
}

TYPED_TEST(Following, ThePidIntegratesItsErrorAndStopsWhereThatWouldWindUp) {
    using T = TypeParam;
    Common common = at_rest();
    const PidParams p{.natural_frequency = 2.0, .damping_ratio = 0.5, .integral_frequency = 3.0};
    const auto c = Pid<T>::prepare(p, common);
    typename Pid<T>::State state{};
    // ω² e + 2 ζ ω ė + ω_i ω² ∫e, the integral of the samples before.
    expect_equal(Pid<T>::step(state, c, motion<T>(1.0, 2.0, 5.0, -5.0)).force, {-4.0 - 10.0, -8.0 + 10.0});
    expect_equal(state.integral, {h * 3.0 * 4.0, h * 3.0 * 8.0});
    expect_equal(Pid<T>::step(state, c, motion<T>(0.0, 0.0)).force, {-1.5, -3.0});
    const Sample<T> missing{.value = vec2<T>(1.0, 1.0)};
    Pid<T>::step(state, c, {}, &missing);
    expect_equal(state.integral, {1.5, 3.0});

    common.force_limit = 4.0;
    const auto limited = Pid<T>::prepare(p, common);
    typename Pid<T>::State held{};
    expect_equal(Pid<T>::step(held, limited, motion<T>(8.0, 0.0)).force, {-4.0, 0.0});
    expect_equal(held.integral, {0.0, 0.0});
    // Beyond the limit on the side from which the integral leads back: x winds up by 1, y unwinds by 3 · 8.
    held.integral = vec2<T>(0.0, -64.0);
    expect_equal(Pid<T>::step(held, limited, motion<T>(1.25, 1.0)).force, {-4.0, 4.0});
    expect_equal(held.integral, {h * 3.0 * 5.0, h * 3.0 * 4.0 - 64.0});
}

TYPED_TEST(Following, SuperTwistingIntegratesTheSignOfTheSurfaceAndNothingOnIt) {
    using T = TypeParam;
    using Twisting = SuperTwisting<T>;
    Common common = at_rest();
    const SuperTwistingParams p{
        .surface_gain = 2.0, .twisting_gain = 3.0, .integral_gain = 16.0, .adaptation = {.adaptive = false}};
    const auto c = Twisting::prepare(p, common);
    typename Twisting::State state{};
    Twisting::step(state, c, motion<T>(0.0, 0.0));
    expect_equal(state.integral, {0.0, 0.0});
    Twisting::step(state, c, motion<T>(0.25, -1e-6));
    expect_equal(state.integral, {-2.0, 2.0});
    Twisting::step(state, c, motion<T>(1.0, 0.0, -2.0, 0.0));  // s = v + 2 q = 0
    expect_equal(state.integral, {-2.0, 2.0});
    expect_equal(Twisting::step(state, c, motion<T>(2.0, 0.0)).force, {-3.0 * 2.0 - 2.0, 2.0});

    common.force_limit = 4.0;
    const auto limited = Twisting::prepare(p, common);
    typename Twisting::State held{};
    EXPECT_EQ(number(Twisting::step(held, limited, motion<T>(8.0, 0.0)).force.x()), -4.0);
    expect_equal(held.integral, {0.0, 0.0});
    // Δu·s decides: beyond the limit by -2 · 8 on x, by 12 · 1/2 on y, which a quotient would weigh the other way.
    held.integral = vec2<T>(0.0, 17.5);
    const auto signals = Twisting::step(held, limited, motion<T>(2.0, 0.125));
    EXPECT_LT(number(signals.excess.x()), 0.0);
    EXPECT_GT(number(signals.excess.y()), 0.0);
    EXPECT_GT(std::abs(number(signals.excess.y())) / 0.25, std::abs(number(signals.excess.x())) / 4.0);
    EXPECT_LT(number(signals.excess.x()) * 4.0 + number(signals.excess.y()) * 0.25, 0.0);
    EXPECT_EQ(number(held.integral.x()), 0.0);
}

}  // namespace
}  // namespace fracgyro::testing
