// The Kalman filter between sensors and controller: its gains, and what it keeps of noise, delays, limits and faults.
#include "fracgyro/controllers/pid.hpp"
#include "fracgyro/hardware/guard.hpp"
#include "fracgyro/hardware/motion_filter.hpp"
#include "fracgyro/plant/gyroscope.hpp"
#include "fracgyro/sim/any_controller.hpp"

#include "follow.hpp"
#include "scalars.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>

namespace fracgyro::testing {
namespace {

template <Scalar T>
using Both = Filtered<Pid<T>, true>;
template <Scalar T>
using Positions = Filtered<Pid<T>, false>;

static_assert(Resumable<Both<double>> && Resumable<Positions<float>>);
static_assert(measures_velocity<Both<double>> && !measures_velocity<Positions<double>>);
static_assert(takes_filter<Pid<double>> &&
              takes_filter<SlidingModeController<double, LinearSurface, GradientAdaptation>>);
static_assert(!takes_filter<Lqg<double>> && !takes_filter<InternalModel<double>> && !takes_filter<OpenLoop<double>>);
static_assert(!takes_filter<SlidingModeController<double, LinearSurface, JointAdaptation>>);
static_assert(std::is_same_v<ForSensors<Pid<double>, false, true>::Type, Both<double>>);
static_assert(std::is_same_v<ForSensors<Pid<double>, true, true>::Type, Positions<double>>);
static_assert(std::is_same_v<ForSensors<Pid<double>, true, false>::Type, Observing<Pid<double>>>);
static_assert(std::is_same_v<ForSensors<Pid<double>, false, false>::Type, Pid<double>>);
static_assert(std::is_same_v<ForSensors<Lqg<double>, false, true>::Type, Lqg<double>>);

// The paper's plant, and a nominal plant that is `ratio` of it.
struct Case {
    PidParams law{.natural_frequency = 300.0, .damping_ratio = 0.7, .integral_frequency = 20.0};
    Common common{.step = h};
    GyroscopeParams plant{.damping = {0.01, 0.002, 0.01}, .stiffness = {355.3, 70.99, 532.9}, .rate = 0.1};
    double force_noise = 0.0, sensor_noise = 0.0;
    std::size_t delay = 0;

    explicit Case(double ratio = 0.95) {
        common.reference = {.frequency = {pi, 0.5 * pi}, .phase = {0.0, 0.5 * pi}};
        common.nominal = {
            .damping = ratio * plant.damping, .stiffness = ratio * plant.stiffness, .rate = ratio * plant.rate};
        common.filter = {.bandwidth = 100.0,
                         .assumed = {.force_noise = 1.0, .position_noise = noise, .velocity_noise = noise}};
        plant.initial_position = {0.5, 0.5};
    }
    static Case in_noise() {
        Case a;
        a.force_noise = 1.0;
        a.sensor_noise = noise;
        return a;
    }
};

template <class C>
using FilterLoop = Loop<C, Case>;

// Error of the prediction for the coming sample: of the position, and h times that of the velocity.
template <class C>
double prediction_error(const FilterLoop<C>& loop) {
    const auto& z = loop.state.filter.motion;
    return std::sqrt(squared_norm(cast<double>(z.position) - loop.motion.position) +
                     h * h * squared_norm(cast<double>(z.velocity) - loop.motion.velocity));
}

template <class C>
class MotionFilterOf : public ::testing::Test {};
using Sensors = ::testing::Types<Both<double>, Positions<double>>;
struct Names {
    template <class C>
    static std::string GetName(int) {
        return C::measures_velocity ? "both" : "positions";
    }
};
TYPED_TEST_SUITE(MotionFilterOf, Sensors, Names);

// The covariance of a Kalman filter of one axis, step after step, in the units of q and its rate.
TYPED_TEST(MotionFilterOf, ItsGainsAreThoseThatAKalmanFilterSettlesAt) {
    constexpr bool both = TypeParam::measures_velocity;
    const Case a;
    const auto c = TypeParam::prepare(a.law, a.common).filter;
    const double stiffness = a.common.nominal.stiffness.xx(), damping = a.common.nominal.damping.xx();
    // The map by many short steps.
    constexpr int parts = 1'000'000;
    const double part = h / parts;
    double f[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int n = 0; n < parts; ++n) {
        for (int j = 0; j < 3; ++j) {
            const double q = f[0][j], v = f[1][j], u = f[2][j],
                         half = v + 0.5 * part * (u - stiffness * q - damping * v);
            f[0][j] = q + part * half;
            f[1][j] = v + part * (u - stiffness * (q + 0.5 * part * v) - damping * half);
        }
    }
    double p[3][3] = {{1e-4, 0, 0}, {0, 1e-2, 0}, {0, 0, 1e2}}, gain[3][2] = {};
    const double learned = a.common.filter.bandwidth * h;
    for (int n = 0; n < 20'000; ++n) {
        for (int j = 0; j < (both ? 2 : 1); ++j) {  // one measurement after the other
            const double s = p[j][j] + noise * noise;
            const double first = gain[1][0];
            double l[3], row[3];
            for (int i = 0; i < 3; ++i) {
                l[i] = p[i][j] / s;
                row[i] = p[j][i];
            }
            for (int i = 0; i < 3; ++i) {
                for (int k = 0; k < 3; ++k) {
                    p[i][k] -= l[i] * row[k];
                }
                if (j == 1) {  // the gain of both at once: the second sees what the first has moved
                    gain[i][0] -= l[i] * first;
                }
                gain[i][j] = l[i];
            }
        }
        double fp[3][3] = {}, next[3][3] = {};
        for (int i = 0; i < 3; ++i) {
            for (int k = 0; k < 3; ++k) {
                for (int j = 0; j < 3; ++j) {
                    fp[i][k] += f[i][j] * p[j][k];
                }
            }
        }
        for (int i = 0; i < 3; ++i) {
            for (int k = 0; k < 3; ++k) {
                for (int j = 0; j < 3; ++j) {
                    next[i][k] += fp[i][j] * f[k][j];
                }
                const double g[3] = {f[0][2], f[1][2], 0.0};
                p[i][k] = next[i][k] + g[i] * g[k] + (i == 2 && k == 2 ? learned * learned : 0.0);
            }
        }
    }
    const std::array found{c.position, c.velocity, c.acceleration};
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < (both ? 2 : 1); ++j) {
            EXPECT_NEAR(found[i].of[j].x(), gain[i][j], 1e-6 * std::abs(gain[i][j])) << i << j;
        }
    }
}

TYPED_TEST(MotionFilterOf, WithTheNominalPlantItPredictsEverySample) {
    for (const std::size_t delay : {0U, 1U, 3U, 8U}) {
        Case a(1.0);
        a.law.natural_frequency = 60.0;
        a.common.force_limit = 700.0;  // it acts at the start, and the filter has to know
        a.delay = delay;
        a.common.filter.assumed.delay = static_cast<std::int64_t>(delay);
        FilterLoop<TypeParam> loop(a);
        double largest = 0.0;
        for (int n = 0; n < 3000; ++n) {
            loop.step();
            largest = std::max(largest, prediction_error(loop));
        }
        EXPECT_LT(largest, 1e-12) << delay;
        EXPECT_LT(squared_norm(loop.motion.position), 2.1) << delay;
    }
}

TYPED_TEST(MotionFilterOf, AConstantForceIsFoundAndLeavesNoError) {
    FilterLoop<TypeParam> loop(Case(1.0));
    for (int n = 0; n < 30'000; ++n) {
        loop.step({50.0, -20.0});
    }
    EXPECT_NEAR(loop.state.filter.acceleration.x(), 50.0, 1e-6);
    EXPECT_NEAR(loop.state.filter.acceleration.y(), -20.0, 1e-6);
    EXPECT_LT(prediction_error(loop), 1e-10);
}

// Values of the PID without the filter: .079 chattering and 4.6e-5 from both, in noise of both sensors.
TYPED_TEST(MotionFilterOf, ItRemovesNoiseFromTheForce) {
    FilterLoop<TypeParam> loop(Case::in_noise());
    const double error = loop.rms(10'000, 20'000);
    double bends = 0.0, sum = 0.0;
    Vec2<double> last = loop.force, before = loop.force;
    for (int n = 0; n < 10'000; ++n) {
        loop.step();
        if (n > 1) {
            bends += squared_norm(loop.force - 2.0 * last + before);
            sum += squared_norm(loop.force);
        }
        before = last;
        last = loop.force;
    }
    constexpr bool both = TypeParam::measures_velocity;
    EXPECT_LT(error, both ? 3e-5 : 9e-5);
    EXPECT_LT(std::sqrt(bends / sum), both ? 0.004 : 0.02);
}

TYPED_TEST(MotionFilterOf, LessNoiseNeverGivesALargerError) {
    double worse = 1.0;
    for (const double sensor : {1e-3, noise, 7e-6, 7e-7, 7e-8, 0.0}) {
        Case a = Case::in_noise();
        a.sensor_noise = a.common.filter.assumed.position_noise = a.common.filter.assumed.velocity_noise = sensor;
        const double error = FilterLoop<TypeParam>(a).rms(10'000, 20'000);
        EXPECT_LT(error, 1.05 * worse) << sensor;
        worse = error;
    }
    EXPECT_LT(worse, 3e-5);
}

TYPED_TEST(MotionFilterOf, AHiddenStepOfDelayCostsLittle) {
    for (const double sensor : {noise, 0.0}) {
        Case a = Case::in_noise();
        a.sensor_noise = a.common.filter.assumed.position_noise = a.common.filter.assumed.velocity_noise = sensor;
        const double known = FilterLoop<TypeParam>(a).rms(10'000, 20'000);
        a.delay = 1;
        EXPECT_LT(FilterLoop<TypeParam>(a).rms(10'000, 20'000), 1.2 * known) << sensor;
    }
}

TYPED_TEST(MotionFilterOf, ItPredictsThroughMissingSamples) {
    FilterLoop<TypeParam> loop(Case::in_noise());
    loop.rms(5000, 1);
    for (int n = 0; n < 40; ++n) {
        loop.step({}, true);
    }
    EXPECT_LT(prediction_error(loop), 0.01);  // the mass is 0.1 further
    EXPECT_LT(loop.rms(5000, 2000), 2e-4);
}

TEST(MotionFilter, ItsGuardKeepsForcesOnTheirWayWhenItStartsOver) {
    Case a = Case::in_noise();
    a.delay = 3;
    a.common.filter.assumed.delay = 3;
    a.law.natural_frequency = 60.0;
    a.common.guard = {.checked = true,
                      .force_tolerance = 50.0,
                      .position_tolerance = 1e-3,
                      .velocity_tolerance = 1e-3,
                      .patience = 4.0};
    using Guarded = Guard<Both<double>>;
    const auto c = Guarded::prepare(a.law, a.common);
    Guarded::State state{};
    const auto plant = Gyroscope<double>::prepare(a.plant, h);
    Motion<double> motion = Gyroscope<double>::start(a.plant);
    std::deque<Vec2<double>> late(3);
    bool lost = false;
    for (int n = 0; n < 6000; ++n) {
        Motion<double> seen = motion;
        if (3000 <= n && n < 3010) {
            seen.position = {std::numeric_limits<double>::quiet_NaN(), 0.0};
        }
        Guarded::step(state, c, seen);
        late.push_back(state.force);
        Gyroscope<double>::step(motion, plant, late.front(), {});
        late.pop_front();
        if (!lost && state.status == Status::lost) {
            lost = true;
            const auto& filter = state.controller.filter;
            EXPECT_FALSE(filter.started);
            for (std::size_t i = 0; i < 3; ++i) {
                EXPECT_EQ(filter.under[i].x(), late[2 - i].x()) << i;
            }
        }
    }
    EXPECT_TRUE(lost);
    EXPECT_EQ(state.status, Status::ok);
    EXPECT_LT(squared_norm(state.error.value), 1e-4);
}

TEST(MotionFilter, ARestartForgetsEverything) {
    FilterLoop<Both<double>> loop(Case::in_noise());
    loop.rms(100, 1);
    Both<double>::start_over(loop.state, false);
    EXPECT_FALSE(loop.state.filter.started);
    EXPECT_EQ(squared_norm(loop.state.filter.force), 0.0);
    EXPECT_EQ(squared_norm(loop.state.filter.acceleration), 0.0);
    EXPECT_EQ(Both<double>::steps(loop.state), 101U);
}

TEST(MotionFilter, TheVelocityThatItDoesNotMeasureChangesNothing) {
    const Case a;
    const auto c = Positions<double>::prepare(a.law, a.common);
    Positions<double>::State one{}, other{};
    for (int n = 0; n < 100; ++n) {
        const Vec2<double> q{0.5 + 0.001 * n, 0.5};
        const auto first = Positions<double>::step(one, c, {.position = q});
        const auto second = Positions<double>::step(other, c, {.position = q, .velocity = {1e9 * n, -5.0}});
        EXPECT_EQ(first.force.x(), second.force.x());
        EXPECT_EQ(first.force.y(), second.force.y());
    }
}

TEST(MotionFilter, FloatIsAsGoodAsDouble) {
    const double exact = FilterLoop<Both<double>>(Case::in_noise()).rms(10'000, 10'000);
    EXPECT_NEAR(FilterLoop<Both<float>>(Case::in_noise()).rms(10'000, 10'000), exact, 0.05 * exact);
    const double positions = FilterLoop<Positions<double>>(Case::in_noise()).rms(10'000, 10'000);
    EXPECT_NEAR(FilterLoop<Positions<float>>(Case::in_noise()).rms(10'000, 10'000), positions, 0.05 * positions);
}

template <Scalar T>
std::unique_ptr<AnyController<T>> erased_pid(const Case& a) {
    auto plain = std::make_unique<ControllerOf<Pid<T>>>(ControllerParams{a.law}, a.common);
    AnyController<T>& pid = *plain;
    return behind_wrappers<T>(pid, a.common, std::move(plain));
}

template <class T>
class MotionFilterScalars : public ::testing::Test {};
TYPED_TEST_SUITE(MotionFilterScalars, Scalars, ScalarNames);

// The controller of a known type and the one behind a table of functions, which runs and Python use.
TYPED_TEST(MotionFilterScalars, TheErasedControllerHasTheSameBits) {
    using T = TypeParam;
    for (const bool positions_only : {false, true}) {
        Case a = Case::in_noise();
        a.common.filter.assumed.delay = 2;
        a.common.observer_bandwidth = positions_only ? 300.0 : 0.0;
        const auto erased = erased_pid<T>(a);
        EXPECT_EQ(erased->needs_velocity(), !positions_only);
        EXPECT_FALSE(erased->takes_filter());
        const auto compare = [&]<class C>() {
            const auto c = C::prepare(a.law, a.common);
            typename C::State state{};
            const Sample<T> none{};
            for (int n = 0; n < 200; ++n) {
                const double x = std::sin(0.01 * n), y = std::cos(0.01 * n);
                const Motion<T> motion{.position = {T(x), T(y)}, .velocity = {T(10.0 * y), T(-10.0 * x)}};
                const Sample<T>* const missing = n % 7 == 3 ? &none : nullptr;
                const auto known = C::step(state, c, motion, missing), found = erased->step(motion, missing);
                EXPECT_EQ(number(known.force.x()), number(found.force.x()));
                EXPECT_EQ(number(known.force.y()), number(found.force.y()));
            }
        };
        positions_only ? compare.template operator()<Positions<T>>() : compare.template operator()<Both<T>>();
    }
}

TEST(MotionFilter, ASavedStateContinuesAndADamagedOneIsRefused) {
    Case a = Case::in_noise();
    a.common.filter.assumed.delay = 2;
    const auto first = erased_pid<double>(a), second = erased_pid<double>(a);
    const auto motion = [](int n) {
        const double x = std::sin(0.01 * n), y = std::cos(0.01 * n);
        return Motion<double>{.position = {x, y}, .velocity = {10.0 * y, -10.0 * x}};
    };
    for (int n = 0; n < 50; ++n) {
        first->step(motion(n), nullptr);
    }
    std::vector<unsigned char> bytes(first->state_size());
    first->save(bytes.data());
    EXPECT_EQ(second->steps_of(bytes.data()), 50U);
    EXPECT_FALSE(second->restore(bytes.data(), 49));
    EXPECT_TRUE(second->restore(bytes.data(), 50));
    for (int n = 50; n < 60; ++n) {
        EXPECT_EQ(first->step(motion(n), nullptr).force.x(), second->step(motion(n), nullptr).force.x());
    }
    using State = MotionFilter<double, true>::State;
    bytes[offsetof(State, started)] = 2;
    EXPECT_FALSE(second->restore(bytes.data(), 50));
}

TEST(MotionFilter, AControllerThatFiltersByItselfHasNoneBeforeIt) {
    Case a;
    const ControllerParams params{InternalModelParams{}};
    ControllerOf<InternalModel<double>> own(params, a.common);
    EXPECT_EQ(behind_wrappers<double>(own, a.common), nullptr);
    a.common.filter = {};
    EXPECT_EQ(erased_pid<double>(a), nullptr);
}

}  // namespace
}  // namespace fracgyro::testing
