#include "made.hpp"
#include "paper.hpp"
#include "scalars.hpp"

#include "fracgyro/plant/disturbance.hpp"
#include "fracgyro/plant/plants.hpp"
#include "fracgyro/sim/any_run.hpp"
#include "fracgyro/sim/user_plant.hpp"

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

// -- Other plants -----------------------------------------------------------------------------------------------------

static_assert(Plant<Gyroscope<double>> && Plant<Gyroscope<float>, float> && Plant<Resonator> && Plant<Duffing> &&
              Plant<General>);
static_assert(TakesRate<Duffing> && !TakesRate<Resonator> && !TakesRate<General>);
static_assert(!Plant<Disturbance> && !Plant<VaryingGyroscope>);

TEST(Registry, HasThePlantsByNameAndTheGyroscopeFirst) {
    std::vector<std::string_view> names;
    for_each_plant([&]<class Entry>(std::size_t kind) {
        EXPECT_EQ(kind, names.size());
        names.push_back(Entry::kind);
    });
    EXPECT_EQ(names, (std::vector<std::string_view>{"gyroscope", "resonator", "duffing", "general"}));
    EXPECT_EQ(make_plant(0, {}, 1e-3, {}), nullptr);
    EXPECT_EQ(own_number_count(0), 0U);
    EXPECT_EQ(own_number_count(1), 0U);
    EXPECT_EQ(own_number_count(2), 3U);
    EXPECT_EQ(own_number_count(3), 3U);
}

TEST(Resonator, DecaysAsItsFormula) {
    // x'' + 2 x' + 26 x = 26: x = 1 + e^-t (A cos 5t + B sin 5t), with A = 1 and B = 0.6 for x = 2, x' = 2.
    const GyroscopeParams linear{.damping = {2.0, 9.0, 9.0},
                                 .stiffness = {20.0, 9.0, 90.0},
                                 .stiffness_deviation = {6.0, 0.0, 0.0},
                                 .rate = 3.0,
                                 .initial_position = {2.0, 7.0},
                                 .initial_velocity = {2.0, 7.0}};
    const auto plant = make_plant(1, linear, 0.25, {});
    PlantState state = plant->start();
    Motion<double> motion;
    for (int n = 1; n <= 20; ++n) {
        plant->step(state, motion, {.control = {20.0, 1e3}, .disturbance = {6.0, -1e3}});
        const double t = 0.25 * n, decay = std::exp(-t), c = std::cos(5.0 * t), s = std::sin(5.0 * t);
        expect_near(motion.position, {1.0 + decay * (c + 0.6 * s), 0.0}, 1e-12);
        expect_near(motion.velocity, {decay * (2.0 * c - 5.6 * s), 0.0}, 1e-12);
    }
}

// Springs that harden on x and soften on y, coupled; turning.
constexpr std::array<double, 3> kappas{8.0, -2.0, 5.0};
GyroscopeParams springs() {
    return {.stiffness = {4.0, 1.0, 9.0}, .rate = 0.7, .initial_position = {0.6, -0.4}, .initial_velocity = {1.0, 0.5}};
}
Motion<double> after(AnyPlant& plant, int steps, const RateCourse& rate) {
    PlantState state = plant.start();
    Motion<double> motion = plant.motion(state);
    for (int n = 0; n < steps; ++n) {
        plant.step(state, motion, {.rate = rate, .sample = n});
    }
    return motion;
}

TEST(Duffing, KeepsItsEnergyWithoutDamping) {
    const auto energy = [](const Motion<double>& m) {
        const double x = m.position.x(), y = m.position.y();
        const double potential = kappas[0] / 4 * x * x * x * x + kappas[1] / 4 * y * y * y * y +
                                 kappas[2] / 2 * x * x * y * y + dot(m.position, springs().stiffness * m.position) / 2;
        return potential + squared_norm(m.velocity) / 2;
    };
    const auto plant = make_plant(2, springs(), 1e-2, kappas);
    const double first = energy(plant->motion(plant->start()));
    EXPECT_GT(first, 1.0);
    for (const int steps : {1, 10, 1000}) {
        EXPECT_NEAR(energy(after(*plant, steps, {0.7, 0.7, 0.7})), first, 1e-6);
    }
}

TEST(Duffing, ErrorsShrinkWithTheFourthPowerOfTheStep) {
    const auto end = [](int steps) {
        return after(*make_plant(2, springs(), 2.0 / steps, kappas), steps, {0.7, 0.7, 0.7}).position;
    };
    const Vec2<double> exact = end(20'000);
    const double coarse = norm(end(50) - exact), fine = norm(end(100) - exact);
    EXPECT_GT(coarse, 1e-7);
    EXPECT_NEAR(coarse / fine, 16.0, 1.5);
}

TEST(Duffing, FollowsTheRateWithinAStep) {
    const auto end = [](const RateCourse& rate) {
        return after(*make_plant(2, springs(), 0.1, kappas), 1, rate).velocity;
    };
    const Vec2<double> rising = end({0.6, 0.7, 0.8}), constant = end({0.7, 0.7, 0.7});
    EXPECT_LT(norm(rising - constant), 0.02);
    EXPECT_GT(norm(rising - constant), 1e-5);
}

TEST(General, WithoutItsOwnNumbersHasTheBitsOfTheGyroscope) {
    const GyroscopeParams p = gyroscope();
    const auto plant = make_plant(3, p, 0.1, std::array{1.0, 0.0, 0.0});
    PlantState state = plant->start();
    Motion<double> got, wanted = Gyroscope<double>::start(p);
    const auto c = Gyroscope<double>::prepare(p, 0.1);
    for (int n = 0; n < 100; ++n) {
        plant->step(state, got, {.control = {30.0, -50.0}, .disturbance = {1.0, 2.0}});
        Gyroscope<double>::step(wanted, c, {30.0, -50.0}, {1.0, 2.0});
    }
    EXPECT_EQ(got.position, wanted.position);
    EXPECT_EQ(got.velocity, wanted.velocity);
}

// q̈ of the equation in general.hpp.
TEST(General, StepsAsManyTinyRungeKuttaStepsOfItsEquation) {
    const GyroscopeParams p = gyroscope();
    constexpr double ratio = 1.6, of_damping = -0.7, of_stiffness = 12.0, step = 0.3;
    const auto plant = make_plant(3, p, step, std::array{ratio, of_damping, of_stiffness});
    PlantState state = plant->start();
    Motion<double> got;
    plant->step(state, got, {.control = {30.0, -50.0}, .disturbance = {1.0, 2.0}});
    const auto d = p.damping + p.damping_deviation, k = p.stiffness + p.stiffness_deviation;
    std::array<double, 4> x{p.initial_position.x(), p.initial_position.y(), p.initial_velocity.x(),
                            p.initial_velocity.y()};
    constexpr int parts = 20'000;
    for (int n = 0; n < parts; ++n) {
        x = fracgyro::runge_kutta(x, step / parts, [&](int, const std::array<double, 4>& s) {
            const Vec2<double> q{s[0], s[1]}, v{s[2], s[3]};
            const Vec2<double> more{0.0, of_damping * v.x() + of_stiffness * q.x()};
            const Vec2<double> f = Vec2{31.0, -48.0} - d * v - k * q - more - (2.0 * p.rate) * turned(v);
            return std::array{v.x(), v.y(), f.x(), f.y() / ratio};
        });
    }
    expect_near(got.position, {x[0], x[1]}, 1e-11);
    expect_near(got.velocity, {x[2], x[3]}, 1e-10);
}

// All motions of a run.
std::vector<Motion<double>> motions(const PlantSetup& setup, bool device) {
    std::vector<Motion<double>> found;
    const auto controller = make_controller<double>(setup.controller, setup.common);
    run_any(setup, *controller, device, &fill_noise<word_bytes>, [&](const auto& at) { found.push_back(at.motion); });
    return found;
}
double largest_difference(const std::vector<Motion<double>>& a, const std::vector<Motion<double>>& b) {
    EXPECT_EQ(a.size(), b.size());
    double largest = 0.0;
    for (std::size_t n = 0; n < std::min(a.size(), b.size()); ++n) {
        largest = std::max({largest, norm(a[n].position - b[n].position), norm(a[n].velocity - b[n].velocity)});
    }
    return largest;
}

PlantSetup run_of(std::int64_t steps) {
    PlantSetup setup;
    static_cast<Setup&>(setup) = paper(steps);
    return setup;
}

TEST(Loop, WithTheGyroscopeAsAnyPlantHasTheSameBits) {
    for (const bool device : {false, true}) {
        PlantSetup setup = run_of(500);
        setup.device.delay = device ? 1 : 0;
        const auto plain = motions(setup, device);
        PlantOf<Gyroscope<double>> plant(setup.plant, setup.common.step);
        setup.model = &plant;
        EXPECT_EQ(largest_difference(motions(setup, device), plain), 0.0);
        EXPECT_EQ(plain.size(), 501U);
    }
}

// -- C functions ------------------------------------------------------------------------------------------------------

// The paper's gyroscope; parameters: damping, stiffness.
void turning(const double* in, const double* s, const double* p, double* out) {
    out[0] = s[2];
    out[1] = s[3];
    out[2] = in[1] - p[0] * s[2] - p[1] * s[3] - p[3] * s[0] - p[4] * s[1] + 2.0 * in[3] * s[3];
    out[3] = in[2] - p[1] * s[2] - p[2] * s[3] - p[4] * s[0] - p[5] * s[1] - 2.0 * in[3] * s[2];
}
std::vector<double> numbers_of(const GyroscopeParams& p) {
    return {p.damping.xx(), p.damping.xy(), p.damping.yy(), p.stiffness.xx(), p.stiffness.xy(), p.stiffness.yy()};
}
constexpr NativePlant::Places in_order{0, 1, 2, 3};

TEST(NativePlant, WithTheEquationsOfTheGyroscopeMovesLikeIt) {
    for (const bool device : {false, true}) {
        PlantSetup setup = run_of(1000);
        if (device) {
            setup.rate = {.kind = AngularRateKind::sine, .amplitude = 0.3, .frequency = 5.0};
        }
        const auto plain = motions(setup, device);
        NativePlant plant(&turning, NativePlant::Computes::derivative, numbers_of(setup.plant), 4, in_order, {});
        plant.begin({}, setup);
        setup.model = &plant;
        EXPECT_LT(largest_difference(motions(setup, device), plain), 1e-4);
        plant.check();
    }
}

// Its exact step; parameters: the effect of x, y, vx, vy, force x, force y on each state. Checks the rest of `in`.
void mapped(const double* in, const double* s, const double* p, double* out) {
    for (int i = 0; i < 4; ++i) {
        const double* const row = p + 6 * i;
        out[i] = row[0] * s[0] + row[1] * s[1] + row[2] * s[2] + row[3] * s[3] + row[4] * in[1] + row[5] * in[2];
    }
    const double n = in[0] / in[6];
    if (in[6] != 1e-3 || std::abs(n - std::round(n)) > 1e-9 || in[3] != 0.1 || in[4] != 0.1 || in[5] != 0.1) {
        out[0] = std::numeric_limits<double>::quiet_NaN();
    }
}

TEST(NativePlant, WithTheStepOfTheGyroscopeMovesLikeIt) {
    for (const bool device : {false, true}) {
        PlantSetup setup = run_of(1000);
        const auto plain = motions(setup, device);
        const auto columns = Gyroscope<double>::prepare(setup.plant, setup.common.step).map;
        std::vector<double> rows;
        for (std::size_t i = 0; i < 4; ++i) {
            for (std::size_t j = 0; j < 6; ++j) {
                rows.push_back(columns[j][i]);
            }
        }
        NativePlant plant(&mapped, NativePlant::Computes::step, rows, 4, in_order, {});
        plant.begin({}, setup);
        setup.model = &plant;
        EXPECT_LT(largest_difference(motions(setup, device), plain), 1e-8);
        plant.check();
    }
}

void beyond(const double*, const double*, const double*, double* out) { out[2] = 1.0; }
void nothing(const double* in, const double*, const double*, double* out) {
    out[0] = in[0] < 0.25 ? 0.0 : std::numeric_limits<double>::quiet_NaN();
    out[1] = 0.0;
}

TEST(NativePlant, ThatWritesBeyondItsStatesOrReturnsNaNIsRefused) {
    const PlantSetup setup = run_of(10);
    NativePlant wrong(&beyond, NativePlant::Computes::derivative, {}, 2, {0, -1, 1, -1}, {1.0, 2.0});
    wrong.begin({}, setup);
    PlantState state = wrong.start();
    expect_near(wrong.motion(state).velocity, {2.0, 0.0}, 0.0);
    Motion<double> motion;
    wrong.step(state, motion, {});
    EXPECT_THROW(wrong.check(), std::domain_error);

    NativePlant nan(&nothing, NativePlant::Computes::derivative, {}, 2, {0, -1, 1, -1}, {});
    nan.begin({}, setup);
    PlantState at = nan.start();
    nan.step(at, motion, {.sample = 248});
    try {
        nan.step(at, motion, {.sample = 249});
        ADD_FAILURE();
    } catch (const std::domain_error& error) {
        EXPECT_EQ(std::string(error.what()),
                  "the plant returned [nan, 0] at t = 0.25: it must return 2 finite numbers; it reads NaN beyond its 2 "
                  "states and 0 parameters");
    }
}

}  // namespace
}  // namespace fracgyro::testing
