#include "paper.hpp"
#include "scalars.hpp"

#include "fracgyro/hardware/guard.hpp"

#include <bit>
#include <cmath>
#include <cstring>
#include <random>

namespace fracgyro::testing {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

template <Scalar T>
using Linear = SlidingModeController<T, LinearSurface>;
template <Scalar T>
using Paper = SlidingModeController<T, FractionalFastTerminalSurface>;

template <Scalar T>
Motion<T> motion(double x, double y, double vx = 0.0, double vy = 0.0) {
    return {.position = vec2<T>(x, y), .velocity = vec2<T>(vx, vy)};
}

// A guarded controller and its last status.
template <class Controller>
struct Guarded {
    using T = typename Controller::Value;
    using Safe = Guard<Controller>;
    typename Safe::Coefficients c;
    typename Safe::State state{};
    Signals<T, typename Safe::Report> signals{};

    explicit Guarded(const Tuning& p) : c(Safe::prepare(p, p)) {}
    Status step(const Motion<T>& measured) {
        signals = Safe::step(state, c, measured);
        EXPECT_EQ(number(signals.force.x()), number(state.force.x()));
        return state.status;
    }
    Estimates<T> estimates() const { return Safe::report(state, c); }
};

Tuning checked_paper() {
    Tuning p = tuning(paper(20'000));
    p.force_limit = 6000.0;
    p.guard = {.checked = true,
               .force_tolerance = 8.0,
               .position_tolerance = 1e-5,
               .velocity_tolerance = 1e-5,
               .patience = 8.0,
               .saturation_patience = 5000.0};
    return p;
}

template <class T>
class Guards : public ::testing::Test {};
TYPED_TEST_SUITE(Guards, Scalars, ScalarNames);

// -- Samples that are not finite or beyond any motion

TYPED_TEST(Guards, ForceAndEstimatesAreHeldWhileNothingIsMeasured) {
    using T = TypeParam;
    Guarded<Paper<T>> guarded(tuning(paper(1000)));
    const auto good = motion<T>(0.5, 0.25);
    EXPECT_EQ(guarded.step(motion<T>(nan, 0)), Status::not_finite);
    EXPECT_EQ(guarded.state.controller.reference.steps, 0U) << "time has not started";
    expect_equal(guarded.state.force, {0, 0});
    EXPECT_EQ(number(guarded.signals.report.stiffness.xx()), number(T(0.95 * 355.3))) << "reported all the same";
    EXPECT_EQ(guarded.step(good), Status::ok);
    const Vec2<T> force = guarded.state.force;
    const double rate = number(guarded.estimates().rate);
    EXPECT_EQ(guarded.step(motion<T>(nan, 0)), Status::not_finite);
    EXPECT_EQ(guarded.step(motion<T>(0, 0, 0, -2e6)), Status::out_of_range);
    EXPECT_EQ(guarded.step(motion<T>(-infinity, 0)), Status::not_finite);
    expect_equal(guarded.state.force - force, {0, 0});
    EXPECT_EQ(number(guarded.estimates().rate), rate);
    EXPECT_EQ(guarded.state.controller.reference.steps, 4U) << "time continues";
    EXPECT_EQ(guarded.step(good), Status::ok);
}

TYPED_TEST(Guards, InAnOutageTheErrorIsTakenToBeTheLastOne) {
    using T = TypeParam;
    Tuning p = held_at_zero(0.0);
    p.reference = {.amplitude = {1.0, 1.0}, .frequency = {1.0, 2.0}};
    p.step = 0.125;
    Guarded<Linear<T>> guarded(p);
    guarded.step(motion<T>(0.75, -0.5, 3.0, 1.0));  // r = (0, 0), dr/dt = (1, 2)
    expect_near(guarded.signals.error.value, {0.75, -0.5}, epsilon<T>);
    expect_near(guarded.signals.error.derivative, {2.0, -1.0}, 4 * epsilon<T>);
    for (int n = 0; n < 5; ++n) {
        EXPECT_EQ(guarded.step(motion<T>(nan, nan, nan, nan)), Status::not_finite);
        expect_near(guarded.signals.error.value, {0.75, -0.5}, 4 * epsilon<T>);
        expect_near(guarded.signals.error.derivative, {2.0, -1.0}, 8 * epsilon<T>);
    }
    EXPECT_LT(0.5, number(guarded.signals.reference.position.x())) << "while the reference moves on";
}

TYPED_TEST(Guards, AForceBeyondTheLimitByLessThanOneIsSaturatedToo) {
    using T = TypeParam;
    for (const double stiffness : {99.75, 100.0, 100.25}) {
        Guarded<Linear<T>> guarded(held_at_zero(stiffness));
        const Status status = guarded.step(motion<T>(1, 0));
        EXPECT_EQ(status, stiffness > 100.0 ? Status::saturated : Status::ok) << stiffness;
    }
}

// -- A memory that is lost

TYPED_TEST(Guards, AMemoryThatIsLostIsStartedAnewUnderTheLastForceAndInTime) {
    using T = TypeParam;
    for (const double limit : {100.0, infinity}) {
        Tuning p = held_at_zero(0.0);
        p.force_limit = limit;
        Guarded<Linear<T>> guarded(p);
        const auto good = motion<T>(1, 0, 1, 0);
        EXPECT_EQ(guarded.step(good), Status::ok);
        const Vec2<T> force = guarded.state.force;
        // The limit makes a finite force of it.
        guarded.state.controller.adaptation.deviation.stiffness = {T(infinity), T(0.0), T(0.0)};
        EXPECT_EQ(guarded.step(good), Status::restarted) << limit;
        expect_equal(guarded.state.force - force, {0, 0});
        EXPECT_EQ(number(guarded.estimates().stiffness.xx()), 0.0);
        EXPECT_EQ(guarded.state.controller.reference.steps, 2U);
        EXPECT_EQ(guarded.step(good), Status::ok);
        EXPECT_EQ(guarded.state.controller.reference.steps, 3U);
    }
}

TYPED_TEST(Guards, AfterARestartABadSampleIsNotHeldThroughButAnsweredWithoutAny) {
    using T = TypeParam;
    Tuning p = held_at_zero(8.0);
    p.reference = {.amplitude = {0.0, 2.0}, .phase = {0.0, 1.5707963267948966}};  // r = (0, 2)
    Guarded<Linear<T>> guarded(p);
    const auto good = motion<T>(1, 2, 1, 0);
    guarded.step(good);
    guarded.state.controller.adaptation.deviation.rate = T(infinity);
    EXPECT_EQ(guarded.step(good), Status::restarted);
    EXPECT_EQ(guarded.step(motion<T>(nan, 0)), Status::lost);
    expect_near(guarded.state.force, {0, 16}, 32 * epsilon<T>);  // K̂ r
    EXPECT_EQ(guarded.step(good), Status::ok);
}

TYPED_TEST(Guards, WhereNothingIsBelievedForLongTheMemoryOfMotionsIsDropped) {
    using T = TypeParam;
    Tuning p = held_at_zero(0.0);
    p.force_limit = infinity;
    p.adaptation.adaptive = false;
    p.surface.kernel = log_trapezoid(0.9, p.step, 1.0);
    p.guard.patience = 3.0;
    Guarded<Paper<T>> guarded(p);
    const auto good = motion<T>(0.5, -0.25);
    for (int n = 0; n < 100; ++n) {
        EXPECT_EQ(guarded.step(good), Status::ok);
    }
    for (int n = 1; n <= 3; ++n) {
        EXPECT_EQ(guarded.step(motion<T>(nan, 0)), n < 3 ? Status::not_finite : Status::lost);
    }
    EXPECT_EQ(guarded.step(good), Status::ok);
    const auto c = Paper<T>::prepare(p, p);
    typename Paper<T>::State fresh{};
    const Sample<T> on_the_reference{};
    Paper<T>::step(fresh, c, good, &on_the_reference);
    const Vec2<T> wanted = Paper<T>::step(fresh, c, good).report.surface;
    EXPECT_EQ(number(guarded.signals.report.surface.x()), number(wanted.x()));
    EXPECT_EQ(number(guarded.signals.report.surface.y()), number(wanted.y()));
}

TYPED_TEST(Guards, AfterTooManySamplesAtTheLimitEverythingLearntIsDropped) {
    using T = TypeParam;
    Tuning p = held_at_zero(1000.0);  // wanted is K̂ x = 1000 and more
    p.guard.saturation_patience = 5.0;
    Guarded<Linear<T>> guarded(p);
    for (int round = 0; round < 2; ++round) {
        for (int n = 1; n < 5; ++n) {
            EXPECT_EQ(guarded.step(motion<T>(1, 0)), Status::saturated) << n;
        }
        EXPECT_NE(number(guarded.estimates().stiffness.xx()), 1000.0);
        EXPECT_EQ(guarded.step(motion<T>(1, 0)), Status::restarted);
        EXPECT_EQ(number(guarded.state.force.x()), 100.0);
        EXPECT_EQ(number(guarded.estimates().stiffness.xx()), 1000.0);
    }
    for (int n = 0; n < 20; ++n) {  // none of them in a row
        EXPECT_EQ(guarded.step(motion<T>(n % 4 == 3 ? 0 : 1, 0)), n % 4 == 3 ? Status::ok : Status::saturated);
    }
}

// -- Samples that the plant cannot have moved to

// A plant without forces of its own and a controller with a known force: K̂ = 0, so v⁻ = v + h u.
Tuning free_mass() {
    Tuning p = held_at_zero(0.0);
    p.step = 0.125;
    p.force_limit = 1e-6;
    p.guard = {.checked = true, .plant_tolerance = 0.0};
    return p;
}

// Status of the last of these samples.
template <class Controller>
Status judged(const Tuning& p, std::initializer_list<Motion<typename Controller::Value>> samples) {
    Guarded<Controller> guarded(p);
    for (const auto& sample : samples) {
        guarded.step(sample);
    }
    return guarded.state.status;
}

TYPED_TEST(Guards, AStepMayBeOffByWhatDisturbanceSensorsAndPlantExplainAndNoMore) {
    using T = TypeParam;
    const auto takes = [](const Tuning& p, const Motion<T>& third) {
        // At rest twice, so that the second has confirmed the first.
        const Status status = judged<Linear<T>>(p, {motion<T>(0, 0), motion<T>(0, 0), third});
        EXPECT_TRUE(status == Status::saturated || status == Status::ok || status == Status::implausible);
        return status != Status::implausible;
    };
    Tuning p = free_mass();
    p.guard.force_tolerance = 2.0;  // 2 h F = 0.5 of velocity, over both axes
    EXPECT_TRUE(takes(p, motion<T>(0.4375 / 16, 0, 0.4375, 0)));
    EXPECT_FALSE(takes(p, motion<T>(0.5625 / 16, 0, 0.5625, 0)));
    EXPECT_TRUE(takes(p, motion<T>(-0.1875 / 16, 0.25 / 16, -0.1875, 0.25)));
    EXPECT_FALSE(takes(p, motion<T>(-0.3125 / 16, 0.25 / 16, -0.3125, 0.25)));
    p.guard.force_tolerance = 0.0;
    p.guard.velocity_tolerance = 0.125;  // 4 V = 0.5 of velocity, 2 h V = 1/32 of position
    EXPECT_TRUE(takes(p, motion<T>(0.4375 / 16, 0, 0.4375, 0)));
    EXPECT_FALSE(takes(p, motion<T>(0.5625 / 16, 0, 0.5625, 0)));
    EXPECT_TRUE(takes(p, motion<T>(0, 0.03, 0, 0)));
    EXPECT_FALSE(takes(p, motion<T>(0, 0.0325, 0, 0)));
    p.guard.velocity_tolerance = 0.0;
    p.guard.position_tolerance = 0.25;  // 4 Q
    p.guard.force_tolerance = 100.0;
    EXPECT_TRUE(takes(p, motion<T>(0.5, -0.4375)));
    EXPECT_FALSE(takes(p, motion<T>(0.5, -0.5625)));
    p.guard.position_tolerance = 0.0;
    p.guard.plant_tolerance = 0.25;  // a fraction of h v = 0.5; the trapezoidal rule gives 0.25
    EXPECT_TRUE(takes(p, motion<T>(0.25 + 0.1, 0, 4, 0)));
    EXPECT_FALSE(takes(p, motion<T>(0.25 + 0.15, 0, 4, 0)));
}

TYPED_TEST(Guards, DampingAndRotationMayChangeTheVelocityAndTheRuleOfTheTrapezoidIsNotExact) {
    using T = TypeParam;
    const auto takes = [](const Tuning& p, double x, double vx) {
        return judged<Linear<T>>(p, {motion<T>(0, 0, 4, 0), motion<T>(0.5, 0, 4, 0), motion<T>(x, 0, vx, 0)}) !=
               Status::implausible;
    };
    Tuning p = free_mass();
    p.guard.force_tolerance = 1e-5;  // the force is 1e-6
    EXPECT_TRUE(takes(p, 1.0, 4.0));
    EXPECT_FALSE(takes(p, 0.96875, 3.5));
    p.nominal.damping = {1, 0, 1};
    p.nominal.rate = -0.5;  // h (‖D‖ + 2 |Ω|) v = v/4: 0.875 of 3.5, 0.75 of 3
    EXPECT_TRUE(takes(p, 0.96875, 3.5));
    EXPECT_FALSE(takes(p, 0.9375, 3.0));
    p.guard.force_tolerance = 100.0;
    p.nominal.stiffness = {48, 0, 48};  // h² ‖K‖/12 = 1/16: of h v, that is of 0.5, 1/32
    EXPECT_TRUE(takes(p, 1.03, 4.0));
    EXPECT_FALSE(takes(p, 1.0325, 4.0));
}

TYPED_TEST(Guards, OfASampleThatIsMissedTheNextTwoMayBeOffByWhatThePredictionMayBeAndNoMore) {
    using T = TypeParam;
    // At the speed 4, by 0.5 a step, of which each may be off by a quarter: 0.125 more than the prediction may be.
    const auto status_after = [](const Tuning& p, std::initializer_list<Motion<T>> samples) {
        Guarded<Linear<T>> guarded(p);
        guarded.step(motion<T>(-0.5, 0, 4, 0));
        guarded.step(motion<T>(0, 0, 4, 0));
        EXPECT_EQ(guarded.step(motion<T>(nan, 0)), Status::not_finite);
        Status status = Status::ok;
        for (const auto& sample : samples) {
            EXPECT_NE(status, Status::implausible);
            status = guarded.step(sample);
        }
        return status;
    };
    Tuning p = free_mass();
    p.guard.plant_tolerance = 0.25;
    p.guard.force_tolerance = 1e-5;
    EXPECT_NE(status_after(p, {motion<T>(1.24, 0, 4, 0)}), Status::implausible);
    EXPECT_EQ(status_after(p, {motion<T>(1.26, 0, 4, 0)}), Status::implausible);
    const auto right = motion<T>(1, 0, 4, 0), right_too = motion<T>(1.5, 0, 4, 0);
    EXPECT_NE(status_after(p, {right, motion<T>(1.74, 0, 4, 0)}), Status::implausible);
    EXPECT_EQ(status_after(p, {right, right_too, motion<T>(2.24, 0, 4, 0)}), Status::implausible);
    EXPECT_NE(status_after(p, {right, right_too, motion<T>(2.12, 0, 4, 0)}), Status::implausible);
    const auto missed = motion<T>(nan, 0);  // again: the first time is forgotten
    EXPECT_NE(status_after(p, {right, right_too, missed, motion<T>(2.74, 0, 4, 0)}), Status::implausible);
    EXPECT_EQ(status_after(p, {right, right_too, missed, motion<T>(2.76, 0, 4, 0)}), Status::implausible);
}

TYPED_TEST(Guards, TheSpringsAndTheForceThatActedAreReckonedWith) {
    using T = TypeParam;
    // h/2 K (q0 + q1) = 1/16 · [[8, 4], [4, 16]] (2, 0) = (1, 0.5), less what the force adds.
    Tuning p = free_mass();
    p.adaptation.adaptive = false;
    p.nominal.stiffness = {8, 4, 16};
    const auto falls = [&](double vx, double vy) {
        Guarded<Linear<T>> guarded(p);
        guarded.step(motion<T>(1, 0));
        return guarded.step(motion<T>(1, 0, vx, vy)) != Status::lost;
    };
    p.guard.position_tolerance = 1.0 / 16;  // 1 of position is never missed by more than h/2 v < 1/4
    p.guard.velocity_tolerance = 0.0;       // 2 h ‖K‖ Q = 5/16
    EXPECT_TRUE(falls(-1, -0.5));
    EXPECT_TRUE(falls(-1.25, -0.5));
    EXPECT_TRUE(falls(-1.34375, -0.5));  // and 1/8 · τ · 20 = 0.065 of the rule of the trapezoid, τ = 20/64/12
    EXPECT_FALSE(falls(-1.25, -0.875));
    EXPECT_FALSE(falls(-0.5, -0.5));
    EXPECT_FALSE(falls(0, 0));
    p.force_limit = 8.0;  // h u = (1, 0.5): the force is what holds it there, ρ apart, which is 0
    p.surface.fractional_gain = {1e-9, 1e-9};
    EXPECT_TRUE(falls(0, 0));
    EXPECT_FALSE(falls(-1, -0.5));
}

// x, y and their rates.
using Measured = std::array<double, 4>;

// The closed loop of the paper, with samples changed by `fault(n, measured)`.
template <class Controller>
struct Watched {
    using T = typename Controller::Value;
    std::vector<Status> statuses;
    std::vector<double> errors;
    std::vector<Vec2<T>> forces;
    std::vector<Estimates<T>> estimates;
    std::vector<bool> trusted;

    int count(Status status) const { return static_cast<int>(std::count(statuses.begin(), statuses.end(), status)); }
};
template <class Controller, class Fault>
Watched<Controller> watch(const Tuning& p, int steps, Fault&& fault) {
    using T = typename Controller::Value;
    const Setup setup = paper(20'000);
    Guarded<Controller> guarded(p);
    const auto plant = Gyroscope<double>::prepare(setup.plant, p.step);
    Motion<double> at = Gyroscope<double>::start(setup.plant);
    Disturbance disturbance(setup.disturbance, p.step);
    Watched<Controller> watched;
    for (int n = 0; n < steps; ++n) {
        Vec2<double> d;
        disturbance.fill(n, {&d, 1});
        Measured m{at.position.x(), at.position.y(), at.velocity.x(), at.velocity.y()};
        fault(n, m);
        watched.statuses.push_back(guarded.step(motion<T>(m[0], m[1], m[2], m[3])));
        const Vec2<double> force{number(guarded.state.force.x()), number(guarded.state.force.y())};
        EXPECT_LE(std::abs(force.x()), p.force_limit);
        EXPECT_LE(std::abs(force.y()), p.force_limit);
        const double t = n * p.step, pi = std::numbers::pi;
        watched.errors.push_back(
            std::hypot(at.position.x() - std::sin(pi * t), at.position.y() - std::cos(0.5 * pi * t)));
        watched.forces.push_back(guarded.state.force);
        watched.estimates.push_back(guarded.signals.report);
        if constexpr (requires { guarded.signals.report.rate_trusted; }) {
            watched.trusted.push_back(number(guarded.signals.report.rate_trusted) > 0.0);
        }
        Gyroscope<double>::step(at, plant, force, d);
    }
    return watched;
}
constexpr auto no_fault = [](int, Measured&) {};

TYPED_TEST(Guards, WithoutFaultsEveryForceIsThatOfTheControllerToTheBit) {
    using T = TypeParam;
    for (const bool checked : {false, true}) {
        Tuning p = checked_paper();
        p.guard.checked = checked;
        const auto c = Paper<T>::prepare(p, p);
        typename Paper<T>::State state{};
        std::vector<Vec2<T>> wanted;
        const auto guarded = watch<Paper<T>>(p, 3000, [&](int, const Measured& m) {
            wanted.push_back(Paper<T>::step(state, c, motion<T>(m[0], m[1], m[2], m[3])).force);
        });
        EXPECT_EQ(guarded.count(Status::ok), 3000);
        for (std::size_t n = 0; n < wanted.size(); ++n) {
            ASSERT_EQ(number(guarded.forces[n].x()), number(wanted[n].x())) << n;
            ASSERT_EQ(number(guarded.forces[n].y()), number(wanted[n].y())) << n;
        }
    }
}

TYPED_TEST(Guards, OneWildSampleOfAnySizeOnAnyOfTheFourIsRefusedAndForgotten) {
    using T = TypeParam;
    const auto calm = watch<Paper<T>>(checked_paper(), 4000, no_fault);
    for (const double size : {1e-2, -0.3, 1.0, 1e3, -9e5, 3e6, 1e30}) {
        for (std::size_t place = 0; place < 4; ++place) {
            const double wild = place < 2 ? size : 20 * size;
            const auto hit =
                watch<Paper<T>>(checked_paper(), 4000, [&](int n, Measured& m) { m[place] += n == 3000 ? wild : 0.0; });
            EXPECT_EQ(hit.count(Status::ok), 3999) << size << " at " << place;
            EXPECT_EQ(hit.statuses[3000], std::abs(wild) < 1e6 ? Status::implausible : Status::out_of_range);
            EXPECT_EQ(number(hit.forces[3000].x()), number(hit.forces[2999].x())) << "held";
            EXPECT_EQ(number(hit.estimates[3001].rate), number(hit.estimates[3000].rate));
            for (std::size_t n = 3000; n < 4000; ++n) {
                ASSERT_NEAR(hit.errors[n], calm.errors[n], 1e-4) << size << " at " << place;
            }
        }
    }
}

TYPED_TEST(Guards, AfterAnOutageWithinItsPatienceTheNextSampleIsBelieved) {
    using T = TypeParam;
    const auto hit =
        watch<Paper<T>>(checked_paper(), 4000, [](int n, Measured& m) { m[0] = 3000 <= n && n < 3007 ? nan : m[0]; });
    EXPECT_EQ(hit.count(Status::not_finite), 7);
    EXPECT_EQ(hit.count(Status::ok), 3993);
    EXPECT_LT(hit.errors[3999], 5e-3);
}

// The nominal plant is off by a tenth, and so is the prediction, increasingly with every missed sample.
TYPED_TEST(Guards, AfterAnOutageTheNextSampleMayBeOffByWhatThePredictionMayBe) {
    using T = TypeParam;
    Tuning p = checked_paper();
    p.nominal.stiffness = (0.9 / 0.95) * p.nominal.stiffness;
    p.guard.plant_tolerance = 0.125;
    p.guard.force_tolerance = 4.0;
    for (const int missed : {1, 3, 7}) {
        int refused = 0;
        for (int begin = 3000; begin < 7000; begin += 250) {
            const auto hit = watch<Paper<T>>(
                p, begin + 40, [&](int n, Measured& m) { m[0] = begin <= n && n < begin + missed ? nan : m[0]; });
            refused += hit.count(Status::implausible) + hit.count(Status::lost);
        }
        EXPECT_EQ(refused, 0) << missed;
    }
}

TYPED_TEST(Guards, WhereSensorsFailForLongItLetsGoAndBelievesThemOnceFourTimesItsPatienceAgree) {
    using T = TypeParam;
    const auto stuck = [](int n, Measured& m) {
        static Measured last;
        last = n < 3000 ? m : last;
        m = n < 3500 ? last : m;
    };
    const auto hit = watch<Paper<T>>(checked_paper(), 8000, stuck);
    for (int n = 3000; n < 3531; ++n) {  // 32 agree, the first of them at 3500
        EXPECT_EQ(hit.statuses[static_cast<std::size_t>(n)], n < 3007 ? Status::implausible : Status::lost) << n;
    }
    EXPECT_EQ(hit.count(Status::ok), 8000 - 531);
    EXPECT_EQ(number(hit.estimates[3400].rate), number(hit.estimates[3002].rate)) << "kept meanwhile";
    EXPECT_LT(*std::max_element(hit.errors.begin() + 3000, hit.errors.end()), 0.2);
    EXPECT_LT(*std::max_element(hit.errors.begin() + 5000, hit.errors.end()), 5e-3);
}

TYPED_TEST(Guards, WithoutAnyPatienceTheForceIsHeldForGood) {
    using T = TypeParam;
    Tuning p = checked_paper();
    p.guard.patience = 0.0;
    const auto hit = watch<Paper<T>>(p, 2000, [](int n, Measured& m) { m[0] = n < 1000 ? m[0] : nan; });
    EXPECT_EQ(hit.count(Status::not_finite), 1000);
    EXPECT_EQ(number(hit.forces[1999].x()), number(hit.forces[999].x()));
}

TYPED_TEST(Guards, ASecondSampleThatContradictsTheFirstIsNoMoreBelievedThanThat) {
    using T = TypeParam;
    const auto hit = watch<Paper<T>>(checked_paper(), 12'000, [](int n, Measured& m) { m[0] += n == 0 ? 7 : 0; });
    EXPECT_EQ(hit.statuses[1], Status::lost);
    EXPECT_EQ(hit.count(Status::lost), 31) << "the 32nd that agrees is accepted";
    EXPECT_EQ(hit.count(Status::ok) + hit.count(Status::saturated), 12'000 - 31);
    EXPECT_LT(hit.errors[11'999], 5e-3);
}

TYPED_TEST(Guards, WhateverIsMeasuredTheForceIsFiniteAndWithinTheLimit) {
    using T = TypeParam;
    std::mt19937_64 random(7);
    for (const bool checked : {false, true}) {
        Tuning p = checked_paper();
        p.guard.checked = checked;
        p.guard.patience = 3.0;
        p.guard.saturation_patience = 9.0;
        watch<SlidingModeController<T, FractionalFastTerminalSurface, CompositeAdaptation>>(
            p, 5000, [&](int, Measured& m) {
                for (double& number : m) {
                    const std::uint64_t bits = random();
                    number = bits % 3 == 0 ? std::bit_cast<double>(random()) : bits % 3 == 1 ? number + 1.0 : number;
                }
            });  // which expects the fault
    }
}

// -- From positions only

TYPED_TEST(Guards, APositionMayBeOffByEightErrorsOfItsSensorAgainstThreeBefore) {
    using T = TypeParam;
    Tuning p = free_mass();
    p.observer_bandwidth = 1.0;
    p.guard.position_tolerance = 0.0625;
    const auto rest = motion<T>(0, 0);
    for (const double off : {0.49, 0.51}) {
        EXPECT_EQ(judged<Observing<Linear<T>>>(p, {rest, rest, rest, motion<T>(off, 0)}) == Status::implausible,
                  off > 0.5);
    }
}

TYPED_TEST(Guards, FromPositionsAloneTheSecondDifferenceIsHeldAgainstTheForce) {
    using T = TypeParam;
    Tuning p = checked_paper();
    p.observer_bandwidth = 300.0;
    const auto calm = watch<Observing<Paper<T>>>(p, 6000, no_fault);
    EXPECT_EQ(calm.count(Status::ok), 6000);
    for (const double size : {1e-3, -0.1, 1.0, 9e5}) {
        const auto hit = watch<Observing<Paper<T>>>(p, 6000, [&](int n, Measured& m) {
            m[1] += n == 3000 ? size : 0.0;
            m[2] = nan, m[3] = 1e30;
        });
        EXPECT_EQ(hit.statuses[3000], Status::implausible) << size;
        EXPECT_EQ(hit.count(Status::ok), 5999) << size;
        for (std::size_t n = 3000; n < 4000; ++n) {
            ASSERT_NEAR(hit.errors[n], calm.errors[n], 2e-3) << size;
        }
    }
    const auto gap =
        watch<Observing<Paper<T>>>(p, 6000, [&](int n, Measured& m) { m[1] = 3000 <= n && n < 3005 ? nan : m[1]; });
    EXPECT_EQ(gap.count(Status::ok), 5995);
    const auto lost =
        watch<Observing<Paper<T>>>(p, 8000, [&](int n, Measured& m) { m[1] = 3000 <= n && n < 3100 ? nan : m[1]; });
    EXPECT_EQ(lost.count(Status::lost), 100 - 7 + 31);
    EXPECT_LT(lost.errors[7999], 5e-3);
}

// -- With least squares

TYPED_TEST(Guards, AStepWithAMissedSampleIsNotLearntFromAndNotTrusted) {
    using T = TypeParam;
    using Controller = SlidingModeController<T, LinearSurface, CompositeAdaptation>;
    Tuning p;
    p.adaptation.initial_bound = {0.0, 0.0, 0.0};
    p.nominal.stiffness = {1, 0, 1};
    Guarded<Controller> guarded(p);
    const auto learnt = [&] { return guarded.state.controller.adaptation.squares; };
    const auto same = [&](const auto& before) {
        const auto now = learnt();
        return std::memcmp(&before, &now, sizeof now) == 0;
    };
    const auto at = [](double x) { return motion<T>(x, 0, 1, 1); };
    guarded.step(at(0.5));
    auto before = learnt();
    guarded.step(at(0.501));
    EXPECT_FALSE(same(before));
    before = learnt();
    EXPECT_EQ(guarded.step(at(nan)), Status::not_finite);
    EXPECT_TRUE(same(before));
    guarded.step(at(0.503));  // the step before it was missed
    EXPECT_TRUE(same(before));
    guarded.step(at(0.504));
    EXPECT_FALSE(same(before));
}

TYPED_TEST(Guards, WhileNothingIsBelievedTheRateIsNotTrustedAndKept) {
    using T = TypeParam;
    using Controller = SlidingModeController<T, FractionalFastTerminalSurface, CompositeAdaptation>;
    const auto hit =
        watch<Controller>(checked_paper(), 4000, [](int n, Measured& m) { m[3] = 3000 <= n && n < 3100 ? nan : m[3]; });
    EXPECT_TRUE(hit.trusted[3000]);
    for (std::size_t n = 3001; n < 3132; ++n) {
        EXPECT_FALSE(hit.trusted[n]) << n;
        ASSERT_EQ(number(hit.estimates[n].rate), number(hit.estimates[3000].rate)) << n;
    }
    EXPECT_TRUE(hit.trusted[3140]);
    EXPECT_NEAR(number(hit.estimates[3999].rate), 0.1, 0.02);
}

}  // namespace
}  // namespace fracgyro::testing
