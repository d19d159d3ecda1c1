// The disturbance observer and the law that has it: closed forms.
#include "scalars.hpp"

#include "fracgyro/controllers/integral_sliding.hpp"

#include <algorithm>
#include <cmath>

namespace fracgyro::testing {
namespace {

constexpr double h = 1e-3, bandwidth = 250.0;

template <class T>
class DisturbanceObserverOf : public ::testing::Test {
protected:
    using Observer = DisturbanceObserver<T>;
    using Vector = Vec2<T>;

    static Vector vector(double x, double y) { return {T(x), T(y)}; }
    // A free mass under this force, with the force of a law that knows nothing of it.
    void run(int steps, const Vector& pushes) {
        for (int n = 0; n < steps; ++n) {
            Observer::correct(state, c, error);
            const Vector acts = vector(3.0 * std::sin(0.1 * n), -2.0);
            Observer::predict(state, c, error, acts);
            error.value = error.value + T(h) * error.derivative;
            error.derivative = error.derivative + T(h) * (acts + pushes);
        }
    }
    typename Observer::Coefficients c = Observer::prepare(bandwidth, h);
    typename Observer::State state{};
    Sample<T> error{};
    double tolerance = std::is_same_v<T, float> ? 2e-3 : 1e-10;  // float rounds each increment
};
TYPED_TEST_SUITE(DisturbanceObserverOf, Scalars, ScalarNames);

TYPED_TEST(DisturbanceObserverOf, FindsAConstantForceWithItsTimeConstantExactly) {
    this->run(1, this->vector(7.0, -4.0));
    for (int n = 1; n < 30; ++n) {
        this->run(1, this->vector(7.0, -4.0));
        const double found = 1.0 - std::exp(-bandwidth * h * n);
        EXPECT_NEAR(number(this->state.force.x()), 7.0 * found, 7.0 * this->tolerance);
        EXPECT_NEAR(number(this->state.force.y()), -4.0 * found, 7.0 * this->tolerance);
    }
}

TYPED_TEST(DisturbanceObserverOf, KeepsItsEstimateOverAGap) {
    this->run(100, this->vector(7.0, -4.0));
    DisturbanceObserver<TypeParam>::pause(this->state);
    const double before = number(this->state.force.x());
    this->error.derivative = this->vector(5.0, 5.0);  // unseen
    this->run(1, this->vector(7.0, -4.0));
    EXPECT_EQ(number(this->state.force.x()), before);
    this->run(100, this->vector(7.0, -4.0));
    EXPECT_NEAR(number(this->state.force.x()), 7.0, 7.0 * this->tolerance);
}

TYPED_TEST(DisturbanceObserverOf, StartsOverWithOrWithoutIt) {
    this->run(100, this->vector(7.0, -4.0));
    auto kept = this->state, dropped = this->state;
    DisturbanceObserver<TypeParam>::start_over(kept, true);
    DisturbanceObserver<TypeParam>::start_over(dropped, false);
    EXPECT_EQ(number(kept.force.x()), number(this->state.force.x()));
    EXPECT_EQ(number(dropped.force.x()), 0.0);
    EXPECT_FALSE(kept.predicts || dropped.predicts);
}

// On the nominal plant and pushed by more than the limit for a while: as soon as the push ends, d̂ is 0 within some 1/L,
// and the force returns from the limit.
TEST(IntegralSliding, NothingWindsUpAtTheForceLimit) {
    using Law = IntegralSliding<double>;
    Common common{.step = h, .reference = {.amplitude = {0.0, 0.0}}, .force_limit = 100.0};
    const auto c = Law::prepare({}, common);
    Law::State state{};
    Motion<double> motion{};
    double error = 0.0;
    for (int n = 0; n < 3000; ++n) {
        const Vec2<double> push = n < 100 ? Vec2<double>{130.0, 0.0} : Vec2<double>{};
        const auto signals = Law::step(state, c, motion);
        motion.position = motion.position + h * motion.velocity + (0.5 * h * h) * (signals.force + push);
        motion.velocity = motion.velocity + h * (signals.force + push);
        if (n == 90) {
            EXPECT_EQ(signals.force.x(), -100.0);
            EXPECT_NEAR(state.observer.force.x(), 130.0, 1e-6);
        }
        if (n == 130) {
            EXPECT_NEAR(state.observer.force.x(), 0.0, 0.1);
        }
        error = n > 2000 ? std::max(error, std::abs(motion.position.x())) : 0.0;
    }
    EXPECT_LT(error, 1e-9);
}

}  // namespace
}  // namespace fracgyro::testing
