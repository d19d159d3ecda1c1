#include "kernel.hpp"
#include "scalars.hpp"

#include "fracgyro/core/kernel_design.hpp"
#include "fracgyro/core/sampled.hpp"

#include <cmath>
#include <functional>
#include <memory>
#include <vector>

namespace fracgyro::testing {
namespace {

using Signal = Sample<double> (*)(double);

// t^p on the first axis and 2 t^p on the second.
template <int p>
Sample<double> monomial(double t) {
    const double value = std::pow(t, p);
    const double rate = p == 0 ? 0.0 : p * std::pow(t, p - 1);
    return {.value = {value, 2.0 * value}, .derivative = {rate, 2.0 * rate}};
}

template <Scalar T>
struct Operator {
    typename Fractional<T>::Coefficients coefficients;
    typename Fractional<T>::State state{};
    double step;

    Operator(const ExponentialSum& kernel, double h, bool riemann_liouville = false)
        : coefficients(Fractional<T>::prepare(kernel, h, riemann_liouville)), step(h) {}

    FractionalOutput<T> at(Signal signal, int n) {
        const Sample<double> e = signal(n * step);
        return Fractional<T>::update(
            state, coefficients,
            {.value = vec2<T>(e.value.x(), e.value.y()), .derivative = vec2<T>(e.derivative.x(), e.derivative.y())});
    }
};

// I^ν t^p = Γ(p+1)/Γ(p+1+ν) t^(p+ν); a negative ν differentiates.
double of_monomial(int p, double nu, double t) {
    return std::tgamma(p + 1.0) / std::tgamma(p + 1.0 + nu) * std::pow(t, p + nu);
}

template <class T>
class FractionalOperator : public ::testing::Test {
protected:
    static constexpr double step = 0x1p-10;  // so that t, t² and t³ are exact in all three types for some time
    static constexpr int samples = 2000;
    static constexpr double tolerance = std::is_same_v<T, float> ? 1e-5 : 5e-10;  // relative

    static ExponentialSum kernel(double order) {
        return log_trapezoid(order, step, samples * step, 0.4, std::is_same_v<T, float> ? 1e-2 : 1e-4);
    }

    // Maximum error of both axes, relative to the final value.
    template <int p>
    static void expect_monomial(double order) {
        Operator<T> op(kernel(order), step);
        double integral_error = 0.0, derivative_error = 0.0;
        for (int n = 0; n <= samples; ++n) {
            const FractionalOutput<T> got = op.at(monomial<p>, n);
            const double integral = of_monomial(p, 1.0 - order, n * step);
            const double derivative = p == 0 ? 0.0 : of_monomial(p, -order, n * step);
            integral_error = std::max({integral_error, std::abs(number(got.integral.x()) - integral),
                                       0.5 * std::abs(number(got.integral.y()) - 2.0 * integral)});
            derivative_error = std::max({derivative_error, std::abs(number(got.derivative.x()) - derivative),
                                         0.5 * std::abs(number(got.derivative.y()) - 2.0 * derivative)});
        }
        const double end = samples * step;
        // The integral is the difference of two terms of this size, whose slow exponentials round alike at every step.
        double terms = 0.0;
        const ExponentialSum m = kernel(order);
        for (std::size_t j = 0; j < m.count; ++j) {
            terms += m.weights[j] / m.poles[j] * std::pow(end, p);
        }
        const double rounding = (p == 0 ? 1000.0 : 50.0) * epsilon<T> * terms;
        EXPECT_LE(integral_error, tolerance * of_monomial(p, 1.0 - order, end) + rounding)
            << "t^" << p << ", order " << order;
        // The derivative of a constant is the difference of the memory and the remainder of the jump, both as large as
        // the kernel and rounded at every sample.
        EXPECT_LE(derivative_error,
                  p == 0 ? samples / 8 * epsilon<T> * std::pow(step, -order) : tolerance * of_monomial(p, -order, end))
            << "t^" << p << ", order " << order;
    }
};
TYPED_TEST_SUITE(FractionalOperator, Scalars, ScalarNames);

TYPED_TEST(FractionalOperator, OrderOneLeavesTheSignalAndItsRateUntouched) {
    Operator<TypeParam> op(TestFixture::kernel(1.0), TestFixture::step);
    for (int n = 0; n < 100; ++n) {
        const Sample<double> e = monomial<2>(n * TestFixture::step);
        const auto got = op.at(monomial<2>, n);
        expect_equal(got.integral, e.value);
        expect_equal(got.derivative, e.derivative);
    }
}

TYPED_TEST(FractionalOperator, OrderZeroIntegratesOnceAndLeavesTheSignalUntouched) {
    constexpr double step = TestFixture::step;
    Operator<TypeParam> op(TestFixture::kernel(0.0), step);
    for (int n = 0; n < 200; ++n) {
        const double t = n * step;
        const double integral = t * t * t * t / 4.0;
        const auto got = op.at(monomial<3>, n);
        expect_near(got.integral, {integral, 2.0 * integral}, 50.0 * epsilon<TypeParam> * integral);
        expect_equal(got.derivative, monomial<3>(t).value);
    }
}

TYPED_TEST(FractionalOperator, CaputoDerivativeOfAConstantIsZeroAndItsIntegralGrowsAsAPower) {
    for (const double order : {0.1, 0.5, 0.9}) {
        TestFixture::template expect_monomial<0>(order);
    }
}

TYPED_TEST(FractionalOperator, PowersUpToTheCubeAreExactToTheToleranceOfTheModes) {
    for (const double order : {0.1, 0.5, 0.9}) {
        TestFixture::template expect_monomial<1>(order);
        TestFixture::template expect_monomial<2>(order);
        TestFixture::template expect_monomial<3>(order);
    }
}

TYPED_TEST(FractionalOperator, RiemannLiouvilleDerivativeOfAConstantIsTheMeanOfItsSingularityOverTheHold) {
    constexpr double step = TestFixture::step;
    for (const double order : {0.1, 0.5, 0.9}) {
        Operator<TypeParam> op(TestFixture::kernel(order), step, true);
        const double nu = 1.0 - order;
        double worst = 0.0;  // relative
        for (int n = 0; n <= TestFixture::samples; ++n) {
            const double mean =
                (std::pow((n + 1) * step, nu) - std::pow(n * step, nu)) / (step * std::tgamma(1.0 + nu));
            worst = std::max(worst, std::abs(number(op.at(monomial<0>, n).derivative.x()) / mean - 1.0));
        }
        EXPECT_LE(worst, 10.0 * TestFixture::tolerance) << "order " << order;
    }
}

TYPED_TEST(FractionalOperator, TheOnsetIsDroppedWhereItsMeanIsTheValueToTheLargestErrorOfTheModesAndNotBefore) {
    constexpr double step = TestFixture::step, order = 0.5, error = 1e-3;
    ExponentialSum kernel = TestFixture::kernel(order);
    kernel.error = error;
    Operator<TypeParam> op(kernel, step, true);
    const double largest = 1.0 / (std::sqrt(step) * std::tgamma(0.5));  // k(h)
    double worst = 0.0;                                                 // relative to k(h)
    int ended = 0;
    for (int n = 0; n <= 60; ++n) {
        const double mean =
            (std::pow((n + 1) * step, order) - std::pow(n * step, order)) / (step * std::tgamma(1.0 + order));
        const bool before = op.state.onset_pairs > 0;
        const double off = std::abs(number(op.at(monomial<0>, n).derivative.x()) - mean) / largest;
        worst = std::max(worst, off);
        ended = before && op.state.onset_pairs == 0 ? n : ended;
    }
    EXPECT_LE(worst, error);
    EXPECT_GT(worst, 0.9 * error);
    EXPECT_EQ(ended, 39);  // 250^(2/3) = 39.7
}

TYPED_TEST(FractionalOperator, RiemannLiouvilleAndCaputoAgreeWhenTheSignalStartsAtZero) {
    const ExponentialSum kernel = TestFixture::kernel(0.9);
    Operator<TypeParam> caputo(kernel, TestFixture::step, false);
    Operator<TypeParam> riemann_liouville(kernel, TestFixture::step, true);
    for (int n = 0; n < 100; ++n) {
        const auto a = caputo.at(monomial<2>, n);
        const auto b = riemann_liouville.at(monomial<2>, n);
        EXPECT_EQ(number(a.derivative.x()), number(b.derivative.x()));
        EXPECT_EQ(number(a.integral.x()), number(b.integral.x()));
    }
}

TYPED_TEST(FractionalOperator, ACopiedStateResumesBitForBit) {
    const ExponentialSum kernel = TestFixture::kernel(0.7);
    Operator<TypeParam> whole(kernel, TestFixture::step, true);
    const Signal wave = [](double t) {
        return Sample<double>{.value = {std::cos(40.0 * t), std::sin(t)},
                              .derivative = {-40.0 * std::sin(40.0 * t), std::cos(t)}};
    };
    for (int n = 0; n < 500; ++n) {
        whole.at(wave, n);
    }
    Operator<TypeParam> resumed(kernel, TestFixture::step, true);
    resumed.state = whole.state;
    for (int n = 500; n < 1000; ++n) {
        const auto a = whole.at(wave, n);
        const auto b = resumed.at(wave, n);
        expect_equal(a.integral, {number(b.integral.x()), number(b.integral.y())});
        expect_equal(a.derivative, {number(b.derivative.x()), number(b.derivative.y())});
    }
}

TYPED_TEST(FractionalOperator, TheInitialValueIsForgottenWithoutSlowSubnormalNumbers) {
    Operator<TypeParam> op(TestFixture::kernel(0.9), TestFixture::step, true);
    for (int n = 0; n < TestFixture::samples; ++n) {
        op.at(monomial<0>, n);
    }
    using Number = std::conditional_t<std::is_same_v<TypeParam, float>, float, double>;
    const double least = static_cast<double>(std::numeric_limits<Number>::min());
    const auto expect_normal = [&](double a) { EXPECT_TRUE(a == 0.0 || std::abs(a) >= least) << a; };
    for (std::size_t j = 0; j < op.state.onset_pairs; ++j) {
        for (std::size_t k = 0; k < sizeof(op.state.onset[j]) / sizeof(op.state.onset[j][0]); ++k) {
            expect_normal(number(op.state.onset[j][k]));
        }
    }
    for (std::size_t j = 0; j < op.coefficients.pairs; ++j) {
        for (std::size_t k = 0; k < 4; ++k) {
            expect_normal(number(op.state.memory[j][k]));
        }
    }
}

// The fourth power is the first with an interpolation error: h⁴ in value and h³ in rate, but with mean 0.
TEST(FractionalConvergence, TheIntegralIsOfOrderFourAndTheDerivativeOfOrderFourMinusAlpha) {
    for (const double order : {0.3, 0.5, 0.8}) {
        std::vector<double> integral, derivative;
        for (const int samples : {8, 16, 32, 64}) {
            const double step = 1.0 / samples;
            Operator<double> op(log_trapezoid(order, step, 1.0, 0.3), step);
            FractionalOutput<double> end;
            for (int n = 0; n <= samples; ++n) {
                end = op.at(monomial<4>, n);
            }
            integral.push_back(std::abs(end.integral.x() - of_monomial(4, 1.0 - order, 1.0)));
            derivative.push_back(std::abs(end.derivative.x() - of_monomial(4, -order, 1.0)));
        }
        for (std::size_t i = 1; i < integral.size(); ++i) {
            EXPECT_NEAR(std::log2(integral[i - 1] / integral[i]), 4.0, 0.15) << "order " << order;
            EXPECT_NEAR(std::log2(derivative[i - 1] / derivative[i]), 4.0 - order, 0.12) << "order " << order;
        }
    }
}

// -- Values only -----------------------------------------------------------------------------------------------------

// The last output for samples from step on.
template <class Number, class Gains, class Term, class Past>
double last_output(const ExponentialSum& kernel, double shortest, double step, const SampledOperator& kind, int samples,
                   const std::function<double(double)>& signal) {
    std::vector<SampledTerm> terms(kernel.count);
    const SampledGains made = sampled_operator({kernel.poles.data(), kernel.count}, kernel.weights.data(), kernel.order,
                                               shortest, step, kind, terms.data());
    std::vector<Term> own;
    for (const SampledTerm& term : terms) {
        own.push_back({static_cast<Number>(term.decay), static_cast<Number>(term.weight)});
    }
    const Gains gains{made.of_values,
                      made.of_changes,
                      static_cast<Number>(made.now),
                      static_cast<Number>(made.past),
                      static_cast<Number>(made.change),
                      static_cast<Number>(made.past_change),
                      static_cast<Number>(detail::vanishing<Number>)};
    std::vector<Number> memory(kernel.count);
    Past past{};
    Number found{};
    for (int n = 1; n <= samples; ++n) {
        found = fracgyro_step_sample(&gains, own.data(), memory.data(), &past, static_cast<Number>(signal(n * step)));
    }
    return number(found);
}
const auto in_doubles =
    last_output<double, in_double::fracgyro_gains, in_double::fracgyro_term, in_double::fracgyro_past>;
const auto in_floats =
    last_output<float, in_single::fracgyro_gains, in_single::fracgyro_term, in_single::fracgyro_past>;

class Sampled : public ::testing::TestWithParam<std::tuple<double, double, bool>> {
protected:
    static constexpr double shortest = 0x1p-10;
    const double order = std::get<0>(GetParam()), step = std::get<1>(GetParam());
    const bool derivative = std::get<2>(GetParam());
    const ExponentialSum kernel = designed_kernel(*std::make_unique<KernelDesign>(), order, shortest, 1000.0, 1e-8);

    // Operator applied to (t - since)^p.
    double exact(int p, double t, double since = 0.0) const {
        return t < since ? 0.0 : of_monomial(p, derivative ? -order : 1.0 - order, t - since);
    }
};
// The shortest time, and a time longer than some exponentials last.
INSTANTIATE_TEST_SUITE_P(Operators, Sampled,
                         ::testing::Combine(::testing::Values(0.1, 0.5, 0.9), ::testing::Values(0x1p-10, 0x1p-4, 3.0),
                                            ::testing::Bool()));

TEST_P(Sampled, OfLinesBetweenSamplesIsAsExactAsItsKernel) {
    const double bend = 100 * step, end = 200 * step;
    const auto bent = [&](double t) { return t + (t > bend ? t - bend : 0.0); };
    const double expected = exact(1, end) + exact(1, end, bend);
    EXPECT_NEAR(in_doubles(kernel, shortest, step, {derivative, false}, 200, bent), expected, 1e-8 * expected);
    EXPECT_NEAR(in_floats(kernel, shortest, step, {derivative, false}, 200, bent), expected, 2e-5 * expected);
}

// The signal t², whose first parabola differs: it is 0 one step before the start. The resulting error fades like the
// kernel or its derivative.
TEST_P(Sampled, OfParabolasThroughSamplesIsAsExactAsItsKernel) {
    const auto square = [](double t) { return t * t; };
    const double expected = exact(2, 200 * step);
    const double start = std::pow(200.0, -order - (derivative ? 1.0 : 0.0)) * std::pow(step, 3.0 - order);
    EXPECT_NEAR(in_doubles(kernel, shortest, step, {derivative, true}, 200, square), expected,
                2e-8 * expected + (derivative ? start / step : start));
    EXPECT_GT(std::abs(in_doubles(kernel, shortest, step, {derivative, false}, 200, square) - expected),
              1e-6 * expected);
}

TEST_P(Sampled, OfASmoothSignalParabolasHaveOneOrderMoreThanLines) {
    if (step != 3.0) {
        const auto fourth = [](double t) { return t * t * t * t; };
        for (const bool parabolas : {false, true}) {
            const auto error = [&](double h) {
                const int samples = static_cast<int>(std::lround(64 * step / h));
                return std::abs(in_doubles(kernel, shortest, h, {derivative, parabolas}, samples, fourth) -
                                exact(4, 64 * step));
            };
            const double at_least = (derivative ? 2.0 - order : 2.0) + (parabolas ? 1.0 : 0.0);
            EXPECT_GT(error(4.0 * step), 0.85 * std::pow(2.0, at_least) * error(2.0 * step)) << parabolas;
        }
    }
}

}  // namespace
}  // namespace fracgyro::testing
