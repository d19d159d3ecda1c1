// Trim of a force-rebalance gyroscope: matched modes and nulled quadrature.
#include "dual_mass_electrodes.hpp"
#include "scalars.hpp"

#include "fracgyro/controllers/conventional.hpp"
#include "fracgyro/hardware/trim.hpp"
#include "fracgyro/plant/gyroscope.hpp"

#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <random>

namespace fracgyro::testing {
namespace {

// shipped/dual_mass.toml.
constexpr double pi = std::numbers::pi, hertz = 2.0 * pi, x_hertz = 3925.29, y_hertz = 3978.45;
constexpr double omega0 = hertz * x_hertz, mass = 1.58e-6, length = 5e-6, step = 0.05, boltzmann = 1.380649e-23;
constexpr double deg_s = pi / 180.0 / omega0;
constexpr ElectrodeScales scales{.force = mass * omega0 * omega0 * length, .length = length};

ElectrodeParams tuning(double volts, double fringe) {
    ElectrodeParams p = tuning_plates(volts);
    p.angle = 0.5 * pi;
    p.fringe = fringe;
    return p;
}
ElectrodeParams quadrature(double volts, double fringe) {
    ElectrodeParams p = nulling_combs(volts);
    p.fringe = fringe;
    return p;
}
Sym2<double> softening(double tuned, double nulled, double fringe = 1.0) {
    return Electrode(tuning(tuned, fringe), scales, false).softening() +
           Electrode(quadrature(nulled, fringe), scales, false).softening();
}

// A force-rebalance gyroscope whose electrodes have the voltages of its trim. Rates are in omega0, K is that without
// voltages.
struct Trimmed {
    Sym2<double> stiffness{1.0, 0.0, (y_hertz / x_hertz) * (y_hertz / x_hertz)};
    double rate = 10.0 * deg_s, fringe = 1.0, noise = 1.0;
    double tone = 10.0 * deg_s;  // apparent rate of the tone
    std::size_t lost_every = 0;  // samples
    TrimParams trim{.split = true, .interval = 0.02 * omega0, .frequency = 300.0 * hertz / omega0};

    // At the end of every interval: split, Hz; k_xy as an angular rate, deg/s; the rate and the quadrature that the
    // controller reports, deg/s.
    struct Found {
        std::vector<double> split{}, coupling{}, rate{}, quadrature{};
    };
    template <Scalar T = double>
    Found operator()(int intervals, std::uint32_t seed = 1) const {
        using C = ForceRebalance<T>;
        const Sym2<double> at_start = softening(trim.tuning, trim.nulling, fringe), none = softening(0.0, 0.0, fringe);
        TrimParams known = trim;
        known.per_square = (softening(1.0, 0.0) - softening(0.0, 0.0)).yy();
        known.per_volt = softening(0.0, 1.0).xy();
        known.modulation = 2.0 * tone / known.per_volt;

        Common common{.step = step, .force_limit = 0.01};
        common.reference = {.amplitude = {1.0, 1.0}, .frequency = {1.0, 1.0}};
        common.nominal = {.damping = {1.0 / 4673.0, 0.0, 1.0 / 449.0}, .stiffness = {1.0, 0.0, 1.0}};
        const auto controller = C::prepare({}, common);
        const auto trimming = Trim<T>::prepare(known, common);
        typename C::State state{};
        auto trimmed = Trim<T>::start(known);

        GyroscopeParams plant{.damping = common.nominal.damping, .stiffness = stiffness + none - at_start};
        plant.rate = rate;
        plant.initial_velocity = {1.0, 0.0};
        const auto move = Gyroscope<double>::prepare(plant, step);
        Motion<double> motion = Gyroscope<double>::start(plant);

        std::mt19937_64 engine(seed);
        std::normal_distribution<double> normal;
        const double position = noise * 1e-13 / length * std::sqrt(0.5 * omega0 / step);
        const double force = noise * std::sqrt(8.66056e-16 / step);
        const auto drawn = [&](double deviation) {
            const double x = normal(engine);
            return deviation * Vec2<double>{x, normal(engine)};
        };
        Found found;
        for (std::size_t n = 1; n <= static_cast<std::size_t>(intervals) * trimming.interval; ++n) {
            const Vec2<double> seen = motion.position + drawn(position);
            const Motion<T> measured{.position = cast<T>(seen)};
            const auto signals = C::step(state, controller, measured);
            const auto volts = Trim<T>::step(trimmed, trimming, measured.position, signals.force,
                                             lost_every > 0 && n % lost_every == 0);
            const Electrode tuned(tuning(double(volts.tuning), fringe), scales, false);
            const Electrode nulled(quadrature(double(volts.nulling), fringe), scales, false);
            const auto kick = [&] {
                const Vec2<double>& q = motion.position;
                const Vec2<double> moved = tuned.force(q, {}) + nulled.force(q, {}) - at_start * q;
                motion.velocity = motion.velocity + 0.5 * step * moved;
            };
            kick();
            Gyroscope<double>::step(motion, move, {double(signals.force.x()), double(signals.force.y())}, drawn(force));
            kick();
            if (n % trimming.interval == 0) {
                const Sym2<double> now =
                    stiffness + none - softening(double(volts.tuning), double(trimmed.nulling), fringe);
                found.split.push_back(x_hertz * (std::sqrt(now.yy()) - std::sqrt(now.xx())));
                found.coupling.push_back(0.5 * now.xy() / deg_s);
                found.rate.push_back(double(state.rate) / deg_s);
                found.quadrature.push_back(double(state.quadrature) / deg_s);
            }
        }
        return found;
    }
};

double spread(const std::vector<double>& values, std::size_t from) {
    double sum = 0.0, squares = 0.0;
    const double count = static_cast<double>(values.size() - from);
    for (std::size_t i = from; i < values.size(); ++i) {
        sum += values[i] / count;
    }
    for (std::size_t i = from; i < values.size(); ++i) {
        squares += (values[i] - sum) * (values[i] - sum) / count;
    }
    return std::sqrt(squares);
}

// Each interval leaves 1 - g of the split.
TEST(Trim, MatchesTheModesOrHoldsASplit) {
    for (const double target : {0.0, 20.0}) {
        for (const double fringe : {1.0, 1.1}) {
            Trimmed run{.fringe = fringe, .noise = 0.0};
            run.trim.target = target * hertz / omega0;
            const auto found = run(10);
            const auto left = [&](std::size_t i) { return (found.split[i] - target) / (found.split[i - 1] - target); };
            if (target == 0.0 && fringe == 1.0) {
                EXPECT_NEAR(left(2), 0.3, 0.06);
                EXPECT_NEAR(left(3), 0.3, 0.03);
            }
            EXPECT_NEAR(found.split[9], target, 0.02) << fringe;
            EXPECT_NEAR(found.rate[9], 10.0, 0.02);
        }
    }
    Trimmed run{.noise = 0.0};
    EXPECT_NEAR(run.operator()<float>(10).split[9], 0.0, 0.02);
}

// Per volt of the tone, with what lasting noise of readings leaves in the loop: σ √(g/(2 - g)).
TEST(Trim, ReadsTheSplitInNoiseByTheSizeOfItsTone) {
    const auto of = [](double tone, double gain) {
        Trimmed run{.tone = tone * deg_s};
        run.trim.gain = gain;
        run.trim.tuning = 7.25;
        return spread(run(250).split, 60);
    };
    const double plain = of(10.0, 0.7);
    EXPECT_NEAR(plain, 0.57, 0.08);
    EXPECT_NEAR(plain / of(30.0, 0.7), 3.0, 0.4);
    EXPECT_LT(of(30.0, 0.05), 0.1);
}

TEST(Trim, NullsTheQuadratureWhileItMatchesTheModes) {
    for (const double fringe : {1.0, 1.1}) {
        Trimmed run{.fringe = fringe, .noise = 0.0, .tone = 20.0 * deg_s};
        run.trim.quadrature = true;
        run.stiffness = run.stiffness + Sym2<double>{0.0, 2.0 * 300.0 * deg_s, 0.0};
        const auto found = run(16);
        EXPECT_NEAR(found.coupling[0], 300.0, 1e-9) << "the loops have not settled";
        EXPECT_NEAR(found.coupling[15], 0.0, 0.005) << fringe;
        EXPECT_NEAR(found.split[15], 0.0, 0.02) << fringe;
        EXPECT_NEAR(found.rate[15], 10.0, 0.05) << fringe;
    }
}

// Only the quadrature, at a split at which the modes stay.
TEST(Trim, NullsTheQuadratureAtASplit) {
    Trimmed run{.noise = 0.0};
    run.trim.split = false;
    run.trim.quadrature = true;
    run.stiffness = run.stiffness + Sym2<double>{0.0, 2.0 * 40.0 * deg_s, 0.0};
    const auto found = run(10);
    EXPECT_NEAR(found.coupling[9], 0.0, 0.01);
    EXPECT_NEAR(found.split[9], y_hertz - x_hertz, 0.5);
}

// Steady signals of a sense axis whose held force and whose tone are exact: Y (k - ν² + jνd) = H U + s M.
struct Steady {
    using Complex = std::complex<double>;
    double stiffness = 1.1, coupling = 0.02, share = 1.3, amplitude = 1.0;
    double late = 0.0;  // by which readings are, beyond half a step
    TrimParams p{.split = true,
                 .quadrature = true,
                 .interval = 4000.0,
                 .modulation = 0.5,
                 .frequency = 0.1,
                 .per_square = 0.01,
                 .per_volt = 0.02,
                 .tuning = 5.0,
                 .nulling = -2.0};

    TrimVolts<double> operator()() const {
        constexpr double h = 0.3, damping = 0.01;
        constexpr Complex j{0.0, 1.0};
        Common common{.step = h};
        common.reference = {.amplitude = {1.0, 1.0}, .frequency = {1.0, 1.0}};
        const auto c = Trim<double>::prepare(p, common);
        const auto sinc = [](double x) { return x == 0.0 ? 1.0 : std::sin(x) / x; };
        const Complex x = -j * amplitude;
        const std::array<double, 3> sides{0.0, p.frequency, -p.frequency};
        const std::array<Complex, 3> force{Complex{0.01, 0.02}, {0.003, -0.001}, {-0.002, 0.004}};
        std::array<Complex, 3> y{};
        for (std::size_t i = 0; i < 3; ++i) {
            const double nu = 1.0 + sides[i];
            const Complex held = std::exp(-j * nu * (0.5 * h + late)) * sinc(0.5 * nu * h) * force[i];
            const Complex hold = std::exp(-j * sides[i] * 0.5 * h) * sinc(0.5 * sides[i] * h);
            const Complex pushed = i == 0 ? -coupling * x : 0.5 * share * p.per_volt * p.modulation * x * hold;
            y[i] = (held + pushed) / (stiffness - nu * nu + j * nu * damping);
        }
        auto state = Trim<double>::start(p);
        TrimVolts<double> volts{};
        for (std::uint64_t n = 0; n < c.interval; ++n) {
            const double t = static_cast<double>(n) * h;
            Complex position{}, asked{};
            for (std::size_t i = 0; i < 3; ++i) {
                const Complex turned = std::exp(j * (1.0 + sides[i]) * t);
                position += y[i] * turned;
                asked += force[i] * turned;
            }
            const double at = std::real(x * std::exp(j * t));
            volts = Trim<double>::step(state, c, {at, position.real()}, {0.0, asked.real()});
        }
        return {.tuning = volts.tuning, .nulling = state.nulling};
    }
};
// The change by one interval, in units of what it corrects.
TEST(Trim, SolvesTheEquationsOfSteadySignals) {
    Steady s;
    s.p.gain = 0.5;
    const double split = 0.5 * (1.1 - 1.0) / 0.01, quadrature = 0.5 * 0.02 / (1.3 * 0.02);
    auto found = s();
    EXPECT_NEAR(found.tuning * found.tuning - 25.0, split, 1e-3 * split);
    EXPECT_NEAR(found.nulling + 2.0, quadrature, 1e-3 * quadrature);
    s.late = s.p.lag = 0.4;
    found = s();
    EXPECT_NEAR(found.tuning * found.tuning - 25.0, split, 1e-3 * split);
    EXPECT_NEAR(found.nulling + 2.0, quadrature, 1e-3 * quadrature);
    for (const double share : {0.4, 2.1, -1.0}) {
        s.share = share;
        EXPECT_EQ(s().tuning, 5.0) << share;
    }
    s.share = 1.3;
    s.amplitude = 0.45;
    EXPECT_EQ(s().tuning, 5.0) << "x does not vibrate";
}
TEST(Trim, KeepsItsVoltagesWithinTheirRange) {
    Steady s;
    s.stiffness = 2.0;  // the sidebands reach 1.21
    auto found = s();
    EXPECT_NEAR(found.tuning * found.tuning - 25.0, 0.7 * 0.21 / 0.01, 0.01);
    s.p.most_tuning = 5.1;
    found = s();
    EXPECT_NEAR(found.tuning, 5.1, 1e-12);
    s.stiffness = 0.5;
    s.p.tuning = 1.0;
    EXPECT_EQ(s().tuning, 0.0);
}

TEST(Trim, ChangesNothingThatItDoesNotKnow) {
    const TrimParams p{.split = true,
                       .quadrature = true,
                       .interval = 200.0,
                       .modulation = 1.0,
                       .frequency = 0.1,
                       .per_square = 1e-3,
                       .per_volt = 1e-3,
                       .tuning = 3.0,
                       .nulling = -2.0};
    Common common{.step = step};
    common.reference = {.amplitude = {1.0, 1.0}, .frequency = {1.0, 1.0}};
    const auto c = Trim<double>::prepare(p, common);
    for (const double vibrates : {0.0, 1.0}) {  // y does not move, or nothing does
        auto state = Trim<double>::start(p);
        for (std::uint64_t n = 0; n < 5 * c.interval; ++n) {
            const double x = vibrates * std::sin(static_cast<double>(n) * step);
            const auto volts = Trim<double>::step(state, c, {x, 0.0}, {0.0, 1e-3});
            ASSERT_EQ(volts.tuning, 3.0);
            ASSERT_LE(std::abs(volts.nulling + 2.0), 1.0);
        }
    }
}
TEST(Trim, BeginsAnIntervalAgainWithoutASample) {
    Trimmed run{.noise = 0.0};
    run.lost_every = 9000;  // an interval has 9,863 steps
    EXPECT_EQ(run(4).split[3], run(1).split[0]);
    run.lost_every = 30000;
    EXPECT_LT(run(10).split[9], 1.0);
}

}  // namespace
}  // namespace fracgyro::testing
