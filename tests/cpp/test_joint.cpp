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

// The textbook extended Kalman filter: dense, the map by the matrix exponential at the estimates, its
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
            // The report precedes the force: it is the state after this correction.
            const std::array<double, 7> found{report.rate,          report.damping.xx(),   report.damping.xy(),
                                              report.damping.yy(),  report.stiffness.xx(), report.stiffness.xy(),
                                              report.stiffness.yy()};
            for (std::size_t i = 0; i < 7; ++i) {
                const double deviation = std::sqrt(book.p[4 + i][4 + i]);
                EXPECT_NEAR(found[i], book.x[4 + i], 0.2 * deviation) << n << " " << i;
            }
            if (!velocities) {  // else it is the measured value
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
        loop.run(20000);
        const double error = (loop.rate() - a.plant.rate) / loop.deviation();
        squares += error * error / 24.0;
        deviation = loop.deviation();
        EXPECT_EQ(loop.trusted(), 1.0);
    }
    EXPECT_GT(squares, 0.45);  // χ² with 24 degrees of freedom, over 24: outside these limits once in 10,000
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
    each.run(24000);
    for (const std::int64_t slots : {2, 3, 4, 5, 8}) {
        a.law.adaptation.covariance_steps = slots;
        Loop<Positions<double>> loop(a);
        loop.run(24000);
        EXPECT_NEAR(loop.rate(), each.rate(), 0.2 * static_cast<double>(slots) * each.deviation()) << slots;
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

TEST(Joint, OneSampleFarOffSpoilsNothingAndALastingMoveIsLearned) {
    Case a;
    Loop<Positions<double>> calm(a), hit(a);
    calm.run(20000);
    hit.run(20000);
    hit.step([](Motion<double>& seen) { seen.position = {5.0, seen.position.y()}; });
    calm.step();
    EXPECT_EQ(hit.trusted(), 1.0);
    EXPECT_EQ(hit.refused(), 1.0);
    EXPECT_NEAR(hit.signals.error.value.x(), calm.signals.error.value.x(), 3.0 * a.position_noise);
    calm.run(200);
    hit.run(200);
    EXPECT_EQ(hit.trusted(), 1.0);
    EXPECT_EQ(hit.refused(), 0.0);
    EXPECT_NEAR(hit.rate(), calm.rate(), 0.1 * calm.deviation());

    hit.motion.position = {hit.motion.position.x() + 0.1, hit.motion.position.y()};
    hit.run(3);
    EXPECT_LT(std::abs(hit.signals.error.value.x()), 5e-5);
    EXPECT_EQ(hit.trusted(), 0.0);  // the third in a row
    hit.run(1);
    EXPECT_NEAR(hit.signals.error.value.x(), 0.1, 0.05);
}

// Exact sensors move positions and velocities together: each residual is conditioned on the earlier ones.
TEST(Joint, ExactSensorsAgreeWithTheModelFromTheFirstSampleOn) {
    Case a;
    a.common.nominal.stiffness = {1.05, 0.0, 1.0};  // 5 % off, which innovations show at first
    a.position_noise = a.velocity_noise = 0.0;
    a.law.datasheet.position_noise = a.law.datasheet.velocity_noise = 0.0;
    const auto doubts = [](auto loop) {
        int count = 0;
        for (int n = 0; n < 30000; ++n) {
            loop.step();
            count += loop.state.adaptation.agreement.doubted > 0.5;
        }
        EXPECT_EQ(loop.trusted(), 1.0);
        return count;
    };
    EXPECT_EQ(doubts(Loop<Both<double>>(a)), 0);
    EXPECT_EQ(doubts(Loop<Positions<double>>(a)), 0);
}

// Rounding of exact numbers is not a disagreement, and the longest window ends.
TEST(Joint, RoundingToSinglePrecisionIsNoise) {
    Case a;
    a.common.step = 0.003;  // two thousand to a period: each step moves little more than rounding
    a.position_noise = a.velocity_noise = 0.0;
    a.law.datasheet.position_noise = a.law.datasheet.velocity_noise = 0.0;
    const auto right = [&](auto loop) {
        loop.run(60000);
        EXPECT_EQ(number(loop.state.adaptation.agreement.doubted), 0.0);
        EXPECT_EQ(loop.trusted(), 1.0);
        EXPECT_LT(std::abs(loop.rate() - a.plant.rate), 4.0 * loop.deviation());
    };
    right(Loop<Both<float>>(a));
    right(Loop<Positions<float>>(a));
}

// Steps from the end of a fault until the rate is trusted again; during and after it a trusted rate is correct.
template <class C>
int recovered(Loop<C> loop, int samples, const std::function<void(Motion<double>&)>& fault, double rate) {
    int wrong = 0, steps = 0;
    const auto look = [&] { wrong += loop.trusted() > 0.5 && std::abs(loop.rate() - rate) > 4.0 * loop.deviation(); };
    for (int n = 0; n < samples; ++n) {
        loop.step(fault);
        look();
    }
    while (steps < 20000 && (steps == 0 || loop.trusted() < 0.5)) {
        loop.step();
        look();
        ++steps;
    }
    for (int n = 0; n < 4000; ++n) {
        loop.step();
        look();
    }
    EXPECT_EQ(wrong, 0);
    EXPECT_EQ(loop.trusted(), 1.0);
    return steps;
}

TEST(Joint, AfterAFaultOfASensorItFindsBackAndIsNeverTrustedWhileWrong) {
    const auto scaled = [](double x, double y) {
        return [x, y](Motion<double>& seen) {
            const Vec2<double> by{x, y};
            seen = {.position = by * seen.position, .velocity = by * seen.velocity};
        };
    };
    const Case a;
    Loop<Positions<double>> loop(a);
    Loop<Both<double>> both(a);
    loop.run(20000);
    both.run(20000);
    const auto offset = [](Motion<double>& seen) { seen.position = seen.position + Vec2<double>{0.01, 0.0}; };
    for (const int samples : {20, 2000}) {
        for (const auto& fault : {std::function<void(Motion<double>&)>(scaled(1.0, -1.0)),
                                  {scaled(1.01, 1.0)},
                                  {scaled(0.0, 1.0)},
                                  {offset}}) {
            EXPECT_LT(recovered(loop, samples, fault, a.plant.rate), 12000) << samples;
            EXPECT_LT(recovered(both, samples, fault, a.plant.rate), 12000) << samples;
        }
    }
}

TEST(Joint, APlantThatHasChangedIsAcceptedInTheEnd) {
    Case a;
    Loop<Positions<double>> loop(a);
    loop.run(20000);
    a.plant.damping = {4e-4, 5e-5, 2e-3};
    loop.map = Gyroscope<double>::prepare(a.plant, a.common.step);
    loop.motion.position = loop.motion.position + Vec2<double>{0.01, 0.0};  // with a jolt
    loop.run(40000);
    EXPECT_EQ(loop.trusted(), 0.0);
    loop.run(110000);
    EXPECT_EQ(loop.trusted(), 1.0);
    EXPECT_NEAR(loop.rate(), a.plant.rate, 4.0 * loop.deviation());
}

// Shares of samples within four stated deviations or not trusted, and of trusted samples, from the start of a turn.
template <class C>
std::array<double, 2> in_a_turn(Case a, int first, double size, double frequency) {
    Loop<C> loop(a);
    const double mean = a.plant.rate;
    const int samples = std::max(50000, static_cast<int>(8.0 / (frequency * a.common.step)));
    double within = 0.0, trusted = 0.0;
    for (int n = 0; n < first + samples; ++n) {
        if (n % 10 == 0) {
            a.plant.rate = mean + (n < first ? 0.0 : size * std::sin(frequency * a.common.step * (n - first)));
            loop.map = Gyroscope<double>::prepare(a.plant, a.common.step);
        }
        loop.step();
        if (n >= first) {
            trusted += loop.trusted() / samples;
            const bool right = std::abs(loop.rate() - a.plant.rate) < 4.0 * loop.deviation();
            within += (right || loop.trusted() < 0.5) / static_cast<double>(samples);
        }
    }
    return {within, trusted};
}

TEST(Joint, ARateThatTurnsIsTrustedAndItsDeviationSaysHowFarItLags) {
    Case a;
    a.law.adaptation.rate_forgetting = 0.02;
    for (const double size : {1e-5, 2e-4}) {
        for (const double frequency : {0.001, 0.005, 0.02}) {
            const auto [within, trusted] = in_a_turn<Positions<double>>(a, 20000, size, frequency);
            EXPECT_GT(within, 0.97) << size << " " << frequency;
            EXPECT_GT(trusted, 0.95) << size << " " << frequency;
        }
    }
}

// 1 Hz and 300 deg/s of the dual mass, which moves K by more than it is uncertain.
TEST(Joint, ATurnThatBeginsAtOnceIsNotAChangeOfThePlant) {
    Case a;
    a.plant.damping = {2.14e-4, 0.0, 2.26e-3};
    a.plant.stiffness = {1.0, 0.0, 1.0272};
    a.plant.rate = 0.0;
    a.law.adaptation.rate_forgetting = 0.0255;
    a.law.datasheet.stiffness_drift = 4e-10;
    a.law.datasheet.damping_drift = 4e-9;
    const auto [within, trusted] = in_a_turn<Positions<double>>(a, 100000, 2.12e-4, 2.55e-4);
    EXPECT_GT(within, 0.99);
    EXPECT_GT(trusted, 0.95);
}

// 4 Hz and 300 deg/s of the disc, whose lag moves D and K by up to 80 deviations if they are learned in it.
TEST(Joint, ADeviceThatTurnsFromItsFirstSampleOnLearnsNoStiffnessFromIt) {
    Case a;
    a.plant.damping = {5e-7, 0.0, 5e-7};
    a.plant.stiffness = {1.0, 0.0, 1.0};
    a.plant.rate = 0.0;
    a.common.nominal = {.damping = 0.999 * a.plant.damping, .stiffness = 0.999 * a.plant.stiffness};
    a.common.reference.frequency = {1.0, 1.005};
    a.law.adaptation.rate_forgetting = 0.01;
    a.law.datasheet.force_noise = a.force_noise = 1e-8;
    a.law.datasheet.stiffness_drift = 1.6e-10;
    a.law.datasheet.damping_drift = 1.6e-9;
    const auto [within, trusted] = in_a_turn<Positions<double>>(a, 0, 8.3e-5, 4e-4);
    EXPECT_GT(within, 0.99);
    EXPECT_GT(trusted, 0.95);
}

// The deviation covers everything, since ε explains only part of a rate beyond the bandwidth.
TEST(Joint, TheDeviationStatesWhatIsNotExplainedToo) {
    using Judged = Consistency<double, 2>;
    const auto c = Judged::prepare(1.0, 0.01, 2, 8.0, 0.0, 1e4);  // windows of 400 samples
    Judged::State state{};
    state.sensitivity = 4.0;
    EXPECT_EQ(Judged::variance(state, c, 1e-3), 1e-3);
    state.squares = 1.25;  // noise
    EXPECT_EQ(Judged::variance(state, c, 1e-3), 1.25e-3);
    state.squares = 101.25;
    EXPECT_NEAR(Judged::variance(state, c, 1e-3), 101.25e-3 + 2.0 * 100.0 / 4.0, 1e-12);
    state.now = 60.0;  // explained, and so no excess
    EXPECT_NEAR(Judged::variance(state, c, 1e-3), 41.25e-3 + 2.0 * 100.0 / 4.0, 1e-12);
    EXPECT_NEAR(Judged::lag_variance(state, c), 2.0 * 60.0 / 4.0, 0.01);
    state.squares = 61.0, state.now = 0.0, state.explained = 80.0;  // in the mean
    EXPECT_NEAR(Judged::lag_variance(state, c), 2.0 * 80.0 / 4.0, 0.01);
    EXPECT_NEAR(Judged::variance(state, c, 1e-3), 61e-3 + 2.0 * 80.0 / 4.0, 0.01);
}

// Counts and means of the consistency test restart, only in the affected lanes.
TEST(Joint, ADisagreementForgetsWhatWasJudged) {
    using Judged = Consistency<double, 2>;
    Judged::State state{};
    const auto fill = [&] {
        state.squares = state.along = state.now = state.explained = state.lasting = state.moved = state.most = 7.0;
        state.beyond = state.inconsistent = state.learning = state.agreed = 7.0;
        state.doubted = 0.0;
    };
    fill();
    Judged::doubt(state, 0.0);
    for (const double kept : {state.squares, state.along, state.now, state.explained, state.lasting, state.moved,
                              state.most, state.beyond, state.inconsistent, state.learning, state.agreed}) {
        EXPECT_EQ(kept, 7.0);
    }
    EXPECT_EQ(state.doubted, 0.0);
    Judged::doubt(state, 1.0);
    for (const double gone : {state.along, state.now, state.explained, state.lasting, state.moved, state.most,
                              state.beyond, state.inconsistent, state.learning, state.agreed}) {
        EXPECT_EQ(gone, 0.0);
    }
    EXPECT_EQ(state.squares, 1.0);
    EXPECT_EQ(state.doubted, 1.0);
}

// Several steps per span: gains scheduled for later in the span were computed from the discarded covariance.
TEST(Joint, ADisagreementForgetsWhatWasForeseen) {
    Case a;
    a.law.adaptation.covariance_steps = 16;
    Loop<Positions<double>> loop(a);
    loop.run(16000);
    const auto& filter = loop.state.adaptation;
    double before = 0.0;
    do {
        EXPECT_GT(filter.precision[0], 0.0);
        before = filter.agreement.learning;
        loop.step([](Motion<double>& seen) { seen.position = {5.0, seen.position.y()}; });
    } while (filter.agreement.learning > before);
    ASSERT_GT(filter.slot, 0);
    for (std::size_t i = 0; i < filter.precision.size(); ++i) {
        EXPECT_EQ(filter.precision[i], 0.0);
        EXPECT_LT(std::abs(filter.sum[i]), 10.0);  // the residual of this sample
    }
    for (const auto& gain : filter.gain) {
        for (const double k : gain.move) {
            EXPECT_EQ(k, 0.0);
        }
    }
}

TEST(Joint, WithoutSamplesStiffnessDriftsOnAndIsLessCertain) {
    Case a;
    a.common.nominal.stiffness = {1.001, 0.5, 1.026};
    a.law.datasheet.stiffness_drift = 1e-9;
    a.law.datasheet.damping_drift = 1e-8;
    Loop<Positions<double>> loop(a);
    loop.run(16000);
    using Filter = Loop<Positions<double>>::Filter;
    const auto& c = loop.c.adaptation.filter;
    auto& filter = loop.state.adaptation;
    constexpr std::size_t slope = Filter::parameters - 1;
    const int steps = static_cast<int>(8 * c.walking * 10);
    filter.plant[slope] = 1e-6;
    filter.agreement.doubted = 1.0;
    filter.agreement.before.value[slope] = 1e-6;
    const auto plant = filter.plant;
    const auto p = [&](std::size_t k) { return Filter::Covariance::variance(filter.covariance, Filter::motions + k); };
    std::array<double, Filter::parameters> variance{};
    for (std::size_t k = 0; k < variance.size(); ++k) {
        variance[k] = p(k);
    }
    for (int n = 0; n < steps; ++n) {
        Filter::predict(filter, c, {}, {}, false);
    }
    for (std::size_t i = 0; i < 3; ++i) {
        const double moves = 1e-6 * steps * a.common.step * std::array{1.001, 0.5, 1.026}[i];
        EXPECT_NEAR(filter.plant[4 + i] - plant[4 + i], moves, 1e-9 * moves);
        EXPECT_EQ(filter.plant[1 + i], plant[1 + i]);
    }
    for (const std::size_t k : {1, 3}) {  // damping does not follow the drift of the stiffness
        EXPECT_NEAR(p(k) - variance[k], steps * c.drift[k], 0.01 * steps * c.drift[k]);
    }
    const auto before = filter.agreement.before.value;
    loop.step();
    for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_NEAR(filter.agreement.before.value[4 + i] - before[4 + i], 1e-6 * c.ramp[i], 1e-12);
    }
}

TEST(Joint, AMotionThatWasLostIsFoundWithTheEstimatesBefore) {
    Case a;
    Loop<Positions<double>> loop(a);
    loop.run(40000);
    auto& filter = loop.state.adaptation;
    const auto before = filter.agreement.before.value;
    ASSERT_NE(before[1], 0.0);
    filter.plant[1] = 0.01;
    Loop<Positions<double>>::Filter::start_over(filter, true);
    EXPECT_EQ(loop.trusted(), 1.0);
    Loop<Positions<double>>::Filter::predict(filter, loop.c.adaptation.filter, {}, {}, false);
    EXPECT_EQ(filter.agreement.doubted, 1.0);
    EXPECT_EQ(filter.agreement.learning, 0.0);
    EXPECT_EQ(loop.trusted(), 0.0);
    loop.step();
    EXPECT_EQ(filter.plant[1], before[1]);
}

// The motion is as unknown as at the start, and the estimates of the plant stay.
TEST(Joint, ASampleThatShowsALateForceMakesTheMotionUnknown) {
    Loop<Both<double>> loop(finely_sensed());
    loop.run(2000);
    using Filter = Loop<Both<double>>::Filter;
    const auto& c = loop.c.adaptation.filter;
    auto& filter = loop.state.adaptation;
    const auto before = filter.covariance;
    const Vec2<double> change{0.01, -0.01};
    filter.change = change;
    ReferencePoint<double> r{};
    const Motion<double> late{.position = filter.error.value + c.half_square * change,
                              .velocity = filter.error.derivative + c.span * change};
    Filter::correct(filter, c, late, r);
    ASSERT_EQ(filter.agreement.delay.lost, 1.0);
    for (std::size_t j = 1; j < Filter::size; ++j) {
        for (std::size_t i = 0; i < j; ++i) {
            const std::size_t at = Filter::Covariance::column(j) + i;
            ASSERT_NE(before.u_factor[at], 0.0);
            EXPECT_EQ(filter.covariance.u_factor[at], i < Filter::motions ? 0.0 : before.u_factor[at]) << i << " " << j;
        }
    }
    for (std::size_t i = 0; i < Filter::size; ++i) {
        EXPECT_EQ(filter.covariance.d_factor[i], i < Filter::motions ? c.prior.unknown[i] : before.d_factor[i]) << i;
    }
}

// RMS tracking error, geometric mean of the axes, over whole runs with some seeds.
template <class C>
double tracking_error_of(const Case& a, bool judged) {
    constexpr int steps = 8000, seeds = 4;
    Vec2<double> squares{};
    for (std::uint64_t seed = 0; seed < seeds; ++seed) {
        Loop<C> loop(a, seed);
        if (!judged) {
            loop.c.adaptation.filter.consistency.limit = 1e30;
        }
        for (int n = 0; n < steps; ++n) {
            const Vec2<double> at = loop.motion.position;
            loop.step();
            const auto& r = loop.signals.reference;
            const Vec2<double> e = at - Vec2<double>{r.position.x(), r.position.y()};
            squares = squares + e * e;
        }
    }
    return std::sqrt(std::sqrt(squares.x() * squares.y()) / (seeds * steps));
}

// With noisy sensors the delay does not show in single samples, and both are alike.
TEST(Joint, AHiddenDelayCostsNoMoreThanWithoutRefusals) {
    Case exact = finely_sensed();
    exact.position_noise = exact.velocity_noise = 0.0;
    exact.law.datasheet.position_noise = exact.law.datasheet.velocity_noise = 0.0;
    for (Case a : {Case(), finely_sensed(), exact}) {
        a.delay = 1;
        EXPECT_LT(tracking_error_of<Both<double>>(a, true), 1.05 * tracking_error_of<Both<double>>(a, false));
        EXPECT_LT(tracking_error_of<Positions<double>>(a, true), 1.05 * tracking_error_of<Positions<double>>(a, false));
    }
}

TEST(Joint, AHiddenDelayOfExactSensorsCostsNoMoreThanAKnownOneAndIsNotTrusted) {
    Case a = finely_sensed();
    a.delay = 1;
    Loop<Both<double>> loop(a);
    loop.run(20000);
    EXPECT_GT(loop.state.adaptation.agreement.delay.late, 0.0);
    EXPECT_EQ(loop.trusted(), 0.0);
    EXPECT_LT(std::abs(loop.rate() - a.plant.rate), 4.0 * loop.deviation());
    const double hidden = tracking_error_of<Both<double>>(a, true);
    a.law.datasheet.delay = 1;
    EXPECT_LT(hidden, 1.1 * tracking_error_of<Both<double>>(a, true));
}

// The forces within a span are independent, which an exact sensor shows.
template <class C>
void expect_agreement(std::int64_t slots) {
    Case a = finely_sensed();
    a.position_noise = a.velocity_noise = 0.0;
    a.law.datasheet.position_noise = a.law.datasheet.velocity_noise = 0.0;
    a.law.adaptation.covariance_steps = slots;
    Loop<C> loop(a);
    loop.run(8000);
    double refused = 0.0;
    for (int n = 0; n < 4000; ++n) {
        loop.step();
        refused += loop.refused();
    }
    EXPECT_EQ(refused, 0.0) << slots;
    EXPECT_LT(number(loop.state.adaptation.agreement.squares), 1.25) << slots;
}

TEST(Joint, ExactSensorsAgreeWithDividedWork) {
    expect_agreement<Both<double>>(2);
    expect_agreement<Positions<double>>(4);
    expect_agreement<Positions<double>>(8);
}

// After each restart its estimate is useless for a while.
TEST(Joint, AModelThatStaysWrongIsLearnedAgainSeldom) {
    Case a;
    a.delay = 1;
    a.law.adaptation.rate_forgetting = 0.0255;
    a.law.datasheet.stiffness_drift = 4e-10;
    a.law.datasheet.damping_drift = 4e-9;
    Loop<Positions<double>> loop(a);
    int begun = 0;
    double largest = 0.0, trusted = 0.0;
    for (int n = 0; n < 200000; ++n) {
        const double before = loop.state.adaptation.agreement.learning;
        loop.step();
        begun += loop.state.adaptation.agreement.learning < before;
        if (n >= 100000) {
            largest = std::max(largest, std::abs(loop.rate() - a.plant.rate));
            trusted += loop.trusted();
        }
    }
    EXPECT_GE(begun, 1);
    EXPECT_LE(begun, 2);
    EXPECT_LT(largest, 0.1 * a.plant.rate);
    EXPECT_EQ(trusted, 0.0);
}

TEST(Joint, AStiffnessThatDriftsAsTheDatasheetSaysIsNoRate) {
    const auto rms = [](double said) {
        Case a;
        a.law.adaptation.rate_forgetting = 0.02;
        a.law.datasheet.stiffness_drift = said;
        Loop<Positions<double>> loop(a);
        double squares = 0.0;
        int wrong = 0;
        for (int n = 0; n < 60000; ++n) {
            if (n % 10 == 0) {  // both axes alike
                GyroscopeParams plant = a.plant;
                plant.stiffness = (1.0 - 1e-9 * a.common.step * n) * a.plant.stiffness;
                loop.map = Gyroscope<double>::prepare(plant, a.common.step);
            }
            loop.step();
            const double error = std::abs(loop.rate() - a.plant.rate);
            squares += n < 20000 ? 0.0 : error * error / 40000.0;
            wrong += n >= 20000 && loop.trusted() > 0.5 && error > 4.0 * loop.deviation();
        }
        EXPECT_TRUE(said == 0.0 || wrong < 400) << wrong;
        return std::sqrt(squares);
    };
    EXPECT_LT(rms(1e-9), 0.1 * rms(0.0));
}

TEST(Joint, ItIsNeverTrustedWithWhatIsNoNumber) {
    Case a;
    Loop<Positions<double>> loop(a);
    loop.run(20000);
    ASSERT_EQ(loop.trusted(), 1.0);
    auto other = loop;
    other.state.adaptation.covariance.d_factor[4] = std::nan("");
    EXPECT_EQ(other.trusted(), 0.0);
    other = loop;
    other.state.adaptation.agreement.squares = std::nan("");
    other.run(10);
    EXPECT_EQ(other.trusted(), 0.0);
}

TEST(Joint, WithoutSamplesItGoesOnFromWhatItKnows) {
    Case a;
    Loop<Positions<double>> loop(a);
    loop.run(20000);
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
    loop.run(20000);
    const double rate = loop.rate(), deviation = loop.deviation();
    auto forgets = loop;
    Positions<double>::start_over(loop.state, true);
    Positions<double>::start_over(forgets.state, false);
    EXPECT_EQ(loop.rate(), rate);
    EXPECT_EQ(forgets.rate(), 0.0);
    EXPECT_EQ(forgets.trusted(), 0.0);
    loop.step();
    forgets.step();
    EXPECT_NEAR(loop.rate(), rate, 4.0 * deviation);
    EXPECT_EQ(loop.trusted(), 0.0);
    EXPECT_GT(loop.deviation(), 0.02);
    EXPECT_GT(forgets.deviation(), 0.02);
    loop.run(20000);
    forgets.run(20000);
    EXPECT_EQ(loop.trusted(), 1.0);
    EXPECT_LT(loop.deviation(), 2.0 * deviation);
    EXPECT_NEAR(loop.rate(), a.plant.rate, 5.0 * loop.deviation());
    EXPECT_NEAR(forgets.rate(), a.plant.rate, 5.0 * forgets.deviation());
}

TEST(Joint, TheRateIsTrustedOnlyWhereTheMotionTellsIt) {
    Case a;
    Loop<Positions<double>> loop(a);
    EXPECT_EQ(loop.trusted(), 0.0);
    loop.run(10);
    EXPECT_EQ(loop.trusted(), 0.0);
    loop.run(20000);
    EXPECT_EQ(loop.trusted(), 1.0);
    a.common.reference.amplitude = {0.0, 0.0};
    a.plant.initial_position = a.plant.initial_velocity = {};
    Loop<Positions<double>> still(a);
    still.run(20000);
    EXPECT_EQ(still.trusted(), 0.0);
}

// Amplitude of the estimate for a rate that oscillates at the requested bandwidth, over the amplitude of the rate.
template <class C>
double seen_at_the_corner(Case a, double bandwidth, double size = 1e-6) {
    a.law.adaptation.rate_forgetting = bandwidth;
    Loop<C> still(a);
    still.run(20000);
    auto moved = still;  // with the same noise
    constexpr double pi = 3.141592653589793;
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

// From 14 to 300 deg/s of the dual mass: innovations far beyond their deviations, but not from a late force.
TEST(Joint, AFastTurnIsNotALateForce) {
    for (const double size : {1e-5, 7e-5, 2e-4}) {
        EXPECT_NEAR(seen_at_the_corner<Both<double>>(Case(), 0.02, size), std::sqrt(0.5), 0.08) << size;
        EXPECT_NEAR(seen_at_the_corner<Positions<double>>(Case(), 0.02, size), std::sqrt(0.5), 0.08) << size;
    }
}

TEST(Joint, WhatDriftsIsFollowed) {
    const Case a = finely_sensed();
    const auto error = [&](double forgetting) {
        Case drifting = a;
        drifting.law.adaptation.forgetting = forgetting;
        Loop<Positions<double>> loop(drifting);
        for (int n = 0; n < 20; ++n) {
            drifting.plant.stiffness = Sym2<double>{drifting.plant.stiffness.xx() - 3e-8, 0.002, 1.027};
            loop.map = Gyroscope<double>::prepare(drifting.plant, drifting.common.step);
            loop.run(1000);
        }
        return std::abs(number(Positions<double>::report(loop.state, loop.c).stiffness.xx()) -
                        drifting.plant.stiffness.xx());
    };
    EXPECT_LT(error(0.02), 0.5 * error(0.0));
}

TEST(Joint, WhatTheMotionDoesNotTellIsForgottenNoFurtherThanThePrior) {
    Case a;
    a.common.reference.amplitude = {1.0, 1e-6};
    a.plant.initial_position = {};
    a.law.adaptation.forgetting = 2.0;
    Loop<Positions<double>> loop(a);
    loop.run(3000);
    using Covariance = Loop<Positions<double>>::Filter::Covariance;
    const double variance = Covariance::variance(loop.state.adaptation.covariance, 10);  // variance of Kyy
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
