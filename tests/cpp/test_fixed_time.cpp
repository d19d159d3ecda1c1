// Fixed-time sliding mode: closed forms on a free mass, and the bound of the time.
#include "follow.hpp"
#include "scalars.hpp"

#include "fracgyro/controllers/fixed_time.hpp"

#include <algorithm>
#include <cmath>

namespace fracgyro::testing {
namespace {

using Law = FixedTimeParams;

// Nearly s = ė: the surface has no gain.
Law reaching(Reaching kind, double near, double far) {
    Law law{.near_gain = 1e-9, .far_gain = 1e-9, .near_reaching = near, .far_reaching = far, .reaching = kind};
    law.adaptation.adaptive = false;
    return law;
}

// A free mass, known as such, which is to come to 0.
template <class T>
class FixedTimeOf : public ::testing::Test {
protected:
    using C = FixedTime<T>;

    void prepare(const Law& law, double position, double velocity) {
        c = C::prepare(law, {.step = h, .reference = {.amplitude = {0.0, 0.0}}});
        state = {};
        motion = {.position = vec2<T>(position, -position), .velocity = vec2<T>(velocity, -velocity)};
    }
    auto step() {
        const auto signals = C::step(state, c, motion);
        motion.position = motion.position + T(h) * (motion.velocity + T(0.5 * h) * signals.force);
        motion.velocity = motion.velocity + T(h) * signals.force;
        return signals;
    }
    double velocity() const { return number(motion.velocity.x()); }

    typename C::Coefficients c{};
    typename C::State state{};
    Motion<T> motion{};
    double tolerance = std::is_same_v<T, float> ? 3e-6 : 1e-8;
};
TYPED_TEST_SUITE(FixedTimeOf, Scalars, ScalarNames);

TYPED_TEST(FixedTimeOf, ItsForceIsThatOfTheEquationsWithAFloorAtZeroError) {
    Law law{.near_gain = 2.0, .far_gain = 4.0, .near_exponent = 0.5, .near_reaching = 10.0, .far_reaching = 1.0};
    law.reaching = Reaching::explicit_step;
    // s = 2.5 + 2 √¼ + 4 ¼^(3/2) = 4, and its slopes over e are 2 ½/√¼ = 2 and 4 1.5 √¼ = 3.
    this->prepare(law, 0.25, 2.5);
    const auto signals = this->step();
    EXPECT_NEAR(number(signals.report.surface.x()), 4.0, this->tolerance);
    EXPECT_NEAR(number(signals.force.x()), -(2.0 + 3.0) * 2.5 - (10.0 * 2.0 + 8.0), 10.0 * this->tolerance);
    EXPECT_NEAR(number(signals.force.y()), 40.5, 10.0 * this->tolerance);
    // 2 ½ (10⁻⁴)^(-½) = 100
    this->prepare(law, 0.0, 1.0);
    EXPECT_NEAR(number(this->step().force.x()), -100.0 - (10.0 + 1.0), 100.0 * this->tolerance);
}

TYPED_TEST(FixedTimeOf, AHeldStepBringsNineToOne) {
    // √9 = 1 + ½ h (k₁ + k₂)
    this->prepare(reaching(Reaching::held, 1000.0, 3000.0), 0.0, 9.0);
    this->step();
    EXPECT_NEAR(this->velocity(), 1.0, 10.0 * this->tolerance);
    EXPECT_NEAR(number(this->motion.velocity.y()), -1.0, 10.0 * this->tolerance);
}

TYPED_TEST(FixedTimeOf, AnExplicitStepTakesTheTermsAtTheSample) {
    this->prepare(reaching(Reaching::explicit_step, 100.0, 100.0), 0.0, 9.0);
    this->step();
    EXPECT_NEAR(this->velocity(), 9.0 - h * (100.0 * 3.0 + 100.0 * 27.0), 10.0 * this->tolerance);
}

TYPED_TEST(FixedTimeOf, HeldItStopsAtZeroAndExplicitlyItCycles) {
    // Explicit: s = h k₁ √s/2 changes its sign each step.
    this->prepare(reaching(Reaching::explicit_step, 100.0, 1e-9), 0.0, 1.0);
    for (int n = 0; n < 200; ++n) {
        this->step();
    }
    EXPECT_NEAR(std::abs(this->velocity()), 0.1 * 0.1 / 4.0, this->tolerance);
    this->prepare(reaching(Reaching::held, 100.0, 1e-9), 0.0, 1.0);
    for (int n = 0; n < 200; ++n) {
        this->step();
    }
    EXPECT_NEAR(this->velocity(), 0.0, this->tolerance);
}

TYPED_TEST(FixedTimeOf, OnlyTheHeldStepBearsAnySpeed) {
    // Explicitly it grows from (2/(h k₂))² = 100 on.
    for (const double speed : {90.0, 110.0}) {
        this->prepare(reaching(Reaching::explicit_step, 1e-9, 200.0), 0.0, speed);
        for (int n = 0; n < 3; ++n) {
            this->step();
        }
        EXPECT_EQ(std::abs(this->velocity()) < speed, speed < 100.0) << speed;
    }
    this->prepare(reaching(Reaching::held, 1e-9, 200.0), 0.0, 1e6);
    double before = 1e6;
    for (int n = 0; n < 100; ++n) {
        this->step();
        EXPECT_LT(this->velocity(), before);
        EXPECT_GT(this->velocity(), 0.0);
        before = this->velocity();
    }
}

TYPED_TEST(FixedTimeOf, WithoutASampleNothingIsLearned) {
    using C = FixedTime<TypeParam>;
    this->prepare({}, 0.5, 0.0);
    this->step();
    const auto stiffness = [](const auto& state) { return number(state.base.adaptation.deviation.stiffness.xx()); };
    const double learned = stiffness(this->state);
    EXPECT_NE(learned, 0.0);
    const Sample<TypeParam> assumed{.value = vec2<TypeParam>(0.3, 0.3)};
    C::step(this->state, this->c, this->motion, &assumed);
    EXPECT_EQ(stiffness(this->state), learned);
    C::start_over(this->state, true);
    EXPECT_EQ(stiffness(this->state), learned);
    C::start_over(this->state, false);
    EXPECT_EQ(stiffness(this->state), 0.0);
}

// Time until |e| stays below 0.02.
double settles(double start, Reaching kind, double limit = std::numeric_limits<double>::infinity()) {
    using C = FixedTime<double>;
    Law law{.near_gain = 3.0, .far_gain = 3.0, .near_exponent = 0.7, .near_reaching = 20.0, .far_reaching = 20.0};
    law.reaching = kind;
    law.adaptation.adaptive = false;
    const auto c = C::prepare(law, {.step = h, .reference = {.amplitude = {0.0, 0.0}}, .force_limit = limit});
    C::State state{};
    Motion<double> motion{.position = {start, 0.0}};
    double last = 0.0;
    for (int n = 1; n <= 8000; ++n) {
        const Vec2<double> force = C::step(state, c, motion).force;
        motion.position = motion.position + h * (motion.velocity + 0.5 * h * force);
        motion.velocity = motion.velocity + h * force;
        last = std::abs(motion.position.x()) < 0.02 ? last : n * h;
    }
    return last;
}

TEST(FixedTime, FromAnyStartTheErrorIsSmallWithinTheBound) {
    const double bound = 1.0 / (3.0 * 0.3) + 1.0 / (3.0 * 0.5) + pi / 20.0;
    double before = 0.0;
    for (const double start : {0.01, 0.1, 1.0, 10.0, 100.0, 1e3, 1e4}) {
        const double time = settles(start, Reaching::held);
        EXPECT_LT(time, bound) << start;
        EXPECT_GE(time, before) << start;
        before = time;
    }
    EXPECT_LT(before, 1.1 * settles(100.0, Reaching::held));
    EXPECT_GT(settles(1e4, Reaching::explicit_step), 7.9);  // never
}

TEST(FixedTime, AForceLimitTakesTheFixedTimeFromIt) {
    EXPECT_GT(settles(100.0, Reaching::held, 1000.0), 2.0);
    EXPECT_LT(settles(1.0, Reaching::held, 1000.0), 1.0);
}

// In noise, on the paper's plant.
TEST(FixedTime, LearnsThePlantThatIsAFewPercentOff) {
    auto a = CaseOf<Law>::in_noise();
    const double learning = Loop<FixedTime<double>>(a).rms(10'000, 10'000);
    a.law.adaptation.adaptive = false;
    EXPECT_LT(learning, 1e-4);
    EXPECT_LT(learning, 0.2 * Loop<FixedTime<double>>(a).rms(10'000, 10'000));
}

}  // namespace
}  // namespace fracgyro::testing
