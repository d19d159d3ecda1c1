// The disturbance observer around a controller: its poles, what acts, and all ways in which it is composed.
#include "follow.hpp"
#include "scalars.hpp"

#include "fracgyro/controllers/conventional.hpp"
#include "fracgyro/controllers/integral_sliding.hpp"
#include "fracgyro/controllers/lqg.hpp"
#include "fracgyro/controllers/pid.hpp"
#include "fracgyro/controllers/sliding_mode.hpp"
#include "fracgyro/hardware/guard.hpp"
#include "fracgyro/sim/any_controller.hpp"

#include <cmath>
#include <limits>
#include <vector>

namespace fracgyro::testing {
namespace {

using Joint = SlidingModeController<double, LinearSurface, JointAdaptation>;
using KnownJoint = FromPositions<Joint>::Type;
using KnownLqg = FromPositions<Lqg<double>>::Type;
template <class C, bool positions, bool filtered, bool triggered>
using Known = ForDevice<C, positions, filtered, triggered, false, true>::Type;
using Plain = Pid<double>;
static_assert(std::is_same_v<Known<Plain, false, false, false>, Compensated<Plain>>);
static_assert(std::is_same_v<Known<Plain, true, false, false>, Observing<Compensated<Plain>>>);
static_assert(std::is_same_v<Known<Plain, true, true, false>, Filtered<Compensated<Plain>, false>>);
static_assert(std::is_same_v<Known<Plain, true, false, true>, Observing<Triggered<Compensated<Plain>>>>);
static_assert(std::is_same_v<Known<Joint, true, false, true>, Observing<Triggered<Compensated<KnownJoint>>>>);
static_assert(std::is_same_v<Known<KnownJoint, true, true, false>, Observing<Compensated<KnownJoint>>>);
static_assert(measures_velocity<Compensated<OpenLoop<double>>> && !takes_filter<Compensated<OpenLoop<double>>>);

template <class C>
CaseOf<typename C::Params> case_with(double bandwidth) {
    auto a = CaseOf<typename C::Params>::in_noise();
    a.common.force_limit = 1000.0;
    a.common.observer_bandwidth = 300.0;
    a.common.compensation_bandwidth = bandwidth;
    return a;
}

template <class C>
void expect_its_controller() {
    const auto a = case_with<C>(0.0);
    Loop<C> plain(a);
    Loop<Compensated<C>> compensated(a);
    for (int n = 0; n < 200; ++n) {
        const bool missing = n % 13 == 5;
        plain.step({}, missing);
        compensated.step({}, missing);
        ASSERT_EQ(number(plain.signals.force.x()), number(compensated.signals.force.x())) << n;
        ASSERT_EQ(number(plain.signals.force.y()), number(compensated.signals.force.y())) << n;
    }
}
TEST(Compensated, WithoutBandwidthItIsItsControllerBitForBit) {
    expect_its_controller<Pid<double>>();
    expect_its_controller<SlidingModeController<double, LinearSurface>>();
    expect_its_controller<Joint>();
}

// The nominal plant under a force that it lacks; the controller gives none.
template <class T>
class CompensationOf : public ::testing::Test {
protected:
    Common common{.step = 1e-3,
                  .nominal = {.damping = {0.1, 0.02, 0.2}, .stiffness = {300.0, 20.0, 500.0}, .rate = 0.1},
                  .compensation_bandwidth = 50.0};
    typename Compensation<T>::State state{};
    Motion<double> motion{.position = {0.3, -0.2}, .velocity = {1.0, 2.0}};

    // One step under the force of the part, and `lacking`; returns that force.
    Vec2<double> step(const Vec2<double>& lacking, bool missing = false) {
        const auto c = Compensation<T>::prepare(common);
        const Motion<T> measured{.position = cast<T>(motion.position), .velocity = cast<T>(motion.velocity)};
        const auto signals = Compensation<T>::step(state, c, measured, missing,
                                                   [](const Motion<T>&) { return Signals<T, EmptyReport>{}; });
        const Vec2<double> force{number(signals.force.x()), number(signals.force.y())};
        const PlantModel<double>& p = common.nominal;
        static const auto plant =
            Gyroscope<double>::prepare({.damping = p.damping, .stiffness = p.stiffness, .rate = p.rate}, common.step);
        Gyroscope<double>::step(motion, plant, force, lacking);
        return force;
    }
};
TYPED_TEST_SUITE(CompensationOf, Scalars, ScalarNames);

TYPED_TEST(CompensationOf, ALackingForceIsFoundWithItsTimeConstant) {
    const Vec2<double> lacking{3.0, -4.0};
    for (int n = 0; n < 200; ++n) {
        const Vec2<double> force = this->step(lacking);
        const double left = std::exp(-50.0 * 1e-3 * n);
        ASSERT_NEAR(force.x(), -3.0 * (1.0 - left), 2e-3) << n;
        ASSERT_NEAR(force.y(), 4.0 * (1.0 - left), 2e-3) << n;
    }
}

TYPED_TEST(CompensationOf, AtTheForceLimitItStillFindsTheForce) {
    this->common.force_limit = 1.0;
    for (int n = 0; n < 400; ++n) {
        ASSERT_LE(std::fabs(this->step({3.0, 0.5}).x()), 1.0);
    }
    EXPECT_NEAR(number(this->state.observer.force.x()), 3.0, 2e-2);
    EXPECT_NEAR(this->step({3.0, 0.5}).y(), -0.5, 2e-2);
}

TYPED_TEST(CompensationOf, WithoutSamplesItKeepsWhatItFound) {
    for (int n = 0; n < 200; ++n) {
        this->step({3.0, 0.5});
    }
    const double found = number(this->state.observer.force.x());
    for (int n = 0; n < 50; ++n) {
        this->step({-5.0, 0.5}, true);
        ASSERT_EQ(number(this->state.observer.force.x()), found);
    }
    this->step({3.0, 0.5});  // the prediction starts over
    EXPECT_EQ(number(this->state.observer.force.x()), found);
}

TYPED_TEST(CompensationOf, StartedOverItHasNoPredictionAndForgetsOnRequest) {
    for (const bool keep : {true, false}) {
        for (int n = 0; n < 200; ++n) {
            this->step({3.0, 0.5});
        }
        const double found = number(this->state.observer.force.x());
        Compensation<TypeParam>::start_over(this->state, keep);
        EXPECT_EQ(number(this->state.observer.force.x()), keep ? found : 0.0);
        this->motion.velocity = {50.0, -70.0};  // not of the plant
        this->step({3.0, 0.5});
        EXPECT_EQ(number(this->state.observer.force.x()), keep ? found : 0.0);
    }
}

TYPED_TEST(CompensationOf, AForceThatActsInsteadIsNotTakenForADisturbance) {
    const auto c = Compensation<TypeParam>::prepare(this->common);
    const auto plant = Gyroscope<double>::prepare({.damping = this->common.nominal.damping,
                                                   .stiffness = this->common.nominal.stiffness,
                                                   .rate = this->common.nominal.rate},
                                                  this->common.step);
    for (int n = 0; n < 100; ++n) {
        const Motion<TypeParam> measured{.position = cast<TypeParam>(this->motion.position),
                                         .velocity = cast<TypeParam>(this->motion.velocity)};
        Compensation<TypeParam>::step(this->state, c, measured, false,
                                      [](const Motion<TypeParam>&) { return Signals<TypeParam, EmptyReport>{}; });
        Compensation<TypeParam>::acted(this->state, c, vec2<TypeParam>(7.0, -2.0));
        Gyroscope<double>::step(this->motion, plant, {7.0, -2.0});
    }
    EXPECT_NEAR(number(this->state.observer.force.x()), 0.0, 2e-3);
    EXPECT_NEAR(number(this->state.observer.force.y()), 0.0, 2e-3);
}

// It is the observer that integral_sliding has inside, but for the point of the reference at which each is exact.
TEST(Compensated, AroundALinearSurfaceItIsItsOwnObserver) {
    using C = IntegralSliding<double>;
    auto inside = case_with<C>(0.0), around = case_with<C>(100.0);
    inside.law.observer_frequency = 100.0;
    around.law.observer_frequency = 0.0;
    Loop<C> one(inside);
    Loop<Compensated<C>> other(around);
    double largest = 0.0, differs = 0.0;
    for (int n = 0; n < 3000; ++n) {
        one.step({});
        other.step({});
        if (n > 500) {
            largest = std::max(largest, std::fabs(one.signals.error.value.x()));
            differs = std::max(differs, std::fabs(one.signals.error.value.x() - other.signals.error.value.x()));
        }
    }
    EXPECT_LT(differs, 0.02 * largest);
}

TEST(Compensated, ALawsFilterKnowsTheForceThatActs) {
    using C = Compensated<Joint>;
    Loop<C> loop(case_with<Joint>(50.0));
    for (int n = 0; n < 300; ++n) {
        loop.step();
        ASSERT_EQ(loop.state.controller.adaptation.force.x(), loop.state.part.sent.x());
        ASSERT_EQ(loop.signals.force.x(), loop.state.part.sent.x());
    }
}

TEST(Compensated, BehindATriggerItKnowsWhatWasSent) {
    using C = Triggered<Compensated<Plain>>;
    auto a = case_with<Plain>(50.0);
    a.common.trigger.threshold = 20.0;
    Loop<C> loop(a);
    for (int n = 0; n < 300; ++n) {
        loop.step();
        ASSERT_EQ(loop.state.controller.part.sent.x(), loop.state.part.sent.x());
    }
}

TEST(Compensated, AGuardedOneRecoversFromBadSamples) {
    using C = Guard<Compensated<Plain>>;
    auto a = case_with<Plain>(50.0);
    a.common.guard.patience = 20;
    const auto c = C::prepare(a.law, a.common);
    C::State state{};
    const double nan = std::numeric_limits<double>::quiet_NaN();
    for (int n = 0; n < 600; ++n) {
        const double t = h * n, bad = n % 100 >= 50 ? nan : 0.0;
        const auto signals = C::step(
            state, c,
            {.position = {std::sin(pi * t) + bad, std::cos(0.5 * pi * t)}, .velocity = {pi * std::cos(pi * t), 0.0}});
        ASSERT_TRUE(std::isfinite(signals.force.x()) && std::isfinite(signals.force.y())) << n;
    }
    EXPECT_EQ(state.status, Status::lost);
}

// The controller of a known type and the one behind a table of functions, also with filter and trigger, and restored.
template <class C, bool filtered, bool triggered>
void expect_erased() {
    using T = C::Value;
    auto a = case_with<C>(60.0);
    a.common.observer_bandwidth = 0.0;
    a.common.trigger.threshold = triggered ? 10.0 : 0.0;
    a.common.filter.bandwidth = filtered ? 40.0 : 0.0;
    a.common.filter.assumed = {.force_noise = 1.0, .position_noise = noise, .velocity_noise = noise};
    using Whole = Known<C, false, filtered, triggered>;
    const auto c = Whole::prepare(a.law, a.common);
    typename Whole::State state{};
    const auto make = [&] {
        auto plain = std::make_unique<ControllerOf<C>>(ControllerParams{a.law}, a.common);
        AnyController<T>& inner = *plain;
        return behind_wrappers<T>(inner, a.common, std::move(plain));
    };
    auto erased = make();
    for (int n = 0; n < 200; ++n) {
        if (n == 100) {
            std::vector<unsigned char> bytes(erased->state_size());
            erased->save(bytes.data());
            EXPECT_EQ(erased->steps_of(bytes.data()), 100U);
            erased = make();
            EXPECT_TRUE(erased->restore(bytes.data(), 100));
        }
        const double x = std::sin(0.01 * n), y = std::cos(0.01 * n);
        const Motion<T> motion{.position = {T(x), T(y)}, .velocity = {T(10.0 * y), T(-10.0 * x)}};
        const auto known = Whole::step(state, c, motion), found = erased->step(motion, nullptr);
        ASSERT_EQ(number(known.force.x()), number(found.force.x())) << n;
        ASSERT_EQ(number(known.force.y()), number(found.force.y())) << n;
    }
}
TEST(Compensated, TheErasedControllerHasTheSameBits) {
    expect_erased<Pid<double>, false, false>();
    expect_erased<Pid<double>, true, false>();
    expect_erased<Pid<double>, true, true>();
    expect_erased<Pid<float>, false, true>();
    expect_erased<Lqg<double>, false, false>();
    expect_erased<Lqg<double>, false, true>();
}

TEST(Compensated, TheErasedControllerNeedsTheVelocity) {
    auto a = case_with<KnownLqg>(0.0);
    const auto needs = [&] {
        ControllerOf<KnownLqg> plain(ControllerParams{a.law}, a.common);
        const auto around = behind_wrappers<double>(plain, a.common);
        return around == nullptr ? plain.needs_velocity() : around->needs_velocity();
    };
    EXPECT_FALSE(needs());
    a.common.trigger.threshold = 1.0;
    EXPECT_FALSE(needs());
    a.common.compensation_bandwidth = 60.0;
    EXPECT_TRUE(needs());
}

}  // namespace
}  // namespace fracgyro::testing
