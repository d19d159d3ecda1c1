// Resonators: closed forms of their loop.
#include "scalars.hpp"

#include "fracgyro/control/course.hpp"
#include "fracgyro/controllers/resonant.hpp"
#include "fracgyro/hardware/observer.hpp"
#include "fracgyro/sim/device_loop.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

namespace fracgyro::testing {
namespace {

using Complex = std::complex<double>;
constexpr double h = 1e-3;

// The paper's plant, whose damping and stiffness are 5 % larger than nominal, on its reference. No disturbance.
DeviceSetupOf<ResonantParams> setup_of(double gain, double duration) {
    DeviceSetupOf<ResonantParams> s{};
    s.controller = {.pid = {.integral_frequency = 0.0}, .resonator_gain = gain};
    s.common = {.step = h};
    s.common.reference = {.frequency = {4.17, 5.11}, .phase = {0.0, 1.5707963267948966}};
    s.plant = {.damping = {0.01, 0.002, 0.01}, .stiffness = {355.3, 70.99, 532.9}, .rate = 0.1};
    s.plant.initial_position = {0.0, 1.0};
    s.plant.initial_velocity = {4.17, 0.0};
    s.common.nominal = {
        .damping = 0.95 * s.plant.damping, .stiffness = 0.95 * s.plant.stiffness, .rate = 0.95 * s.plant.rate};
    s.steps = static_cast<std::int64_t>(duration / h);
    return s;
}

std::vector<Vec2<double>> errors_of(const DeviceSetupOf<ResonantParams>& s) {
    std::vector<Vec2<double>> errors;
    run_device_loop<Resonant<double>>(s, [&](const auto& at) { errors.push_back(at.signals.error.value); });
    return errors;
}
double largest(const std::vector<Vec2<double>>& errors, double from, double to, double step = h) {
    double found = 0.0;
    for (auto n = static_cast<std::size_t>(from / step); n < static_cast<std::size_t>(to / step); ++n) {
        found = std::max({found, std::abs(errors[n].x()), std::abs(errors[n].y())});
    }
    return found;
}

TEST(Resonant, LeavesNoErrorAtItsFrequenciesOnAPlantFivePercentOff) {
    const double without = largest(errors_of(setup_of(0.0, 40.0)), 30.0, 40.0);
    EXPECT_GT(without, 4e-4) << "5 % of a stiffness of 355 over 200^2";
    EXPECT_LT(largest(errors_of(setup_of(2.0, 40.0)), 30.0, 40.0), 1e-10);
}

// With one frequency: the error's amplitude there, a rotating phasor, is that of e^(-k t/2).
TEST(Resonant, TheErrorDecaysAtHalfTheGain) {
    for (const double integral : {0.0, 20.0}) {
        auto s = setup_of(0.2, 30.0);
        s.controller.pid.integral_frequency = integral;
        s.common.reference.frequency = {4.0, 4.0};
        s.plant.initial_velocity = {4.0, 0.0};
        const auto errors = errors_of(s);
        const double later = 7.0 * 1.5707963267948966;  // periods
        EXPECT_NEAR(std::log(largest(errors, 10.0, 12.0) / largest(errors, 10.0 + later, 12.0 + later)),
                    0.5 * 0.2 * later, 0.01);
    }
}

// A loop whose damper, not its spring, holds the error at the reference's frequency: the resonators need a phase lead
// of nearly 90 degrees. Without it, they would barely be stable.
TEST(Resonant, DecaysAtThatRateAtResonanceToo) {
    DeviceSetupOf<ResonantParams> s{};
    s.controller = {.pid = {.natural_frequency = 0.05, .integral_frequency = 0.0}, .resonator_gain = 0.002};
    s.common = {.step = 0.05};
    s.common.reference = {.frequency = {1.0, 1.0}, .phase = {0.0, 1.5707963267948966}};
    s.common.nominal = {.damping = {1e-4, 0.0, 1e-3}, .stiffness = {1.0, 0.0, 1.027}};
    s.plant = {.damping = {1e-4, 0.0, 1e-3}, .stiffness = {1.0, 1e-4, 1.027}, .rate = 1e-4};
    s.plant.initial_position = {0.0, 1.0};
    s.plant.initial_velocity = {1.0, 0.0};
    s.steps = 40'000;
    const auto errors = errors_of(s);
    const double early = largest(errors, 800.0, 810.0, 0.05), late = largest(errors, 1600.0, 1610.0, 0.05);
    EXPECT_NEAR(std::log(early / late), 0.5 * 0.002 * 800.0, 0.05);
}

TEST(Resonant, TheGrowthOfTheForceIsTheLoopInverted) {
    auto s = setup_of(3.0, 1.0);
    s.common.reference.frequency = {4.0, 4.0};
    const auto c = Resonant<double>::prepare(s.controller, s.common);
    const double wn = 200.0;
    const Complex inverse{wn * wn + 0.95 * 355.3 - 16.0, 4.0 * (2.0 * 0.7 * wn + 0.95 * 0.01)};
    const Complex share{3.0, -1.5 * 1.5 / 4.0},
        found{c.resonators[0].gain.real.x(), c.resonators[0].gain.imaginary.x()};
    EXPECT_LT(std::abs(found / (h * share * inverse) - std::polar(1.0, 1.5 * 4.0 * h)), 1e-12);
    EXPECT_EQ(c.resonators[0].cosine, sine_cosine<double>(phase_of(0.004)).cosine);
}

std::vector<double> frequencies(ReferenceParams reference, const std::vector<SineTerm>& terms = {}) {
    const Course course = make_course(reference, h, terms, {});
    reference.course = needs_course(reference) ? &course : nullptr;
    const auto c = Resonant<double>::prepare({}, {.step = h, .reference = reference});
    std::vector<double> found;
    for (std::size_t i = 0; i < c.count; ++i) {
        if (c.resonators[i].cosine != 0.0) {
            found.push_back(std::round(1e9 * std::atan2(c.resonators[i].sine, c.resonators[i].cosine) / h) / 1e9);
        }
    }
    return found;
}
TEST(Resonant, HasAResonatorForEachFrequencyThatAnAxisHas) {
    using enum ReferenceKind;
    using List = std::vector<double>;
    EXPECT_EQ(frequencies({.frequency = {2.0, 3.0}}), (List{2.0, 3.0}));
    EXPECT_EQ(frequencies({.frequency = {2.0, 2.0}}), (List{2.0}));
    EXPECT_EQ(frequencies({.frequency = {2.0, 2.001}}), (List{2.0})) << "as good as the same";
    EXPECT_EQ(frequencies({.frequency = {-2.0, 0.0}}), (List{2.0})) << "the integral is the resonator at 0";
    EXPECT_EQ(frequencies({.amplitude = {1.0, 0.0}, .frequency = {2.0, 3.0}}), (List{2.0}));
    EXPECT_EQ(frequencies({.frequency = {2.0, 1001.0}}), (List{2.0})) << "above 1/h the loop cannot act";
    EXPECT_EQ(frequencies({.frequency = {2.0, 3.0}, .offset = {0.1, 0.0}}), (List{2.0, 3.0}));
    EXPECT_EQ(frequencies({.kind = {sine, rest}, .frequency = {2.0, 3.0}}), (List{2.0}));
    EXPECT_EQ(frequencies({.kind = {step, chirp}, .frequency = {2.0, 3.0}}), (List{}));
    const std::vector<SineTerm> terms{
        {{1.0, 1.0}, {1.0, 2.0}, {}}, {{1.0, 1.0}, {3.0, 1.0}, {}}, {{0.0, 1.0}, {9.0, 4.0}, {}}};
    EXPECT_EQ(frequencies({.kind = {sines, sines}}, terms), (List{1.0, 3.0, 2.0, 4.0}));
    std::vector<SineTerm> many(12);
    for (std::size_t i = 0; i < many.size(); ++i) {
        many[i] = {{1.0, 1.0}, {1.0 + static_cast<double>(i), 50.0}, {}};
    }
    EXPECT_EQ(frequencies({.kind = {sines, sines}}, many), (List{1, 2, 3, 4, 5, 6, 7, 8})) << "the first that differ";
}

// A force of 250 cannot follow a reference that needs 380: at each start of a period it is at the limit. As soon as
// the limit is lifted, the controller follows as one that was never limited.
TEST(Resonant, DoesNotWindUpAtTheForceLimit) {
    const auto s = setup_of(5.0, 1.0);
    Common limited = s.common;
    limited.force_limit = 250.0;
    using Law = Resonant<double>;
    const auto within = Law::prepare(s.controller, limited), free = Law::prepare(s.controller, s.common);
    const auto plant = Gyroscope<double>::prepare(s.plant, h);
    Law::State state{};
    Motion<double> motion = Gyroscope<double>::start(s.plant);
    double at_limit = 0.0, after = 0.0;
    for (int n = 0; n < 60'000; ++n) {
        const auto signals = Law::step(state, n < 50'000 ? within : free, motion);
        at_limit += signals.excess == Vec2<double>{} ? 0.0 : 1.0;
        if (n >= 54'000) {
            after = std::max({after, std::abs(signals.error.value.x()), std::abs(signals.error.value.y())});
        }
        Gyroscope<double>::step(motion, plant, signals.force);
    }
    EXPECT_GT(at_limit, 20'000.0);
    EXPECT_LT(after, 1e-6);
}

}  // namespace
}  // namespace fracgyro::testing
