#include "factors.hpp"
#include "joint.hpp"
#include "scalars.hpp"

#include <cmath>
#include <complex>
#include <random>

namespace fracgyro::testing {
namespace {

constexpr std::size_t size = 11;
using Square = fracgyro::Matrix<size>;

template <class T>
class JointOf : public ::testing::Test {};
TYPED_TEST_SUITE(JointOf, Scalars, ScalarNames);

// P - P rᵀ (r P rᵀ + noise)⁻¹ r P, and the gain.
template <std::size_t Count>
std::array<double, Count> measure(fracgyro::Matrix<Count>& p, const std::array<double, Count>& row, double noise) {
    std::array<double, Count> gain{};
    double variance = noise;
    for (std::size_t i = 0; i < Count; ++i) {
        for (std::size_t j = 0; j < Count; ++j) {
            gain[i] += p[i][j] * row[j];
        }
        variance += row[i] * gain[i];
    }
    const auto through = gain;
    for (double& k : gain) {
        k /= variance;
    }
    for (std::size_t i = 0; i < Count; ++i) {
        for (std::size_t j = 0; j < Count; ++j) {
            p[i][j] -= gain[i] * through[j];
        }
    }
    return gain;
}

TYPED_TEST(JointOf, TheFactorsAreThoseOfTheCovariance) {
    using T = TypeParam;
    using Factored = FactoredCovariance<T, 5>;
    std::mt19937 random(5);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    typename Factored::State state{};
    fracgyro::Matrix<5> p{};
    for (std::size_t i = 0; i < 5; ++i) {
        state.d_factor[i] = T(2.0);
        p[i][i] = 2.0;
    }
    const double tolerance = 500.0 * epsilon<T>;
    for (int n = 0; n < 60; ++n) {
        const std::array<double, 3> row{uniform(random), uniform(random), uniform(random)};
        const double noise = 0.1 + std::abs(uniform(random)), more = std::abs(uniform(random));
        const auto found = Factored::measure(state, std::array{T(row[0]), T(row[1]), T(row[2])}, T(noise));
        double variance = noise;
        for (std::size_t i = 0; i < 3; ++i) {
            for (std::size_t j = 0; j < 3; ++j) {
                variance += row[i] * p[i][j] * row[j];
            }
        }
        const auto gain = measure<5>(p, {row[0], row[1], row[2], 0.0, 0.0}, noise);
        EXPECT_NEAR(number(found.variance), variance, tolerance * variance);
        for (std::size_t i = 0; i < 5; ++i) {
            EXPECT_NEAR(number(found.move[i]), gain[i], tolerance);
        }
        const std::size_t grows = static_cast<std::size_t>(n) % 5;
        Factored::add(state, grows, T(more));
        p[grows][grows] += more;
        const auto now = product_of_factors<5>(state);
        for (std::size_t i = 0; i < 5; ++i) {
            EXPECT_NEAR(number(Factored::variance(state, i)), p[i][i], tolerance * 5);
            for (std::size_t j = 0; j < 5; ++j) {
                EXPECT_NEAR(now[i][j], p[i][j], tolerance * 5) << n;
            }
        }
    }
}

// The extended Kalman filter as it stands in textbooks: dense, the map by the matrix exponential at the estimates, its
// derivatives by differences.
struct Textbook {
    Case a;
    std::array<double, size> x{};  // q, v, then Ωz, D, K
    Square p{};

    Textbook(const Case& from, const Motion<double>& first, bool velocities) : a(from) {
        const PlantModel<double>& m = a.common.nominal;
        x = {first.position.x(),
             first.position.y(),
             0.0,
             0.0,
             m.rate,
             m.damping.xx(),
             m.damping.xy(),
             m.damping.yy(),
             m.stiffness.xx(),
             m.stiffness.xy(),
             m.stiffness.yy()};
        p[0][0] = p[1][1] = a.position_noise * a.position_noise;
        p[2][2] = p[3][3] = 1.0135 * 1.0135;
        if (velocities) {
            x[2] = first.velocity.x(), x[3] = first.velocity.y();
            p[2][2] = p[3][3] = a.velocity_noise * a.velocity_noise;
        }
        const double k = 0.5 * (m.stiffness.xx() + m.stiffness.yy());
        for (std::size_t i = 4; i < size; ++i) {
            p[i][i] = 0.05 * 0.05 * k * (i < 8 ? 1.0 : k);
        }
    }
    std::array<double, 4> flow(const std::array<double, size>& at, const Vec2<double>& u) const {
        GyroscopeParams plant{.damping = {at[5], at[6], at[7]}, .stiffness = {at[8], at[9], at[10]}, .rate = at[4]};
        Motion<double> m{.position = {at[0], at[1]}, .velocity = {at[2], at[3]}};
        Gyroscope<double>::step(m, Gyroscope<double>::prepare(plant, a.common.step), u);
        return {m.position.x(), m.position.y(), m.velocity.x(), m.velocity.y()};
    }
    void predict(const Vec2<double>& u) {
        Square f{};
        for (std::size_t j = 0; j < size; ++j) {
            f[j][j] = j < 4 ? 0.0 : 1.0;
            auto up = x, down = x;
            up[j] += 1e-5, down[j] -= 1e-5;
            const auto above = flow(up, u), below = flow(down, u);
            for (std::size_t i = 0; i < 4; ++i) {
                f[i][j] += (above[i] - below[i]) / 2e-5;
            }
        }
        const auto next = flow(x, u);
        std::copy(next.begin(), next.end(), x.begin());
        Square transposed{};
        for (std::size_t i = 0; i < size; ++i) {
            for (std::size_t j = 0; j < size; ++j) {
                transposed[i][j] = f[j][i];
            }
        }
        p = product(product(f, p), transposed);
        const double h = a.common.step, q = a.force_noise * a.force_noise;
        for (std::size_t i = 0; i < 2; ++i) {
            p[i][i] += q * h * h * h * h / 4.0;
            p[i][i + 2] += q * h * h * h / 2.0;
            p[i + 2][i] += q * h * h * h / 2.0;
            p[i + 2][i + 2] += q * h * h;
        }
    }
    void correct(const Motion<double>& seen, bool velocities) {
        const std::array<double, 4> y{seen.position.x(), seen.position.y(), seen.velocity.x(), seen.velocity.y()};
        for (std::size_t i = 0; i < (velocities ? 4 : 2); ++i) {
            const double noise = i < 2 ? a.position_noise : a.velocity_noise, miss = y[i] - x[i];
            std::array<double, size> row{};
            row[i] = 1.0;
            const auto gain = measure<size>(p, row, noise * noise);
            for (std::size_t j = 0; j < size; ++j) {
                x[j] += gain[j] * miss;
            }
        }
    }
};

template <class C>
void expect_that_of_textbooks(bool velocities) {
    Case a;
    Loop<C> loop(a);
    loop.step();
    Textbook book(a, loop.seen, velocities);
    for (int n = 1; n < 1500; ++n) {
        book.predict(loop.signals.force);
        loop.step();
        book.correct(loop.seen, velocities);
        if (n % 100 == 0) {
            const auto report = C::report(loop.state, loop.c);
            // The report is that before the force was computed: after this correction.
            const std::array<double, 7> found{report.rate,          report.damping.xx(),   report.damping.xy(),
                                              report.damping.yy(),  report.stiffness.xx(), report.stiffness.xy(),
                                              report.stiffness.yy()};
            for (std::size_t i = 0; i < 7; ++i) {
                const double deviation = std::sqrt(book.p[4 + i][4 + i]);
                EXPECT_NEAR(found[i], book.x[4 + i], 0.2 * deviation) << n << " " << i;
            }
            if (!velocities) {  // else it is what was measured
                const Motion<double> known{.position = {book.x[0], book.x[1]}, .velocity = {book.x[2], book.x[3]}};
                EXPECT_NEAR(loop.signals.reference.position.x() + loop.signals.error.value.x(), known.position.x(),
                            0.2 * std::sqrt(book.p[0][0]));
                EXPECT_NEAR(loop.signals.reference.velocity.y() + loop.signals.error.derivative.y(), known.velocity.y(),
                            0.2 * std::sqrt(book.p[3][3]));
            }
            EXPECT_NEAR(loop.deviation(), std::sqrt(book.p[4][4]), 0.06 * std::sqrt(book.p[4][4])) << n;
        }
    }
}

TEST(Joint, ItIsTheFilterOfTextbooks) {
    expect_that_of_textbooks<Positions<double>>(false);
    expect_that_of_textbooks<Both<double>>(true);
}

TEST(Joint, ItsDeviationIsThatOfItsErrors) {
    double squares = 0.0, deviation = 0.0;
    for (std::uint64_t seed = 0; seed < 24; ++seed) {
        Case a;
        Loop<Positions<double>> loop(a, seed);
        loop.run(12000);
        const double error = (loop.rate() - a.plant.rate) / loop.deviation();
        squares += error * error / 24.0;
        deviation = loop.deviation();
        EXPECT_EQ(loop.trusted(), 1.0);
    }
    EXPECT_GT(squares, 0.45);  // of χ² with 24 degrees of freedom over 24: beyond these once in 10,000
    EXPECT_LT(squares, 2.0);
    EXPECT_LT(deviation, 3e-6);
}

TYPED_TEST(JointOf, SinglePrecisionLosesNothing) {
    using T = TypeParam;
    Case a;
    Loop<Positions<double>> exact(a);
    Loop<Positions<T>> loop(a);
    exact.run(20000);
    loop.run(20000);
    EXPECT_NEAR(loop.rate(), exact.rate(), 0.2 * exact.deviation());
    EXPECT_NEAR(loop.deviation(), exact.deviation(), 0.02 * exact.deviation());
}

TEST(Joint, TheWorkOnTheCovarianceMayBeDivided) {
    Case a;
    Loop<Positions<double>> each(a);
    each.run(16000);
    for (const std::int64_t slots : {2, 3, 4, 5, 8}) {
        a.law.adaptation.covariance_steps = slots;
        Loop<Positions<double>> loop(a);
        loop.run(16000);
        EXPECT_NEAR(loop.rate(), each.rate(), 0.12 * static_cast<double>(slots) * each.deviation()) << slots;
        EXPECT_NEAR(loop.deviation(), each.deviation(), 0.1 * each.deviation()) << slots;
    }
}

TEST(Joint, TheVelocityThatItIsHandedChangesNothing) {
    Case a;
    Loop<Positions<double>> one(a), other(a);
    for (int n = 0; n < 100; ++n) {
        one.step();
        other.step([&](Motion<double>& seen) { seen.velocity = {1e9 * n, std::nan("")}; });
    }
    EXPECT_EQ(one.signals.force, other.signals.force);
    EXPECT_EQ(one.rate(), other.rate());
}

TEST(Joint, ItKnowsOfADelayThatItIsToldOf) {
    Case a;
    a.delay = 3;
    a.plant.stiffness = {1.0, 0.01, 1.027};  // in quadrature, which a late force makes a rate of
    a.law.datasheet.delay = 3;
    Loop<Positions<double>> knows(a);
    knows.run(16000);
    EXPECT_NEAR(knows.rate(), a.plant.rate, 5.0 * knows.deviation());
    a.law.datasheet.delay = 0;
    Loop<Positions<double>> does_not(a);
    does_not.run(16000);
    EXPECT_GT(std::abs(does_not.rate() - a.plant.rate), 20.0 * knows.deviation());
}

TEST(Joint, OneSampleFarOffSpoilsNothingAndALastingMoveIsLearnt) {
    Case a;
    Loop<Positions<double>> calm(a), hit(a);
    calm.run(8000);
    hit.run(8000);
    hit.step([](Motion<double>& seen) { seen.position = {5.0, seen.position.y()}; });
    calm.step();
    EXPECT_EQ(hit.trusted(), 0.0);
    EXPECT_NEAR(hit.signals.error.value.x(), calm.signals.error.value.x(), 3.0 * a.position_noise);
    calm.run(200);
    hit.run(200);
    EXPECT_EQ(hit.trusted(), 1.0);
    EXPECT_NEAR(hit.rate(), calm.rate(), 0.1 * calm.deviation());

    hit.motion.position = {hit.motion.position.x() + 0.1, hit.motion.position.y()};
    hit.run(2);
    EXPECT_LT(std::abs(hit.signals.error.value.x()), 5e-5);
    hit.run(1);  // the third in a row
    EXPECT_GT(std::abs(hit.signals.error.value.x()), 1e-4);
}

TEST(Joint, WithoutSamplesItGoesOnFromWhatItKnows) {
    Case a;
    Loop<Positions<double>> loop(a);
    loop.run(10000);
    const double deviation = loop.deviation();
    for (int n = 0; n < 10; ++n) {
        const Motion<double> truth = loop.motion;
        loop.step({}, true);
        expect_near(loop.signals.reference.position + loop.signals.error.value, truth.position, 1e-5);
    }
    EXPECT_GE(loop.deviation(), 0.999 * deviation);
    loop.run(4000);
    EXPECT_NEAR(loop.rate(), a.plant.rate, 5.0 * loop.deviation());
    EXPECT_LT(loop.deviation(), deviation);
}

TEST(Joint, ItStartsOverWithOrWithoutWhatItLearnt) {
    Case a;
    Loop<Positions<double>> loop(a);
    loop.run(10000);
    const double rate = loop.rate(), deviation = loop.deviation();
    auto forgets = loop;
    Positions<double>::start_over(loop.state, true);
    Positions<double>::start_over(forgets.state, false);
    EXPECT_EQ(loop.rate(), rate);
    EXPECT_EQ(forgets.rate(), 0.0);
    EXPECT_EQ(forgets.trusted(), 0.0);
    loop.step();
    forgets.step();
    EXPECT_NEAR(loop.deviation(), deviation, 0.02 * deviation);
    EXPECT_GT(forgets.deviation(), 0.02);
    loop.run(3000);
    forgets.run(10000);
    EXPECT_NEAR(loop.rate(), a.plant.rate, 5.0 * loop.deviation());
    EXPECT_NEAR(forgets.rate(), a.plant.rate, 5.0 * forgets.deviation());
}

TEST(Joint, TheRateIsTrustedOnlyWhereTheMotionTellsIt) {
    Case a;
    Loop<Positions<double>> loop(a);
    EXPECT_EQ(loop.trusted(), 0.0);
    loop.run(10);
    EXPECT_EQ(loop.trusted(), 0.0);
    loop.run(10000);
    EXPECT_EQ(loop.trusted(), 1.0);
    a.common.reference.amplitude = {0.0, 0.0};
    a.plant.initial_position = a.plant.initial_velocity = {};
    Loop<Positions<double>> still(a);
    still.run(10000);
    EXPECT_EQ(still.trusted(), 0.0);
}

// Amplitude of the estimate's answer to a rate that oscillates at the bandwidth asked for, over that of the rate.
template <class C>
double seen_at_the_corner(Case a, double bandwidth) {
    a.law.adaptation.rate_forgetting = bandwidth;
    Loop<C> still(a);
    still.run(20000);
    auto moved = still;  // with the same noise
    constexpr double size = 1e-4, pi = 3.141592653589793;
    constexpr int held = 20, periods = 3;
    const int period = static_cast<int>(std::round(2.0 * pi / bandwidth / a.common.step / held)) * held;
    const double mean = a.plant.rate;
    std::complex<double> sum{};
    for (int n = 0; n < (2 + periods) * period; ++n) {
        const double phase = 2.0 * pi * n / period;
        if (n % held == 0) {
            a.plant.rate = mean + size * std::sin(phase);
            moved.map = Gyroscope<double>::prepare(a.plant, a.common.step);
        }
        moved.step();
        still.step();
        if (n >= 2 * period) {
            sum += (moved.rate() - still.rate()) * std::polar(1.0, -phase);
        }
    }
    return 2.0 * std::abs(sum) / (periods * period) / size;
}

TEST(Joint, AMovingRateIsFollowedAsFastAsItIsAskedForWhateverTheSensorsNoise) {
    const double half_power = std::sqrt(0.5);
    EXPECT_NEAR(seen_at_the_corner<Both<double>>(finely_sensed(), 0.02), half_power, 0.02);
    EXPECT_NEAR(seen_at_the_corner<Positions<double>>(finely_sensed(), 0.02), half_power, 0.02);
    Case noisy;
    EXPECT_NEAR(seen_at_the_corner<Both<double>>(noisy, 0.02), half_power, 0.08);
    EXPECT_NEAR(seen_at_the_corner<Positions<double>>(noisy, 0.02), half_power, 0.08);
    EXPECT_NEAR(seen_at_the_corner<Positions<double>>(noisy, 0.005), half_power, 0.08);
    noisy.law.datasheet.position_noise = noisy.position_noise = 1e-4;
    EXPECT_NEAR(seen_at_the_corner<Positions<double>>(noisy, 0.02), half_power, 0.08);
}

TEST(Joint, WhatDriftsIsFollowed) {
    const Case a = finely_sensed();
    const auto error = [&](double forgetting) {
        Case drifting = a;
        drifting.law.adaptation.forgetting = forgetting;
        Loop<Positions<double>> loop(drifting);
        for (int n = 0; n < 20; ++n) {
            drifting.plant.stiffness = Sym2<double>{drifting.plant.stiffness.xx() - 1e-5, 0.002, 1.027};
            loop.map = Gyroscope<double>::prepare(drifting.plant, drifting.common.step);
            loop.run(1000);
        }
        return std::abs(number(Positions<double>::report(loop.state, loop.c).stiffness.xx()) -
                        drifting.plant.stiffness.xx());
    };
    EXPECT_LT(error(0.02), 0.2 * error(0.0));
}

TEST(Joint, WhatTheMotionDoesNotTellIsForgottenNoFurtherThanThePrior) {
    Case a;
    a.common.reference.amplitude = {1.0, 1e-6};
    a.plant.initial_position = {};
    a.law.adaptation.forgetting = 2.0;
    Loop<Positions<double>> loop(a);
    loop.run(3000);
    using Covariance = Loop<Positions<double>>::Filter::Covariance;
    const double variance = Covariance::variance(loop.state.adaptation.covariance, 10);  // of Kyy
    const double prior = loop.c.adaptation.filter.prior.plant[6];
    EXPECT_GT(variance, 0.5 * prior);
    EXPECT_LE(variance, prior);
}

TEST(Joint, AStateThatCannotBeIsFound) {
    Case a;
    a.law.adaptation.covariance_steps = 4;
    Loop<Positions<double>> loop(a);
    loop.run(10);
    EXPECT_TRUE(Positions<double>::sound(loop.state, loop.c));
    for (const std::int32_t slot : {-1, 4}) {
        auto other = loop.state;
        other.adaptation.slot = slot;
        EXPECT_FALSE(Positions<double>::sound(other, loop.c));
    }
    auto other = loop.state;
    reinterpret_cast<unsigned char&>(other.adaptation.started) = 7;
    EXPECT_FALSE(Positions<double>::sound(other, loop.c));
}

}  // namespace
}  // namespace fracgyro::testing
