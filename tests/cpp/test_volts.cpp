// A device in volts: electrodes, amplifiers, delays, and how a run steps them. Closed forms are those of EQUATIONS.md.
#include "dual_mass_electrodes.hpp"
#include "joint.hpp"
#include "paper.hpp"
#include "scalars.hpp"

#include "fracgyro/sim/any_run.hpp"

#include <cmath>
#include <complex>
#include <random>

namespace fracgyro::testing {
namespace {

constexpr double pi = std::numbers::pi, turn = 2.0 * pi, epsilon = Electrode::permittivity;
// The sense mode of shipped/dual_mass.toml.
constexpr double mass = 1.58e-6, drive_hertz = 3925.29, sense_hertz = 3978.45, gap = tuning_gap;
constexpr double sense_stiffness = mass * (turn * sense_hertz) * (turn * sense_hertz);

ElectrodeParams plates(bool pair, double bias) {
    ElectrodeParams p = tuning_plates(bias);
    p.pair = pair;
    return p;
}
// The same mass on both axes; units of the sense mode, gaps as lengths.
DeviceSetup device(std::vector<ElectrodeParams> electrodes, double step) {
    const double rate = turn * sense_hertz;
    DeviceSetup s;
    s.common.step = step;
    s.plant = {.stiffness = {1.0, 0.0, 1.0}};
    s.volts = {.electrodes = std::move(electrodes), .mass = mass, .length = gap, .rate = rate, .present = true};
    s.plant.stiffness = s.plant.stiffness - at_bias(s.volts).softening;
    return s;
}
struct Running {
    explicit Running(const DeviceSetup& s) : c(DeviceGyroscope::prepare(s)), state(DeviceGyroscope::start(s)) {}
    void step(const Vec2<double>& force = {}) {
        DeviceGyroscope::act(state, c, force, n);
        DeviceGyroscope::step(state, c, n++);
    }
    DeviceGyroscope::Coefficients c;
    DeviceGyroscope::State state;
    std::int64_t n = 0;
};

// -- The force of electrodes ------------------------------------------------------------------------------------------

// ½ V² C of all parts of an electrode, per unit of ε f N, at true meters: written out again.
double energy(const ElectrodeParams& p, double x, double y, double v) {
    const double f = 0.5 * epsilon * p.fringe * p.count, t = p.thickness, l = p.overlap, g = p.gap;
    const auto square = [](double a) { return a * a; };
    const double along = std::cos(p.angle) * x + std::sin(p.angle) * y;
    const double across = std::cos(p.angle) * y - std::sin(p.angle) * x;
    x = along + p.offset;
    if (p.role == ElectrodeRole::quadrature) {
        double sum = 0.0;
        for (const double sx : {1.0, -1.0}) {
            for (const double sy : {1.0, -1.0}) {
                sum += f * square(p.bias + sx * sy * p.nulling) * t * (l + sx * x) *
                       (1.0 / (g - sy * across) + 1.0 / (p.ratio * g + sy * across));
            }
        }
        return sum;
    }
    if (p.kind == ElectrodeKind::plate) {
        const double other = p.pair ? f * square(p.bias - v) * p.area / (g + x) : 0.0;
        return f * square(p.bias + v) * p.area / (g - x) + other;
    }
    const double ratio = p.kind == ElectrodeKind::skewed ? p.ratio : 1.0;
    const double gaps = t * (1.0 / (g - across) + 1.0 / (ratio * g + across));
    return f * gaps * (square(p.bias + v) * (l + x) + (p.pair ? square(p.bias - v) * (l - x) : 0.0));
}

std::vector<ElectrodeParams> every_electrode() {
    std::vector<ElectrodeParams> found;
    for (const ElectrodeKind kind : {ElectrodeKind::plate, ElectrodeKind::comb, ElectrodeKind::skewed}) {
        for (const bool pair : {false, true}) {
            for (const double angle : {0.0, 0.5 * pi, 0.7, -2.0}) {
                found.push_back({.role = ElectrodeRole::force,
                                 .kind = kind,
                                 .pair = pair,
                                 .angle = angle,
                                 .count = 12,
                                 .gap = 3e-6,
                                 .area = 2e-9,
                                 .overlap = 9e-6,
                                 .thickness = 30e-6,
                                 .ratio = 2.5,
                                 .fringe = 1.1,
                                 .offset = 0.2e-6,
                                 .bias = 4.0});
            }
        }
    }
    ElectrodeParams groups = found.back();
    groups.role = ElectrodeRole::quadrature, groups.offset = 0.0, groups.nulling = 1.5;
    for (const double angle : {0.0, 1.1}) {
        groups.angle = angle;
        found.push_back(groups);
    }
    return found;
}

TEST(Electrodes, TheirForceIsTheGradientOfTheirEnergy) {
    std::mt19937_64 random(3);
    const auto uniform = [&] { return 2.0 * static_cast<double>(random() >> 11) * 0x1p-53 - 1.0; };
    const ElectrodeScales scales{.force = 2e-6, .length = 5e-7};
    for (const ElectrodeParams& p : every_electrode()) {
        const Electrode electrode(p, scales, false);
        for (int i = 0; i < 20; ++i) {
            const double x = 1.5e-6 * uniform(), y = 1.5e-6 * uniform();
            const Vec2<double> volts{3.0 * uniform(), 3.0 * uniform()};
            const double v = std::cos(p.angle) * volts.x() + std::sin(p.angle) * volts.y(), d = 1e-9;
            const Vec2<double> wanted{(energy(p, x + d, y, v) - energy(p, x - d, y, v)) / (2.0 * d),
                                      (energy(p, x, y + d, v) - energy(p, x, y - d, v)) / (2.0 * d)};
            const Vec2<double> got =
                scales.force * electrode.force((1.0 / scales.length) * Vec2<double>{x, y}, {.drive = volts});
            EXPECT_NEAR(got.x(), wanted.x(), 1e-5 * norm(wanted));
            EXPECT_NEAR(got.y(), wanted.y(), 1e-5 * norm(wanted));
        }
    }
}

TEST(Electrodes, TheirCapacitanceIsThatOfTheirEnergy) {
    for (ElectrodeParams p : every_electrode()) {
        if (p.role == ElectrodeRole::quadrature) {
            continue;  // no pick-off
        }
        p.offset = 0.0;
        const double wanted = 2.0 * energy(p, 0.0, 0.0, 0.0) / (p.bias * p.bias);
        EXPECT_NEAR(Electrode(p, {}, false).capacitance(), wanted, 1e-9 * wanted);
    }
}

TEST(Electrodes, TheirSofteningAndGainAreTheSlopesOfTheirForce) {
    const ElectrodeScales scales{.force = 2e-6, .length = 5e-7};
    const double d = 1e-5;
    for (const ElectrodeParams& p : every_electrode()) {
        const Electrode e(p, scales, false);
        const auto slope = [&](const Vec2<double>& q, const Vec2<double>& v) {
            return (0.5 / d) * (e.force(d * q, {.drive = d * v}) - e.force(-d * q, {.drive = -d * v}));
        };
        const Vec2<double> by_x = slope({1.0, 0.0}, {}), by_y = slope({0.0, 1.0}, {});
        const double size = norm(by_x) + norm(by_y);
        EXPECT_NEAR(e.softening().xx(), by_x.x(), 1e-7 * size);
        EXPECT_NEAR(e.softening().xy(), by_x.y(), 1e-7 * size);
        EXPECT_NEAR(e.softening().xy(), by_y.x(), 1e-7 * size);
        EXPECT_NEAR(e.softening().yy(), by_y.y(), 1e-7 * size);
        const double gain = dot(e.direction(), slope({}, e.direction()));
        EXPECT_NEAR(e.gain(), gain, 1e-7 * absolute(gain));
    }
}

TEST(Electrodes, OnTheAxesTheyAreExactlyThere) {
    for (const auto& [angle, n] : {std::pair{0.0, Vec2<double>{1.0, 0.0}}, std::pair{0.5 * pi, Vec2<double>{0.0, 1.0}},
                                   std::pair{pi, Vec2<double>{-1.0, 0.0}}}) {
        ElectrodeParams p = plates(true, 1.0);
        p.angle = angle;
        expect_equal(Electrode(p, {}, true).direction(), n);
    }
}

TEST(Electrodes, TuningPlatesMatchTheModesOfADevice) {
    const double matched = mass * turn * turn * (sense_hertz * sense_hertz - drive_hertz * drive_hertz);
    EXPECT_NEAR(matched, 26.21, 0.005);
    const double at_1_volt = Electrode(plates(true, 1.0), {}, false).softening().xx();
    EXPECT_NEAR(at_1_volt, 0.498, 5e-4);
    const double volts = std::sqrt(matched / at_1_volt);
    EXPECT_NEAR(volts, 7.2541, 5e-5);
    const auto hertz = [&](double v) { return std::sqrt((sense_stiffness - at_1_volt * v * v) / mass) / turn; };
    EXPECT_NEAR(hertz(volts), drive_hertz, 1e-6);
    EXPECT_NEAR((hertz(volts + 1e-4) - hertz(volts - 1e-4)) / 2e-4, -14.76, 0.005);
}

TEST(Electrodes, SkewedCombsNullTheQuadratureOfADevice) {
    const ElectrodeParams p = nulling_combs(5.0);
    const double geometric = std::sqrt(1.42e-6 * 1.58e-6);
    const double nulled = Electrode(p, {}, false).softening().xy() / (2.0 * geometric * turn * drive_hertz);
    EXPECT_NEAR(nulled * 360.0 / turn, 41.5, 0.05);
    ElectrodeParams resting = p;
    resting.nulling = 0.0;
    EXPECT_NEAR(Electrode(resting, {}, false).softening().yy(), 0.14, 0.005);
}

// -- Pull-in ----------------------------------------------------------------------------------------------------------

// True if a mass that starts there touches a plate within a time, with this damping.
bool pulls_in(bool pair, double volts, double start, double damping, double step, double time) {
    DeviceSetup s = device({plates(pair, volts)}, step);
    s.plant.damping = {damping, 0.0, damping};
    s.plant.initial_position = {start, 0.0};
    Running run(s);
    while (static_cast<double>(run.n) * step < time && run.state.volts.touched == 0) {
        run.step();
    }
    EXPECT_EQ(bounded(run.state.motion), run.state.volts.touched == 0);
    return run.state.volts.touched == 1;
}

TEST(PullIn, HappensAtTheClosedForm) {
    const double single = pull_in_voltage(plates(false, 0.0), sense_stiffness);
    EXPECT_NEAR(single, 34.2740, 5e-5);
    EXPECT_FALSE(pulls_in(false, single * (1.0 - 1e-6), 0.33, 1.0, 0.005, 6000.0));
    EXPECT_TRUE(pulls_in(false, single * (1.0 + 1e-6), 0.33, 1.0, 0.005, 6000.0));
    const double pair = pull_in_voltage(plates(true, 0.0), sense_stiffness);
    EXPECT_NEAR(pair, 44.5232, 5e-5);
    EXPECT_FALSE(pulls_in(true, pair * (1.0 - 1e-6), 1e-4, 0.01, 0.1, 40'000.0));
    EXPECT_TRUE(pulls_in(true, pair * (1.0 + 1e-6), 1e-4, 0.01, 0.1, 40'000.0));
}

TEST(PullIn, ByAStepOfTheVoltageIsEarlierByTheRootOf27Over32) {
    const double single = std::sqrt(27.0 / 32.0) * pull_in_voltage(plates(false, 0.0), sense_stiffness);
    EXPECT_FALSE(pulls_in(false, single * (1.0 - 1e-3), 0.0, 0.0, 0.02, 1000.0));
    EXPECT_TRUE(pulls_in(false, single * (1.0 + 1e-3), 0.0, 0.0, 0.02, 1000.0));
}

// -- The step ---------------------------------------------------------------------------------------------------------

// The period of an undamped x with these plates, in units of time, by quadrature of the energy: with q = A sin φ the
// integrand is smooth and its mean over evenly spaced φ converges faster than any power.
double exact_period(const DeviceSetup& s, double amplitude) {
    const ElectrodeParams& p = s.volts.electrodes[0];
    const double strength = 0.5 * epsilon * p.count * p.area / (gap * gap) * p.bias * p.bias / s.volts.scales().force;
    constexpr int count = 400;
    double sum = 0.0;
    for (int i = 0; i < count; ++i) {
        const double phi = pi * (i + 0.5) / count - 0.5 * pi;
        const double q = amplitude * std::sin(phi);
        // ½ v² = ½ (A² - q²) - 2 s (1/(1 - A²) - 1/(1 - q²)), over A² - q² = A² cos² φ.
        const double square = 1.0 - 4.0 * strength / ((1.0 - amplitude * amplitude) * (1.0 - q * q));
        sum += 1.0 / std::sqrt(square);
    }
    return 2.0 * pi * sum / count;
}

// The mean period over whole turns, from the times at which x crosses 0 upwards.
double simulated_period(const DeviceSetup& s, int turns) {
    Running run(s);
    double first = 0.0, last = 0.0;
    for (int crossed = 0; crossed <= turns;) {
        const double x = run.state.motion.position.x(), v = run.state.motion.velocity.x();
        run.step();
        const double next = run.state.motion.position.x(), speed = run.state.motion.velocity.x();
        if (x < 0.0 && next >= 0.0) {
            // Hermite's cubic between the samples, by Newton.
            double at = -x / (next - x);
            const double h = s.common.step;
            for (int i = 0; i < 8; ++i) {
                const double u = at, a = h * v, b = h * speed;
                const double value = x * (1 + 2 * u) * (1 - u) * (1 - u) + a * u * (1 - u) * (1 - u) +
                                     next * u * u * (3 - 2 * u) - b * u * u * (1 - u);
                const double slope = 6 * u * (1 - u) * (next - x) + a * (1 - u) * (1 - 3 * u) - b * u * (2 - 3 * u);
                at -= value / slope;
            }
            (crossed == 0 ? first : last) = (static_cast<double>(run.n - 1) + at) * h;
            ++crossed;
        }
    }
    return (last - first) / turns;
}

DeviceSetup backbone(double meters, double step) {
    DeviceSetup s = device({plates(true, 7.2541)}, step);
    s.plant.initial_position = {meters / gap, 0.0};
    return s;
}

TEST(Backbone, IsThatOfTheQuadratureOfTheEnergy) {
    const double k = Electrode(plates(true, 7.2541), {}, false).softening().xx();
    const double linear = std::sqrt((sense_stiffness - k) / mass) / turn;
    EXPECT_NEAR(linear, drive_hertz, 1e-3);
    const struct {
        double meters, closed, exact;
    } rows[] = {{0.1e-6, -0.0502, -0.0502}, {0.5e-6, -1.254, -1.279}, {1e-6, -5.02, -5.44}};
    for (const auto& row : rows) {
        const double third = -2.0 * k / (gap * gap);  // coefficient of q³
        const double shift = 3.0 * third * row.meters * row.meters / (8.0 * (sense_stiffness - k)) * linear;
        EXPECT_NEAR(shift, row.closed, 6e-4 * std::abs(row.closed) + 5e-5);
        const DeviceSetup s = backbone(row.meters, 0.05);
        const double period = exact_period(s, row.meters / gap);
        EXPECT_NEAR(sense_hertz * turn / period - linear, row.exact, 1e-3 * std::abs(row.exact) + 5e-5);
        EXPECT_NEAR(simulated_period(s, 200) / period, 1.0, 1e-6);
    }
}

// The motion after four units of time at half the gap, on both axes.
Motion<double> after(std::int64_t steps, bool drifts) {
    ElectrodeParams along_y = plates(true, 20.0);
    along_y.angle = 0.5 * pi;
    DeviceSetup s = device({plates(true, 25.0), along_y}, 4.0 / static_cast<double>(steps));
    s.plant.rate = 0.05;
    s.plant.initial_position = {0.5, -0.3};
    s.steps = steps;
    if (drifts) {
        s.rate = {.kind = AngularRateKind::sine, .amplitude = 0.05, .frequency = 1.0};
    }
    Running run(s);
    for (std::int64_t n = 0; n < steps; ++n) {
        run.step({0.01, 0.02});
    }
    return run.state.motion;
}

TEST(StepInVolts, IsOfSecondOrderAndOfFourthWithAPlantThatVaries) {
    for (const bool drifts : {false, true}) {
        const auto error = [fine = after(6'400, drifts), drifts](std::int64_t steps) {
            const Motion<double> found = after(steps, drifts);
            return norm(found.position - fine.position) + norm(found.velocity - fine.velocity);
        };
        EXPECT_NEAR(std::log2(error(100) / error(200)), drifts ? 4.0 : 2.0, 0.1);
        EXPECT_NEAR(std::log2(error(50) / error(100)), drifts ? 4.0 : 2.0, 0.1);
    }
}

TEST(StepInVolts, NeitherGainsNorLosesEnergy) {
    // The softening of the whole split, y/g = 0.47 and 0.12, 126 samples a turn.
    for (const auto& [amplitude, band] : {std::pair{0.12, 5.1e-7}, std::pair{0.47, 1.1e-5}}) {
        const DeviceSetup s = backbone(amplitude * gap, 0.05);
        const ElectrodeParams& p = s.volts.electrodes[0];
        const double strength = epsilon * p.count * p.area / (gap * gap) * p.bias * p.bias / s.volts.scales().force;
        Running run(s);
        const auto total = [&] {
            const double q = run.state.motion.position.x(), v = run.state.motion.velocity.x();
            return 0.5 * v * v + 0.5 * q * q - strength / (1.0 - q * q) + strength;
        };
        const double first = total();
        double most[2] = {}, least[2] = {};
        constexpr std::int64_t steps = 400'000;
        for (std::int64_t n = 0; n < steps; ++n) {
            const double off = total() / first - 1.0;
            ASSERT_LT(std::abs(off), band);
            const int part = n < steps / 10 ? 0 : n >= steps - steps / 10 ? 1 : -1;
            if (part >= 0) {
                most[part] = std::max(most[part], off);
                least[part] = std::min(least[part], off);
            }
            run.step();
        }
        EXPECT_NEAR((most[1] - least[1]) / (most[0] - least[0]), 1.0, 0.01);
    }
}

TEST(StepInVolts, WithoutVoltagesIsTheMechanicalDevice) {
    DeviceSetup s = device({plates(true, 0.0)}, 0.05), mechanical = s;
    s.plant.initial_position = mechanical.plant.initial_position = {0.3, -0.2};
    mechanical.volts = {};
    Running one(s), other(mechanical);
    for (int n = 0; n < 1000; ++n) {
        one.step({0.01, -0.02});
        other.step({0.01, -0.02});
        expect_equal(one.state.motion.position, other.state.motion.position);
        expect_equal(one.state.motion.velocity, other.state.motion.velocity);
        expect_equal(one.state.volts.readout.reading, other.state.motion.position);
    }
}

ElectrodeParams combs(ElectrodeRole role, double angle) {
    return {.role = role,
            .kind = ElectrodeKind::comb,
            .angle = angle,
            .count = 200,
            .gap = 2e-6,
            .overlap = 20e-6,
            .thickness = 60e-6,
            .bias = 5.0};
}

TEST(StepInVolts, CombsAndIdealElectronicsActAsTheForceAskedFor) {
    // Across their fingers, the combs of y act on x by the cube of its motion, which is kept small: the force in that
    // is 1e-14 of the spring's.
    DeviceSetup s = device({combs(ElectrodeRole::force, 0.0), combs(ElectrodeRole::force, 0.5 * pi),
                            combs(ElectrodeRole::pickoff, 0.0), combs(ElectrodeRole::pickoff, 0.5 * pi)},
                           0.05);
    // 4 N ε t V_b/g.
    EXPECT_NEAR(at_bias(s.volts).gain.xx() * s.volts.scales().force, 4.0 * 200 * epsilon * 60e-6 * 5.0 / 2e-6, 1e-15);
    DeviceSetup mechanical = s;
    mechanical.volts = {};
    Running one(s), other(mechanical);
    for (int n = 0; n < 5000; ++n) {
        const Vec2<double> force{1e-9 * std::sin(0.05 * n), 0.0};
        one.step(force);
        other.step(force);
        ASSERT_NEAR(one.state.motion.position.x(), other.state.motion.position.x(), 1e-20);
        ASSERT_NEAR(one.state.volts.readout.reading.x(), other.state.motion.position.x(), 1e-20);
    }
}

TEST(StepInVolts, TurnedElectrodesChangeNothingInTheirAxes) {
    const auto turned_by = [](double angle, const Vec2<double>& a) {
        return Vec2<double>{std::cos(angle) * a.x() - std::sin(angle) * a.y(),
                            std::sin(angle) * a.x() + std::cos(angle) * a.y()};
    };
    const auto made = [&](double angle) {
        ElectrodeParams drive = plates(true, 5.0), pick = combs(ElectrodeRole::pickoff, 0.0);
        drive.role = ElectrodeRole::force;
        std::vector<ElectrodeParams> electrodes;
        for (ElectrodeParams each : {drive, pick}) {
            for (const double axis : {0.0, 0.5 * pi}) {
                each.angle = axis + angle;
                electrodes.push_back(each);
            }
        }
        electrodes.push_back(plates(false, 10.0));
        electrodes.back().angle = 0.3 + angle;
        DeviceSetup s = device(electrodes, 0.05);
        s.volts.electronics.sample_delay = 0.3 * 0.05 / s.volts.rate;
        s.volts.electronics.update_delay = 0.6 * 0.05 / s.volts.rate;
        s.plant.initial_position = turned_by(angle, {0.2, -0.1});
        return s;
    };
    for (const double angle : {0.5 * pi, 0.7}) {
        Running one(made(0.0)), other(made(angle));
        for (int n = 0; n < 300; ++n) {
            const Vec2<double> force{1e-3 * std::sin(0.3 * n), 2e-3 * std::cos(0.2 * n)};
            one.step(force);
            other.step(turned_by(angle, force));
            expect_near(other.state.motion.position, turned_by(angle, one.state.motion.position), 1e-13);
            expect_near(other.state.volts.readout.reading, turned_by(angle, one.state.volts.readout.reading), 1e-12);
        }
    }
}

TEST(StepInVolts, APairOfPlatesDrivesAsItsClosedForm) {
    // (2 ε a V_b²/g²) ((1 + w²) X + w (1 + X²))/(1 - X²)², w = v/V_b.
    ElectrodeParams x = plates(true, 5.0), y = x;
    x.role = y.role = ElectrodeRole::force;
    y.angle = 0.5 * pi;
    const Electrode e(x, {.force = 1.0, .length = gap}, false);
    for (const double at : {-0.4, 0.0, 0.3}) {
        const double w = 0.6, d = 1.0 - at * at, a = 150 * 60e-6 * 200e-6;
        const double wanted =
            2.0 * epsilon * a * 25.0 / (gap * gap) * ((1.0 + w * w) * at + w * (1.0 + at * at)) / (d * d);
        EXPECT_NEAR(e.force({at, 0.2}, {.drive = {w * 5.0, 9.0}}).x(), wanted, 1e-12 * std::abs(wanted) + 1e-18);
    }
}

TEST(Electrodes, FollowATrimAsIfTheyHadBeenMadeWithItsVoltages) {
    const ElectrodeScales scales{.force = 2e-6, .length = 5e-7};
    const Vec2<double> q{0.3, -0.7};
    for (ElectrodeParams p : every_electrode()) {
        const bool nulls = p.role == ElectrodeRole::quadrature;
        p.role = nulls ? p.role : ElectrodeRole::tuning;
        Electrode trimmed(p, scales, false);
        const Electrode as_it_was = trimmed;
        trimmed.follow_trim();
        const Voltages volts{.tuning = 7.0, .nulling = -3.0};
        EXPECT_EQ(as_it_was.force(q, volts).x(), as_it_was.force(q, {}).x());
        p.bias = nulls ? p.bias : 7.0;
        p.nulling = nulls ? -3.0 : p.nulling;
        const Electrode made(p, scales, false);
        EXPECT_EQ(trimmed.force(q, volts).x(), made.force(q, {}).x());
        EXPECT_EQ(trimmed.force(q, volts).y(), made.force(q, {}).y());
        EXPECT_EQ(trimmed.softening(volts).yy(), made.softening().yy());
        EXPECT_EQ(trimmed.softening(volts).xy(), made.softening().xy());
    }
}

TEST(Driver, GivesTheForceAskedForInStepsOfItsConverter) {
    std::vector<ElectrodeParams> electrodes{combs(ElectrodeRole::force, 0.0), combs(ElectrodeRole::force, 0.5 * pi)};
    for (ElectrodeParams& each : electrodes) {
        each.range = 10.0, each.bits = 8, each.fringe = 1.25;
    }
    Running run(device(electrodes, 0.05));
    const double volt = at_bias(device(electrodes, 0.05).volts).gain.xx();
    run.step({3.01 * volt, 100.0 * volt});
    expect_near(run.state.volts.volts.drive, {39 * 10.0 / 128, 10.0 - 10.0 / 128}, 1e-12);
    expect_near(run.state.applied, (1.25 * volt) * run.state.volts.volts.drive, 1e-12 * volt);
}

TEST(Driver, LinearizedMakesPlatesAsStrongAsAtRest) {
    std::vector<ElectrodeParams> electrodes{plates(true, 5.0), plates(true, 5.0)};
    electrodes[0].role = electrodes[1].role = ElectrodeRole::force;
    electrodes[1].angle = 0.5 * pi;
    DeviceSetup s = device(electrodes, 0.05);
    s.volts.electronics.linearized = true;
    Running run(s);
    run.state.measured.position = {0.3, -0.2};
    run.step({1e-4, 2e-4});
    for (std::size_t axis = 0; axis < 2; ++axis) {
        const Electrode e(electrodes[axis], s.volts.scales(), false);
        const Vec2<double> at = run.state.measured.position;
        const Vec2<double> volts = run.state.volts.volts.drive;
        const Vec2<double> more = 0.5 * (e.force(at, {.drive = volts}) - e.force(at, {.drive = -volts}));
        EXPECT_NEAR(axis == 0 ? more.x() : more.y(), axis == 0 ? 1e-4 : 2e-4, 1e-15);
    }
}

TEST(ToldTheForce, APredictionIsThatUnderTheForceThatActs) {
    using Law = Positions<double>;
    using Filter = Law::AdaptationType::Filter;
    const Vec2<double> asked{3e-3, -2e-3}, acts{3.1e-3, -2.2e-3};
    for (const std::int64_t delay : {0, 2}) {
        Case a;
        a.law.datasheet.delay = delay;
        a.delay = static_cast<std::size_t>(delay);
        Loop<Law> loop(a);
        loop.run(100);
        const auto& c = loop.c.adaptation.filter;
        Filter::State informed = loop.state.adaptation, knew = informed;
        const Sample<double> at = informed.error;
        Filter::predict(informed, c, {}, asked, true);
        const Vec2<double> without = informed.error.derivative;
        Filter::acted(informed, c, acts);
        Filter::predict(knew, c, {}, acts, true);
        expect_near(informed.error.value, knew.error.value, 1e-9);
        expect_near(informed.error.derivative, knew.error.derivative, 1e-8);
        EXPECT_EQ(norm(informed.error.derivative - without) > 1e-6, delay == 0);
        for (std::int64_t n = 0; n < delay; ++n) {  // the force arrives
            Filter::predict(informed, c, {}, acts, true);
            Filter::predict(knew, c, {}, acts, true);
        }
        expect_near(informed.error.derivative, knew.error.derivative, 1e-8);
        EXPECT_GT(norm(informed.error.derivative - at.derivative), 1e-5);
    }
}

TEST(ToldTheForce, ObserverAndFilterPredictUnderIt) {
    const Vec2<double> asked{0.3, -0.2}, acts{0.31, -0.22};
    const PlantModel<double> nominal{.damping = {0.02, 0.003, 0.04}, .stiffness = {1.0, 0.05, 1.1}, .rate = 0.01};
    const auto observer = Observer<double>::prepare(nominal, 1.0, 0.05);
    Observer<double>::State informed{.motion = {{0.1, 0.2}, {0.3, 0.4}}, .started = true}, knew = informed;
    Observer<double>::predict(informed, observer, asked);
    Observer<double>::more(informed, observer, acts - asked);
    Observer<double>::predict(knew, observer, acts);
    expect_near(informed.motion.position, knew.motion.position, 1e-16);
    expect_near(informed.motion.velocity, knew.motion.velocity, 1e-16);
    for (const std::int64_t delay : {0, 2}) {
        using Filter = MotionFilter<double, true>;
        Common common{.step = 0.05, .nominal = nominal};
        common.filter = {
            .bandwidth = 1.0,
            .assumed = {.force_noise = 1e-3, .position_noise = 1e-3, .velocity_noise = 1e-3, .delay = delay}};
        const auto c = Filter::prepare(common);
        Filter::State a{}, b{};
        const auto step = [&](Filter::State& state, const Vec2<double>& force) {
            const Motion<double> seen{{0.1, 0.2}, {0.3, 0.4}};
            Filter::step(state, c, seen, false,
                         [&](const Motion<double>&) { return Signals<double, EmptyReport>{.force = force}; });
        };
        for (int n = 0; n < 4; ++n) {
            step(a, asked);
            Filter::acted(a, c, acts);
            step(b, acts);
            expect_near(a.motion.position, b.motion.position, 1e-15);
            expect_near(a.motion.velocity, b.motion.velocity, 1e-15);
        }
    }
}

TEST(ToldTheForce, ALoopTellsItsControllerTheCode) {
    // An observer of a plant without noise: with the codes known its velocity is that of an ideal driver.
    std::vector<ElectrodeParams> electrodes{combs(ElectrodeRole::force, 0.0), combs(ElectrodeRole::force, 0.5 * pi)};
    electrodes[0].range = electrodes[1].range = 10.0;
    electrodes[0].bits = electrodes[1].bits = 4;
    DeviceSetup s = device(electrodes, 0.05);
    Running run(s);
    const Vec2<double> asked{2.6e-4, -1.1e-4};
    DeviceGyroscope::act(run.state, run.c, asked, 0);
    const Vec2<double>* const code = DeviceGyroscope::code(run.state, run.c);
    ASSERT_NE(code, nullptr);
    expect_near(*code, run.state.applied, 1e-18);
    EXPECT_GT(norm(*code - asked), 1e-6);
    electrodes[0].range = electrodes[1].range = ElectronicsParams::off;
    electrodes[0].bits = electrodes[1].bits = 0;
    Running ideal(device(electrodes, 0.05));
    EXPECT_EQ(DeviceGyroscope::code(ideal.state, ideal.c), nullptr);
}

// -- Pick-offs and amplifiers -----------------------------------------------------------------------------------------

// Amplitude of the harmonic of f(sin φ).
template <class F>
double harmonic(F&& f, int order) {
    std::complex<double> sum{};
    constexpr int count = 4096;
    for (int i = 0; i < count; ++i) {
        const double phi = turn * i / count;
        sum += f(std::sin(phi)) * std::polar(2.0 / count, order * phi);
    }
    return std::abs(sum);
}

TEST(Pickoff, HasTheHarmonicsOfItsCapacitance) {
    const double a = 0.125, s = std::sqrt(1.0 - a * a), r = (1.0 - s) / a;
    ElectrodeParams p = plates(true, 5.0);
    p.role = ElectrodeRole::pickoff;
    for (const bool pair : {false, true}) {
        p.pair = pair;
        const Electrode e(p, {.force = 1.0, .length = gap}, false);
        const auto value = [&](double q) { return e.reading({a * q, 0.3}); };
        const double first = harmonic(value, 1);
        if (pair) {
            EXPECT_NEAR(first / a, 2.0 * r / (s * a), 1e-12);
            EXPECT_NEAR(100.0 * (first / a - 1.0), 1.1873, 5e-5);
            EXPECT_NEAR(harmonic(value, 3) / first, r * r, 1e-12);
            EXPECT_NEAR(100.0 * r * r, 0.39371, 5e-6);
        } else {
            EXPECT_NEAR(harmonic(value, 2) / first, r, 1e-12);
        }
    }
}

TEST(Amplifier, HasTheNoiseOfItsParts) {
    const double slope = 1.17e-6, omega = 24661.5;  // pF/um
    const auto density = [&](const ElectronicsParams& e, double volts) {
        return position_noise_density(e, volts * slope, 0.0, omega);
    };
    ElectronicsParams e{.feedback_resistance = 1e9, .input_capacitance = 12e-12, .voltage_noise = 5e-9};
    EXPECT_NEAR(density(e, 5.0), 3.0e-14, 0.05e-14);
    e.input_capacitance = 40e-12;
    EXPECT_NEAR(density(e, 5.0), 4.4e-14, 0.05e-14);
    e.input_capacitance = 12e-12;
    e.feedback_resistance = 1e7;
    EXPECT_NEAR(density(e, 5.0), 2.8e-13, 0.05e-13);
    e.feedback_resistance = 1e6;
    EXPECT_NEAR(density(e, 5.0), 8.9e-13, 0.05e-13);
    e.feedback_resistance = 1e7, e.carrier_frequency = 1e6;
    EXPECT_NEAR(density(e, 1.0), 5.2e-14, 0.05e-14);
}

TEST(Amplifier, DrawsTheNoiseOfEachAxis) {
    ElectrodeParams weak = combs(ElectrodeRole::pickoff, 0.5 * pi);
    weak.count = 50;
    DeviceSetup s = device({combs(ElectrodeRole::pickoff, 0.0), weak}, 0.05);
    s.volts.electronics = {.amplifier = AmplifierKind::charge, .voltage_noise = 5e-9};
    const Vec2<double> wanted = at_bias(s.volts).noise;
    DeviceGyroscope::Draw draw(s);
    Vec2<double> sum{};
    constexpr std::int64_t count = 200'000;
    for (std::int64_t n = 0; n < count; ++n) {
        const Vec2<double> noise = draw(n).device.noise.position;
        sum = sum + noise * noise;
    }
    // One-sided, up to half the sampling frequency.
    const double band = 0.5 * s.volts.rate / s.common.step;
    EXPECT_NEAR(std::sqrt(sum.x() / count) * gap / std::sqrt(band) / wanted.x(), 1.0, 0.01);
    EXPECT_NEAR(std::sqrt(sum.y() / count) * gap / std::sqrt(band) / wanted.y(), 1.0, 0.01);
    EXPECT_NEAR(wanted.x() / wanted.y(), 1.0, 1e-12) << "e_n C_s/(V_b C') does not depend on the number of fingers";
}

GyroscopeParams moving() {
    return {.damping = {0.02, 0.003, 0.04},
            .stiffness = {1.0, 0.05, 1.1},
            .rate = 0.01,
            .initial_position = {0.6, -0.3},
            .initial_velocity = {0.2, 0.9}};
}
Vec2<double> force_at(std::int64_t n) {
    return {0.3 * std::sin(0.9 * static_cast<double>(n)), 0.2 * std::cos(0.7 * static_cast<double>(n))};
}

// The reading by small Runge-Kutta steps of the equations, independent of the rows.
struct Slow {
    GyroscopeParams plant;
    ReadoutParams p;
    std::vector<double> derivative(const std::vector<double>& s, const Vec2<double>& u) const {
        std::vector<double> d(10);
        const Sym2<double>&k = plant.stiffness, &c = plant.damping;
        d[0] = s[2], d[1] = s[3];
        d[2] = u.x() - k.xx() * s[0] - k.xy() * s[1] - c.xx() * s[2] - (c.xy() - 2.0 * plant.rate) * s[3];
        d[3] = u.y() - k.xy() * s[0] - k.yy() * s[1] - (c.xy() + 2.0 * plant.rate) * s[2] - c.yy() * s[3];
        const Vec2<double> put = p.feedthrough * u;
        const double in[2] = {s[0] + put.x() - s[4], s[1] + put.y() - s[5]};
        d[4] = p.high_pass.x() * in[0], d[5] = p.high_pass.y() * in[1];
        d[6] = p.pole.x() * (in[0] + s[8] - s[6]), d[7] = p.pole.y() * (in[1] + s[9] - s[7]);
        d[8] = p.leak * put.x() - p.high_pass.x() * s[8], d[9] = p.leak * put.y() - p.high_pass.y() * s[9];
        return d;
    }
};

TEST(Readout, IsThatOfItsEquations) {
    const GyroscopeParams plant = moving();
    const double h = 0.3;
    const ReadoutParams p{.pole = {2.0, 5.0},
                          .high_pass = {0.2, 0.1},
                          .feedthrough = {{0.3, -0.2}, {0.1, 0.4}},
                          .leak = 0.7,
                          .sample_delay = 0.06,
                          .update_delay = 0.12};
    for (const double aperture : {0.0, 0.09}) {
        ReadoutParams with = p;
        with.aperture = aperture;
        const auto c = Readout::prepare(with, plant, h);
        const auto step = Gyroscope<double>::prepare(plant, h);
        Motion<double> motion = Gyroscope<double>::start(plant);
        Readout::State state = Readout::start(c, motion, {});
        const Slow slow{plant, with};
        std::vector<double> s{0.6, -0.3, 0.2, 0.9, state.inside[0], state.inside[1], state.inside[2], state.inside[3],
                              0.0, 0.0};
        constexpr int parts = 1000;
        for (std::int64_t n = 0; n < 12; ++n) {
            const Vec2<double> force = force_at(n), before = n > 0 ? force_at(n - 1) : Vec2<double>{};
            Vec2<double> wanted{}, sum{};
            for (int i = 0; i < parts; ++i) {
                const double dt = h / parts, t = i * dt;
                const Vec2<double>& u = i < parts * 0.4 ? before : force;
                const auto at = [&](double part, const std::vector<double>& k) {
                    std::vector<double> moved = s;
                    for (std::size_t j = 0; j < s.size(); ++j) {
                        moved[j] += part * k[j];
                    }
                    return moved;
                };
                const auto k1 = slow.derivative(s, u), k2 = slow.derivative(at(0.5 * dt, k1), u);
                const auto k3 = slow.derivative(at(0.5 * dt, k2), u), k4 = slow.derivative(at(dt, k3), u);
                const Vec2<double> z{s[6], s[7]};
                for (std::size_t j = 0; j < s.size(); ++j) {
                    s[j] += dt / 6.0 * (k1[j] + 2.0 * k2[j] + 2.0 * k3[j] + k4[j]);
                }
                const double end = t + dt;
                if (end > h - with.sample_delay - with.aperture + 1e-9 && end < h - with.sample_delay + 1e-9) {
                    sum = sum + (0.5 * dt) * (z + Vec2<double>{s[6], s[7]});
                }
                if (std::abs(end - (h - with.sample_delay)) < 1e-9) {
                    wanted = {s[6], s[7]};
                }
            }
            wanted = aperture > 0.0 ? (1.0 / aperture) * sum : wanted;
            const Motion<double> from = motion;
            Gyroscope<double>::step(motion, step, force);
            Readout::delay(motion, state, c, force);
            Readout::step(state, c, from, motion, force, {}, {}, {});
            expect_near(motion.position, {s[0], s[1]}, 1e-10);
            expect_near(motion.velocity, {s[2], s[3]}, 1e-10);
            expect_near(state.reading, wanted, aperture > 0.0 ? 1e-6 : 1e-9);
        }
    }
}

// j/(1 + j/ω_p) of a vibration at the resonance, and feedthrough from a sine of the drive as its derivative.
TEST(Readout, OfATransimpedanceAmplifierIsTheVelocity) {
    const double pole = 6.0, step = 0.05, at = 0.7;
    DeviceSetup s = device({combs(ElectrodeRole::force, 0.0), combs(ElectrodeRole::force, 0.5 * pi),
                            combs(ElectrodeRole::pickoff, 0.0), combs(ElectrodeRole::pickoff, 0.5 * pi)},
                           step);
    s.plant.stiffness = {1.0, 0.0, at * at};
    s.plant.initial_position = {2e-5, 0.0};
    s.plant.initial_velocity = {0.0, 3e-5};
    s.volts.electronics = {.amplifier = AmplifierKind::transimpedance,
                           .pole = {pole * s.volts.rate / turn, pole * s.volts.rate / turn}};
    Running run(s);
    const auto amplified = [&](double omega) {
        const std::complex<double> j{0.0, 1.0};
        return j / (1.0 + j * omega / pole);
    };
    for (int n = 1; n <= 2000; ++n) {
        run.step();
        const double t = n * step;
        const Vec2<double> read = run.state.volts.readout.reading;
        ASSERT_NEAR(read.x(), 2e-5 * (amplified(1.0) * std::polar(1.0, t)).real(), 1e-12) << n;
        ASSERT_NEAR(read.y(), 3e-5 / at * (amplified(at) * std::polar(1.0, at * t - 0.5 * pi)).real(), 3e-12) << n;
    }
}

TEST(Readout, AFractionOfAStepLateItIsThePositionOfThatTime) {
    const GyroscopeParams plant = moving();
    const double h = 0.05, late = 0.37 * h;
    const auto c = Readout::prepare({.sample_delay = late}, plant, h);
    const auto whole = Gyroscope<double>::prepare(plant, h), part = Gyroscope<double>::prepare(plant, h - late);
    Motion<double> motion = Gyroscope<double>::start(plant);
    Readout::State state = Readout::start(c, motion, {});
    for (std::int64_t n = 0; n < 1000; ++n) {
        Motion<double> then = motion;
        Gyroscope<double>::step(then, part, force_at(n));
        const Motion<double> from = motion;
        Gyroscope<double>::step(motion, whole, force_at(n));
        Readout::step(state, c, from, motion, force_at(n), {}, {}, {});
        expect_near(state.reading, then.position, 1e-13);
    }
}

TEST(Readout, StartsWhereASteadyOscillationIs) {
    const GyroscopeParams plant{
        .stiffness = {1.0, 0.0, 1.1}, .initial_position = {0.6, -0.3}, .initial_velocity = {0.2, 0.9}};
    const auto c =
        Readout::prepare({.pole = {20.0, 3.0}, .high_pass = {0.01, 0.02}, .sample_delay = 0.02}, plant, 0.05);
    const auto step = Gyroscope<double>::prepare(plant, 0.05);
    Motion<double> motion = Gyroscope<double>::start(plant);
    Readout::State state = Readout::start(c, motion, {});
    for (int n = 0; n < 400; ++n) {
        const auto fresh = Readout::start(c, motion, {});
        expect_near(state.reading, fresh.reading, 1e-12);
        const Motion<double> from = motion;
        Gyroscope<double>::step(motion, step, {});
        Readout::step(state, c, from, motion, {}, {}, {}, {});
    }
}

TEST(Readout, BendsWithThePickoffThroughAnyPole) {
    // A pole far above the samples leaves p(q); the device has plates that read x at half their gap.
    ElectrodeParams x = plates(true, 1e-3), y = x;
    x.role = y.role = ElectrodeRole::pickoff;
    y.angle = 0.5 * pi;
    for (const double pole : {1e9, ElectronicsParams::off}) {
        DeviceSetup s = device({x, y}, 0.05);
        s.volts.electronics.pole = {pole, pole};
        s.plant.initial_position = {0.5, 0.2};
        Running run(s);
        for (int n = 0; n < 300; ++n) {
            const double q = run.state.motion.position.x();
            EXPECT_NEAR(run.state.volts.readout.reading.x(), q / (1.0 - q * q), 1e-4 * (pole < 1e12) + 1e-14);
            run.step();
        }
    }
}

TEST(Feedthrough, OfAFemtofaradIsThatOfItsClosedForm) {
    // C_f/(V_b C' G): 3.96e-5 m/N at 5 V, 1.17 pF/um and 4.3 uN/V.
    ElectrodeParams drive = combs(ElectrodeRole::force, 0.0), pick = combs(ElectrodeRole::pickoff, 0.0);
    DeviceSetup s = device({}, 0.05);
    // Thickness of combs with that gain and that slope.
    drive.thickness = 4.3e-6 * drive.gap / (4.0 * drive.count * epsilon * drive.bias);
    pick.thickness = 1.17e-6 * pick.gap / (4.0 * pick.count * epsilon);
    for (ElectrodeParams each : {drive, pick}) {
        for (const double angle : {0.0, 0.5 * pi}) {
            each.angle = angle;
            s.volts.electrodes.push_back(each);
        }
    }
    s.volts.electronics.feedthrough = {0.0, 1e-15, 0.0, 0.0};  // to x from the drive of y
    const AtBias at = at_bias(s.volts);
    const double newton = 1.0 / s.volts.scales().force;
    EXPECT_NEAR(at.gain.xx() / newton, 4.3e-6, 1e-15);
    EXPECT_NEAR(at.charge.xx(), 5.0 * 1.17e-6, 1e-15);
    Running run(s);
    const double force = 1e-3;
    run.step({0.0, force});
    const Vec2<double> put = run.state.volts.readout.reading - run.state.motion.position;
    EXPECT_NEAR(put.x() * gap / (force / newton), 3.975e-5, 0.005e-5);
    EXPECT_NEAR(put.y(), 0.0, 1e-15);
}

// Through a charge amplifier far above its corner, a sine of the drive comes with the capacitance over the cosine, late
// by the phase stated for the resonance of x.
TEST(Feedthrough, ThatLeaksLagsByItsPhaseAtTheResonanceOfX) {
    const double lag = 0.6, step = 0.01;
    ElectronicsParams e{.amplifier = AmplifierKind::charge, .feedback_resistance = 1e13, .feedback_capacitance = 1e-12};
    const auto read = [&](double of_lag) {
        DeviceSetup s = device({combs(ElectrodeRole::force, 0.0), combs(ElectrodeRole::force, 0.5 * pi),
                                combs(ElectrodeRole::pickoff, 0.0), combs(ElectrodeRole::pickoff, 0.5 * pi)},
                               step);
        s.plant.stiffness = {1.0, 0.0, 1.0};
        s.volts.electronics = e;
        s.volts.electronics.feedthrough = {0.0, 1e-15, 0.0, 0.0};
        s.volts.electronics.feedthrough_lag = of_lag;
        Running run(s);
        std::complex<double> sum{};
        const int turns = 20, count = static_cast<int>(std::llround(turns * turn / step));
        for (int n = 0; n < count; ++n) {
            run.step({0.0, 1e-3 * std::sin(step * (n + 0.5))});
            sum += run.state.volts.readout.reading.x() * std::polar(1.0, -step * n);
        }
        return sum / static_cast<double>(count);
    };
    const std::complex<double> late = read(lag) / read(0.0);
    EXPECT_NEAR(std::abs(late), 1.0 / std::cos(lag), 0.01);
    EXPECT_NEAR(std::arg(late), -lag, 0.01);
}

// -- The common mode --------------------------------------------------------------------------------------------------

TEST(CommonMode, AnswersASuddenAccelerationAsADampedOscillator) {
    const double omega = 1.7, quality = 3.0, step = 0.1, push = -0.4;
    CommonModeParams p{.frequency = {omega, CommonModeParams::off}, .quality = {quality, 1.0}};
    ASSERT_TRUE(p.on());
    const auto c = CommonMode::prepare(p, step);
    CommonMode::State state{};
    const double sink = omega / (2.0 * quality), damped = std::sqrt(omega * omega - sink * sink);
    for (int n = 1; n <= 500; ++n) {
        CommonMode::step(state, c, {push, push});
        const double t = n * step, turned = std::cos(damped * t) + sink / damped * std::sin(damped * t);
        ASSERT_NEAR(state.position.x(), push / (omega * omega) * (1.0 - std::exp(-sink * t) * turned), 1e-13) << n;
        ASSERT_EQ(state.position.y(), 0.0);
    }
    EXPECT_FALSE(CommonModeParams{}.on());
}

// A pair of plates at X has k_e (1 + 3X²)/(1 - X²)³, and no force on a mass at rest that acts on one mode only.
TEST(CommonMode, SoftensMoreWhereItClosesAGap) {
    DeviceSetup s = device({plates(true, 5.0)}, 0.05);
    s.volts.common = {.frequency = {2.0, 2.0}};
    const auto c = Volts::prepare(s.volts, s.plant, s.common.step);
    const double k = at_bias(s.volts).softening.xx(), x = 0.3, small = 1e-5;
    const auto force = [&](double q) { return Volts::rest(c, {q, 0.0}, {}, {x, 0.0}).x() + k * q; };
    const double wanted = k * (1.0 + 3.0 * x * x) / std::pow(1.0 - x * x, 3);
    EXPECT_NEAR((force(small) - force(-small)) / (2.0 * small) / wanted, 1.0, 1e-8);
    EXPECT_EQ(force(0.0), 0.0);
    EXPECT_GT(std::abs(wanted / k - (1.0 + 6.0 * x * x)), 0.1) << "beyond the first term";
}

TEST(CommonMode, ReadsTheModesThroughTheGapsThatItLeaves) {
    ElectrodeParams pick = plates(true, 5.0);
    pick.role = ElectrodeRole::pickoff;
    ElectrodeParams other = pick;
    other.angle = 0.5 * pi;
    DeviceSetup s = device({pick, other}, 0.05);
    s.volts.common = {.frequency = {2.0, 2.0}, .quality = {1.0, 1.0}};
    s.volts.common.acceleration.terms = {{.kind = TermKind::step, .amplitude = {0.0, 1.2}}};
    Running run(s);
    DeviceGyroscope::Draw draw(s);
    run.state.motion = {.position = {0.01, 0.01}, .velocity = {}};
    for (int n = 0; n < 400; ++n) {
        DeviceGyroscope::sense(run.state, run.c, draw(n));
        run.state.motion = {.position = {0.01, 0.01}, .velocity = {}};
        run.step();
    }
    const double x = run.state.volts.common.position.y();
    EXPECT_NEAR(x, 1.2 / 4.0, 1e-6);
    const auto pair = [](double at) { return at / (1.0 - at * at); };
    const Vec2<double> q = run.state.motion.position, read = run.state.volts.readout.reading;
    EXPECT_NEAR(read.y(), pair(x + q.y()) - pair(x), 1e-12);
    EXPECT_NEAR(read.x(), pair(q.x()), 1e-12);
}

TEST(Jitter, MovesASampleByTheVelocity) {
    DeviceSetup s = device({}, 0.05);
    s.volts.electronics.jitter = 1e-9;
    s.disturbance.kind = DisturbanceKind::none;
    s.plant.initial_velocity = {3.0, -1.0};
    Running run(s);
    DeviceGyroscope::Draw draw(s);
    double sum = 0.0;
    constexpr std::int64_t count = 100'000;
    for (std::int64_t n = 0; n < count; ++n) {
        const Motion<double> seen = DeviceGyroscope::sense(run.state, run.c, draw(n));
        sum += seen.position.x() * seen.position.x();
    }
    EXPECT_NEAR(std::sqrt(sum / count), 3.0 * 1e-9 * s.volts.rate, 0.01 * 3.0 * 1e-9 * s.volts.rate);
}

}  // namespace
}  // namespace fracgyro::testing
