// The event trigger: its rule, and a controller behind it.
#include "follow.hpp"
#include "scalars.hpp"

#include "fracgyro/controllers/conventional.hpp"
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
static_assert(std::is_same_v<ForDevice<Pid<double>, false, false, false, false>::Type, Pid<double>>);
static_assert(std::is_same_v<ForDevice<Pid<double>, false, false, true, false>::Type, Triggered<Pid<double>>>);
static_assert(
    std::is_same_v<ForDevice<Pid<double>, true, false, true, false>::Type, Observing<Triggered<Pid<double>>>>);
static_assert(
    std::is_same_v<ForDevice<Pid<double>, true, true, true, false>::Type, Filtered<Triggered<Pid<double>>, false>>);
static_assert(std::is_same_v<ForDevice<Joint, true, false, true, false>::Type, Triggered<FromPositions<Joint>::Type>>);
static_assert(!measures_velocity<Triggered<OpenLoop<double>>> && Resumable<Triggered<OpenLoop<double>>>);

template <class T>
class TriggerOf : public ::testing::Test {
protected:
    typename Trigger<T>::State state{};

    Vec2<T> sent(const TriggerParams& p, double x, double y = 0.0) {
        return Trigger<T>::sent(state, Trigger<T>::prepare({.trigger = p}), vec2<T>(x, y));
    }
};
TYPED_TEST_SUITE(TriggerOf, Scalars, ScalarNames);

TYPED_TEST(TriggerOf, SendsWhatDiffersByTheThresholdOnAnAxis) {
    const TriggerParams p{.threshold = 2.0};
    expect_equal(this->sent(p, 1.5, -1.5), {0, 0});
    expect_equal(this->sent(p, 2.0, 1.0), {2, 1});
    expect_equal(this->sent(p, 3.5, -0.5), {2, 1});
    expect_equal(this->sent(p, 3.5, -1.0), {3.5, -1});
    expect_equal(this->sent(p, -3.5, -1.0), {-3.5, -1});
}

TYPED_TEST(TriggerOf, AllowsAShareOfTheForceThatActs) {
    const TriggerParams p{.threshold = 1.0, .share = 0.25};
    expect_equal(this->sent(p, 8.0, -4.0), {8, -4});
    expect_equal(this->sent(p, 10.5, -5.5), {8, -4});
    expect_equal(this->sent(p, 8.0, -6.0), {8, -6});
    expect_equal(this->sent(p, 5.0, -6.0), {5, -6});
}

TYPED_TEST(TriggerOf, SendsWhatIsNotANumber) {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(std::isnan(number(this->sent({.threshold = 2.0}, nan).x())));
    expect_equal(this->sent({.threshold = 2.0}, 0.5), {0.5, 0});
}

template <class C>
using Case = CaseOf<typename C::Params>;

template <class C>
Case<C> case_with(double threshold, double share) {
    Case<C> a = Case<C>::in_noise();
    a.common.force_limit = 1000.0;
    a.common.observer_bandwidth = 300.0;
    a.common.trigger = {.threshold = threshold, .share = share};
    return a;
}

template <class C>
void expect_its_controller() {
    const auto a = case_with<C>(0.0, 0.0);
    Loop<C> plain(a);
    Loop<Triggered<C>> triggered(a);
    for (int n = 0; n < 200; ++n) {
        const bool missing = n % 13 == 5;
        plain.step({}, missing);
        triggered.step({}, missing);
        ASSERT_EQ(number(plain.signals.force.x()), number(triggered.signals.force.x())) << n;
        ASSERT_EQ(number(plain.signals.force.y()), number(triggered.signals.force.y())) << n;
    }
}
TEST(Triggered, WithoutThresholdItIsItsControllerBitForBit) {
    expect_its_controller<Pid<double>>();
    expect_its_controller<SlidingModeController<double, LinearSurface>>();
    expect_its_controller<Joint>();
    expect_its_controller<OpenLoop<double>>();
}

TEST(Triggered, WhatActsIsWithinTheThresholdOfTheLaw) {
    using C = Pid<double>;
    const auto a = case_with<C>(20.0, 0.1);
    Loop<Triggered<C>> loop(a);
    int sends = 0;
    Vec2<double> before{};
    for (int n = 0; n < 5000; ++n) {
        const auto start = loop.state.controller;
        loop.step();
        auto own = start;
        const Vec2<double> wanted = C::step(own, loop.c.controller, loop.measured).force;
        const Vec2<double> sent = loop.signals.force;
        ASSERT_LE(std::fabs(wanted.x() - sent.x()), 20.0 + 0.1 * std::fabs(sent.x())) << n;
        ASSERT_LE(std::fabs(wanted.y() - sent.y()), 20.0 + 0.1 * std::fabs(sent.y())) << n;
        sends += squared_norm(sent - before) > 0.0;
        before = sent;
    }
    EXPECT_GT(sends, 50);
    EXPECT_LT(sends, 2500);
}

TEST(Triggered, TheObserverKnowsWhatWasSent) {
    using C = Observing<Triggered<Pid<double>>>;
    Loop<C> loop(case_with<Pid<double>>(50.0, 0.0));
    for (int n = 0; n < 300; ++n) {
        loop.step();
        ASSERT_EQ(loop.state.force.x(), loop.state.controller.part.sent.x());
    }
}

TEST(Triggered, AFilterOfTheLawKnowsWhatWasSent) {
    using C = Triggered<Joint>;
    Loop<C> loop(case_with<Joint>(50.0, 0.0));
    for (int n = 0; n < 300; ++n) {
        loop.step();
        ASSERT_EQ(loop.state.controller.adaptation.force.x(), loop.state.part.sent.x());
    }
}

TEST(Triggered, AGuardedOneRecoversFromBadSamples) {
    using C = Guard<Triggered<Pid<double>>>;
    auto a = case_with<Pid<double>>(50.0, 0.0);
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

// The controller of a known type and the one behind a table of functions, also with a filter around, and restored.
template <class T, bool positions_only, bool filtered>
void expect_erased() {
    auto a = case_with<Pid<double>>(10.0, 0.02);
    a.common.observer_bandwidth = positions_only ? 300.0 : 0.0;
    a.common.filter.bandwidth = filtered ? 40.0 : 0.0;
    a.common.filter.assumed = {.force_noise = 1.0, .position_noise = noise, .velocity_noise = noise};
    using C = typename ForDevice<Pid<T>, positions_only && filtered, filtered, true, false>::Type;
    const auto c = C::prepare(a.law, a.common);
    typename C::State state{};
    const auto make = [&] {
        auto plain = std::make_unique<ControllerOf<Pid<T>>>(ControllerParams{a.law}, a.common);
        AnyController<T>& pid = *plain;
        return behind_wrappers<T>(pid, a.common, std::move(plain));
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
        const auto known = C::step(state, c, motion), found = erased->step(motion, nullptr);
        ASSERT_EQ(number(known.force.x()), number(found.force.x())) << n;
        ASSERT_EQ(number(known.force.y()), number(found.force.y())) << n;
    }
}
TEST(Triggered, TheErasedControllerHasTheSameBits) {
    expect_erased<double, false, false>();
    expect_erased<double, false, true>();
    expect_erased<double, true, true>();
    expect_erased<float, false, true>();
}

}  // namespace
}  // namespace fracgyro::testing
