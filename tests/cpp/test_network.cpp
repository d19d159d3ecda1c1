// The network and its basis functions: closed forms, and the integral that it contains.
#include "follow.hpp"
#include "scalars.hpp"

#include "fracgyro/controllers/integral_sliding.hpp"
#include "fracgyro/controllers/network.hpp"

#include <algorithm>
#include <cmath>

namespace fracgyro::testing {
namespace {

// Amplitudes 2 and -0.5, at the phases 0 and π/2.
const ReferenceParams reference{.amplitude = {2.0, -0.5}, .frequency = {pi, 0.5 * pi}, .phase = {0.0, 0.5 * pi}};

template <class T>
class BasisOf : public ::testing::Test {
protected:
    using B = Basis<T>;

    T evaluate(const BasisParams& p, const Motion<double>& x) {
        c = B::prepare(p, reference);
        return B::evaluate(c, memory, {.position = cast<T>(x.position), .velocity = cast<T>(x.velocity)}, values);
    }
    double value(std::size_t j) const { return number(values[j]); }

    typename B::Coefficients c{};
    typename B::Memory memory{};
    typename B::Values values{};
    double tolerance = 20.0 * epsilon<T>;
};
TYPED_TEST_SUITE(BasisOf, Scalars, ScalarNames);

TYPED_TEST(BasisOf, InputsAreInUnitsOfTheReference) {
    this->evaluate({}, {});
    const auto x = Basis<TypeParam>::inputs(
        this->c, {.position = vec2<TypeParam>(1.0, 0.25), .velocity = vec2<TypeParam>(pi, pi)});
    expect_near(x.position, {0.5, 0.5}, this->tolerance);
    expect_near(x.velocity, {0.5, 4.0}, this->tolerance);
}

TYPED_TEST(BasisOf, ConstantIsOneAndLinearHasTheInputs) {
    const Motion<double> x{.position = {0.5, -0.25}, .velocity = {2.0, 1.0}};
    EXPECT_EQ(number(this->evaluate({.kind = BasisKind::constant}, x)), 1.0);
    EXPECT_EQ(this->c.count, 1U);
    EXPECT_EQ(number(this->evaluate({.kind = BasisKind::linear}, x)), 1.0 + 0.25 + 0.0625 + 4.0 + 1.0);
    EXPECT_EQ(this->c.count, 5U);
    const std::array<double, 5> expected{1.0, 0.5, -0.25, 2.0, 1.0};
    for (std::size_t j = 0; j < 5; ++j) {
        EXPECT_EQ(this->value(j), expected[j]);
    }
}

TYPED_TEST(BasisOf, ChebyshevPolynomialsAreCosinesOfMultiples) {
    const std::array<double, 4> angles{0.3, 1.1, 2.0, 2.9};
    this->evaluate({.kind = BasisKind::chebyshev, .degree = 5},
                   {.position = {std::cos(angles[0]), std::cos(angles[1])},
                    .velocity = {std::cos(angles[2]), std::cos(angles[3])}});
    EXPECT_EQ(this->c.count, 21U);
    EXPECT_EQ(this->value(0), 1.0);
    for (std::size_t k = 1; k <= 5; ++k) {
        for (std::size_t i = 0; i < 4; ++i) {
            EXPECT_NEAR(this->value(4 * k - 3 + i), std::cos(static_cast<double>(k) * angles[i]), this->tolerance);
        }
    }
    // Inputs count as within ±1.
    this->evaluate({.kind = BasisKind::chebyshev, .degree = 2}, {.position = {7.0, -7.0}});
    EXPECT_EQ(this->value(1), 1.0);
    EXPECT_EQ(this->value(2), -1.0);
    EXPECT_EQ(this->value(5), 1.0);
    EXPECT_EQ(this->value(7), -1.0);
}

TYPED_TEST(BasisOf, AGaussianIsOneAtItsCenterAndFallsWithItsWidth) {
    const BasisParams p{.nodes = 4, .width = 0.5};
    // The first center: sin 0 and -sin π/2, and their slopes.
    const Motion<double> center{.position = {0.0, -1.0}, .velocity = {1.0, 0.0}};
    this->evaluate(p, center);
    EXPECT_EQ(this->c.count, 4U);
    EXPECT_NEAR(this->value(0), 1.0, this->tolerance);
    // The second, a quarter of the slower period later: sin π, -sin π, -1 and 1.
    EXPECT_NEAR(this->value(1), std::exp(-(0.0 + 1.0 + 4.0 + 1.0) / (2.0 * 0.25)), this->tolerance);
    this->evaluate(p, {.position = {0.5, -1.0}, .velocity = {1.0, 0.0}});
    EXPECT_NEAR(this->value(0), std::exp(-0.5), this->tolerance);
}

TYPED_TEST(BasisOf, TheDiagonalHasEqualInputs) {
    this->evaluate({.layout = Layout::diagonal, .nodes = 5, .width = 1.0},
                   {.position = {0.5, 0.5}, .velocity = {0.5, 0.5}});
    EXPECT_EQ(this->value(3), 1.0);
    EXPECT_NEAR(this->value(0), std::exp(-0.5 * 4.0 * 2.25), this->tolerance);
}

TYPED_TEST(BasisOf, AMembershipSeesOneInput) {
    const BasisParams p{.kind = BasisKind::membership, .nodes = 15, .width = 0.5};
    this->evaluate(p, {.position = {-1.0, 0.0}, .velocity = {1.0, 0.25}});
    EXPECT_EQ(this->c.count, 12U);  // three for each input, at -1, 0 and 1
    const std::array<double, 4> x{-1.0, 0.0, 1.0, 0.25};
    for (std::size_t j = 0; j < 12; ++j) {
        const double away = x[j % 4] - (static_cast<double>(j / 4) - 1.0);
        EXPECT_NEAR(this->value(j), std::exp(-2.0 * away * away), this->tolerance) << j;
    }
}

TYPED_TEST(BasisOf, NormalizedNodesSumToOneAndFadeFarAway) {
    for (const BasisKind kind : {BasisKind::gaussian, BasisKind::membership}) {
        const auto sum = [&](double width, double x) {
            this->evaluate({.kind = kind, .nodes = 8, .width = width, .normalized = true}, {.position = {x, 0.3}});
            double all = 0.0;
            for (std::size_t j = 0; j < 8; ++j) {
                all += this->value(j);
            }
            return all;
        };
        EXPECT_NEAR(sum(0.5, 0.2), 1.0, this->tolerance);
        const double far = sum(0.1, 1e3);
        EXPECT_GE(far, 0.0);
        EXPECT_LE(far, 1.0 + this->tolerance);
    }
    // Polynomials have no such rules.
    EXPECT_EQ(number(this->evaluate({.kind = BasisKind::linear, .normalized = true}, {.position = {2.0, 0.0}})), 5.0);
}

TYPED_TEST(BasisOf, AnInnerLoopAddsTheLastValueToTheInputsOfItsNode) {
    const BasisParams p{.layout = Layout::diagonal, .nodes = 1, .width = 2.0, .inner = 0.5};
    const Motion<double> x{.position = {1.0, 0.0}};
    this->evaluate(p, x);
    const double first = this->value(0);
    EXPECT_NEAR(first, std::exp(-0.125), this->tolerance);
    Basis<TypeParam>::remember(this->memory, this->c, this->values, {});
    this->evaluate(p, x);
    const double more = 0.5 * first, square = (1.0 + more) * (1.0 + more) + 3.0 * more * more;
    EXPECT_NEAR(this->value(0), std::exp(-0.125 * square), this->tolerance);
}

TYPED_TEST(BasisOf, AnOuterLoopMovesThePositionsByTheLastForceWithinTheReference) {
    this->evaluate({.kind = BasisKind::linear, .outer = 0.5}, {});
    const auto positions = [&](double force) {
        Basis<TypeParam>::remember(this->memory, this->c, this->values, vec2<TypeParam>(force, 0.0));
        return Basis<TypeParam>::inputs(this->c, this->memory, {.position = vec2<TypeParam>(0.2, 0.1)}).position;
    };
    // The largest acceleration on x is 2 π².
    expect_near(positions(pi * pi), {0.1 + 0.25, 0.2}, this->tolerance);
    expect_near(positions(-1e9), {0.1 - 0.5, 0.2}, this->tolerance);
}

TYPED_TEST(BasisOf, AGateIsALag) {
    const BasisParams p{.kind = BasisKind::linear, .gate = 0.75};
    double expected = 0.0;
    for (int n = 0; n < 5; ++n) {
        this->evaluate(p, {.position = {2.0, 0.0}});
        Basis<TypeParam>::remember(this->memory, this->c, this->values, {});
        expected = 0.75 * expected + 0.25 * 2.0;
        EXPECT_NEAR(this->value(1), expected, this->tolerance);
    }
}

// By the difference of φ for each center and width, with weights that make W's product with s one.
TYPED_TEST(BasisOf, CentersAndWidthsMoveAgainstTheForceThatTheyAdd) {
    using B = Basis<TypeParam>;
    for (const BasisKind kind : {BasisKind::gaussian, BasisKind::membership}) {
        const BasisParams p{.kind = kind, .nodes = 8, .width = 0.8, .center_rate = 3.0, .width_rate = 2.0};
        const Motion<double> x{.position = {0.4, -0.3}, .velocity = {0.2, 0.7}};
        this->memory = {};
        this->evaluate(p, x);
        std::array<Vec2<TypeParam>, B::most> weights{};
        weights.fill(vec2<TypeParam>(2.0, 1.0));
        const Motion<TypeParam> seen{.position = cast<TypeParam>(x.position), .velocity = cast<TypeParam>(x.velocity)};
        auto moved = this->memory;
        B::move(moved, this->c, seen, this->values, weights, vec2<TypeParam>(1e-3, -1e-3));
        const double small = std::is_same_v<TypeParam, float> ? 1e-2 : 1e-5;
        for (std::size_t j = 0; j < 8; ++j) {
            const auto slope = [&](auto change) {
                typename B::Memory up{}, down{};
                change(up, small);
                change(down, -small);
                typename B::Values above{}, below{};
                B::evaluate(this->c, up, seen, above);
                B::evaluate(this->c, down, seen, below);
                return (number(above[j]) - number(below[j])) / (2.0 * small);
            };
            const double by_center = slope([&](auto& m, double d) { m.centers[j].position = vec2<TypeParam>(d, 0.0); });
            const double by_width = slope([&](auto& m, double d) { m.widths[j] = TypeParam(d); });
            if (kind == BasisKind::gaussian || j % 4 == 0) {
                EXPECT_NEAR(number(moved.centers[j].position.x()), -3.0 * 1e-3 * by_center, 1e-6) << j;
            }
            EXPECT_NEAR(number(moved.widths[j]), -2.0 * 1e-3 * by_width, 1e-6) << j;
        }
    }
}

TYPED_TEST(BasisOf, CentersAndWidthsStayInTheirRange) {
    using B = Basis<TypeParam>;
    this->evaluate({.nodes = 4, .width = 0.8, .center_rate = 1e6, .width_rate = 1e6}, {.position = {0.4, -0.3}});
    std::array<Vec2<TypeParam>, B::most> weights{};
    weights.fill(vec2<TypeParam>(2.0, 1.0));
    for (const double push : {1.0, -1e9, 1e30}) {
        const Motion<TypeParam> far{.position = vec2<TypeParam>(1e25, 0.0)};
        B::move(this->memory, this->c, far, this->values, weights, vec2<TypeParam>(push, 0.0));
        B::evaluate(this->c, this->memory, far, this->values);
        for (std::size_t j = 0; j < 4; ++j) {
            const auto& center = this->memory.centers[j];
            EXPECT_LE(std::fabs(number(center.position.x())), 1.0);
            EXPECT_LE(std::fabs(number(center.velocity.y())), 1.0);
            EXPECT_GE(number(this->memory.widths[j]) + 0.8, 0.05 - this->tolerance);
            EXPECT_LE(number(this->memory.widths[j]) + 0.8, 10.0 + this->tolerance);
            EXPECT_TRUE(std::isfinite(this->value(j)));
        }
    }
}

TEST(Basis, LoopsAndGateDoNotChangeTheLargestSquare) {
    const auto largest = [](const BasisParams& p) { return Basis<double>::largest_on_orbit(p, reference); };
    EXPECT_EQ(largest({.inner = 1.0, .outer = 1.0, .gate = 0.9}), largest({}));
    EXPECT_LT(largest({.normalized = true}), largest({}));
}

TEST(Basis, TheLargestSquareOnTheOrbitIsThatOfTheSines) {
    const auto largest = [](const BasisParams& p) { return Basis<double>::largest_on_orbit(p, reference); };
    EXPECT_EQ(largest({.kind = BasisKind::constant}), 1.0);
    EXPECT_NEAR(largest({.kind = BasisKind::linear}), 3.0, 1e-14);
    EXPECT_NEAR(largest({.kind = BasisKind::chebyshev, .degree = 1}), 3.0, 1e-14);
    EXPECT_NEAR(largest({.nodes = 1, .width = 0.5}), 1.0, 1e-14);
    // At rest: the inputs are 0.
    EXPECT_EQ(Basis<double>::largest_on_orbit({.kind = BasisKind::linear}, {.amplitude = {0.0, 0.0}}), 1.0);
}

// -- The law

template <class T>
class NetworkOf : public ::testing::Test {
protected:
    using C = Network<T>;

    void prepare(const NetworkParams& law, double limit = std::numeric_limits<double>::infinity()) {
        c = C::prepare(law, {.step = h, .reference = {.amplitude = {0.0, 0.0}}, .force_limit = limit});
        state = {};
    }
    // At rest at `position`, of which s = 10 e.
    auto step(double position, const Sample<T>* missing = nullptr) {
        return C::step(state, c, {.position = vec2<T>(position, 0.0)}, missing);
    }
    double learned(double position) { return number(step(position).report.learned.x()); }

    typename C::Coefficients c{};
    typename C::State state{};
    double tolerance = 50.0 * epsilon<T>;
};
TYPED_TEST_SUITE(NetworkOf, Scalars, ScalarNames);

constexpr NetworkParams constant{
    .surface_gain = 10.0, .reaching_rate = 50.0, .learning_frequency = 20.0, .basis = {.kind = BasisKind::constant}};

TYPED_TEST(NetworkOf, ItsForceIsThatOfTheEquations) {
    NetworkParams law = constant;
    law.switching_force = 3.0;
    law.layer_thickness = 4.0;
    this->prepare(law);
    // s = 10 e = 2, and half the layer.
    EXPECT_NEAR(number(this->step(0.2).force.x()), -(50.0 * 2.0) - 1.5, 100.0 * this->tolerance);
    EXPECT_NEAR(number(this->step(1.0).force.x()), -(50.0 * 10.0) - 3.0 - h * 400.0 * 2.0, 1000.0 * this->tolerance);
}

TYPED_TEST(NetworkOf, FarFromTheOrbitItLearnsAtTheSameFrequency) {
    // ‖φ‖² over the greater of itself and M, which is 1 at rest, or with T₂(0) = -1 of four inputs 5.
    const auto check = [&](BasisKind kind, double position, double share) {
        NetworkParams law = constant;
        law.basis.kind = kind;
        this->prepare(law);
        this->step(position);
        EXPECT_NEAR(this->learned(position) / (-h * 400.0 * 10.0 * position), share, this->tolerance);
    };
    for (const double position : {0.5, 1000.0}) {
        check(BasisKind::constant, position, 1.0);
        check(BasisKind::linear, position, 1.0);
    }
    check(BasisKind::chebyshev, 0.5, (1.0 + 0.25 + 0.25 + 3.0) / 5.0);
    check(BasisKind::chebyshev, 1000.0, 1.0);
}

TYPED_TEST(NetworkOf, TheFrequencyIsLimitedToWhatASampledLoopBears) {
    NetworkParams law = constant;
    law.surface_gain = 1e-9;
    law.learning_frequency = 1e6;
    this->prepare(law);
    double speed = 1.0;
    for (int n = 0; n < 2000; ++n) {
        const auto signals = TestFixture::C::step(this->state, this->c, {.velocity = vec2<TypeParam>(speed, 0.0)});
        speed += h * number(signals.force.x());
    }
    EXPECT_NEAR(speed, 0.0, 1e-3);
    EXPECT_NEAR(number(this->c.rate), 0.9 * 50.0, 100.0 * this->tolerance);
}

TYPED_TEST(NetworkOf, TheLeakIsExactAndNoLeakIsTooLarge) {
    NetworkParams law = constant;
    law.leak = 100.0;
    this->prepare(law);
    const double first = -h * 400.0 * 2.0;
    this->step(0.2);
    EXPECT_NEAR(this->learned(0.0), first, this->tolerance);
    EXPECT_NEAR(this->learned(0.0), first * std::exp(-0.1), this->tolerance);
    law.leak = 0.0;
    law.error_leak = 50.0;  // ‖s‖ is 2
    this->prepare(law);
    this->step(0.2);
    this->step(0.2);
    EXPECT_NEAR(this->learned(0.0), first * (1.0 + std::exp(-0.1)), this->tolerance);
    law.error_leak = 1e9;
    this->prepare(law);
    this->step(0.2);
    this->step(0.2);
    EXPECT_NEAR(this->learned(0.0), first, this->tolerance);
}

TYPED_TEST(NetworkOf, MinimalLearningIsAGainOfLimitedSize) {
    NetworkParams law = constant;
    law.minimal = true;
    this->prepare(law);
    EXPECT_EQ(this->learned(0.2), 0.0);
    // θ = ½ h ωₐ² s², and the force is -½ θ s.
    EXPECT_NEAR(this->learned(0.2), -0.5 * (0.5 * h * 400.0 * 4.0) * 2.0, this->tolerance);
    for (int n = 0; n < 100; ++n) {
        this->step(1000.0);
    }
    EXPECT_NEAR(number(this->step(0.0).report.gain), 0.8 / h - 50.0, 1e4 * this->tolerance);
    TestFixture::C::start_over(this->state, true);
    EXPECT_NEAR(number(this->step(0.0).report.gain), 0.8 / h - 50.0, 1e4 * this->tolerance);
    TestFixture::C::start_over(this->state, false);
    EXPECT_EQ(number(this->step(0.0).report.gain), 0.0);
}

TYPED_TEST(NetworkOf, WithoutASampleAndAtTheLimitWhatIsLearnedRests) {
    this->prepare(constant);
    this->step(0.2);
    const double learned = this->learned(0.0);
    const Sample<TypeParam> assumed{.value = vec2<TypeParam>(3.0, 3.0)};
    this->step(0.0, &assumed);
    EXPECT_EQ(this->learned(0.0), learned);
    EXPECT_NEAR(number(this->step(0.0).report.norm), -learned, this->tolerance);
    TestFixture::C::start_over(this->state, true);
    EXPECT_EQ(this->learned(0.0), learned);
    TestFixture::C::start_over(this->state, false);
    EXPECT_EQ(this->learned(0.0), 0.0);
    this->prepare(constant, 10.0);
    EXPECT_EQ(number(this->step(0.2).force.x()), -10.0);
    EXPECT_EQ(this->learned(0.0), 0.0);
}

// A free mass, known but for a constant force p: z = ė - m has dz/dt = p + Wᵀφ - β z, and W follows it.
TYPED_TEST(NetworkOf, TheModelFindsAForceFromItsOwnError) {
    NetworkParams law = constant;
    law.surface_gain = 1e-9;
    law.prediction_rate = 20.0;
    law.prediction_weight = 0.5;
    const double rate = law.learning_frequency * law.learning_frequency, push = 7.0;
    this->prepare(law);
    // The equations, with the exact steps of the model: z grows by the force that is unknown.
    double speed = 0.0, weights = 0.0, z = 0.0;
    for (int n = 0; n < 400; ++n) {
        const auto signals = TestFixture::C::step(this->state, this->c, {.velocity = vec2<TypeParam>(speed, 0.0)});
        ASSERT_NEAR(number(signals.report.learned.x()), weights, 40.0 * this->tolerance * 100.0) << n;
        const double unknown = push + weights;
        weights -= h * rate * (speed + 0.5 * z);
        z = std::exp(-0.02) * z + h * unknown;
        speed += h * (number(signals.force.x()) + push);
    }
    EXPECT_NEAR(weights, -push, 0.05);
}

TYPED_TEST(NetworkOf, AtTheForceLimitThePredictionStillLearns) {
    NetworkParams law = constant;
    law.surface_gain = 1e-9;
    law.prediction_rate = 20.0;
    law.prediction_weight = 2.0;
    this->prepare(law, 3.0);
    // Pushed by more than the limit, so that s only grows and its part rests.
    double speed = 0.1;
    for (int n = 0; n < 1000; ++n) {
        const auto signals = TestFixture::C::step(this->state, this->c, {.velocity = vec2<TypeParam>(speed, 0.0)});
        speed += h * (number(signals.force.x()) + 7.0);
    }
    EXPECT_NEAR(this->learned(0.0), -7.0, 0.1);
}

TYPED_TEST(NetworkOf, ThePredictionStartsOverAfterAGap) {
    NetworkParams law = constant;
    law.prediction_weight = 2.0;
    this->prepare(law);
    this->step(0.0);
    this->step(0.0);
    const Sample<TypeParam> assumed{};
    this->step(0.0, &assumed);
    const auto moved = [&](double speed) {
        TestFixture::C::step(this->state, this->c, {.velocity = vec2<TypeParam>(speed, 0.0)});
        return this->learned(0.0);
    };
    EXPECT_NEAR(moved(5.0), -h * 400.0 * 5.0, 100.0 * this->tolerance) << "s alone, as z starts at 0";
    reinterpret_cast<unsigned char&>(this->state.predicts) = 2;
    EXPECT_FALSE(TestFixture::C::sound(this->state, this->c));
}

TYPED_TEST(NetworkOf, NoWeightOfThePredictionDiverges) {
    NetworkParams law = constant;
    law.surface_gain = 1e-9;
    law.prediction_weight = 1e9;
    for (const double rate : {0.1, 5.0, 800.0, 1e5}) {
        for (const double frequency : {1.0, 30.0, 1e4}) {
            law.prediction_rate = rate;
            law.learning_frequency = frequency;
            this->prepare(law);
            double speed = 1.0;
            for (int n = 0; n < 50'000; ++n) {
                const Motion<TypeParam> motion{.velocity = vec2<TypeParam>(speed, 0.0)};
                speed += h * number(TestFixture::C::step(this->state, this->c, motion).force.x());
                ASSERT_LT(std::fabs(speed), 3.0) << rate << ' ' << frequency << ' ' << n;
            }
        }
    }
}

TYPED_TEST(NetworkOf, WithoutASampleLoopsRestAndAStartOverForgetsThem) {
    NetworkParams law = constant;
    law.basis = {.kind = BasisKind::gaussian, .nodes = 4, .outer = 1.0, .gate = 0.5, .center_rate = 5.0};
    this->prepare(law);
    this->step(0.2);
    this->step(0.3);
    const auto& memory = this->state.memory;
    const double value = number(memory.values[0]), force = number(memory.force.x());
    const double center = number(memory.centers[0].position.x());
    EXPECT_NE(force, 0.0);
    EXPECT_NE(center, 0.0);
    const Sample<TypeParam> assumed{.value = vec2<TypeParam>(3.0, 3.0)};
    this->step(0.0, &assumed);
    EXPECT_EQ(number(memory.values[0]), value);
    EXPECT_EQ(number(memory.force.x()), force);
    EXPECT_EQ(number(memory.centers[0].position.x()), center);
    TestFixture::C::start_over(this->state, true);
    EXPECT_EQ(number(memory.values[0]), 0.0);
    EXPECT_EQ(number(memory.force.x()), 0.0);
    EXPECT_EQ(number(memory.centers[0].position.x()), center);
    TestFixture::C::start_over(this->state, false);
    EXPECT_EQ(number(memory.centers[0].position.x()), 0.0);
}

// -- On the paper's plant, in noise

template <class Params>
CaseOf<Params> limited() {
    auto a = CaseOf<Params>::in_noise();
    a.common.force_limit = 1000.0;
    return a;
}

TEST(Network, AConstantBasisIsTheIntegralOfIntegralSlidingMode) {
    auto a = limited<NetworkParams>();
    a.law.reaching_rate = 80.0;
    a.law.learning_frequency = 40.0;
    a.law.basis.kind = BasisKind::constant;
    auto b = limited<IntegralSlidingParams>();
    b.law = {.surface_gain = 30.0, .reaching_rate = 80.0, .integral_rate = 20.0, .observer_frequency = 0.0};
    Loop<Network<double>> ours(a);
    Loop<IntegralSliding<double>> theirs(b);
    for (int n = 0; n < 4000; ++n) {
        ours.step();
        theirs.step();
        ASSERT_NEAR(ours.force.x(), theirs.force.x(), 1e-8) << n;
        ASSERT_NEAR(ours.force.y(), theirs.force.y(), 1e-8) << n;
    }
}

TEST(Network, APredictionLowersTheErrorInNoise) {
    auto a = limited<NetworkParams>();
    const auto error = [&](double weight) {
        a.law.prediction_weight = weight;
        return Loop<Network<double>>(a).rms(10'000, 10'000);
    };
    EXPECT_LT(error(2.0), 0.8 * error(0.0));
}

double error_of(const BasisParams& basis, bool minimal = false, bool model = true) {
    auto a = limited<NetworkParams>();
    a.law.surface_gain = 36.0;
    a.law.reaching_rate = 150.0;
    a.law.minimal = minimal;
    a.law.nominal_model = model;
    a.law.basis = basis;
    return Loop<Network<double>>(a).rms(10'000, 10'000);
}

TEST(Network, NodesLearnWhatTheModelLacksAndOnlyIfTheyAreWhereTheMotionIs) {
    const double gaussian = error_of({});
    EXPECT_LT(error_of({.kind = BasisKind::chebyshev}), 1e-4);
    EXPECT_LT(gaussian, 3e-4);
    EXPECT_GT(error_of({.layout = Layout::diagonal, .nodes = 7}), 8.0 * gaussian);
    EXPECT_GT(error_of({}, /*minimal=*/true), 8.0 * gaussian);
    EXPECT_GT(error_of({}, false, /*model=*/false), 8.0 * gaussian);
}

// A surface without any learning has more than eight times the error of the nodes.
TEST(Network, EachSettingLearnsButNoneLowersTheErrorByATenth) {
    const double plain = error_of({});
    const auto check = [&](const BasisParams& p) {
        const double error = error_of(p);
        EXPECT_NE(error, plain);
        EXPECT_GT(error, 0.9 * plain);
        EXPECT_LT(error, 5.0 * plain);
    };
    check({.inner = 0.5});
    check({.outer = 0.5});
    check({.gate = 0.5});
    check({.center_rate = 5.0, .width_rate = 5.0});
    check({.normalized = true});
    check({.kind = BasisKind::membership, .nodes = 20});
    check({.normalized = true, .inner = 0.5, .outer = 0.5, .gate = 0.5, .center_rate = 5.0, .width_rate = 5.0});
}

TEST(Network, WeightsStayBoundedInNoiseWithoutALeak) {
    Loop<Network<double>> loop(limited<NetworkParams>());
    double halfway = 0.0;
    for (int n = 0; n < 200'000; ++n) {
        loop.step();
        halfway = n == 100'000 ? loop.signals.report.norm : halfway;
    }
    EXPECT_NEAR(loop.signals.report.norm / halfway, 1.0, 0.2);
}

}  // namespace
}  // namespace fracgyro::testing
