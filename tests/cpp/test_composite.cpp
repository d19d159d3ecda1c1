#include "factors.hpp"
#include "paper.hpp"
#include "scalars.hpp"

#include "fracgyro/estimation/composite.hpp"

#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

namespace fracgyro::testing {
namespace {

template <class T>
class Squares : public ::testing::Test {};
TYPED_TEST_SUITE(Squares, Scalars, ScalarNames);

template <std::size_t Count>
using Matrix = std::array<std::array<double, Count>, Count>;

template <std::size_t Count>
Matrix<Count> inverse(Matrix<Count> a) {
    Matrix<Count> b{};
    for (std::size_t i = 0; i < Count; ++i) {
        b[i][i] = 1.0;
    }
    for (std::size_t i = 0; i < Count; ++i) {  // positive definite: no pivots
        const double pivot = a[i][i];
        for (std::size_t j = 0; j < Count; ++j) {
            a[i][j] /= pivot;
            b[i][j] /= pivot;
        }
        for (std::size_t k = 0; k < Count; ++k) {
            const double factor = k == i ? 0.0 : a[k][i];
            for (std::size_t j = 0; j < Count; ++j) {
                a[k][j] -= factor * a[i][j];
                b[k][j] -= factor * b[i][j];
            }
        }
    }
    return b;
}

TYPED_TEST(Squares, OneRowMovesAndNarrowsItsOwnParameterAlone) {
    using T = TypeParam;
    using L = RecursiveLeastSquares<T, 3>;
    typename L::State state{};
    // α = 1 + 2² prior. The remaining residual is 1/α of it; the variance becomes 1/(1/prior + 2²).
    const T left = L::update(state, {T(0.0), T(2.0), T(0.0)}, T(6.0));
    const double alpha = 1.0 + 4.0 * L::prior;
    EXPECT_NEAR(number(left), 1.0 / alpha, epsilon<T>);
    EXPECT_EQ(number(state.value[0]), 0.0);
    EXPECT_NEAR(number(state.value[1]), -3.0, 1e-4);  // 6 + 2 x = 0, except for the prior
    EXPECT_NEAR(number(L::variance(state, 1)), L::prior / alpha, epsilon<T>);
    EXPECT_EQ(number(L::variance(state, 2)), L::prior);
}

TYPED_TEST(Squares, RowByRowIsAllRowsAtOnce) {
    using T = TypeParam;
    using L = RecursiveLeastSquares<T, 3>;
    typename L::State state{};
    Matrix<3> information{};
    std::array<double, 3> right{};
    for (std::size_t i = 0; i < 3; ++i) {
        information[i][i] = 1.0 / L::prior;
    }
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    for (int n = 0; n < 200; ++n) {
        const std::array row{number(T(normal(random))), number(T(normal(random))), number(T(normal(random)))};
        const double y = number(T(row[0] - 2.0 * row[1] + 0.5 * row[2] + 0.1 * normal(random)));
        typename L::Row typed{T(row[0]), T(row[1]), T(row[2])};
        T residual = T(y);
        for (std::size_t i = 0; i < 3; ++i) {
            residual = residual + typed[i] * state.value[i];
            right[i] -= row[i] * y;
            for (std::size_t j = 0; j < 3; ++j) {
                information[i][j] += row[i] * row[j];
            }
        }
        L::update(state, typed, residual);
    }
    const Matrix<3> p = inverse(information);
    for (std::size_t i = 0; i < 3; ++i) {
        const double wanted = p[i][0] * right[0] + p[i][1] * right[1] + p[i][2] * right[2];
        EXPECT_NEAR(number(state.value[i]), wanted, 100.0 * epsilon<T>);
        EXPECT_NEAR(number(L::variance(state, i)), p[i][i], 100.0 * epsilon<T> * p[i][i]);
    }
}

TYPED_TEST(Squares, VariancesStayPositiveAndRightOverAMillionRowsThatHardlyDiffer) {
    using T = TypeParam;
    using L = RecursiveLeastSquares<T, 2>;
    typename L::State state{};
    constexpr int rows = 1'000'000;
    constexpr double angle = 1.0 / 64.0;  // rows (1, ±angle): the second parameter is seen 4096 times worse
    for (int n = 0; n < rows; ++n) {
        L::update(state, {T(1.0), T(n % 2 == 0 ? angle : -angle)}, T(0.0));
        ASSERT_LT(0.0, number(state.d_factor[0])) << n;
        ASSERT_LT(0.0, number(state.d_factor[1])) << n;
    }
    const double tolerance = 5.0 * std::sqrt(rows) * epsilon<T> + 1e-6;  // roundings, and the prior
    EXPECT_NEAR(number(L::variance(state, 0)) * rows, 1.0, tolerance);
    EXPECT_NEAR(number(L::variance(state, 1)) * rows * angle * angle, 1.0, tolerance);
}

TYPED_TEST(Squares, SpreadingTheFirstParameterAddsToItsVarianceAlone) {
    using T = TypeParam;
    using L = RecursiveLeastSquares<T, 2>;
    typename L::State state{};
    L::update(state, {T(1.0), T(0.5)}, T(1.0));
    L::update(state, {T(0.25), T(1.0)}, T(1.0));
    const Matrix<2> before = product_of_factors<2>(state);
    L::inflate_first(state, T(0.5));
    const Matrix<2> after = product_of_factors<2>(state);
    EXPECT_NEAR(after[0][0], before[0][0] + 0.5, 4.0 * epsilon<T>);
    EXPECT_EQ(after[0][1], before[0][1]);
    EXPECT_EQ(after[1][1], before[1][1]);
}

// A plant slow and damped enough that its damping is observable, excited by two sines and by noise.
struct Pushed {
    double step = 0.02;
    double noise = 0.0;
    Vec2<double> amplitude{1.0, 1.0};
    PlantModel<double> nominal{};
    AdaptationParams adaptation{};
};
GyroscopeParams slow_plant() { return {.damping = {0.5, 0.1, 0.4}, .stiffness = {2.0, 0.5, 3.0}, .rate = 0.2}; }

template <Scalar T>
struct Sensed {
    using Law = CompositeAdaptation<T>;
    typename Law::Coefficients coefficients{};
    typename Law::State state{};

    Estimates<T> estimates() const { return Law::estimates(state, coefficients); }
    double trusted() const { return number(Law::trusted(state, coefficients)); }
    double deviation() const { return number(Law::report(state, coefficients).rate_deviation); }
    double refused() const { return number(Law::report(state, coefficients).sample_refused); }
};

template <Scalar T>
Sensed<T> sense(const Pushed& p, int steps) {
    using Law = CompositeAdaptation<T>;
    AdaptationParams adaptation = p.adaptation;
    adaptation.damping_gain = adaptation.stiffness_gain = adaptation.rate_gain = 0.0;
    Sensed<T> sensed{.coefficients = Law::prepare(adaptation, p.nominal, p.step)};
    const auto plant = Gyroscope<double>::prepare(slow_plant(), p.step);
    Motion<double> motion{};
    std::mt19937 random(3);
    std::normal_distribution<double> normal(0.0, 1.0);
    for (int n = 0; n < steps; ++n) {
        const double t = n * p.step;
        const Vec2<double> u{p.amplitude.x() * std::sin(1.3 * t), p.amplitude.y() * std::cos(2.1 * t)};
        const Motion<T> measured{.position = vec2<T>(motion.position.x(), motion.position.y()),
                                 .velocity = vec2<T>(motion.velocity.x(), motion.velocity.y())};
        Law::update(sensed.state, sensed.coefficients, measured, {}, {}, vec2<T>(u.x(), u.y()));
        const Vec2<double> d = p.noise * Vec2<double>{normal(random), normal(random)};
        Gyroscope<double>::step(motion, plant, u, d);
    }
    return sensed;
}

template <class T>
class Composed : public ::testing::Test {};
TYPED_TEST_SUITE(Composed, Scalars, ScalarNames);

TYPED_TEST(Composed, WithoutNoiseThePlantIsFoundFromNothing) {
    const auto found = sense<TypeParam>({}, 5'000).estimates();
    const double tolerance = 1e-6 + 1e5 * epsilon<TypeParam> * 0.02;  // velocities are divided by the step
    expect_near(found.damping, {0.5, 0.1, 0.4}, tolerance);
    expect_near(found.stiffness, {2.0, 0.5, 3.0}, tolerance);
    EXPECT_NEAR(number(found.rate), 0.2, tolerance);
}

// Starting from the true values, only the quadrature error moves it.
TEST(ComposedOrder, TheHoldIsModelledToTheFourthOrder) {
    const GyroscopeParams truth = slow_plant();
    const auto error = [&](double step, int steps) {
        Pushed p{.step = step};
        p.nominal = {.damping = truth.damping, .stiffness = truth.stiffness, .rate = truth.rate};
        return norm(Vec2<double>{sense<double>(p, steps).estimates().stiffness.xx() - truth.stiffness.xx(),
                                 sense<double>(p, steps).estimates().damping.xx() - truth.damping.xx()});
    };
    EXPECT_NEAR(std::log2(error(0.2, 500) / error(0.1, 1000)), 4.0, 0.2);
}

// With rows made of the measured mean velocity, D̂ is off by h σ²/(2 v²), here by some 0.1: ten standard deviations.
TYPED_TEST(Composed, NoiseDoesNotBiasTheDamping) {
    using Law = CompositeAdaptation<TypeParam>;
    // Such noise is distinguished from the estimates' own errors only once they are trusted, which is early with this
    // limit.
    const auto sensed = sense<TypeParam>({.noise = 3.0, .nominal = {.stiffness = {100, 0, 100}}}, 100'000);
    const auto found = sensed.estimates();
    const double sigma = std::sqrt(number(sensed.state.noise));
    EXPECT_NEAR(sigma, 3.0, 0.03);
    const auto deviation = [&](std::size_t i) {
        return sigma * std::sqrt(number(Law::Squares::variance(sensed.state.squares, i)));
    };
    EXPECT_NEAR(number(found.damping.xx()), 0.5, 4.0 * deviation(1));
    EXPECT_NEAR(number(found.damping.yy()), 0.4, 4.0 * deviation(3));
    EXPECT_LT(deviation(1), 0.02);
    EXPECT_NEAR(number(found.rate), 0.2, 4.0 * sensed.deviation());
}

TYPED_TEST(Composed, TheRateIsTrustedOnceBothAxesMoveMoreThanNoiseMovesThem) {
    using T = TypeParam;
    Pushed p{.noise = 1e-3, .nominal = {.stiffness = {1, 0, 1}}};  // 1 % of its frequency is 0.01
    EXPECT_EQ(sense<T>(p, 1).trusted(), 0.0);
    EXPECT_EQ(sense<T>(p, 2'000).trusted(), 1.0);
    p.amplitude = {0.0, 0.0};
    EXPECT_EQ(sense<T>(p, 2'000).trusted(), 0.0);
    p.noise = 3.0;  // much information, but too little compared with the noise
    EXPECT_EQ(sense<T>(p, 2'000).trusted(), 0.0);
    p.noise = 0.0;
    EXPECT_EQ(sense<T>(p, 2'000).trusted(), 0.0);
}

TYPED_TEST(Composed, LeastSquaresAreBelievedOnceTrustedAndForGood) {
    using T = TypeParam;
    using Law = CompositeAdaptation<T>;
    Pushed p{.noise = 1e-3, .nominal = {.stiffness = {1, 0, 1}}, .adaptation = {.forgetting = 1.0}};
    auto early = sense<T>(p, 3);
    EXPECT_NE(number(early.estimates().stiffness.xx()), 1.0);
    EXPECT_EQ(number(Law::control_estimates(early.state, early.coefficients, {}).stiffness.xx()), 1.0);
    auto late = sense<T>(p, 2'000);
    ASSERT_EQ(late.trusted(), 1.0);
    Law::rest(late.state);
    for (int n = 0; n < 2'000; ++n) {
        Law::update(late.state, late.coefficients, {}, {}, {}, {});  // at rest, where it is forgotten
    }
    EXPECT_EQ(late.trusted(), 0.0);
    const Estimates<T> reported = late.estimates(),
                       accepted = Law::control_estimates(late.state, late.coefficients, {});
    EXPECT_EQ(number(accepted.stiffness.xx()), number(reported.stiffness.xx()));
    EXPECT_EQ(number(accepted.rate), number(reported.rate));
}

// The deviation may be 1 % of the natural frequency, of which the mean of kxx and kyy is the square.
TYPED_TEST(Composed, BothStiffnessesDecideOnTrust) {
    using T = TypeParam;
    using Law = CompositeAdaptation<T>;
    const auto sensed = sense<T>({.noise = 1e-3, .nominal = {.stiffness = {1, 0, 1}}}, 2'000);
    const double deviation = sensed.deviation(), square = 1e4 * deviation * deviation;
    const auto trusted = [&](double kxx, double kyy) {
        const auto c = Law::prepare({}, {.stiffness = {kxx * square, 0, kyy * square}}, 0.02);
        return number(Law::trusted(sensed.state, c));
    };
    EXPECT_EQ(trusted(1.8, 0.4), 1.0);
    EXPECT_EQ(trusted(0.4, 1.8), 1.0);
    EXPECT_EQ(trusted(1.4, 0.4), 0.0);
    EXPECT_EQ(trusted(0.4, 1.4), 0.0);
}

// The slow plant as above, sensed through `fault(n, numbers of the motion)`, from a given state on, with the estimates
// after each step, or after every n steps.
template <Scalar T, class Fault>
std::vector<Sensed<T>> sense_faulty(int steps, double later_rate, Fault&& fault, int every = 1,
                                    const typename CompositeAdaptation<T>::State& from = {}) {
    using Law = CompositeAdaptation<T>;
    const AdaptationParams adaptation{.damping_gain = 0, .stiffness_gain = 0, .rate_gain = 0};
    constexpr double h = 0.02;
    Sensed<T> sensed{.coefficients = Law::prepare(adaptation, {.stiffness = {1, 0, 1}}, h), .state = from};
    std::vector<Sensed<T>> all;
    GyroscopeParams params = slow_plant();
    auto plant = Gyroscope<double>::prepare(params, h);
    Motion<double> motion{};
    std::mt19937 random(3);
    std::normal_distribution<double> normal(0.0, 1e-3);
    for (int n = 0; n < steps; ++n) {
        const Vec2<double> u{std::sin(1.3 * h * n), std::cos(2.1 * h * n)};
        std::array m{motion.position.x(), motion.position.y(), motion.velocity.x(), motion.velocity.y()};
        fault(n, m);
        Law::update(sensed.state, sensed.coefficients,
                    {.position = vec2<T>(m[0], m[1]), .velocity = vec2<T>(m[2], m[3])}, {}, {}, vec2<T>(u.x(), u.y()));
        if (n % every == 0) {
            all.push_back(sensed);
        }
        if (n == 2'000) {
            params.rate = later_rate;
            plant = Gyroscope<double>::prepare(params, h);
        }
        Gyroscope<double>::step(motion, plant, u, {normal(random), normal(random)});
    }
    return all;
}

template <Scalar T>
bool learnt_between(const Sensed<T>& a, const Sensed<T>& b) {
    return std::memcmp(&a.state.squares, &b.state.squares, sizeof a.state.squares) != 0;
}

TYPED_TEST(Composed, OneBadSampleOfAnySizeIsRefusedAndTheRateTrustedAsBefore) {
    using T = TypeParam;
    for (const double size : {-0.01, 1.0, 1e6, 1e18, 1e300, std::numeric_limits<double>::infinity(), std::nan("")}) {
        for (std::size_t place = 0; place < 4; ++place) {
            const auto sensed = sense_faulty<T>(
                2'010, 0.2, [&](int n, std::array<double, 4>& m) { m[place] += n == 2'004 ? size : 0.0; });
            for (std::size_t n = 2'002; n < 2'010; ++n) {
                const bool spoilt = n == 2'004 || n == 2'005;  // the step to it and the step from it
                EXPECT_EQ(learnt_between(sensed[n - 1], sensed[n]), !spoilt) << size << " at " << place << ", " << n;
                EXPECT_EQ(sensed[n].refused(), spoilt ? 1.0 : 0.0) << size << " at " << place << ", " << n;
                EXPECT_EQ(sensed[n].trusted(), 1.0) << size << " at " << place << ", " << n;
            }
        }
    }
}

TYPED_TEST(Composed, AThirdResidualInARowThatIsFarOffIsThatOfAPlantThatMoved) {
    using T = TypeParam;
    const auto sensed = sense_faulty<T>(12'000, 2.0, [](int, std::array<double, 4>&) {});
    EXPECT_EQ(sensed[2'000].trusted(), 1.0);
    for (std::size_t n = 2'001; n < 2'008; ++n) {
        EXPECT_EQ(learnt_between(sensed[n - 1], sensed[n]), 2'002 < n) << n;
        EXPECT_EQ(sensed[n].refused(), n <= 2'003 ? 1.0 : 0.0) << n;
        EXPECT_EQ(sensed[n].trusted(), n <= 2'002 ? 1.0 : 0.0) << "the residuals are not those of noise, " << n;
    }
}

TYPED_TEST(Composed, AfterADisagreementAllOthersAgreeForFourWindowsBeforeTheRateIsTrusted) {
    using T = TypeParam;
    const auto sensed = sense_faulty<T>(
        11'000, 0.2, [](int n, std::array<double, 4>& m) { m[2] += 4'000 <= n && n < 4'004 ? 0.1 * (n % 3) : 0.0; });
    const std::size_t four_windows = 4 * 1'256;  // four periods of 2π in steps of 0.02
    EXPECT_EQ(sensed[4'000].trusted(), 1.0);
    for (std::size_t n = 4'004; n < 4'004 + four_windows; ++n) {
        ASSERT_EQ(sensed[n].trusted(), 0.0) << n;
    }
    EXPECT_EQ(sensed[10'999].trusted(), 1.0);
    EXPECT_NEAR(number(sensed[10'999].estimates().rate), 0.2, 4.0 * sensed[10'999].deviation());
}

TYPED_TEST(Composed, ResidualsThatGrowAreNotTakenForNoise) {
    using T = TypeParam;
    std::mt19937 random(7);
    std::normal_distribution<double> noise(0.0, 2e-4);
    const auto sensed = sense_faulty<T>(
        24'000, 0.2, [&](int n, std::array<double, 4>& m) { m[3] += 4'000 <= n && n < 14'000 ? noise(random) : 0.0; });
    EXPECT_EQ(sensed[3'999].trusted(), 1.0);
    for (std::size_t n = 4'200; n < 14'000; ++n) {
        ASSERT_EQ(sensed[n].trusted(), 0.0) << n;
    }
    const Sensed<T>& last = sensed.back();
    EXPECT_EQ(last.trusted(), 1.0);
    EXPECT_LT(last.deviation(), 2.0 * sensed[3'999].deviation());
    EXPECT_NEAR(number(last.estimates().rate), 0.2, 4.0 * last.deviation());
}

TYPED_TEST(Composed, NoiseThatStaysIsThatOfTheSensorInTheEnd) {
    using T = TypeParam;
    std::mt19937 random(7);
    std::normal_distribution<double> noise(0.0, 3e-5);
    const auto sensed = sense_faulty<T>(
        160'000, 0.2, [&](int n, std::array<double, 4>& m) { m[3] += 4'000 <= n ? noise(random) : 0.0; }, 1'000);
    const auto trusted = [&](int n) { return sensed[static_cast<std::size_t>(n / 1'000)].trusted(); };
    EXPECT_EQ(trusted(130'000), 0.0);
    EXPECT_EQ(trusted(159'000), 1.0);
    EXPECT_NEAR(number(sensed.back().estimates().rate), 0.2, 4.0 * sensed.back().deviation());
}

// The guard restarts if nothing else helps: estimates learned during the fault that caused it must agree with earlier
// ones.
TYPED_TEST(Composed, AControllerThatStartsOverKnowsItsSensorStill) {
    using T = TypeParam;
    using Controller = SlidingModeController<T, LinearSurface, CompositeAdaptation>;
    typename Controller::State state{};
    state.adaptation = sense_faulty<T>(4'000, 0.2, [](int, std::array<double, 4>&) {}).back().state;
    const auto before = state.adaptation.agreement.before;
    Controller::start_over(state, false);
    EXPECT_EQ(std::memcmp(&before, &state.adaptation.agreement.before, sizeof before), 0);
    EXPECT_EQ(number(state.adaptation.agreement.doubted), 1.0);
    EXPECT_EQ(number(state.adaptation.squares.value[4]), 0.0);
    EXPECT_EQ(number(state.adaptation.noise), 0.0);
    EXPECT_FALSE(state.adaptation.measured);

    typename Controller::State unknown{};
    Controller::start_over(unknown, false);
    EXPECT_EQ(number(unknown.adaptation.agreement.doubted), 0.0);

    // From then on x is inverted: a plant can be found that moves so, but it is not the one before.
    for (const double sign : {1.0, -1.0}) {
        const auto all = sense_faulty<T>(
            12'000, 0.2, [&](int, std::array<double, 4>& m) { m[0] *= sign, m[2] *= sign; }, 1, state.adaptation);
        for (std::size_t n = 0; n < 5'000; ++n) {
            ASSERT_EQ(all[n].trusted(), 0.0) << n;
        }
        EXPECT_EQ(all.back().trusted(), sign < 0.0 ? 0.0 : 1.0);
    }
}

TYPED_TEST(Composed, WhatIsFarOffBeforeTheRateIsTrustedIsLearntFrom) {
    using T = TypeParam;
    const auto sensed = sense_faulty<T>(10, 0.2, [](int n, std::array<double, 4>& m) { m[2] += n == 4 ? 1.0 : 0.0; });
    for (std::size_t n = 1; n < 10; ++n) {
        EXPECT_TRUE(learnt_between(sensed[n - 1], sensed[n])) << n;
    }
}

// A motion of size 1 on x and `other` on y, under the forces that it takes where K = 1, D = 0 and Ωz = 0.25.
template <Scalar T>
Sensed<T> sense_motion(double other) {
    using Law = CompositeAdaptation<T>;
    constexpr double h = 0.02, rate = 0.25;
    Sensed<T> sensed{.coefficients = Law::prepare({}, {.stiffness = {1, 0, 1}, .rate = 0.3}, h)};
    const auto at = [&](double t) {
        return Motion<double>{.position = {std::sin(t), other * std::sin(1.7 * t)},
                              .velocity = {std::cos(t), 1.7 * other * std::cos(1.7 * t)}};
    };
    for (int n = 0; n < 2'000; ++n) {
        const auto [q0, v0] = at(n * h);
        const auto [q1, v1] = at((n + 1) * h);
        const Vec2<double> v = (1.0 / h) * (q1 - q0);
        const Vec2<double> coriolis = 2.0 * rate * Vec2<double>{-v.y(), v.x()};
        const Vec2<double> u = (1.0 / h) * (v1 - v0) + coriolis + 0.5 * (q0 + q1) + (h / 12.0) * (v0 - v1);
        Law::update(sensed.state, sensed.coefficients,
                    {.position = vec2<T>(q0.x(), q0.y()), .velocity = vec2<T>(v0.x(), v0.y())}, {}, {},
                    vec2<T>(u.x(), u.y()));
    }
    return sensed;
}

// Ωz and Dxy act only on the axis at rest, in the same way.
TYPED_TEST(Composed, OneAxisInMotionDoesNotTellTheRateFromTheDampingBetweenTheAxes) {
    using T = TypeParam;
    EXPECT_EQ(sense_motion<T>(0.7).trusted(), 1.0);
    EXPECT_NEAR(number(sense_motion<T>(0.7).estimates().rate), 0.25, 1e-3);
    EXPECT_EQ(sense_motion<T>(0.02).trusted(), 0.0);
    EXPECT_EQ(sense_motion<T>(0.0).trusted(), 0.0);
    const auto e = sense_motion<T>(0.0).estimates();
    EXPECT_NEAR(number(e.damping.xy()) + 2.0 * number(e.rate), 0.5, 1e-3);  // their sum is still known
}

TYPED_TEST(Composed, TheInflationOfTheVarianceIsThatOfTheWholeMatrixWithForgettingToo) {
    using T = TypeParam;
    Pushed p{.noise = 0.1};
    p.adaptation.forgetting = 0.05;
    p.adaptation.rate_forgetting = 0.3;
    for (const int steps : {2, 50, 3'000}) {
        const auto sensed = sense<T>(p, steps);
        const Matrix<7> information = inverse(product_of_factors<7>(sensed.state.squares));
        EXPECT_NEAR(number(sensed.state.rate_information), information[0][0],
                    (1e-9 + 1e4 * epsilon<T>)*information[0][0])
            << steps;
    }
}

TYPED_TEST(Composed, WhatIsForgottenIsNeverMoreThanThePrior) {
    using T = TypeParam;
    using L = typename CompositeAdaptation<T>::Squares;
    Pushed p;
    p.adaptation.forgetting = 1.0;
    p.adaptation.rate_forgetting = 10.0;
    p.amplitude = {0.0, 0.0};  // no excitation
    const auto sensed = sense<T>(p, 100'000);
    for (std::size_t i = 0; i < 7; ++i) {
        EXPECT_LE(number(L::variance(sensed.state.squares, i)), 7.0 * L::prior);
    }
    // With one excited axis nearly everything is forgotten, but the variances of the other do not grow without bound.
    p.amplitude = {1.0, 0.0};
    const auto half = sense<T>(p, 100'000);
    double trace = 0.0;
    for (std::size_t i = 0; i < 7; ++i) {
        trace += number(L::variance(half.state.squares, i));
        EXPECT_LT(0.0, number(half.state.squares.d_factor[i]));
    }
    EXPECT_LE(trace, 7.0 * L::prior * (1.0 + 1e5 * epsilon<T>));
}

// The closed loop

template <Scalar T>
Estimates<T> last_estimates(const Setup& setup) {
    Estimates<T> last{};
    with_light_controller<T>(setup, [&]<class Controller>() {
        run_loop<Controller>(setup, [&](const auto& at) {
            if constexpr (requires { at.signals.report.bound; }) {
                last = at.signals.report;
            }
        });
    });
    return last;
}

TEST(ComposedLoop, EverySurfaceSensesTheRateAndSinglePrecisionSensesTheSame) {
    for (const std::string_view kind : sliding_modes) {
        auto setup = paper(20'000, kind);
        law(setup).adaptation.kind = AdaptationKind::composite;
        const auto found = last_estimates<double>(setup);
        const auto single = last_estimates<float>(setup);
        EXPECT_NEAR(found.rate, 0.1, 4.0 * 0.0018) << kind;  // the Cramér-Rao bound
        EXPECT_NEAR(number(single.rate), found.rate, 0.0002) << kind;
        EXPECT_NEAR(found.stiffness.xx(), 355.3, 0.5) << kind;
    }
}

}  // namespace
}  // namespace fracgyro::testing
