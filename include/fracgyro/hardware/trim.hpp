// Trim: voltages of the tuning and quadrature electrodes, adjusted while any controller runs. It matches the modes, so
// that the sense axis is at a given split from the drive's frequency, and nulls the quadrature.
//
//    The quadrature electrodes' voltage has a small tone, v + Δv cos ψ with ψ = ω_t t, so that kxy shakes the sense
//    axis at θ ± ψ. θ is the phase of the vibration on x, of a phase-locked loop of its own. X, Y and U are the phasors
//    of x, y and the force asked of y, over an interval:
//
//        k̂_yy = ν² + Re((H U + s M)/Y)              ν = ω̂ ± ω_t        M = ½ c Δv X e^(∓jω_t h/2)
//        k̂_xy = Re((H U - (k̂_yy - ω̂² + jω̂d̂) Y)/X)  at θ               H = e^(-jνλ) (1 - ν²h²/24)
//
//        V² ← V² + g (k̂_yy - (ω̂ + δ)²)/k₁        v ← v + g k̂_xy/(s c)
//
//    k₁ is what the tuning electrodes take off k_yy per V², c what a volt of the quadrature electrodes takes off k_xy,
//    as designed. The two sidebands give k̂_yy, s, the true c over that, and d̂ as the imaginary part over ν; unless s
//    is between ½ and 2, the sense axis does not answer the tone, and nothing is changed. λ: half a step, the delay and
//    the lag of the datasheet. The first eighth of an interval, in which the last change dies out, is not read; the
//    rest is weighted by a whole number of periods of the tone, smoothed by half a cosine of another eighth. ω_t is to
//    be above the bandwidth at which the controller reads the rate.
//
// Source: the tone: Micromachines 2018, 9, 511 (abstract read); the equations are this project's (EQUATIONS.md).
#pragma once

#include "fracgyro/control/vibration.hpp"
#include "fracgyro/core/fields.hpp"
#include "fracgyro/core/phase.hpp"

namespace fracgyro {

enum class TrimTuning { fixed, split };
enum class TrimQuadrature { fixed, null };

// Table of a scenario, in SI.
struct TrimSettings {
    TrimTuning tuning = TrimTuning::fixed;
    TrimQuadrature quadrature = TrimQuadrature::fixed;
    double interval = 0.02, gain = 0.7, modulation = 0.0, frequency = 300.0, target = 0.0;

    static constexpr std::string_view tunings[] = {"fixed", "split"}, quadratures[] = {"fixed", "null"};
    static constexpr auto fields() {
        using P = TrimSettings;
        constexpr Range share{.low = 0.0, .high = 1.0, .strict = true};
        return Fields{
            choice("tuning", &P::tuning, tunings,
                   "split: the voltage of the tuning electrodes of y is adjusted until its mode is target above that "
                   "of x. fixed: off."),
            choice("quadrature", &P::quadrature, quadratures,
                   "null: nulling of the quadrature electrodes is adjusted until kxy is 0. fixed: off."),
            field("interval", &P::interval, "s", above_0, "> 0: from one adjustment to the next."),
            field("gain", &P::gain, "1", share,
                  "Part of what an interval finds that it corrects, between 0 and 1: a lower one leaves less noise."),
            field("modulation", &P::modulation, "V", at_least_0,
                  "Amplitude of a tone on the nulling voltage, by which the split is found; needed. 0.0: off."),
            field("frequency", &P::frequency, "Hz", above_0,
                  "> 0: of the tone, above the bandwidth at which the controller reads the rate."),
            field("target", &P::target, "Hz", any_number, "Frequency of y less that of x to hold. 0.0: matched modes."),
        };
    }
    bool on() const { return tuning != TrimTuning::fixed || quadrature != TrimQuadrature::fixed; }
};

// Nondimensional but for voltages.
struct TrimParams {
    bool split = false, quadrature = false;                        // quantities to adjust
    double interval = 0.0, gain = 0.7;                             // between changes
    double modulation = 0.0, frequency = 0.0;                      // Δv, ω_t
    double target = 0.0;                                           // δ
    double per_square = 0.0, per_volt = 0.0;                       // k₁, c, as designed
    double tuning = 0.0, nulling = 0.0;                            // V and v at the start
    double most_tuning = std::numeric_limits<double>::infinity();  // largest |V|, |v|
    double most_nulling = std::numeric_limits<double>::infinity();
    double lag = 0.0;  // readings and forces, with delays
};

// Voltages of the tuning and quadrature electrodes, and s of the last interval; 0 before the first.
template <Scalar T>
struct TrimVolts {
    T tuning{}, nulling{}, share{};
};

template <Scalar T>
struct Trim {
    using Loop = Vibration<T>;
    using Phase = PhaseOf<T>;
    using Complex = Vec2<T>;  // real and imaginary part

    struct Coefficients {
        typename Loop::Coefficients loop{};
        bool split = false, quadrature = false;
        std::uint64_t settling = 0, ramp = 1, interval = 1;  // steps
        std::uint64_t per_step = 0, half_ramp_step = 0;      // phases of ψ and of a ramp, 2^-64 turns
        T per_sum{}, per_read{};
        T modulation{}, tone{}, gain_square{}, gain_volt{}, half_volt{};  // Δv, ω_t, g/k₁, g/c, ½ c Δv
        T target{}, most_square{}, most_nulling{};                        // δ
        T lead{}, step_square{}, least{};                                 // λ, h²/24, the smallest |X|²
        Complex late{};                                                   // e^(-jω_t h/2)
    };
    // Sums of x, y and the force on y times e^-j of a phase.
    struct Line {
        LongSum<T> cosine{}, sine{};
    };
    struct State {
        typename Loop::State loop{};
        Complex drive{};  // phasor of x for the loop
        typename Phase::Type tone{};
        std::uint64_t place = 0;  // steps in this interval
        LongSum<T> frequency{};
        Line x{};
        std::array<Line, 3> y{}, force{};  // at θ, θ + ψ, θ - ψ
        T square{}, nulling{}, share{};    // V², v, s
    };

    static Coefficients prepare(const TrimParams& p, const Common& common) {
        const double h = common.step, turns = p.frequency * h;
        constexpr double turn = 6.28318530717958647693;
        const auto whole = [](double count) { return static_cast<std::uint64_t>(maximum(count, 1.0)); };
        const std::uint64_t settling = whole(0.125 * p.interval / h), ramp = whole(0.125 * p.interval / h);
        const std::uint64_t periods = whole(0.75 * p.interval * p.frequency / turn);
        const std::uint64_t read = whole(static_cast<double>(periods) * turn / turns + 0.5);
        const double amplitude = common.reference.amplitude.x();
        return {.loop = Loop::prepare({}, common),
                .split = p.split,
                .quadrature = p.quadrature,
                .settling = settling,
                .ramp = ramp,
                .interval = settling + read + ramp,
                .per_step = phase_of(turns),
                .half_ramp_step = (std::uint64_t{1} << 62) / ramp,
                .per_sum = T(2.0 / static_cast<double>(read)),
                .per_read = T(1.0 / static_cast<double>(read + ramp)),
                .modulation = T(p.modulation),
                .tone = T(p.frequency),
                .gain_square = T(p.gain / p.per_square),
                .gain_volt = T(p.gain / p.per_volt),
                .half_volt = T(0.5 * p.per_volt * p.modulation),
                .target = T(p.target),
                .most_square = T(p.most_tuning * p.most_tuning),
                .most_nulling = T(p.most_nulling),
                .lead = T(0.5 * h + p.lag),
                .step_square = T(h * h / 24.0),
                .least = T(0.25 * amplitude * amplitude),
                .late = turn_of<T>(-0.5 * turns)};
    }
    static State start(const TrimParams& p) {
        State state{};
        state.square = T(p.tuning * p.tuning);
        state.nulling = T(p.nulling);
        return state;
    }
    // After a controller's step, with the position that it measured and the force that it asks for, as the range and
    // the steps of a converter leave it; returns the voltages from here on. Without a measurement the interval begins
    // again.
    static TrimVolts<T> step(State& state, const Coefficients& c, const Vec2<T>& position, const Vec2<T>& force,
                             bool missing = false) {
        const SineCosine<T> tone = Phase::sine_cosine(state.tone);
        const bool reads = !missing && state.place >= c.settling;
        if (!missing) {
            Loop::demodulate(state.drive, c.loop, state.loop, position.x());
        }
        if (reads) {
            const Complex carrier = weight(state.place, c) * conjugate(state.loop.oscillator);
            const Complex down{tone.cosine, -tone.sine};
            const std::array<Complex, 3> lines{carrier, product(carrier, down), product(carrier, conjugate(down))};
            add(state.x, carrier, position.x());
            for (std::size_t i = 0; i < 3; ++i) {
                add(state.y[i], lines[i], position.y());
                add(state.force[i], lines[i], force.y());
            }
        }
        const auto driven = Loop::drive(state.loop, c.loop, state.drive);
        state.tone = state.tone + c.per_step;
        if (reads) {
            state.frequency = state.frequency + driven.frequency;
        }
        state.place = missing ? 0 : state.place + 1;
        if (state.place >= c.interval) {
            change(state, c);
            state.place = 0;
        }
        if (state.place == 0) {
            state.frequency = {};
            state.x = {};
            state.y = {};
            state.force = {};
        }
        return {.tuning = square_root(state.square),
                .nulling = state.nulling + c.modulation * tone.cosine,
                .share = state.share};
    }

private:
    static Complex product(const Complex& a, const Complex& b) { return Loop::product(a, b); }
    static Complex conjugate(const Complex& a) { return {a.x(), -a.y()}; }
    static void add(Line& line, const Complex& back, T value) {
        line.cosine = line.cosine + back.x() * value;
        line.sine = line.sine + back.y() * value;
    }
    // 1 with ramps of a cosine at both ends, so that the ripple at 2ω̂ leaves nothing.
    static T weight(std::uint64_t place, const Coefficients& c) {
        const std::uint64_t since = place - c.settling, left = c.interval - 1 - place,
                            near = since < left ? since : left;
        if (near >= c.ramp) {
            return T(1.0);
        }
        const auto along = Phase::sine_cosine(typename Phase::Type{} + (2 * near + 1) * c.half_ramp_step);
        return T(0.5) * (T(1.0) - along.cosine);
    }
    // a e^(-jx)
    static Complex late_by(const Complex& a, T x) {
        constexpr double turns = 1.0 / 6.28318530717958647693;
        const SineCosine<T> turn = Phase::sine_cosine(Phase::after(typename Phase::Type{}, -(T(turns) * x)));
        return product(a, {turn.cosine, turn.sine});
    }
    // a/b
    static Complex ratio(const Complex& a, const Complex& b) {
        return (T(1.0) / maximum(squared_norm(b), T(smallest))) * product(a, conjugate(b));
    }
    static void change(State& state, const Coefficients& c) {
        const T one = T(1.0), per = c.per_sum;
        const auto phasor = [&](const Line& line) { return Complex{per * line.cosine.value, per * line.sine.value}; };
        const T omega = c.per_read * state.frequency.value;
        const Complex x = phasor(state.x);
        const auto acting = [&](std::size_t i, T nu) {
            return (one - nu * nu * c.step_square) * late_by(phasor(state.force[i]), nu * c.lead);
        };
        // k_yy - ω̂² + jνd = known + share · pushed at both sidebands.
        std::array<Complex, 2> known{}, pushed{};
        std::array<T, 2> per_frequency{};
        for (std::size_t i = 0; i < 2; ++i) {
            const T side = i == 0 ? c.tone : -c.tone, nu = omega + side;
            const Complex y = phasor(state.y[i + 1]);
            known[i] = Complex{side * (omega + nu), T(0.0)} + ratio(acting(i + 1, nu), y);
            pushed[i] = c.half_volt * ratio(product(x, i == 0 ? c.late : conjugate(c.late)), y);
            per_frequency[i] = T(0.5) / nu;
        }
        const T share = (known[1].x() - known[0].x()) / (pushed[0].x() - pushed[1].x());
        state.share = share;
        const std::array<Complex, 2> both{known[0] + share * pushed[0], known[1] + share * pushed[1]};
        const T excess = T(0.5) * (both[0].x() + both[1].x());
        const T damping = per_frequency[0] * both[0].y() + per_frequency[1] * both[1].y();
        const Complex left = product(Complex{excess, omega * damping}, phasor(state.y[0]));
        const T coupling = ratio(acting(0, omega) - left, x).x();
        // Without a vibration, or without an answer to the tone, nothing is known.
        if (!(c.least < squared_norm(x) && T(0.5) < share && share < T(2.0))) {
            return;
        }
        if (c.split) {
            const T most = c.tone * (T(2.0) * omega + c.tone);  // the sidebands reach no further
            const T beyond = clamp(excess - c.target * (T(2.0) * omega + c.target), -most, most);
            state.square = clamp(state.square + c.gain_square * beyond, T(0.0), c.most_square);
        }
        if (c.quadrature) {
            state.nulling = clamp(state.nulling + c.gain_volt * coupling / share, -c.most_nulling, c.most_nulling);
        }
    }
    static constexpr double smallest = 1e-30;
};

}  // namespace fracgyro
