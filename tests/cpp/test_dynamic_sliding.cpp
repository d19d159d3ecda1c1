// Dynamic sliding mode: closed forms on a free mass, and what the law is for.
#include "follow.hpp"
#include "scalars.hpp"

#include "fracgyro/controllers/dynamic_sliding.hpp"

#include <algorithm>
#include <cmath>

namespace fracgyro::testing {
namespace {

using Law = DynamicSlidingParams;

Law unlearned(Law law = {}) {
    law.adaptation.adaptive = false;
    return law;
}

// A free mass, known as such, at rest at (0.5, -0.25), which is to come to 0.
template <class T>
class DynamicSlidingOf : public ::testing::Test {
protected:
    using C = DynamicSliding<T>;

    void prepare(const Law& law, double limit = std::numeric_limits<double>::infinity()) {
        c = C::prepare(law, {.step = h, .reference = {.amplitude = {0.0, 0.0}}, .force_limit = limit});
        state = {};
        motion = {.position = vec2<T>(0.5, -0.25)};
    }
    // `pushes`: a force on x that the law does not know.
    Signals<T, typename C::Report> step(double pushes = 0.0) {
        const auto signals = C::step(state, c, motion);
        const Vec2<T> acts = signals.force + vec2<T>(pushes, 0.0);
        motion.position = motion.position + T(h) * (motion.velocity + T(0.5 * h) * acts);
        motion.velocity = motion.velocity + T(h) * acts;
        return signals;
    }
    double sigma() { return number(step().report.dynamic.x()); }

    typename C::Coefficients c{};
    typename C::State state{};
    Motion<T> motion{};
    double tolerance = std::is_same_v<T, float> ? 1e-4 : 1e-11;
};
TYPED_TEST_SUITE(DynamicSlidingOf, Scalars, ScalarNames);

TYPED_TEST(DynamicSlidingOf, SigmaBeginsAsThePdsForceAndDecaysAtItsRateExactly) {
    this->prepare(unlearned({.surface_gain = 10.0, .reaching_rate = 20.0, .force_bandwidth = 100.0}));
    for (int n = 0; n < 40; ++n) {
        EXPECT_NEAR(this->sigma(), 10.0 * 20.0 * 0.5 * std::exp(-0.1 * n), 100.0 * this->tolerance) << n;
    }
}

TYPED_TEST(DynamicSlidingOf, SwitchingAddsItsRateOutsideTheLayerAndADecayWithin) {
    this->prepare(unlearned({.surface_gain = 10.0,
                             .reaching_rate = 20.0,
                             .force_bandwidth = 100.0,
                             .switching_rate = 5000.0,
                             .layer_thickness = 50.0}));
    EXPECT_NEAR(this->sigma(), 100.0, 100.0 * this->tolerance);
    EXPECT_NEAR(this->sigma(), 100.0 * std::exp(-0.1) - 5.0, 100.0 * this->tolerance);
    double before = 100.0;
    while (before > 25.0) {
        before = this->sigma();
    }
    // At the rates k and k_s/δ, 100 each.
    EXPECT_NEAR(this->sigma(), before * std::exp(-0.2), 100.0 * this->tolerance);
}

TYPED_TEST(DynamicSlidingOf, NoGainMakesSigmaOvershoot) {
    this->prepare(unlearned({.surface_gain = 10.0,
                             .reaching_rate = 20.0,
                             .force_bandwidth = 1.0,
                             .switching_rate = 1e9,
                             .layer_thickness = 1e-3}));
    EXPECT_NEAR(this->sigma(), 100.0, 100.0 * this->tolerance);
    for (int n = 0; n < 20; ++n) {
        EXPECT_NEAR(this->sigma(), 0.0, 100.0 * this->tolerance);
    }
}

TYPED_TEST(DynamicSlidingOf, AForceThatTheModelLacksLeavesAnErrorForThereIsNoIntegral) {
    this->prepare(unlearned({.surface_gain = 10.0, .reaching_rate = 20.0, .force_bandwidth = 100.0}));
    for (int n = 0; n < 4000; ++n) {
        this->step(30.0);
    }
    // p/(λκ) (1 + (λ + κ)/k), as the model takes p for an acceleration; sampled: with (λ + κ + λκh/2) h/(1 - e^(-kh)).
    const double share = (10.0 + 20.0 + 0.1) * h / (1.0 - std::exp(-0.1));
    EXPECT_NEAR(number(this->motion.position.x()), 30.0 / (10.0 * 20.0) * (1.0 + share), 0.15 * this->tolerance);
    EXPECT_NEAR(number(this->motion.position.y()), 0.0, 0.15 * this->tolerance);
}

TYPED_TEST(DynamicSlidingOf, AtTheLimitTheForceThatActsIsItsState) {
    this->prepare(unlearned(), 60.0);
    int at_the_limit = 0;
    for (int n = 0; n < 4000; ++n) {
        const auto signals = this->step();
        at_the_limit += number(signals.force.x()) == -60.0;
        EXPECT_EQ(number(this->state.force.x()), number(signals.force.x()));
        EXPECT_LE(std::abs(number(signals.force.x())), 60.0);
    }
    EXPECT_GT(at_the_limit, 50);
    EXPECT_NEAR(number(this->motion.position.x()), 0.0, 1e-6);
}

TYPED_TEST(DynamicSlidingOf, WithoutASampleNothingIsLearnedAndTheFeedforwardMovesOn) {
    using C = DynamicSliding<TypeParam>;
    const auto stiffness = [&] { return number(this->state.base.adaptation.deviation.stiffness.xx()); };
    const Common common{.step = h, .reference = {.frequency = {pi, pi}}};
    this->c = C::prepare({}, common);
    this->step();
    this->step();
    const double force = number(this->state.force.x()), learned = stiffness();
    EXPECT_NE(learned, 0.0);
    const Sample<TypeParam> assumed{.value = vec2<TypeParam>(0.3, 0.3), .derivative = vec2<TypeParam>(0.1, 0.0)};
    C::step(this->state, this->c, this->motion, &assumed);
    EXPECT_EQ(number(this->state.force.x()), force);
    EXPECT_EQ(stiffness(), learned);
    // Without estimates: r̈ of a unit sine half a step after sample 3, for which the hold is made up.
    this->c = C::prepare(unlearned(), common);
    this->state.base.adaptation = {};
    const auto signals = C::step(this->state, this->c, this->motion, &assumed);
    const double half = 0.5 * pi * h, held = -pi * pi * std::sin(7.0 * half) * half / std::sin(half);
    EXPECT_NEAR(number(signals.force.x()) - force, held, 100.0 * this->tolerance);
}

TYPED_TEST(DynamicSlidingOf, StartsOverFromTheFeedforwardWithOrWithoutItsEstimates) {
    this->prepare({});
    this->step();
    this->step();
    auto kept = this->state, dropped = this->state;
    DynamicSliding<TypeParam>::start_over(kept, true);
    DynamicSliding<TypeParam>::start_over(dropped, false);
    EXPECT_NE(number(this->state.force.x()), 0.0);
    EXPECT_EQ(number(kept.force.x()), 0.0);
    EXPECT_EQ(number(dropped.force.x()), 0.0);
    EXPECT_NE(number(kept.base.adaptation.deviation.stiffness.xx()), 0.0);
    EXPECT_EQ(number(dropped.base.adaptation.deviation.stiffness.xx()), 0.0);
}

// -- In noise, on the paper's plant, known within 5 %

using InNoise = CaseOf<Law>;

InNoise in_noise(double force_bandwidth = 400.0) {
    InNoise a = InNoise::in_noise();
    a.law.reaching_rate = 200.0;
    a.law.surface_gain = 120.0;
    a.law.force_bandwidth = force_bandwidth;
    a.common.force_limit = 1000.0;
    return a;
}

struct Steady {
    double error = 0.0, chattering = 0.0;
};
Steady steady(const InNoise& a) {
    Loop<DynamicSliding<double>> loop(a);
    Steady sum{};
    Vec2<double> last{}, before{};
    for (int n = 0; n < 20'000; ++n) {
        const Vec2<double> error = loop.step();
        const Vec2<double> second = loop.force - last + (before - last);
        if (n >= 10'000) {
            sum.error += 1e-4 * squared_norm(error);
            sum.chattering += 1e-4 * squared_norm(second);
        }
        before = last;
        last = loop.force;
    }
    return {std::sqrt(sum.error), std::sqrt(sum.chattering)};
}

TEST(DynamicSliding, ItsForceChattersFarLessThanThatOfThePdThatItFollows) {
    const Steady ours = steady(in_noise()), theirs = steady(in_noise(1e6));  // σ is gone after a step
    EXPECT_LT(ours.chattering, 0.25 * theirs.chattering);
    EXPECT_LT(ours.error, 1.1 * theirs.error);
}

TEST(DynamicSliding, LearningRemovesTheErrorThatTheLackingIntegralLeaves) {
    InNoise fixed = in_noise();
    fixed.law.adaptation.adaptive = false;
    EXPECT_LT(steady(in_noise()).error, 0.1 * steady(fixed).error);
}

TEST(DynamicSliding, AStepOfDelayThatNobodyStatedCostsLittle) {
    InNoise late = in_noise();
    late.delay = 1;
    EXPECT_LT(steady(late).error, 1.2 * steady(in_noise()).error);
}

}  // namespace
}  // namespace fracgyro::testing
