// Requirements of a controller, and that they suffice: an unregistered controller works everywhere.
#include "paper.hpp"
#include "scalars.hpp"

#include "fracgyro/sim/lane_setup.hpp"
#include "fracgyro/hardware/guard.hpp"
#include "fracgyro/sim/stepper.hpp"

#include <bit>
#include <cmath>
#include <random>
#include <vector>

namespace fracgyro::testing {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

// -- The registry's

template <class... Controllers>
consteval bool fit(List<Controllers...>) {
    return (Resumable<Controllers> && ...);
}
template <class... Controllers>
consteval bool fit_on_hardware(List<Controllers...>) {
    return (Resumable<typename FromPositions<Controllers>::Type> && ...) && (Controller<Guard<Controllers>> && ...) &&
           (Controller<Guard<typename FromPositions<Controllers>::Type>> && ...) &&
           // One that measures no velocity stays as it is.
           ((measures_velocity<Guard<Controllers>> == measures_velocity<Controllers> &&
             std::is_same_v<Controllers, typename FromPositions<Controllers>::Type> != measures_velocity<Controllers> &&
             !measures_velocity<Guard<typename FromPositions<Controllers>::Type>>) &&
            ...);
}
template <class... Entries>
consteval bool all_fit(std::tuple<Entries...>*) {
    const auto one = []<class Family>(Family) {
        return fit(typename Family::template Types<double>{}) && fit(typename Family::template Types<float>{}) &&
               fit(typename Family::template Types<Explicit>{}) &&
               fit(typename Family::template Types<Lanes<double, 2>>{}) &&
               fit(typename Family::template Types<Lanes<float, 4>>{}) &&
               fit_on_hardware(typename Family::template Types<double>{}) &&
               fit_on_hardware(typename Family::template Types<float>{});
    };
    return (one(typename Entries::Type{}) && ...);
}
static_assert(all_fit(static_cast<Registry*>(nullptr)));
constexpr std::size_t linear = [] {
    std::size_t kind = 0;
    while (controller_kinds[kind] != "linear") {
        ++kind;
    }
    return kind;
}();
static_assert(std::is_same_v<RegisteredController<double, linear, 1>,
                             SlidingModeController<double, LinearSurface, CompositeAdaptation>>);
static_assert(std::is_same_v<FromPositions<RegisteredController<double, linear, 2>>::Type,
                             SlidingModeController<double, LinearSurface, JointFromPositions>>);
static_assert(std::is_same_v<FromPositions<RegisteredController<double, linear, 1>>::Type,
                             Observing<RegisteredController<double, linear, 1>>>);

TEST(Registry, EveryKindPreparesTheControllerOfItsParameters) {
    for (std::size_t kind = 0; kind < controller_kinds.size(); ++kind) {
        const ControllerParams params = params_of_kind(kind);
        EXPECT_EQ(params.index(), kind);
        int visited = 0;
        for (const bool observed : {false, true}) {
            with_controller<double>(params, observed, [&]<class C>() {
                ++visited;
                EXPECT_FALSE(observed && measures_velocity<C>);
                const auto c = prepare<C>(params, Common{});
                typename C::State state{};
                EXPECT_TRUE(C::sound(state, c));
                EXPECT_EQ(number(C::step(state, c, {}).error.value.x()), 0.0);
                EXPECT_EQ(C::steps(state), 1U);
            });
        }
        EXPECT_EQ(visited, 2) << controller_kinds[kind];
    }
}

TEST(Registry, WhatAControllerIsGivenUnlessAskedOtherwiseIsAllowed) {
    for (std::size_t kind = 0; kind < controller_kinds.size(); ++kind) {
        const ControllerParams chosen = params_of_kind(kind);
        with_params(chosen, [&](const auto& params, auto) {
            for_each_field("controller", params, [&](std::string_view, const auto& field, const auto& value) {
                for_each_part(value, [&](std::string_view, const auto& part) {
                    const auto found = static_cast<double>(part);
                    const Range& r = field.range;
                    const bool inside = r.strict ? r.low < found && found < r.high : r.low <= found && found <= r.high;
                    EXPECT_TRUE(inside || (r.infinite && std::isinf(found)) || !field.choices.empty())
                        << controller_kinds[kind] << " " << field.name << " " << found;
                });
            });
        });
    }
}

TEST(Registry, OfEveryKindTheGuardedForceIsFiniteAndWithinTheLimitWhateverIsMeasured) {
    std::mt19937_64 random(7);
    const auto expect = [&](fracgyro::Setup setup, std::string_view kind) {
        setup.common.force_limit = 6000.0;
        setup.common.observer_bandwidth = 300.0;
        setup.common.guard = {.patience = 3.0, .saturation_patience = 9.0};
        const auto watch = [&]<class C>() {
            using Safe = Guard<C>;
            using T = typename C::Value;
            const auto c = prepare<Safe>(setup.controller, setup.common);
            typename Safe::State state{};
            int accepted = 0;
            for (int n = 0; n < 3000; ++n) {
                std::array<double, 4> seen{std::sin(1e-3 * n), 0.5, 1e-3, 0.0};
                for (double& one : seen) {
                    const std::uint64_t bits = random();
                    one = bits % 9 == 0 ? std::bit_cast<double>(random()) : one;
                }
                Safe::step(state, c, {.position = vec2<T>(seen[0], seen[1]), .velocity = vec2<T>(seen[2], seen[3])});
                ASSERT_LE(std::abs(number(state.force.x())), 6000.0) << kind << ' ' << n;
                ASSERT_LE(std::abs(number(state.force.y())), 6000.0) << kind << ' ' << n;
                ASSERT_TRUE(Safe::sound(state, c)) << kind << ' ' << n;
                accepted += state.status <= Status::saturated ? 1 : 0;
            }
            EXPECT_GT(accepted, 1500) << kind;
        };
        for (const bool observed : {false, true}) {
            with_controller<double>(setup.controller, observed, watch);
            with_controller<float>(setup.controller, observed, watch);
        }
    };
    for (const std::string_view kind : controller_kinds) {
        expect(paper(3000, kind), kind);
    }
    for (const AdaptationKind adaptation : {AdaptationKind::composite, AdaptationKind::joint}) {
        fracgyro::Setup setup = paper(3000, "linear");
        law(setup).adaptation.kind = adaptation;
        expect(setup, AdaptationParams::kinds[static_cast<std::size_t>(adaptation)]);
    }
}

// -- One of a page, of proportional and derivative action

template <Scalar T>
struct Pd {
    using Value = T;
    struct Params {
        double stiffness = 1.0, damping = 1.5;

        static constexpr auto fields() {
            return Fields{field("pd_stiffness", &Params::stiffness, "1", above_0, "Of the error."),
                          field("pd_damping", &Params::damping, "1", above_0, "Of its rate.")};
        }
    };
    struct Report {
        static constexpr auto fields() { return Fields{}; }
    };
    struct Coefficients {
        typename Reference<T>::Coefficients reference{};
        T stiffness{}, damping{};
    };
    struct State {
        typename Reference<T>::State reference{};
    };
    static Coefficients prepare(const Params& p, const Common& common) {
        return {Reference<T>::prepare(common.reference, common.step), T(p.stiffness), T(p.damping)};
    }
    static Report report(const State&, const Coefficients&) { return {}; }
    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured) {
        Signals<T, Report> signals{.reference = Reference<T>::update(state.reference, c.reference)};
        signals.error = tracking_error(measured, signals.reference);
        signals.force = -(c.stiffness * signals.error.value + c.damping * signals.error.derivative);
        return signals;
    }
};

// The same controller, which can also handle a missing sample.
template <Scalar T>
struct PatientPd : Pd<T> {
    using Plain = Pd<T>;
    using typename Plain::Coefficients, typename Plain::State, typename Plain::Report;

    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        auto signals = Plain::step(state, c, measured);
        if (missing != nullptr) {
            signals.error = *missing;
            signals.force = -(c.stiffness * missing->value + c.damping * missing->derivative);
        }
        return signals;
    }
    static void start_over(State&, bool) {}
    static std::uint64_t steps(const State& state) { return state.reference.steps; }
    static bool sound(const State&, const Coefficients&) { return true; }
};

static_assert(Controller<Pd<double>> && !Resumable<Pd<double>> && !SensesRate<Pd<double>>);
static_assert(Resumable<PatientPd<double>> && measures_velocity<PatientPd<double>>);
static_assert(!measures_velocity<Guard<Observing<PatientPd<double>>>>);

// A mass of 1 without springs, a step of 1, r = 0. With stiffness 1 and damping 3/2 it is at rest after two steps, from
// anywhere: (4, 0) under -4 goes to 4 - 4/2 = 2 with velocity -4; under -(2 - 6) = 4 to 2 - 4 + 4/2 = 0 with velocity
// 0.
template <Scalar T>
SetupOf<typename Pd<T>::Params> free_mass() {
    SetupOf<typename Pd<T>::Params> setup;
    setup.common.step = 1.0;
    setup.plant.initial_position = {4.0, 8.0};
    setup.steps = 3;
    return setup;
}
constexpr std::array<double, 4> positions{4.0, 2.0, 0.0, 0.0}, velocities{0.0, -4.0, 0.0, 0.0};
constexpr std::array<double, 4> forces{-4.0, 4.0, 0.0, 0.0};  // x; y moves twice as far

template <class T>
class Unlisted : public ::testing::Test {};
TYPED_TEST_SUITE(Unlisted, Scalars, ScalarNames);

TYPED_TEST(Unlisted, RunsInTheLoopAndIsRecorded) {
    using T = TypeParam;
    using Report = typename Pd<T>::Report;
    static_assert(row_width<Report> == 14);
    std::vector<std::array<double, row_width<Report>>> rows;
    const auto samples = run_loop<Pd<T>>(
        free_mass<T>(), [&](const Snapshot<T, Report>& at) { write_row(at, rows.emplace_back().data()); });
    ASSERT_EQ(samples, 4);
    for (std::size_t n = 0; n < 4; ++n) {
        const double q = positions[n], v = velocities[n], u = forces[n];
        // position, velocity, reference, error, its rate, force, disturbance
        const std::array<double, 14> wanted{q, 2 * q, v, 2 * v, 0, 0, q, 2 * q, v, 2 * v, u, 2 * u, 0, 0};
        for (std::size_t k = 0; k < wanted.size(); ++k) {
            EXPECT_NEAR(rows[n][k], wanted[k], 8 * epsilon<T>) << n << ' ' << k;
        }
    }
    int reported = 0;
    for_each_reported<Report>([&](const Channel&) { ++reported; });
    EXPECT_EQ(reported, 0);
}

TYPED_TEST(Unlisted, RunsOneSampleAtATime) {
    using T = TypeParam;
    const auto setup = free_mass<T>();
    const auto c = Stepper<Pd<T>>::prepare(setup);
    Disturbance disturbance(setup.disturbance, setup.common.step);
    auto state = Stepper<Pd<T>>::start(setup, c, disturbance);
    for (std::size_t n = 0; n < 4; ++n) {
        expect_near(state.motion.position, {positions[n], 2 * positions[n]}, 8 * epsilon<T>);
        expect_near(state.snapshot().signals.force, {forces[n], 2 * forces[n]}, 8 * epsilon<T>);
        EXPECT_TRUE(Stepper<Pd<T>>::advance(state, c, disturbance));
    }
    EXPECT_EQ(state.step, 4);
}

TEST(AnUnlistedController, HasTheMetricsOfWhatItReportsAndNoOthers) {
    const auto setup = free_mass<double>();
    const MetricsParams params{.transient = 2.0};
    MetricsSums<double> sums{.error_bound_squared = params.error_bound * params.error_bound};
    MetricsTotals totals{};
    CommonReport last{};
    run_loop<Pd<double>>(setup, [&](const auto& at) {
        sums.add(at.signals);
        totals.add(sums.segment, at.step, first_steady_sample(params, setup));
        sums.segment = {};
        last = CommonReport::of(at.signals.report, [](double a) { return a; });
    });
    const auto values = metric_values(params, setup, totals, last, last.bound[0], 4);
    EXPECT_NEAR(values.rmse_whole.x(), std::sqrt((16.0 + 4.0) / 4.0), 1e-12);
    EXPECT_NEAR(values.rmse_transient.y(), std::sqrt((64.0 + 16.0) / 2.0), 1e-12);
    EXPECT_NEAR(values.rmse_steady.x(), 0.0, 1e-12);
    EXPECT_NEAR(values.effort.x(), std::sqrt((16.0 + 16.0) / 4.0), 1e-12);
    EXPECT_NEAR(values.largest_force, 8.0, 1e-12);
    EXPECT_EQ(values.error_settling_time, 2.0);
    for (const double unreported :
         {values.surface_settling_time, values.rate_error, values.rate_error_rms, values.rate_error_peak,
          values.rate_settling_time, values.damping_error, values.stiffness_error, values.bound_final[0],
          values.bound_final[2], values.bound_0_halfway, values.diverged_at}) {
        EXPECT_TRUE(std::isnan(unreported));
    }
}

TYPED_TEST(Unlisted, IsGuardedIfItCanDoWithoutASample) {
    using T = TypeParam;
    using Safe = Guard<PatientPd<T>>;
    const auto setup = free_mass<T>();
    const auto c = prepare<Safe>(setup.controller, setup.common);
    typename Safe::State state{};
    const auto force = [&](double q, double v) {
        expect_equal(Safe::step(state, c, {.position = vec2<T>(q, 0), .velocity = vec2<T>(v, 0)}).force - state.force,
                     {0, 0});
        return number(state.force.x());
    };
    EXPECT_EQ(force(nan, 0), 0.0);
    EXPECT_EQ(Safe::steps(state), 0U) << "time has not started";
    EXPECT_EQ(force(4, 0), -4.0);
    EXPECT_EQ(force(nan, -4), -4.0);
    EXPECT_EQ(state.status, Status::not_finite);
    EXPECT_EQ(force(2, -4), 4.0);
    EXPECT_EQ(state.status, Status::ok);
    EXPECT_EQ(Safe::steps(state), 3U);
    EXPECT_TRUE(Safe::sound(state, c));
}

// The observer starts at rest like the mass, and knows every force, so it has no error.
TYPED_TEST(Unlisted, IsObservedIfItCanDoWithoutASample) {
    using T = TypeParam;
    using Observed = Observing<PatientPd<T>>;
    auto setup = free_mass<T>();
    setup.common.observer_bandwidth = 0.5;
    const auto c = prepare<Observed>(setup.controller, setup.common);
    typename Observed::State state{};
    for (std::size_t n = 0; n < 4; ++n) {
        const auto signals = Observed::step(
            state, c, {.position = vec2<T>(positions[n], 2 * positions[n]), .velocity = vec2<T>(nan, 1e9)});
        expect_near(signals.force, {forces[n], 2 * forces[n]}, 64 * epsilon<T>);
    }
}

template <class T>
class UnlistedInLanes : public ::testing::Test {};
using Several = ::testing::Types<Lanes<double, 2>, Lanes<float, 4>>;
TYPED_TEST_SUITE(UnlistedInLanes, Several);

// In parallel, one with half the stiffness and damping 1: 4, 4 - 2/2 = 3 with -2, 3 - 2 + 0.5/2 = 1.25 with -1.5.
TYPED_TEST(UnlistedInLanes, RunsInABlockBesideAnotherOfItsKind) {
    using T = TypeParam;
    using Plain = typename T::Number;
    auto setup = free_mass<T>();
    Block<Pd<T>> block;
    block.controller = Pd<T>::prepare(setup.controller, setup.common);
    block.plant = Gyroscope<T>::prepare(setup.plant, setup.common.step);
    block.motion = Gyroscope<T>::start(setup.plant);
    const auto other = Pd<T>::prepare({.stiffness = 0.5, .damping = 1.0}, setup.common);
    detail::set_lane<T>(block.controller, other, 1);
    ASSERT_EQ(advance_block<Pd<T>>(block, 0, 2), 2);
    const auto lane = [](const T& a, std::size_t k) { return static_cast<double>(a.lane[k]); };
    constexpr double close = 32 * epsilon<Plain>;
    EXPECT_NEAR(lane(block.motion.position.x(), 0), 0.0, close);
    EXPECT_NEAR(lane(block.motion.velocity.y(), 0), 0.0, close);
    EXPECT_NEAR(lane(block.motion.position.x(), 1), 1.25, close);
    EXPECT_NEAR(lane(block.motion.velocity.x(), 1), -1.5, close);
    EXPECT_NEAR(lane(block.sums.segment.squares.x(), 0), 16.0 + 4.0, 10 * close);
    EXPECT_NEAR(lane(block.sums.segment.squares.x(), 1), 16.0 + 9.0, 10 * close);
    EXPECT_FALSE(diverged<T>(block));
    block.motion.position.second.lane[1] = static_cast<Plain>(2e6);
    EXPECT_TRUE(diverged<T>(block));
}

}  // namespace
}  // namespace fracgyro::testing
