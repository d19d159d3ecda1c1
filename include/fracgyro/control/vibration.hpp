// A vibration from its positions: demodulation, and a drive that keeps it at its resonance and amplitude by a
// phase-locked loop (PLL) and an automatic gain control (AGC). Shared by the controllers that measure by a vibration of
// their own.
//
//    One oscillator (NCO) of phase θ serves all. Each position z is demodulated by least mean squares, which leaves no
//    ripple at twice the frequency, with one pole at μ/h:
//
//        z ≈ a sin θ + b cos θ        ε = z - a sin θ - b cos θ
//        a ← a + 2μ ε sin θ        b ← b + 2μ ε cos θ
//
//    Drive: φ is the sine of the phase of the vibration against θ, A its amplitude, and F is kept within 0, or minus
//    the force limit, and the force limit:
//
//        ω̂ = ω + k_p φ + ∫ k_i φ        k_p = 1.4 w        k_i = w²
//        F = k_a (A_r - A) + ∫ k_a k_b (A_r - A)        u = F cos θ′
//
//    θ′ = θ + ω̂h (½ + delay) + ω̂ lag: the center of the hold, and what the datasheet states.
//
// Source: AGC and PLL: Leland 2005, doi 10.1109/JSEN.2005.844538 (abstract read).
#pragma once

#include "fracgyro/control/common.hpp"
#include "fracgyro/control/datasheet.hpp"

namespace fracgyro {

struct ConventionalParams {
    double pll_bandwidth = 0.01;          // w
    double amplitude_bandwidth = 0.01;    // k_a = 2ω times it
    double amplitude_integral = 0.002;    // k_b
    double demodulation_bandwidth = 0.2;  // μ/h
    double output_bandwidth = 0.01;
    double lag = 0.0;
    Datasheet datasheet{};

    static constexpr auto fields() {
        using P = ConventionalParams;
        return Fields{
            field("pll_bandwidth", &P::pll_bandwidth, "omega0", above_0,
                  "Unit omega0, > 0: natural frequency of the phase-locked loop."),
            field("amplitude_bandwidth", &P::amplitude_bandwidth, "omega0", above_0,
                  "Unit omega0, > 0: bandwidth of the automatic gain control."),
            field("amplitude_integral", &P::amplitude_integral, "omega0", at_least_0,
                  "k_b, unit omega0: of its integral action. 0.0: off."),
            field("demodulation_bandwidth", &P::demodulation_bandwidth, "omega0", above_0,
                  "Unit omega0, > 0: of the filters that demodulate; at least 5 times rebalance_bandwidth."),
            field("output_bandwidth", &P::output_bandwidth, "omega0", above_0,
                  "Unit omega0, > 0: of the filter of the angular rate."),
            Inner{"datasheet", &P::datasheet},
            in_table("datasheet",
                     fixed(field("lag", &P::lag, "1/omega0", any_number,
                                 "Unit 1/omega0: time by which readings and forces are late in "
                                 "addition to delay: by amplifiers and parts of steps. Not set: that simulated."))),
        };
    }
};

// A complex number is stored as cosine and sine, or real and imaginary part.
template <Scalar T>
struct Vibration {
    struct Coefficients {
        T limit{}, least_force{};
        bool limited = false;
        T step{}, amplitude{}, frequency{}, largest_detuning{};  // A_r, ω; maximum deviation of ω̂h from ωh
        Vec2<T> turn{}, lead{};                                  // cosine and sine of ωh, and of ωh (½ + delay)
        T lead_steps{};
        T demodulation{};  // 2μ
        T phase_gain{}, phase_step{}, amplitude_gain{}, amplitude_step{};
        T output{};
    };
    struct State {
        Vec2<T> oscillator{T(1.0), T(0.0)};  // e^jθ
        T detuning{}, force{};               // integral parts: ω̂ - ω, and F
        T frequency{};                       // ω̂ - ω
    };
    // Results of a step of the drive.
    struct Driven {
        T force{}, removed{};  // F, and what the limit removed
        T frequency{};         // ω̂
        Vec2<T> ahead{};       // e^jθ′
    };

    // brakes: the drive may also damp, down to minus the limit, as a vibration that decays for minutes needs.
    static Coefficients prepare(const ConventionalParams& p, const Common& common, bool brakes = false) {
        const double h = common.step, w = common.reference.frequency.x();
        const double lead = 0.5 + static_cast<double>(p.datasheet.delay) + p.lag / h;
        const double amplitude_gain = 2.0 * w * p.amplitude_bandwidth;
        const bool limited = common.force_limit < std::numeric_limits<double>::infinity();
        const double most = limited ? common.force_limit : static_cast<double>(std::numeric_limits<float>::max());
        return {.limit = T(most),
                .least_force = T(brakes ? -most : 0.0),
                .limited = limited,
                .step = T(h),
                .amplitude = T(common.reference.amplitude.x()),
                .frequency = T(w),
                .largest_detuning = T(0.1 * w),
                .turn = turn_of<T>(w * h),
                .lead = turn_of<T>(w * h * lead),
                .lead_steps = T(lead),
                .demodulation = T(2.0 * p.demodulation_bandwidth * h),
                .phase_gain = T(1.4 * p.pll_bandwidth),
                .phase_step = T(h * p.pll_bandwidth * p.pll_bandwidth),
                .amplitude_gain = T(amplitude_gain),
                .amplitude_step = T(h * amplitude_gain * p.amplitude_integral),
                .output = T(1.0 - exponential(-p.output_bandwidth * h))};
    }

    // Sets the oscillator to the phase that the reference has at the first step.
    static void start(State& state, const typename Reference<T>::Coefficients& reference) {
        const auto first = PhaseOf<T>::sine_cosine(reference.phases.start[0]);
        state.oscillator = {first.cosine, first.sine};
    }
    // Keeps the phase, and the frequency found if the estimates are kept.
    static State started_over(const State& state, bool keep_estimates) {
        State fresh{};
        fresh.oscillator = state.oscillator;
        if (keep_estimates) {
            fresh.detuning = state.detuning;
            fresh.frequency = state.frequency;
        }
        return fresh;
    }

    // z = Re(Z e^jθ), with Z = b - ja: a += 2μ ε sin θ, b += 2μ ε cos θ.
    static void demodulate(Vec2<T>& phasor, const Coefficients& c, const State& state, T z) {
        const Vec2<T>& oscillator = state.oscillator;
        const T missed = z - (phasor.x() * oscillator.x() - phasor.y() * oscillator.y());
        const T move = c.demodulation * missed;
        phasor = {phasor.x() + move * oscillator.x(), phasor.y() - move * oscillator.y()};
    }
    // The velocity of a vibration with this phasor, before the drive's step.
    static T velocity(const Vec2<T>& phasor, const Coefficients& c, const State& state) {
        return -((c.frequency + state.frequency) * product(phasor, state.oscillator).y());
    }
    static T amplitude(const Vec2<T>& phasor) { return norm(phasor); }

    // Keeps the vibration of this phasor at resonance and amplitude; the oscillator advances by a step.
    static Driven drive(State& state, const Coefficients& c, const Vec2<T>& phasor) {
        const T zero = T(0.0), one = T(1.0);
        // x = A sin θ in lock: b = 0 and a = A.
        const T a = -phasor.y(), b = phasor.x(), size = amplitude(phasor);
        const T side = with_sign_of(b, one);
        const T phase = if_less(zero, a, b / maximum(size, T(1e-9)), side);
        const T most = c.largest_detuning;
        state.detuning = clamp(state.detuning + c.phase_step * phase, -most, most);
        state.frequency = clamp(state.detuning + c.phase_gain * phase, -most, most);

        const T lacks = c.amplitude - size;
        const T wanted = c.amplitude_gain * lacks + state.force;
        const T given = clamp(wanted, c.least_force, c.limit);
        const T winds_up = (wanted - given) * lacks;
        const T wound = state.force + if_less(zero, winds_up, zero, c.amplitude_step) * lacks;
        state.force = clamp(wound, c.least_force, c.limit);

        const T extra = c.step * state.frequency;  // extra phase over this step
        const Driven driven{.force = given,
                            .removed = wanted - given,
                            .frequency = c.frequency + state.frequency,
                            .ahead = product(state.oscillator, product(c.lead, small_turn(c.lead_steps * extra)))};
        const Vec2<T> next = product(state.oscillator, product(c.turn, small_turn(extra)));
        state.oscillator = (T(1.5) - T(0.5) * squared_norm(next)) * next;  // normalized to length 1
        return driven;
    }

    // Product of complex numbers.
    static Vec2<T> product(const Vec2<T>& a, const Vec2<T>& b) {
        return {a.x() * b.x() - a.y() * b.y(), a.x() * b.y() + a.y() * b.x()};
    }
    // Avoids a division by 0 without a reference.
    static T sound_divisor(T a) { return if_less(absolute(a), T(1e-9), T(1.0), a); }

private:
    // e^jx for |x| far below 1.
    static Vec2<T> small_turn(T x) {
        const T square = x * x;
        return {T(1.0) - square * (T(0.5) - T(1.0 / 24.0) * square),
                x * (T(1.0) - square * (T(1.0 / 6.0) - T(1.0 / 120.0) * square))};
    }
};

}  // namespace fracgyro
