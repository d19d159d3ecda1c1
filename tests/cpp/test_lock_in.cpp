// The lock-in: its parts, and a loop with the dual mass in noise, from rest, with delay, limits and faults.
#include "fracgyro/controllers/lock_in.hpp"
#include "fracgyro/control/held_plant.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <numbers>
#include <random>

namespace fracgyro::testing {
namespace {

constexpr double h = 0.05, position_noise = 1e-5, force_noise = 1.3e-7, pi = std::numbers::pi;
constexpr double range = 2.12e-4;  // 300 deg/s

// -- Parts ------------------------------------------------------------------------------------------------------------

using P = FactoredCovariance<double, 6>;

P::State some_covariance() {
    P::State state;
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    for (double& d : state.d_factor) {
        d = std::exp(normal(random));
    }
    for (double& u : state.u_factor) {
        u = normal(random);
    }
    return state;
}
void expect_same(const P::State& a, const P::State& b) {
    EXPECT_EQ(a.d_factor, b.d_factor);
    EXPECT_EQ(a.u_factor, b.u_factor);
}

TEST(FactoredCovariance, AMeasurementInPartsHasTheBitsOfAWholeOne) {
    P::State whole = some_covariance(), parts = whole;
    const std::array<double, 6> row{0.3, -1.0, 0.0, 2.0, 0.7, -0.1};
    const P::Gain gain = P::measure(whole, row, 0.4);
    P::Running running;
    P::begin(running, 0.4);
    EXPECT_EQ(running.inverse, 1.0 / 0.4);
    for (std::size_t j = 0; j < 6; ++j) {
        double f = row[j];
        for (std::size_t k = 0; k < j; ++k) {
            f = f + row[k] * parts.u_factor[P::column(j) + k];
        }
        P::open_column(parts, running, j, f);
        for (std::size_t k = 0; k < j; ++k) {
            P::absorb_row(parts, running, j, k);
        }
        P::close_column(parts, running, j, f);
    }
    P::finish(running);
    expect_same(whole, parts);
    EXPECT_EQ(gain.move, running.found.move);
    EXPECT_EQ(gain.variance, running.found.variance);
}

TEST(FactoredCovariance, AnAdditionInPartsHasTheBitsOfAWholeOne) {
    P::State whole = some_covariance(), parts = whole;
    P::add(whole, 3, 0.7);
    P::Added added{.share = {0.0, 0.0, 0.0, 1.0}, .left = 0.7};
    P::add_column<3>(parts, added);
    P::add_column<2>(parts, added);
    P::add_column<1>(parts, added);
    P::add_first(parts, added);
    expect_same(whole, parts);
    EXPECT_NE(whole.d_factor, some_covariance().d_factor);
}

// -- A loop -----------------------------------------------------------------------------------------------------------

struct Case {
    double rate = range, known = 0.999, limit = 0.01;
    std::size_t delay = 0;
    std::int64_t stated_delay = 0;
    bool from_rest = false;
    LockInParams law{.adaptation = {.rate_forgetting = 0.0}};
};

template <class T>
class Loop {
public:
    using C = LockIn<T>;

    explicit Loop(const Case& a) : force_(a.delay) {
        truth_ = {.damping = {2.14e-4, 0.0, 2.26e-3}, .stiffness = {1.0, 0.0, 1.02719}, .rate = a.rate};
        Common common{.step = h};
        common.reference = {.frequency = {1.0, 1.0135}, .phase = {0.0, 0.5 * pi}};
        common.nominal = {.damping = a.known * truth_.damping, .stiffness = a.known * truth_.stiffness};
        common.force_limit = a.limit;
        LockInParams p = a.law;
        p.datasheet = {.force_noise = force_noise, .position_noise = position_noise, .delay = a.stated_delay};
        c = C::prepare(p, common);
        map_ = held_plant::without_units(held_plant::both_axes(truth_, h), h);
        if (!a.from_rest) {
            motion_ = {0.0, 1.0, 1.0, 0.0};
        }
    }

    void run(int steps, double spike = 0.0, bool missing = false) {
        for (int n = 0; n < steps; ++n) {
            const Motion<T> seen{.position = {T(motion_[0] + spike + position_noise * normal_(random_)),
                                              T(motion_[1] + position_noise * normal_(random_))}};
            const Sample<T> none{};
            signals = C::step(state, c, seen, missing ? &none : nullptr);
            most = std::max({most, std::abs(double(signals.force.x())), std::abs(double(signals.force.y()))});
            if (!missing) {
                held_ = {double(signals.force.x()), double(signals.force.y())};
            }
            force_.push_back(held_);
            const Vec2<double> u = force_.front();
            force_.pop_front();
            const double forces[2] = {u.x() + force_noise * normal_(random_), u.y() + force_noise * normal_(random_)};
            std::array<double, 4> next{};
            for (std::size_t i = 0; i < 4; ++i) {
                next[i] = map_[i][4] * forces[0] + map_[i][5] * forces[1];
                for (std::size_t k = 0; k < 4; ++k) {
                    next[i] += map_[i][k] * motion_[k];
                }
            }
            motion_ = next;
        }
    }
    template <class Change>
    void change(Change&& change) {
        change(truth_);
        map_ = held_plant::without_units(held_plant::both_axes(truth_, h), h);
    }
    auto report() const { return C::report(state, c); }
    double error() const { return static_cast<double>(report().rate) - truth_.rate; }
    double deviation() const { return static_cast<double>(report().rate_deviation); }
    bool trusted() const { return report().rate_trusted > T(0.5); }
    void seed(unsigned value) { random_.seed(value); }

    typename C::Coefficients c;
    typename C::State state{};
    Signals<T, typename C::Report> signals{};
    double most = 0.0;

private:
    PlantModel<double> truth_;
    Matrix<6> map_{};
    std::array<double, 4> motion_{};
    Vec2<double> held_{};
    std::deque<Vec2<double>> force_;
    std::mt19937_64 random_{1};
    std::normal_distribution<double> normal_;
};

constexpr int whole = 100'000;  // 0.2 s: 625 spans

template <class T>
class LockInIn : public ::testing::Test {};
using Numbers = ::testing::Types<double, float>;
TYPED_TEST_SUITE(LockInIn, Numbers);

// The bound of Cramér and Rao for this run is 1.07e-6 of the range at either rate.
TYPED_TEST(LockInIn, TheRateOfARangeHasNoErrorButNoise) {
    for (unsigned seed = 1; seed <= 4; ++seed) {
        Loop<TypeParam> loop(Case{});
        loop.seed(seed);
        loop.run(whole);
        EXPECT_TRUE(loop.trusted());
        EXPECT_LT(std::abs(loop.error()), 4.0 * loop.deviation());
        EXPECT_LT(loop.deviation(), 3e-6 * range);
        EXPECT_NEAR(static_cast<double>(loop.report().stiffness.xx()), 1.0, 1e-6);
        EXPECT_NEAR(static_cast<double>(loop.report().damping.yy()), 2.26e-3, 1e-6);
    }
}

TYPED_TEST(LockInIn, ItsReferenceIsThatOfAllControllers) {
    Loop<TypeParam> loop(Case{});
    typename Reference<TypeParam>::State other{};
    for (int n = 0; n < 500; ++n) {
        if (n == 333) {
            LockIn<TypeParam>::start_over(loop.state, true);
        }
        loop.run(1);
        const auto r = Reference<TypeParam>::update(other, loop.c.reference);
        ASSERT_EQ(loop.signals.reference.position, r.position);
        ASSERT_EQ(loop.signals.reference.velocity, r.velocity);
        ASSERT_EQ(LockIn<TypeParam>::steps(loop.state), other.steps);
    }
}

TEST(LockIn, FromRestTheForceKeepsItsLimitAndTheRateIsFound) {
    Loop<double> loop(Case{.from_rest = true});
    loop.run(whole);
    EXPECT_LE(loop.most, 0.01);
    EXPECT_GT(loop.most, 0.009);
    EXPECT_TRUE(loop.trusted());
    EXPECT_LT(std::abs(loop.error()), 4.0 * loop.deviation());
    EXPECT_LT(loop.deviation(), 5e-6 * range);
}

TEST(LockIn, AStiffnessFivePercentOffIsFound) {
    for (const double known : {0.95, 1.05}) {
        Loop<double> loop(Case{.known = known});
        loop.run(whole);
        EXPECT_NEAR(loop.report().stiffness.yy(), 1.02719, 1e-5);
        EXPECT_LT(std::abs(loop.error()), 4.0 * loop.deviation());
    }
}

TEST(LockIn, AStatedDelayCostsNothingAndAHiddenOneMuch) {
    const auto error = [](std::int64_t stated) {
        Loop<double> loop(Case{.delay = 2, .stated_delay = stated});
        loop.run(whole);
        return std::abs(loop.error());
    };
    EXPECT_LT(error(2), 5e-6 * range);
    EXPECT_GT(error(0), 1e-3 * range);
}

TEST(LockIn, NothingIsTrustedBeforeItsTime) {
    Loop<double> loop(Case{});
    for (int span = 0; span < 250; ++span) {
        loop.run(160);
        ASSERT_FALSE(loop.trusted());
    }
    loop.run(20 * 160);
    EXPECT_TRUE(loop.trusted());
}

TEST(LockIn, AWrongSampleIsNotLearnedFrom) {
    Loop<double> loop(Case{}), same(Case{});
    loop.run(whole);
    same.run(whole);
    loop.run(1, 1.0);
    same.run(1);
    loop.run(2 * 160);
    same.run(2 * 160);
    EXPECT_NEAR(loop.error(), same.error(), 0.1 * same.deviation());
    loop.run(10 * 160);
    EXPECT_TRUE(loop.trusted());
}

TEST(LockIn, MissingSamplesAreNotLearnedFromAndTheRateReturns) {
    Loop<double> loop(Case{});
    loop.run(whole);
    loop.run(160, 0.0, true);
    const double before = loop.error();
    loop.run(159);
    EXPECT_EQ(loop.error(), before);  // the incomplete span taught nothing
    for (int n = 0; n < 20; ++n) {
        loop.run(40 * 160);
        EXPECT_LT(std::abs(loop.error()), 4.0 * loop.deviation());
    }
    EXPECT_TRUE(loop.trusted());
}

// For this filter the rate is constant.
TEST(LockIn, ARateThatJumpsIsWithinTheStatedDeviation) {
    Loop<double> loop(Case{});
    loop.run(whole);
    loop.change([](PlantModel<double>& plant) { plant.rate *= 0.5; });
    for (int n = 0; n < 20; ++n) {
        loop.run(160 * 30);
        EXPECT_TRUE(!loop.trusted() || std::abs(loop.error()) < 4.0 * loop.deviation());
    }
}

TEST(LockIn, AnotherStiffnessIsNotTrustedUntilItIsLearned) {
    Loop<double> loop(Case{});
    loop.run(whole);
    loop.change([](PlantModel<double>& plant) { plant.stiffness = 1.001 * plant.stiffness; });
    loop.run(160 * 30);
    EXPECT_FALSE(loop.trusted());
    loop.run(160 * 1500);
    EXPECT_TRUE(loop.trusted());
    EXPECT_NEAR(loop.report().stiffness.xx(), 1.001, 1e-6);
    EXPECT_LT(std::abs(loop.error()), 4.0 * loop.deviation());
    EXPECT_LT(loop.deviation(), 1e-4 * range);
}

TEST(LockIn, StartingOverKeepsTheEstimatesOrNot) {
    Loop<double> loop(Case{});
    loop.run(whole);
    const double rate = loop.report().rate;
    LockIn<double>::start_over(loop.state, true);
    EXPECT_EQ(loop.report().rate, rate);
    loop.run(100 * 160);
    EXPECT_FALSE(loop.trusted());
    EXPECT_LT(std::abs(loop.error()), 4.0 * loop.deviation());
    LockIn<double>::start_over(loop.state, false);
    EXPECT_EQ(loop.report().rate, 0.0);
}

TEST(LockIn, StartingOverKeepsNothingOfItsCovariance) {
    Loop<double> loop(Case{});
    loop.run(whole);
    const auto& covariance = loop.state.filter.covariance;
    for (const double u : covariance.u_factor) {
        ASSERT_NE(u, 0.0);
    }
    LockIn<double>::start_over(loop.state, true);
    loop.run(100);
    for (const double u : covariance.u_factor) {
        EXPECT_EQ(u, 0.0);
    }
    for (std::size_t k = 0; k < LockInFilter<double>::parameters; ++k) {
        EXPECT_EQ(covariance.d_factor[LockInFilter<double>::motions + k], loop.c.prior.plant[k]);
    }
}

TEST(LockIn, AStateWithAnIndexBeyondItsTasksIsNotSound) {
    Loop<double> loop(Case{});
    loop.run(1000);
    EXPECT_TRUE(LockIn<double>::sound(loop.state, loop.c));
    auto wrong = loop.state;
    wrong.slot = loop.c.steps;
    EXPECT_FALSE(LockIn<double>::sound(wrong, loop.c));
    wrong = loop.state;
    wrong.filter.task = LockInFilter<double>::tasks + 1;
    EXPECT_FALSE(LockIn<double>::sound(wrong, loop.c));
}

// Every span has room for all its tasks, from any step on.
TEST(LockIn, EveryForceIsDesignedBeforeItsSpanBegins) {
    for (const int first : {0, 1, 7, 29, 30, 31}) {
        Loop<double> loop(Case{});
        loop.run(first);
        LockIn<double>::start_over(loop.state, true);
        for (int span = 0; span < 5; ++span) {
            loop.run(160);
            ASSERT_EQ(loop.state.filter.task, LockInFilter<double>::tasks);
        }
    }
}

}  // namespace
}  // namespace fracgyro::testing
