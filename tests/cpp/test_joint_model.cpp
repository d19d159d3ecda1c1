// Assumptions of the joint filter, in numbers: its map, process noise, prior and drifts.
#include "joint.hpp"

#include <cmath>

namespace fracgyro::testing {
namespace {

// Far from the nominal plant, where the covariance must use the map at the estimates.
TEST(JointModel, ItsMapIsThatOfThePlantAtTheEstimates) {
    Case a;
    a.plant.rate = 0.03;
    a.plant.stiffness = {0.96, 0.02, 1.05};
    a.plant.damping = {0.02, 0.01, 0.03};
    a.common.force_limit = 1.0;
    Loop<Both<double>> loop(a);
    loop.run(6000);
    const auto report = Both<double>::report(loop.state, loop.c);
    EXPECT_NEAR(report.rate, a.plant.rate, 1e-3);
    GyroscopeParams found{.damping = report.damping, .stiffness = report.stiffness, .rate = report.rate};
    const auto exact = Gyroscope<double>::prepare(found, a.common.step);
    for (std::size_t j = 0; j < 4; ++j) {
        std::array<double, 4> unit{};
        unit[j] = 1.0;
        Motion<double> m{.position = {unit[0], unit[1]}, .velocity = {unit[2], unit[3]}};
        Gyroscope<double>::step(m, exact, {});
        const std::array column{m.position.x(), m.position.y(), m.velocity.x(), m.velocity.y()};
        for (std::size_t i = 0; i < 4; ++i) {
            EXPECT_NEAR(loop.state.adaptation.map[i][j], column[i], 1e-5) << i << " " << j;
        }
    }
}

// Mean of residual²/variance of every number, which of a consistent filter is 1.
template <class C>
void expect_consistent_innovations(std::int64_t slots) {
    Case a;
    a.velocity_noise = a.law.datasheet.velocity_noise = 3e-5;
    a.law.adaptation.covariance_steps = slots;
    Loop<C> loop(a);
    loop.run(4000);
    constexpr std::size_t sensors = Loop<C>::Filter::sensors;
    constexpr int samples = 8000;
    std::array<double, sensors> mean{};
    for (int n = 0; n < samples; ++n) {
        const auto before = loop.state.adaptation;
        loop.step();
        const auto& r = loop.signals.reference;
        const std::array residual{loop.seen.position.x() - r.position.x() - before.error.value.x(),
                                  loop.seen.position.y() - r.position.y() - before.error.value.y(),
                                  loop.seen.velocity.x() - r.velocity.x() - before.error.derivative.x(),
                                  loop.seen.velocity.y() - r.velocity.y() - before.error.derivative.y()};
        for (std::size_t i = 0; i < sensors; ++i) {
            mean[i] += residual[i] * residual[i] * before.precision[i] / samples;
        }
    }
    for (std::size_t i = 0; i < sensors; ++i) {
        EXPECT_NEAR(mean[i], 1.0, 0.1) << i << " of a span of " << slots;  // 6 deviations of the mean
    }
}

TEST(JointModel, WhatItDoesNotForeseeHasTheVarianceThatItForesees) {
    for (const std::int64_t slots : {1, 4}) {
        expect_consistent_innovations<Positions<double>>(slots);
        expect_consistent_innovations<Both<double>>(slots);
    }
}

// A plant that is `factor` times as fast, with all its settings.
Case faster(Case a, double factor) {
    const double square = factor * factor;
    a.common.step /= factor;
    a.common.reference.frequency = factor * a.common.reference.frequency;
    PlantModel<double>& nominal = a.common.nominal;
    nominal = {
        .damping = factor * nominal.damping, .stiffness = square * nominal.stiffness, .rate = factor * nominal.rate};
    a.law.datasheet.force_noise *= square;
    a.law.datasheet.velocity_noise *= factor;
    a.law.adaptation.rate_forgetting *= factor;
    a.law.adaptation.forgetting *= factor;
    return a;
}

template <class C>
void expect_no_unit_of_time() {
    using Filter = typename Loop<C>::Filter;
    constexpr double factor = 4.0, square = factor * factor;
    Case a;
    a.law.adaptation.rate_forgetting = 0.02;
    a.law.adaptation.forgetting = 0.001;
    Loop<C> loop(a);
    const Case fast = faster(a, factor);
    const auto c = C::prepare(fast.law, fast.common).adaptation.filter;
    typename Filter::State state{};
    for (int n = 0; n < 3000; ++n) {
        loop.step();
        const auto& r = loop.signals.reference;
        const ReferencePoint<double> reference{.position = r.position, .velocity = factor * r.velocity};
        Filter::correct(state, c, {.position = loop.seen.position, .velocity = factor * loop.seen.velocity}, reference);
        Filter::predict(state, c, reference, square * loop.signals.force, true);
        const auto& slow = loop.state.adaptation;
        const double deviation = Filter::rate_deviation(slow, loop.c.adaptation.filter);
        ASSERT_NEAR(Filter::rate_deviation(state, c) / factor / deviation, 1.0, 1e-4) << n;
        for (std::size_t i = 0; i < 7; ++i) {
            const double unit = i < 4 ? factor : square, known = i < 4 ? deviation : 1e-6;
            ASSERT_NEAR(state.plant[i] / unit, slow.plant[i], 1e-3 * known + 1e-6 * std::abs(slow.plant[i])) << n << i;
        }
    }
}

TEST(JointModel, ItKnowsOfNoUnitOfTime) {
    expect_no_unit_of_time<Positions<double>>();
    expect_no_unit_of_time<Both<double>>();
}

// A motion of 2 sin t on x and 3 sin 2t on y: mean squares 2 and 4.5, of the velocities 2 and 18. The information on a
// parameter per unit of time is the mean square of its force over the density of the noise.
Case of_two_lines(const Datasheet& said) {
    Case a;
    a.law.datasheet = said;
    a.common.reference.amplitude = {2.0, 3.0};
    a.common.reference.frequency = {1.0, 2.0};
    a.common.nominal = {.stiffness = {5.0, 0.0, 10.0}};
    a.law.adaptation.rate_forgetting = 2e-4;
    a.law.adaptation.forgetting = 1e-4;
    return a;
}

template <class C>
void expect_drift(const Case& a, const std::array<double, 7>& information) {
    const auto c = C::prepare(a.law, a.common).adaptation.filter;
    for (std::size_t i = 0; i < 7; ++i) {
        const double bandwidth = i == 0 ? 2e-4 : 1e-4, h = a.common.step;
        EXPECT_NEAR(c.drift[i] * c.noise.variance * information[i] / (bandwidth * bandwidth * h), 1.0, 1e-5) << i;
    }
}

TEST(JointModel, WhatMayDriftGrowsByTheSquareOfItsBandwidthOverTheInformationOnIt) {
    const double h = Case().common.step, density = 1e-3 * 1e-3 * h;
    const auto over = [&](std::array<double, 7> sums) {
        for (double& sum : sums) {
            sum /= density;
        }
        return sums;
    };
    Case a = of_two_lines({.force_noise = 1e-3});
    expect_drift<Positions<double>>(a, over({4.0 * 20.0, 2.0, 20.0, 18.0, 2.0, 6.5, 4.5}));
    // Noise so large that the information on each parameter is less than one over a unit of time.
    const double much = 1e3 * 1e3 * h;
    expect_drift<Positions<double>>(
        of_two_lines({.force_noise = 1e3}),
        {4.0 * 20.0 / much, 2.0 / much, 20.0 / much, 18.0 / much, 2.0 / much, 6.5 / much, 4.5 / much});
    // Sensing noise is force noise of (k - w²)² times its density: 16 of x on x, 81 of x on y, 1 of y on x, 36 of y
    // on y.
    a = of_two_lines({.position_noise = 1e-3});
    const double xx = 2.0 / 16.0, xy = 2.0 / 81.0, yx = 4.5, yy = 4.5 / 36.0;
    expect_drift<Positions<double>>(a, over({4.0 * (xy + 4.0 * yx), xx, xy + 4.0 * yx, 4.0 * yy, xx, xy + yx, yy}));
    // A velocity sensor with the noise of the position sensor adds w² times its information: 1 + 1 on x, 1 + 4 on y.
    a = of_two_lines({.position_noise = 1e-3, .velocity_noise = 1e-3});
    expect_drift<Both<double>>(a, over({8.0 * xy + 80.0 * yx, 2.0 * xx, 2.0 * xy + 20.0 * yx, 20.0 * yy, 2.0 * xx,
                                        2.0 * xy + 5.0 * yx, 5.0 * yy}));

    a.common.reference.amplitude = {2.0, 0.0};  // which carries no information on Dyy and Kyy
    const auto c = Both<double>::prepare(a.law, a.common).adaptation.filter;
    EXPECT_EQ(c.drift[3], 0.0);
    EXPECT_EQ(c.drift[6], 0.0);
    EXPECT_GT(c.drift[4], 0.0);
}

// A free mass under independent forces, one a step. Of these a span of 4 steps has one number: its mean velocity lacks
// a quarter to three quarters of all but the last, h²(1² + 2² + 3²)/4² of variance.
TEST(JointModel, TheMeanOfASpanHasTheNoiseOfTheForcesWithinIt) {
    Case a;
    a.common.nominal = {};
    a.law.datasheet = {.force_noise = 2.0, .position_noise = 1e-5, .velocity_noise = 1e-4};
    const auto more = [&](std::int64_t slots, std::size_t i) {
        a.law.adaptation.covariance_steps = slots;
        const auto c = Both<double>::prepare(a.law, a.common).adaptation.filter;
        const double single = i < 2 ? 1e-10 : 1e-8;
        return c.noise.measured[i] * c.noise.variance - single / static_cast<double>(slots);
    };
    const double h = a.common.step;
    for (const std::size_t i : {2U, 3U}) {
        EXPECT_NEAR(more(1, i), 0.0, 1e-15);
        EXPECT_NEAR(more(4, i) / (2.0 * 2.0 * h * h * 14.0 / 16.0), 1.0, 1e-9);
        EXPECT_NEAR(more(2, i) / (2.0 * 2.0 * h * h / 4.0), 1.0, 1e-9);
    }
}

TEST(JointModel, AMotionThatIsNotMeasuredMayBeAsFastAsTheReferenceOrAFreeOneAtFirst) {
    const auto deviation = [](double frequency) {
        Case a;
        a.common.nominal.stiffness = {9.0, 0.0, 9.0};
        a.common.reference.amplitude = {1.0, -2.0};
        a.common.reference.frequency = {frequency, frequency};
        const auto c = Positions<double>::prepare(a.law, a.common).adaptation.filter;
        return std::sqrt(c.prior.motion[2] * c.noise.variance);
    };
    EXPECT_NEAR(deviation(5.0), 2.0 * 5.0, 1e-12);
    EXPECT_NEAR(deviation(0.5), 2.0 * 3.0, 1e-12);
}

TEST(JointModel, ExactSensorsLeaveTheNoiseOfTheForce) {
    Case a;
    a.position_noise = a.velocity_noise = 0.0;
    a.law.datasheet = {.force_noise = a.force_noise};
    Loop<Positions<double>> loop(a);
    loop.run(20000);
    // The force of a rate is 2 Ωz times the speed of the other axis: mean square ½ and ½ 1.0135².
    const double information = 4.0 * (0.5 + 0.5 * 1.0135 * 1.0135) * 1000.0 / (1e-7 * 1e-7 * a.common.step);
    EXPECT_NEAR(loop.deviation() * std::sqrt(information), 1.0, 0.05);
    EXPECT_NEAR(loop.rate(), a.plant.rate, 5.0 * loop.deviation());
}

}  // namespace
}  // namespace fracgyro::testing
