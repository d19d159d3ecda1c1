// The controller with a model of its reference: its gains, and what the loop keeps of noise, delays, limits and faults.
#include "fracgyro/controllers/internal_model.hpp"
#include "fracgyro/control/course.hpp"
#include "follow.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

namespace fracgyro::testing {
namespace {

// -- Riccati equations ------------------------------------------------------------------------------------------------

TEST(Riccati, ThatOfAnIntegratorIsTheGoldenRatio) {
    LeadingMatrix<3> a{.size = 1}, h{.size = 1};
    a[0][0] = h[0][0] = 1.0;
    Table<3, 1> b{};
    b[0][0] = 1.0;
    const std::array<double, 1> r{1.0};
    const auto x = riccati(a, b, h, r);  // X = X/(1 + X) + 1
    EXPECT_NEAR(x[0][0], std::numbers::phi, 1e-15);
    EXPECT_NEAR(riccati_gain(x, b, r)[0][0], 1.0 / std::numbers::phi, 1e-15);
    const std::array<double, 1> small{1e-12};
    EXPECT_NEAR(riccati(a, b, h, small)[0][0], 1.0 + 1e-12, 1e-15);
}

// The one solution with a stable closed loop, for inputs that are cheap and dear.
TEST(Riccati, RandomSystemsSatisfyTheEquationWithAStableLoop) {
    std::mt19937_64 random(1);
    const auto any = [&] { return std::ldexp(static_cast<double>(random() >> 11), -52) - 1.0; };
    constexpr std::size_t room = 9;
    for (int trial = 0; trial < 200; ++trial) {
        const std::size_t size = 2 + static_cast<std::size_t>(trial) % 8;
        LeadingMatrix<room> a{.size = size}, root{.size = size};
        Table<room, 2> b{};
        for (std::size_t i = 0; i < size; ++i) {
            for (std::size_t j = 0; j < size; ++j) {
                a[i][j] = any();
                root[i][j] = any();
            }
            b[i] = {any(), any()};
        }
        const auto h = root * root.transposed();
        const double price = std::pow(10.0, 2.0 - trial % 11);
        const std::array<double, 2> r{price, 2.0 * price};
        const auto x = riccati(a, b, h, r);
        const auto gain = riccati_gain(x, b, r);
        LeadingMatrix<room> closed = a;  // A - B K
        for (std::size_t i = 0; i < size; ++i) {
            for (std::size_t j = 0; j < size; ++j) {
                for (std::size_t k = 0; k < 2; ++k) {
                    for (std::size_t n = 0; n < size; ++n) {
                        closed[i][j] -= b[i][k] * gain[k][n] * a[n][j];
                    }
                }
            }
        }
        const auto expected = a.transposed() * (x * closed) + h;
        double largest = 0.0;
        for (std::size_t i = 0; i < size; ++i) {
            largest = std::max(largest, x[i][i]);
        }
        for (std::size_t i = 0; i < size; ++i) {
            for (std::size_t j = 0; j < size; ++j) {
                EXPECT_NEAR(x[i][j], expected[i][j], 1e-10 * largest) << trial;
            }
        }
        for (int n = 0; n < 12; ++n) {
            closed = closed * closed;
        }
        for (std::size_t i = 0; i < size; ++i) {
            EXPECT_LT(std::abs(closed[i][i]), 1e-3) << trial;
        }
    }
}

// -- The loop ---------------------------------------------------------------------------------------------------------

using FromBoth = InternalModelOf<double, true>;
using FromPositionsOnly = InternalModelOf<double, false>;

using Case = CaseOf<InternalModelParams>;

template <class C>
class InternalModelFrom : public ::testing::Test {};
using Both = ::testing::Types<FromBoth, FromPositionsOnly>;
struct Sensing {
    template <class C>
    static std::string GetName(int) {
        return C::measures_velocity ? "both" : "positions";
    }
};
TYPED_TEST_SUITE(InternalModelFrom, Both, Sensing);

TYPED_TEST(InternalModelFrom, WithoutNoiseNoErrorRemainsWhateverThePlant) {
    for (const double factor : {1.0, 0.8, 1.5}) {
        Case a;
        a.plant.stiffness = factor * a.plant.stiffness;
        Loop<TypeParam> loop(a);
        EXPECT_LT(loop.rms(40'000, 4'000), 4e-8) << factor;
    }
}

TYPED_TEST(InternalModelFrom, AConstantForceLeavesNoError) {
    Loop<TypeParam> loop(Case{});
    for (int n = 0; n < 40'000; ++n) {
        loop.step({20.0, -30.0});
    }
    for (int n = 0; n < 1'000; ++n) {
        EXPECT_LT(norm(loop.step({20.0, -30.0})), 1e-7);
    }
    EXPECT_NEAR(loop.state.constant.x(), 20.0, 0.5);
    EXPECT_NEAR(loop.state.constant.y(), -30.0, 0.5);
}

// The feedforward is exact for the held force, and after its delay: the oscillators have nothing to do.
TYPED_TEST(InternalModelFrom, OfAKnownPlantNoForceIsLacking) {
    for (const std::size_t delay : {0U, 2U, 8U}) {
        Case a;
        a.common.nominal = {.damping = a.plant.damping, .stiffness = a.plant.stiffness, .rate = a.plant.rate};
        a.law.datasheet.delay = static_cast<std::int64_t>(delay);
        a.delay = delay;
        Loop<TypeParam> loop(a);
        EXPECT_LT(loop.rms(25'000, 1'000), 5e-8) << delay;
        for (std::size_t i = 0; i < 2; ++i) {
            EXPECT_LT(norm(loop.state.cosine[i]) + norm(loop.state.sine[i]), 1e-4) << delay;
        }
    }
}

// -- Noise, delay, single precision -----------------------------------------------------------------------------------

// The variances follow from the linear loop: 3.55e-6 from both, 3.95e-5 from positions at 0.5 (docs/decisions/0047).
TEST(InternalModel, ItsErrorInNoiseIsThatOfTheLinearLoop) {
    Case a = Case::in_noise();
    EXPECT_NEAR(Loop<FromBoth>(a).rms(10'000, 60'000), 1.414 * 3.55e-6, 0.1 * 5.0e-6);
    a.law.feedback.loop_bandwidth = 0.5;
    EXPECT_NEAR(Loop<FromPositionsOnly>(a).rms(10'000, 60'000), 1.414 * 3.95e-5, 0.1 * 5.6e-5);
}

TEST(InternalModel, OneStepOfHiddenDelayCostsAtMostAFactorOfTwo) {
    for (const double bandwidth : {0.3, 0.75, 1.1}) {
        for (const std::size_t known : {0U, 1U, 4U}) {
            Case a = Case::in_noise();
            a.law.feedback.loop_bandwidth = bandwidth;
            a.law.datasheet.delay = static_cast<std::int64_t>(known);
            a.delay = known;
            Case hidden = a;
            hidden.delay = known + 1;
            const double expected = Loop<FromBoth>(a).rms(10'000, 20'000);
            EXPECT_LT(Loop<FromBoth>(hidden).rms(10'000, 20'000), 2.1 * expected) << bandwidth << " " << known;
            const double positions = Loop<FromPositionsOnly>(a).rms(10'000, 20'000);
            EXPECT_LT(Loop<FromPositionsOnly>(hidden).rms(10'000, 20'000), 1.2 * positions) << bandwidth << known;
        }
    }
}

TEST(InternalModel, AKnownDelayOfEightStepsIsStable) {
    Case a = Case::in_noise();
    a.law.datasheet.delay = 8;
    a.delay = 8;
    EXPECT_LT(Loop<FromBoth>(a).rms(10'000, 10'000), 1e-4);
    EXPECT_LT(Loop<FromPositionsOnly>(a).rms(10'000, 10'000), 2e-4);
}

TEST(InternalModel, SinglePrecisionHasTheSameError) {
    const Case a = Case::in_noise();
    const double wide = Loop<FromBoth>(a).rms(10'000, 20'000);
    EXPECT_NEAR((Loop<InternalModelOf<float, true>>(a).rms(10'000, 20'000)), wide, 0.01 * wide);
    const double positions = Loop<FromPositionsOnly>(a).rms(10'000, 20'000);
    EXPECT_NEAR((Loop<InternalModelOf<float, false>>(a).rms(10'000, 20'000)), positions, 0.01 * positions);
}

// -- Force limit, missing samples, restart ----------------------------------------------------------------------------

// The known plant lacks no force: oscillators that mistake a limited force for one would wind up.
TYPED_TEST(InternalModelFrom, AtTheForceLimitNothingWindsUp) {
    Case a;
    a.common.nominal = {.damping = a.plant.damping, .stiffness = a.plant.stiffness, .rate = a.plant.rate};
    a.common.force_limit = 700.0;
    Loop<TypeParam> loop(a);
    double lacking = 0.0, excess = 0.0;
    int limited = 0;
    for (int n = 0; n < 1'000; ++n) {
        loop.step();
        EXPECT_LE(norm(loop.force), 1.0001 * std::sqrt(2.0) * 700.0);
        excess = std::max(excess, norm(loop.signals.excess));
        limited += norm(loop.signals.excess) > 0.0 ? 1 : 0;
        lacking = std::max(lacking, norm(loop.state.cosine[0]) + norm(loop.state.sine[1]) + norm(loop.state.constant));
    }
    EXPECT_GT(excess, 1e3);
    EXPECT_GT(limited, 20);
    EXPECT_LT(lacking, 1e-3 * 700.0);
    EXPECT_LT(loop.rms(0, 1'000), 1e-4);
}

// Braking begins in time: the least possible RMS over ten units is 0.0190 and 0.0231 (a convex problem).
TYPED_TEST(InternalModelFrom, FromAfarItApproachesNearlyAsFastAsTheLimitAllows) {
    Case a;
    a.common.force_limit = 1000.0;
    const Vec2<double> start = Loop<TypeParam>(a).rms_of_axes();
    EXPECT_LT(start.x(), 0.0190 * 1.05);
    EXPECT_LT(start.y(), 0.0231 * 1.05);
}

TYPED_TEST(InternalModelFrom, WithoutSamplesItPredictsTheMotionUnderTheHeldForce) {
    Case a;
    a.common.nominal = {.damping = a.plant.damping, .stiffness = a.plant.stiffness, .rate = a.plant.rate};
    for (const std::size_t delay : {0U, 2U}) {
        a.delay = delay;
        a.law.datasheet.delay = static_cast<std::int64_t>(delay);
        Loop<TypeParam> loop(a);
        loop.rms(20'000, 1);
        for (int n = 0; n < 50; ++n) {
            loop.step({}, true);
        }
        Loop<TypeParam> next = loop;
        const Vec2<double> error = next.step({}, true);
        EXPECT_GT(norm(error), 1e-3);
        EXPECT_NEAR(loop.state.error.value.x(), error.x(), 4e-6);
        EXPECT_NEAR(loop.state.error.value.y(), error.y(), 4e-6);
        EXPECT_LT(loop.rms(500, 500), 1e-5);
    }
}

TYPED_TEST(InternalModelFrom, StartingOverKeepsTheLackingForceOrDropsIt) {
    Loop<TypeParam> loop(Case{});
    loop.rms(20'000, 1);
    auto kept = loop.state, dropped = loop.state;
    TypeParam::start_over(kept, true);
    TypeParam::start_over(dropped, false);
    EXPECT_FALSE(kept.started);
    EXPECT_EQ(norm(kept.error.value), 0.0);
    EXPECT_EQ(norm(kept.past[1]), 0.0);
    EXPECT_GT(norm(kept.cosine[0]) + norm(kept.sine[0]), 10.0);
    EXPECT_EQ(norm(dropped.cosine[0]) + norm(dropped.sine[0]), 0.0);
    EXPECT_EQ(TypeParam::steps(kept), TypeParam::steps(loop.state));
    EXPECT_EQ(TypeParam::steps(dropped), 20'001U);
}

// -- References -------------------------------------------------------------------------------------------------------

std::array<double, 4> frequencies_of(ReferenceParams r) {
    const Course course = make_course(r, h, {}, {});
    r.course = r.course == nullptr ? &course : r.course;
    return InternalModelDesign::prepare({}, {.step = h, .reference = r}, true).frequencies;
}

TEST(InternalModel, ItHasOneOscillatorForEachFrequencyOfTheReference) {
    using Four = std::array<double, 4>;
    EXPECT_EQ(frequencies_of({.frequency = {3.0, -2.0}}), (Four{3.0, 2.0, 0.0, 0.0}));
    EXPECT_EQ(frequencies_of({.frequency = {3.0, 3.0}}), (Four{3.0, 0.0, 0.0, 0.0}));
    EXPECT_EQ(frequencies_of({.amplitude = {0.0, 1.0}, .frequency = {3.0, 2.0}}), (Four{2.0, 0.0, 0.0, 0.0}));
    EXPECT_EQ(frequencies_of({.frequency = {0.0, 4000.0}}), (Four{})) << "more than samples show";
    EXPECT_EQ(frequencies_of({.kind = {ReferenceKind::step, ReferenceKind::sine}, .frequency = {3.0, 2.0}}),
              (Four{2.0, 0.0, 0.0, 0.0}));
}

TEST(InternalModel, OfMoreThanFourFrequenciesItTakesThoseOfTheLargestAmplitudes) {
    std::array<SineTerm, 6> terms{};
    for (std::size_t i = 0; i < terms.size(); ++i) {
        terms[i] = {.amplitude = {0.1, 1.0 + static_cast<double>((i + 4) % 6)},
                    .frequency = {1.0 + static_cast<double>(i), 1.0 + static_cast<double>(i)}};
    }
    ReferenceParams r{.kind = {ReferenceKind::sines, ReferenceKind::sines}};
    const Course course = make_course(r, h, terms, {});
    r.course = &course;
    auto found = frequencies_of(r);
    std::ranges::sort(found);
    EXPECT_EQ(found, (std::array<double, 4>{1.0, 2.0, 5.0, 6.0}));
}

// A reference without oscillators: the force in the middle of the coming step.
TYPED_TEST(InternalModelFrom, AnyOtherReferenceIsFollowedByFeedforward) {
    Case a;
    a.common.nominal = {.damping = a.plant.damping, .stiffness = a.plant.stiffness, .rate = a.plant.rate};
    a.common.reference = {.kind = {ReferenceKind::step, ReferenceKind::ramp}, .slope = {0.0, 1.0}, .smoothing = 0.3};
    a.plant.initial_position = {0.0, 0.0};
    const Course course = make_course(a.common.reference, h, {}, {});
    a.common.reference.course = &course;
    Loop<TypeParam> loop(a);
    EXPECT_LT(loop.rms(0, 3'000), 2e-6);
}

}  // namespace
}  // namespace fracgyro::testing
