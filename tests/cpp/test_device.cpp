// A dynamic rate, time-varying springs, and the device between the gyroscope and its controller.
#include "made.hpp"
#include "paper.hpp"
#include "scalars.hpp"

#include "fracgyro/sim/running_loop.hpp"
#include "fracgyro/sim/settings.hpp"
#include "fracgyro/hardware/guard.hpp"

#include <cmath>
#include <complex>
#include <map>
#include <random>
#include <string>

namespace fracgyro::testing {
namespace {

using Proposed = SlidingModeController<double, FractionalFastTerminalSurface>;

// -- Rates ------------------------------------------------------------------------------------------------------------

TEST(MovingRate, AStaircaseClimbsAtItsSamplesAndStaysOnTheLastLevel) {
    const AngularRate rate({.kind = AngularRateKind::staircase, .amplitude = 0.5, .start = 10, .hold = 4, .levels = 3},
                           1.0, 0.1, 100);
    EXPECT_EQ(rate.at(9), 1.0);
    EXPECT_EQ(rate.at(10), 1.5);
    EXPECT_EQ(rate.before(10), 1.0);
    EXPECT_EQ(rate.within(9, 2), 1.0);
    EXPECT_EQ(rate.at(14), 2.0);
    EXPECT_EQ(rate.at(18), 2.5);
    EXPECT_EQ(rate.at(100), 2.5);
    const AngularRate from_the_first({.kind = AngularRateKind::staircase, .amplitude = 0.5}, 1.0, 0.1, 100);
    EXPECT_EQ(from_the_first.before(0), 1.5) << "at the first sample nothing jumps";
}

TEST(MovingRate, ASineAndAChirpAreThoseOfTheTimeSinceTheirStart) {
    constexpr double step = 1e-3;
    const AngularRate sine({.kind = AngularRateKind::sine, .amplitude = 2.0, .start = 100, .frequency = 3.0}, 1.0, step,
                           10'000);
    const AngularRate chirp(
        {.kind = AngularRateKind::chirp, .amplitude = 2.0, .start = 100, .frequency = 3.0, .final_frequency = 40.0},
        1.0, step, 10'100);
    for (std::int64_t n = 0; n <= 10'000; n += 37) {
        for (const int halves : {0, 1, 2}) {
            const double t = n < 100 ? 0.0 : static_cast<double>(n - 100) * step + 0.5 * step * halves;
            EXPECT_NEAR(sine.within(n, halves), 1.0 + 2.0 * std::sin(3.0 * t), 1e-12);
            EXPECT_NEAR(chirp.within(n, halves), 1.0 + 2.0 * std::sin(3.0 * t + 0.5 * 37.0 * t * t / 10.0), 1e-9);
        }
    }
}

TEST(MovingRate, NoiseHasItsStandardDeviationAndNothingBeyondItsBand) {
    constexpr std::int64_t count = 40'000;
    constexpr double step = 0.05, band = 2.0;
    double mean_square = 0.0, mean_square_slope = 0.0;
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
        const AngularRate rate({.kind = AngularRateKind::noise, .amplitude = 3.0, .frequency = band, .seed = seed}, 1.0,
                               step, count);
        for (std::int64_t n = 0; n < count; n += 10) {
            const double slope = (rate.at(n + 1) - rate.at(n)) / step;
            mean_square += (rate.at(n) - 1.0) * (rate.at(n) - 1.0) / (20.0 * count / 10.0);
            mean_square_slope += slope * slope / (20.0 * count / 10.0);
        }
    }
    EXPECT_NEAR(mean_square, 9.0, 0.1);
    // For a flat spectrum up to ω the slope has ω²/3 of the variance.
    EXPECT_NEAR(mean_square_slope / mean_square, band * band / 3.0, 0.03);
}

TEST(MovingRate, NoiseDoesNotComeBackWhenEvenlySpacedTonesWould) {
    constexpr double step = 0.05, band = 2.0;
    // Tones with even spacing band/32 would repeat the start, up to a sign, after 2π 32/band.
    const auto period = static_cast<std::int64_t>(std::round(2.0 * 3.14159265358979 * 32.0 / band / step));
    const AngularRate rate({.kind = AngularRateKind::noise, .amplitude = 1.0, .frequency = band, .seed = 3}, 0.0, step,
                           8 * period);
    double product = 0.0, square = 0.0;
    for (std::int64_t n = 0; n < 4 * period; ++n) {
        product += rate.at(n) * rate.at(n + period);
        square += rate.at(n) * rate.at(n);
    }
    EXPECT_LT(std::abs(product / square), 0.5);
}

TEST(MovingRate, NoiseIsTheSumOfToneAfterToneOfItsSeed) {
    constexpr double step = 0.05, band = 2.0, pi = std::numbers::pi;
    const AngularRate rate({.kind = AngularRateKind::noise, .amplitude = 3.0, .frequency = band, .seed = 5}, 1.0, step,
                           1000);
    for (const std::int64_t n : {0, 1, 999}) {
        double sum = 0.0;
        for (std::uint32_t k = 0; k < 32; ++k) {
            const PhiloxBlock words = philox(5, {k, 0, 3, 0});
            const double frequency = band * (k + words[0] * 0x1p-32) / 32.0, phase = 2.0 * pi * words[1] * 0x1p-32;
            sum += std::sin(frequency * static_cast<double>(n) * step + phase);
        }
        EXPECT_NEAR(rate.at(n), 1.0 + 3.0 * std::sqrt(2.0 / 32.0) * sum, 1e-9) << n;
    }
}

TEST(MovingRate, AProfileIsLinearBetweenItsTimesAndConstantBeyondThem) {
    const Profile profile{.times = {2.0, 4.0, 10.0}, .values = {1.0, 3.0, 0.0}};
    EXPECT_EQ(profile.at(0), 1.0);
    EXPECT_EQ(profile.at(3), 2.0);
    EXPECT_EQ(profile.within(3, 1), 2.5);
    EXPECT_EQ(profile.within(3, 2), 3.0);
    EXPECT_EQ(profile.at(7), 1.5);
    EXPECT_EQ(profile.at(11), 0.0);
    EXPECT_EQ(Profile{}.at(3), 0.0);
}

TEST(DeviceSettings, AreDescribedAndComeBackFromTheirNumbers) {
    constexpr double off = Quantizer::unlimited;
    DeviceSetup setup;
    setup.rate = {.kind = AngularRateKind::table, .seed = 7, .inertial = true};
    setup.device = {.position = {{2.0, off}, 24}, .actuator_limit = 3.0, .delay = 3, .rate_walk_step = 8.0};
    std::map<std::string, double> named;
    std::vector<double> numbers;
    for_each_device_setting(setup, [&](std::string_view table, const auto& field, std::string_view part, auto number) {
        named[std::string(table) + '.' + std::string(field.name) + std::string(part)] = static_cast<double>(number);
        numbers.push_back(static_cast<double>(number));
    });
    EXPECT_EQ(numbers.size(), device_setting_count());
    EXPECT_EQ(named.size(), numbers.size()) << "two numbers have one name";
    EXPECT_EQ(named["rate.kind"], 5.0);
    EXPECT_EQ(named["rate.seed"], 7.0);
    EXPECT_EQ(named["device.position_range.x"], 2.0);
    EXPECT_EQ(named["device.position_range.y"], off);
    EXPECT_EQ(named["device.position_bits"], 24.0);
    EXPECT_EQ(named["device.velocity_bits"], 0.0);
    EXPECT_EQ(named["device.actuator_limit"], 3.0);
    DeviceSetup other;
    take_device_settings(other, numbers.data());
    EXPECT_EQ(other.rate.kind, AngularRateKind::table);
    EXPECT_TRUE(other.rate.inertial);
    EXPECT_EQ(other.device.position.range.y(), off);
    EXPECT_EQ(other.device.position.bits, 24);
    EXPECT_EQ(other.device.delay, 3);
    EXPECT_EQ(other.device.rate_walk_step, 8.0);
    EXPECT_EQ(other.device.actuator()(Vec2<double>{5.0, -1.0}).x(), 3.0);
}

// -- The plant that varies --------------------------------------------------------------------------------------------

GyroscopeParams gyroscope() {
    return {.damping = {0.3, 0.1, 0.2},
            .stiffness = {355.3, 70.99, 532.9},
            .stiffness_deviation = {5.0, -3.0, 7.0},
            .rate = 1.0,
            .initial_position = {0.5, -0.3},
            .initial_velocity = {2.0, 1.0}};
}

// Two units of time of a sine of the rate that is as large as the rate, with drifting and stiffening springs.
Motion<double> driven(const GyroscopeParams& p, bool inertial, std::int64_t steps) {
    const double step = 2.0 / static_cast<double>(steps);
    const AngularRate rate({.kind = AngularRateKind::sine, .amplitude = 3.0, .frequency = 5.0}, p.rate, step, steps);
    const Profile temperature{.times = {0.0, static_cast<double>(steps)}, .values = {0.0, 0.1}};
    const auto c = VaryingGyroscope::prepare({p, {20.0, -10.0}, inertial}, step);
    Motion<double> motion = Gyroscope<double>::start(p);
    for (std::int64_t n = 0; n < steps; ++n) {
        VaryingGyroscope::Course course{.rate_before = rate.before(n) - p.rate};
        for (int k = 0; k < 3; ++k) {
            course.at[static_cast<std::size_t>(k)] = {rate.within(n, k) - p.rate, temperature.within(n, k)};
        }
        VaryingGyroscope::step(motion, c, {30.0, -50.0}, {}, course);
    }
    return motion;
}

double distance(const Motion<double>& a, const Motion<double>& b) {
    return norm(a.position - b.position) + norm(a.velocity - b.velocity);
}

TEST(VaryingGyroscope, ItsStepIsOfFourthOrder) {
    for (const bool inertial : {false, true}) {
        const Motion<double> fine = driven(gyroscope(), inertial, 12'800);
        const double coarse = distance(driven(gyroscope(), inertial, 200), fine);
        const double half = distance(driven(gyroscope(), inertial, 400), fine);
        const double quarter = distance(driven(gyroscope(), inertial, 800), fine);
        EXPECT_LT(quarter, 1e-4);
        EXPECT_NEAR(std::log2(coarse / half), 4.0, 0.2);
        EXPECT_NEAR(std::log2(half / quarter), 4.0, 0.1);
    }
}

TEST(VaryingGyroscope, WhatTheControllerIsNotToldActsAsWhatItIs) {
    for (const bool inertial : {false, true}) {
        GyroscopeParams modeled = gyroscope();
        GyroscopeParams unmodeled = modeled;
        modeled.stiffness = modeled.stiffness + modeled.stiffness_deviation;
        modeled.stiffness_deviation = {};
        unmodeled.damping = {};
        unmodeled.damping_deviation = modeled.damping;
        expect_equal(driven(modeled, inertial, 400).position, driven(unmodeled, inertial, 400).position);
        expect_equal(driven(modeled, inertial, 400).velocity, driven(unmodeled, inertial, 400).velocity);
    }
}

TEST(VaryingGyroscope, WithNothingThatVariesItIsTheExactMap) {
    const GyroscopeParams p = gyroscope();
    const auto c = VaryingGyroscope::prepare({p, {}, false}, 0.3);
    const auto exact = Gyroscope<double>::prepare(p, 0.3);
    Motion<double> got = Gyroscope<double>::start(p), wanted = got;
    for (int n = 0; n < 10; ++n) {
        VaryingGyroscope::step(got, c, {30.0, -50.0}, {}, {});
        Gyroscope<double>::step(wanted, exact, {30.0, -50.0});
    }
    EXPECT_LT(distance(got, wanted), 1e-12);
}

TEST(VaryingGyroscope, AConstantDeviationOfTheRateIsThatRate) {
    GyroscopeParams p = gyroscope(), whole = p;
    whole.rate += 0.5;
    const auto c = VaryingGyroscope::prepare({p, {}, false}, 1e-3);
    const auto exact = Gyroscope<double>::prepare(whole, 1e-3);
    Motion<double> got = Gyroscope<double>::start(p), wanted = got;
    for (int n = 0; n < 1000; ++n) {
        VaryingGyroscope::step(got, c, {}, {}, {0.5, {{{0.5, 0.0}, {0.5, 0.0}, {0.5, 0.0}}}});
        Gyroscope<double>::step(wanted, exact, {});
    }
    EXPECT_LT(distance(got, wanted), 1e-9);
}

TEST(VaryingGyroscope, DampersThatHaveDriftedAreThoseDampers) {
    for (const bool inertial : {false, true}) {
        GyroscopeParams p = gyroscope(), more = p;
        more.damping = 1.25 * p.damping;
        const auto c = VaryingGyroscope::prepare({p, {}, inertial}, 1e-3);
        const auto wanted_c = VaryingGyroscope::prepare({more, {}, inertial}, 1e-3);
        Motion<double> got = Gyroscope<double>::start(p), wanted = got;
        for (int n = 0; n < 1000; ++n) {
            const Variation now{.rate = 0.5}, drifted{.rate = 0.5, .damping = 0.25};
            VaryingGyroscope::step(got, c, {}, {}, {0.5, {{drifted, drifted, drifted}}});
            VaryingGyroscope::step(wanted, wanted_c, {}, {}, {0.5, {{now, now, now}}});
        }
        EXPECT_LT(distance(got, wanted), 1e-9);
    }
}

// Entries that drift with temperature, by one kelvin.
TEST(VaryingGyroscope, EntriesThatHaveDriftedAreThoseEntries) {
    const ThermalParams thermal{
        .spring = {0.02, -0.03}, .damper = {0.4, -0.3}, .quadrature = 0.01, .damping_axis = 0.05};
    for (const bool inertial : {false, true}) {
        GyroscopeParams p = gyroscope(), warm = p;
        const Sym2<double> k = p.stiffness + p.stiffness_deviation, d = p.damping + p.damping_deviation;
        warm.stiffness = {1.02 * k.xx(), k.xy() + 0.01 * std::sqrt(k.xx() * k.yy()), 0.97 * k.yy()};
        warm.stiffness_deviation = {};
        // To first order the axes turn by the angle.
        const double c = 1.0, s = 0.05;
        warm.damping = {1.4 * d.xx() - 2.0 * c * s * d.xy(), d.xy() + s * (d.xx() - d.yy()),
                        0.7 * d.yy() + 2.0 * c * s * d.xy()};
        warm.damping_deviation = {};
        const auto drifting = VaryingGyroscope::prepare({p, {}, inertial, thermal}, 1e-3);
        const auto wanted_c = VaryingGyroscope::prepare({warm, {}, inertial}, 1e-3);
        Motion<double> got = Gyroscope<double>::start(p), wanted = got;
        for (int n = 0; n < 1000; ++n) {
            const Variation now{.rate = 0.5}, kelvin{.rate = 0.5, .warmer = 1.0};
            VaryingGyroscope::step(got, drifting, {}, {}, {0.5, {{kelvin, kelvin, kelvin}}});
            VaryingGyroscope::step(wanted, wanted_c, {}, {}, {0.5, {{now, now, now}}});
        }
        EXPECT_LT(distance(got, wanted), 1e-8);
    }
}

// Two axes of one frequency, without damping.
GyroscopeParams round_oscillator() {
    return {.stiffness = {1.0, 0.0, 1.0}, .initial_position = {1.0, 0.0}, .initial_velocity = {0.0, 0.4}};
}
Motion<double> free_motion(const GyroscopeParams& p, Vec2<double> own, const CubicCoupling& coupling, int steps) {
    const auto c = VaryingGyroscope::prepare({p, own, false, {}, coupling}, 1e-2);
    Motion<double> motion = Gyroscope<double>::start(p);
    for (int n = 0; n < steps; ++n) {
        VaryingGyroscope::step(motion, c, {}, {}, {});
    }
    return motion;
}

TEST(CubicCoupling, ItsForcesComeFromItsEnergy) {
    const CubicCoupling coupling{.shared = 0.7, .skewed = {-0.4, 0.9}};
    const auto energy = [&](double x, double y) {
        return 0.35 * x * x * y * y - 0.4 * x * x * x * y + 0.9 * x * y * y * y;
    };
    for (const Vec2<double> q : {Vec2<double>{0.8, -0.3}, Vec2<double>{-1.1, 0.6}}) {
        constexpr double d = 1e-5;
        const double x = q.x(), y = q.y();
        expect_near(coupling(q),
                    {(energy(x - d, y) - energy(x + d, y)) / (2 * d), (energy(x, y - d) - energy(x, y + d)) / (2 * d)},
                    1e-9);
    }
}

TEST(CubicCoupling, SpringsThatAreTheSameInAllDirectionsKeepTheAngularMomentum) {
    const GyroscopeParams p = round_oscillator();
    const auto momentum = [](const Motion<double>& m) {
        return m.position.x() * m.velocity.y() - m.position.y() * m.velocity.x();
    };
    const Motion<double> round = free_motion(p, {0.1, 0.1}, {.shared = 0.1}, 2000);
    EXPECT_NEAR(momentum(round), 0.4, 1e-8);
    EXPECT_GT(std::abs(momentum(free_motion(p, {0.1, 0.1}, {}, 2000)) - 0.4), 1e-3);
}

// An ellipse with the half axes a and b turns against its motion by κ a b/(4 ω) (Friedland and Hutton, 1978), κ small.
TEST(CubicCoupling, AnEllipseTurns) {
    constexpr double a = 1.0, b = 0.4, kappa = 1e-3;
    constexpr int steps = 40'000;  // 400 units of time
    const Motion<double> m = free_motion(round_oscillator(), {kappa, kappa}, {.shared = kappa}, steps);
    const double across = 2.0 * (m.position.x() * m.position.y() + m.velocity.x() * m.velocity.y());
    const double along = m.position.x() * m.position.x() + m.velocity.x() * m.velocity.x() -
                         m.position.y() * m.position.y() - m.velocity.y() * m.velocity.y();
    const double turned = -kappa * a * b / 4.0 * 1e-2 * steps;
    EXPECT_NEAR(0.5 * std::atan2(across, along), turned, 0.01 * std::abs(turned));
}

TEST(ThermalParams, ASmallTurnOfTheDampingKeepsItsEigenvalues) {
    const Sym2<double> d{3.0, 0.5, 1.0};
    const auto turned_by = [&](double angle) { return d + damping_per_kelvin({.damping_axis = angle}, d); };
    const Sym2<double> found = turned_by(1e-6);
    EXPECT_NEAR(found.xx() + found.yy(), 4.0, 1e-15);
    EXPECT_NEAR(found.xx() * found.yy() - found.xy() * found.xy(), 2.75, 1e-11);
    const auto axis = [](const Sym2<double>& a) { return 0.5 * std::atan2(2.0 * a.xy(), a.xx() - a.yy()); };
    EXPECT_NEAR(axis(found) - axis(d), 1e-6, 1e-11);
}

TEST(Imperfections, GainsDriftWithTheTemperatureOfTheSample) {
    ImperfectionParams p;
    p.thermal = {.pickoff_gain = {0.01, -0.02}, .force_gain = {0.1, 0.2}};
    p.temperature = {.times = {0.0, 10.0}, .values = {0.0, 5.0}};
    const auto c = Imperfections::prepare(p);
    Imperfections::State state{};
    DeviceNoise noise(p, 0, 1e-3);
    const auto seen = Imperfections::sense(state, c, {{1.0, 2.0}, {3.0, 4.0}}, noise(4));
    expect_near(seen.position, {1.02, 2.0 * 0.96}, 1e-15);
    expect_near(seen.velocity, {3.0 * 1.02, 4.0 * 0.96}, 1e-15);
    expect_near(Imperfections::actuate(state, c, {1.0, 1.0}, 4), {1.2, 1.4}, 1e-15);
}

TEST(VaryingGyroscope, SeenFromAFrameThatIsSpunUpAFreeMassGoesStraightOn) {
    // No springs, no force; in inertial space q = (1, 0) + t (0, 2). The frame turns by t²/2: its rate is t, at once
    // 0.5 more after one unit of time.
    const GyroscopeParams p{.initial_position = {1.0, 0.0}, .initial_velocity = {0.0, 2.0}};
    constexpr std::int64_t steps = 400;
    constexpr double h = 2.0 / steps;
    const auto c = VaryingGyroscope::prepare({p, {}, true}, h);
    const auto jump = [](std::int64_t n) { return n < steps / 2 ? 0.0 : 0.5; };
    Motion<double> motion = Gyroscope<double>::start(p);
    for (std::int64_t n = 0; n < steps; ++n) {
        const double t = static_cast<double>(n) * h;
        VaryingGyroscope::step(motion, c, {}, {},
                               {n > 0 ? t + jump(n - 1) : 0.0,
                                {{{t + jump(n), 0.0}, {t + 0.5 * h + jump(n), 0.0}, {t + h + jump(n), 0.0}}}});
    }
    const double angle = 2.0 + 0.5;
    const Vec2<double> q{1.0, 4.0};
    expect_near(motion.position,
                {std::cos(angle) * q.x() + std::sin(angle) * q.y(), std::cos(angle) * q.y() - std::sin(angle) * q.x()},
                1e-8);
}

TEST(VaryingGyroscope, AModeOfHighQualityKeepsItsAmplitude) {
    // 10⁵ steps of a fifteenth of a period; what moves is the rate, by 1e-3.
    const GyroscopeParams p{.stiffness = {1.0, 0.0, 1.0}, .initial_position = {1.0, 0.0}};
    constexpr double h = 0.4;
    const auto c = VaryingGyroscope::prepare({p, {}, false}, h);
    const AngularRate rate({.kind = AngularRateKind::sine, .amplitude = 1e-3, .frequency = 0.01}, 0.0, h, 100'000);
    Motion<double> motion = Gyroscope<double>::start(p);
    for (std::int64_t n = 0; n < 100'000; ++n) {
        VaryingGyroscope::step(
            motion, c, {}, {},
            {rate.before(n), {{{rate.at(n), 0.0}, {rate.within(n, 1), 0.0}, {rate.within(n, 2), 0.0}}}});
    }
    const double energy = squared_norm(motion.position) + squared_norm(motion.velocity);
    EXPECT_NEAR(energy, 1.0, 1e-5);  // Runge-Kutta without the exact linear part would leave 0.4 %
}

// -- The device -------------------------------------------------------------------------------------------------------

TEST(Quantization, ThreeBitsOverFourHaveEightLevelsOfOne) {
    const Quantizer q{.range = {4.0, 4.0}, .bits = 3};
    expect_equal(q({0.4, 0.6}), {0.0, 1.0});
    expect_equal(q({-2.7, 100.0}), {-3.0, 3.0});
    expect_equal(q({-100.0, 3.4}), {-4.0, 3.0});
    const Quantizer clip{.range = {4.0, 4.0}};
    expect_equal(clip({0.4, -7.0}), {0.4, -4.0});
}

TEST(Quantization, IsIdempotentMonotoneAndWithinHalfAStep) {
    std::mt19937_64 random(7);
    for (int i = 0; i < 10'000; ++i) {
        const double span = std::exp2(static_cast<double>(random() % 40) - 30.0);
        const int bits = 1 + static_cast<int>(random() % 32);
        const Quantizer q{.range = {span, span}, .bits = bits};
        const auto uniform = [&] { return 6.0 * span * (static_cast<double>(random() >> 11) * 0x1p-53 - 0.5); };
        const auto of = [&](double a) { return q(Vec2<double>{a, 0.0}).x(); };
        const double a = uniform(), b = uniform(), step = 2.0 * span / std::exp2(bits);
        ASSERT_EQ(of(of(a)), of(a));
        ASSERT_LE(of(std::min(a, b)), of(std::max(a, b)));
        ASSERT_TRUE(-span <= of(a) && of(a) <= span - step);
        if (-span <= a && a <= span - step) {
            ASSERT_LE(std::abs(of(a) - a), 0.5 * step * (1.0 + 1e-9));
        }
    }
}

TEST(Quantization, NeedsARange) {
    const Quantizer q{.range = {Quantizer::unlimited, 4.0}, .bits = 3};
    EXPECT_EQ(q({0.3, 0.3}).x(), 0.3);
    EXPECT_EQ(q({0.3, 0.3}).y(), 0.0);
}

TEST(Quantization, EachAxisHasItsOwnRange) {
    const Quantizer q{.range = {4.0, 0.25}, .bits = 3};
    EXPECT_TRUE(q.on());
    expect_equal(q({0.6, 0.6}), {1.0, 0.1875});
    expect_equal(q({-0.6, -0.07}), {-1.0, -0.0625});
    const Quantizer clip{.range = {Quantizer::unlimited, 0.25}};
    EXPECT_TRUE(clip.on());
    expect_equal(clip({100.0, 100.0}), {100.0, 0.25});
}

TEST(Device, ADelayOfTwoStepsGivesEachForceTwoStepsLate) {
    const auto late = Imperfections::prepare({.delay = 2});
    Imperfections::State state{};
    const std::array<double, 5> given{0.0, 0.0, 1.0, 2.0, 3.0};
    for (std::size_t n = 0; n < given.size(); ++n) {
        const Vec2<double> asked{static_cast<double>(n + 1), 0.0};
        EXPECT_EQ(Imperfections::actuate(state, late, asked, static_cast<std::int64_t>(n)).x(), given[n]);
    }
}

TEST(Device, NoiseOfTheSensorsIsNeitherThatOfTheForceNorOfEachOther) {
    const auto draw = [](std::uint32_t stream) {
        std::array<Vec2<double>, 4> d{};
        Disturbance({.kind = DisturbanceKind::noise, .seed = 5, .stream = stream}, 1.0).fill(0, d);
        return d;
    };
    EXPECT_NE(draw(0)[0].x(), draw(1)[0].x());
    EXPECT_NE(draw(1)[0].x(), draw(2)[0].x());
    const ImperfectionParams device{.position_noise = 2.0, .velocity_noise = 3.0};
    Imperfections::State state{};
    const Motion<double> seen =
        Imperfections::sense(state, Imperfections::prepare(device), {}, DeviceNoise(device, 5, 1.0)(3));
    EXPECT_EQ(seen.position.y(), 2.0 * draw(1)[3].y());
    EXPECT_EQ(seen.velocity.x(), 3.0 * draw(2)[3].x());
}

TEST(Device, PickOffsThatAreTurnedByARightAngleSeeTheOtherAxis) {
    const auto c = Imperfections::prepare({.pickoff = {{1.0, 0.5}, 0.5 * std::numbers::pi}});
    Imperfections::State state{};
    const Motion<double> seen = Imperfections::sense(state, c, {{10.0, 1.0}, {-4.0, 2.0}}, {});
    expect_near(seen.position, {2.0 * 1.0, 1.5 * -10.0}, 1e-14);
    expect_near(seen.velocity, {2.0 * 2.0, 1.5 * 4.0}, 1e-14);
}

TEST(Device, ActuatorsThatAreTurnedByARightAnglePushAlongTheOtherAxis) {
    const auto c = Imperfections::prepare({.force = {{1.0, 0.5}, 0.5 * std::numbers::pi}});
    Imperfections::State state{};
    expect_near(Imperfections::actuate(state, c, {10.0, 1.0}, 0), {1.5 * -1.0, 2.0 * 10.0}, 1e-14);
}

TEST(Device, TurnedAlikePickOffsAndActuatorsAreTheirOwnInverse) {
    const auto c = Imperfections::prepare({.pickoff = {{}, 0.3}, .force = {{}, 0.3}});
    Imperfections::State state{};
    const Vec2<double> acts = Imperfections::actuate(state, c, {10.0, 1.0}, 0);
    expect_near(Imperfections::sense(state, c, {.position = acts}, {}).position, {10.0, 1.0}, 1e-14);
}

// -- Flicker noise ----------------------------------------------------------------------------------------------------

TEST(FlickerNoise, ItsAnswerToOneDrawIsTheHalfIntegralOfIt) {
    // (1 - z⁻¹)^(-1/2) = 1 + z⁻¹/2 + 3/8 z⁻² + …: each the last one times (2n - 1)/2n.
    Flicker::State<double> state{};
    double wanted = 1.0, sum = 0.0, wanted_sum = 0.0;
    for (int n = 0; n <= 1'000'000; ++n) {
        wanted *= n == 0 ? 1.0 : (2.0 * n - 1.0) / (2.0 * n);
        const double got = Flicker::next(state, n == 0 ? 1.0 : 0.0);
        ASSERT_NEAR(got / wanted, 1.0, n < 3 ? 0.02 : 2e-3) << n;
        sum += got, wanted_sum += wanted;
    }
    EXPECT_NEAR(sum / wanted_sum, 1.0, 1e-3);
}

TEST(FlickerNoise, ItsDensityIsOneOverTheFrequencyOverNineDecades) {
    const Flicker::Coefficients& c = Flicker::coefficients;
    const auto decibels = [&](double theta) {  // over those of the exact half integral
        // 1 - p z⁻¹ = 1 - p + p (1 - z⁻¹), the latter without cancellation.
        const double s = std::sin(0.5 * theta);
        const std::complex<double> difference(2.0 * s * s, std::sin(theta));
        std::complex<double> answer(c.direct);
        for (std::size_t k = 0; k < Flicker::poles; ++k) {
            answer += c.weight[k] / ((1.0 - c.pole[k]) + c.pole[k] * difference);
        }
        return 10.0 * std::log10(std::norm(answer) * 2.0 * s);
    };
    for (double theta = 3.2e-10; theta < std::numbers::pi; theta *= 1.1) {
        EXPECT_NEAR(decibels(theta), 0.0, 0.08) << theta;
    }
    for (double theta = 3e-8; theta < 0.03; theta *= 1.1) {
        EXPECT_NEAR(decibels(theta), 0.0, 0.01) << theta;
    }
    EXPECT_LT(decibels(1e-12), -10.0);
}

TEST(FlickerNoise, OfTwoAxesEachHasItsOwn) {
    Flicker::State<double> one{};
    Flicker::State<Vec2<double>> both{};
    for (int n = 0; n < 100; ++n) {
        const double a = std::sin(1.7 * n), b = std::cos(0.3 * n * n);
        const Vec2<double> got = Flicker::next(both, Vec2<double>{a, b});
        EXPECT_EQ(got.x(), Flicker::next(one, a));
        EXPECT_NE(got.y(), got.x());
    }
}

TEST(DeviceLoop, OfAnIdealDeviceItsSamplesAreThoseOfTheLoop) {
    const DeviceSetup setup{{paper(2'000)}};
    ASSERT_TRUE(is_ideal(setup));
    const std::size_t width = row_width_of(setup.controller), device_row = width + device_width;
    std::vector<double> wanted(2'001 * width), got(2'001 * device_row);
    record<double>(setup, 1, wanted.data());
    double* next = got.data();
    const auto controller = make_controller<double>(setup.controller, setup.common);
    record_any(PlantSetup{setup}, *controller, 1, device_width, &fill_noise<word_bytes>,
               [&](std::size_t row) { return std::exchange(next, next + row); });
    for (std::size_t n = 0; n <= 2'000; ++n) {
        for (std::size_t k = 0; k < width; ++k) {
            ASSERT_EQ(got[n * device_row + k], wanted[n * width + k]) << n << ' ' << k;
        }
    }
}

// -- The observer -----------------------------------------------------------------------------------------------------

template <class T>
class VelocityObserver : public ::testing::Test {};
TYPED_TEST_SUITE(VelocityObserver, Scalars, ScalarNames);

TYPED_TEST(VelocityObserver, ForgetsAnErrorAtItsBandwidthThreeTimesOver) {
    // For a free mass under an unmodeled constant acceleration, all errors are polynomials of degree 2 times θⁿ.
    using T = TypeParam;
    constexpr double h = 0.01, bandwidth = 20.0;
    const auto c = Observer<T>::prepare({}, bandwidth, h);
    typename Observer<T>::State state{};
    double error = 0.0;
    for (int n = 0; n <= 200; ++n) {
        const double t = n * h;
        Observer<T>::correct(state, c, vec2<T>(1.0 + 2.0 * t - 1.5 * t * t, 0.0));
        error = number(state.motion.velocity.x()) - (2.0 - 3.0 * t);
        if (n == 50) {  // e^-10 (a + b n + c n²): still far from 0
            EXPECT_LT(std::abs(error), 50.0 * 50.0 * std::exp(-10.0));
            EXPECT_GT(std::abs(error), std::exp(-10.0));
        }
        Observer<T>::predict(state, c, vec2<T>(0.0, 0.0));
    }
    EXPECT_NEAR(error, 0.0, 1e-9 + 3e2 * epsilon<T>);
    expect_near(state.acceleration, {-3.0, 0.0}, 1e-8 + 5e4 * epsilon<T>);
}

TYPED_TEST(VelocityObserver, OfTheNominalPlantUnderAKnownForceItFindsTheVelocity) {
    using T = TypeParam;
    GyroscopeParams p{.damping = {0.3, 0.1, 0.2}, .stiffness = {35.0, 7.0, 53.0}, .rate = 0.5};
    p.initial_position = {0.5, -0.3};
    p.initial_velocity = {2.0, 1.0};
    constexpr double h = 1e-3;
    const auto plant = Gyroscope<double>::prepare(p, h);
    const auto c = Observer<T>::prepare({.damping = p.damping, .stiffness = p.stiffness, .rate = p.rate}, 100.0, h);
    typename Observer<T>::State state{};
    Motion<double> motion = Gyroscope<double>::start(p);
    for (int n = 0; n < 3'000; ++n) {
        Observer<T>::correct(state, c, vec2<T>(motion.position.x(), motion.position.y()));
        if (n > 500) {  // 3 d/ω² with the prediction's own error for d: h/2 d²a/dt², some 500 here
            expect_near(state.motion.velocity, motion.velocity, 2e-4 + 1e3 * epsilon<T>);
        }
        const Vec2<double> force{(n / 100) % 2 == 0 ? 5.0 : -5.0, 3.0};
        Observer<T>::predict(state, c, vec2<T>(force.x(), force.y()));
        Gyroscope<double>::step(motion, plant, force);
    }
}

TEST(Observing, TheVelocityThatItIsHandedChangesNothing) {
    auto setup = paper(1'000);
    setup.common.observer_bandwidth = 300.0;
    const auto c = prepared<Observing<Proposed>>(setup);
    Observing<Proposed>::State one{}, other{};
    for (int n = 0; n < 1'000; ++n) {
        const Vec2<double> q{std::sin(1e-3 * n), 0.5};
        const auto a = Observing<Proposed>::step(one, c, {.position = q});
        const auto b = Observing<Proposed>::step(other, c, {.position = q, .velocity = {1e9 * n, -5.0}});
        ASSERT_EQ(a.force, b.force);
    }
}

TEST(Observing, ItsGuardHoldsTheForceThroughBadSamplesAndGoesOn) {
    using Guarded = Guard<Observing<Proposed>>;
    auto setup = paper(3'000);
    setup.common.observer_bandwidth = 300.0;
    const auto c = prepared<Guarded>(setup);
    const auto plant = Gyroscope<double>::prepare(setup.plant, setup.common.step);
    Guarded::State state{};
    Motion<double> motion = Gyroscope<double>::start(setup.plant);
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    for (int n = 0; n < 3'000; ++n) {
        const bool bad = n >= 1'000 && n < 1'010;
        const Vec2<double> before = state.force;
        Guarded::step(state, c,
                      {.position = {bad ? nan : motion.position.x(), motion.position.y()}, .velocity = {nan, nan}});
        ASSERT_EQ(state.status, bad ? Status::not_finite : Status::ok) << n;
        if (bad) {
            ASSERT_EQ(state.force, before);
        }
        Gyroscope<double>::step(motion, plant, state.force);
        if (n == 1'009) {  // the prediction used the held force; the missing one would give an error of .08
            expect_near(state.controller.observer.motion.velocity, motion.velocity, 0.02);
        }
    }
    expect_near(motion.position, {std::sin(std::numbers::pi * 3.0), std::cos(0.5 * std::numbers::pi * 3.0)}, 0.05);
}

// -- A loop that is held on to ----------------------------------------------------------------------------------------

PlantSetup held_setup() {
    PlantSetup setup;
    static_cast<Setup&>(setup) = paper(1'000);
    return setup;
}
struct WithController {
    std::unique_ptr<AnyController<double>> own;
};
struct Held : WithController, RunningLoop {
    explicit Held(const PlantSetup& setup)
        : WithController{make_controller<double>(setup.controller, setup.common)}, RunningLoop(setup, *own) {}
};

Motion<double> motion_after(Held& loop, std::int64_t samples) {
    Motion<double> last{};
    loop.run(samples, [&](const auto& at) { last = at.motion; });
    return last;
}

TEST(RunningLoop, AKickChangesTheVelocityOfTheComingSampleAndNotItsPosition) {
    Held one(held_setup()), other(held_setup());
    motion_after(one, 100), motion_after(other, 100);
    one.kick({0.25, -2.0});
    const Motion<double> kicked = motion_after(one, 1), plain = motion_after(other, 1);
    EXPECT_EQ(kicked.position, plain.position);
    EXPECT_EQ(kicked.velocity, plain.velocity + Vec2<double>(0.25, -2.0));
}

TEST(RunningLoop, WhatIsSetActsFromTheComingSampleOnAndAnotherControllerIsRefused) {
    Held one(held_setup()), other(held_setup());
    PlantSetup faster = held_setup();
    faster.plant.rate = 0.3;
    motion_after(one, 100), motion_after(other, 100);
    ASSERT_TRUE(one.set(faster));
    EXPECT_EQ(motion_after(one, 1).velocity, motion_after(other, 1).velocity);
    EXPECT_NE(motion_after(one, 1).velocity, motion_after(other, 1).velocity);
    PlantSetup composite = held_setup();
    law(composite).adaptation.kind = AdaptationKind::composite;
    EXPECT_FALSE(one.set(composite));
    PlantSetup shorter = held_setup();
    *kernel_of(shorter.controller) = log_trapezoid(0.9, 2e-3, 1.0);
    EXPECT_FALSE(one.set(shorter)) << "its memory would be another";
    EXPECT_EQ(one.setup().plant.rate, 0.3);
}

TEST(RunningLoop, ADisturbanceThatIsSetActsFromTheComingSampleOn) {
    Held one(held_setup()), other(held_setup());
    PlantSetup pushed = held_setup();
    pushed.disturbance = {
        .kind = DisturbanceKind::sine, .amplitude = {0.0, 50.0}, .frequency = {0.0, 1.0}, .phase = {0.0, 1.5}};
    motion_after(one, 100), motion_after(other, 100);
    ASSERT_TRUE(one.set(pushed));
    motion_after(one, 1), motion_after(other, 1);
    const double step = held_setup().common.step, force = 50.0 * std::sin(100.0 * step + 1.5);
    const Vec2<double> difference = motion_after(one, 1).velocity - motion_after(other, 1).velocity;
    EXPECT_NEAR(difference.y(), force * step, 1e-2 * force * step);
}

TEST(RunningLoop, ASavedStateResumesAndADamagedOneIsRefused) {
    Held one(held_setup()), other(held_setup());
    motion_after(one, 300);
    std::vector<unsigned char> bytes(one.saved_size());
    one.save(bytes.data());
    ASSERT_TRUE(other.restore(bytes.data(), bytes.size()));
    EXPECT_EQ(other.step(), 300);
    EXPECT_EQ(motion_after(one, 50).position, motion_after(other, 50).position);
    EXPECT_FALSE(other.restore(bytes.data(), bytes.size() - 1));
    bytes[100] ^= 1;
    EXPECT_FALSE(other.restore(bytes.data(), bytes.size()));
    EXPECT_EQ(other.step(), 350);
}

}  // namespace
}  // namespace fracgyro::testing
