// The conventional vibratory gyroscope, from positions only: x is driven at its resonance by a phase-locked loop (PLL)
// and an automatic gain control (AGC), and the rate is read from y.
//
//    One oscillator (NCO) of phase θ serves all. Each position z is demodulated by least mean squares, which leaves no
//    ripple at twice the frequency, with one pole at μ/h:
//
//        z ≈ a sin θ + b cos θ        ε = z - a sin θ - b cos θ
//        a ← a + 2μ ε sin θ        b ← b + 2μ ε cos θ
//
//    Drive: φ is the sine of the phase of x against θ, A its amplitude, and F is kept within 0 and the force limit:
//
//        ω̂ = ω + k_p φ + ∫ k_i φ        k_p = 1.4 w        k_i = w²
//        F = k_a (A_r - A) + ∫ k_a k_b (A_r - A)        u_x = F cos θ′
//
//    Sense axis: with y = Re(Y e^jθ), the slow motion of Y under u_y = Re(F_y e^jθ′), F_y = 2jω̂ W, is
//
//        Y = b - j a        dY/dt = (jδ - ½dyy) Y + W + F_c/(2jω̂)        Re F_c = -2 A ω̂ Ωz
//
//    The rate is filtered by a first-order low-pass. θ′ = θ + ω̂h (½ + delay) + ω̂ lag: the center of the hold, and
//    what the datasheet states. A dxy acts as a rate dxy/2, and no conventional gyroscope can separate them.
//
// Source: AGC and PLL: Leland 2005, doi 10.1109/JSEN.2005.844538 (abstract read).
#pragma once

#include "fracgyro/control/controller.hpp"
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
        return std::tuple{
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
struct RebalanceParams {
    ConventionalParams loop{};
    double bandwidth = 0.02;  // w_L

    static constexpr auto fields() {
        using P = RebalanceParams;
        return std::tuple{
            Inner{"controller", &P::loop},
            field("rebalance_bandwidth", &P::bandwidth, "omega0", above_0,
                  "Unit omega0, > 0: of the loop that holds the sense axis at rest."),
        };
    }
};

template <Scalar T>
struct ConventionalReport {
    T rate{}, amplitude{}, frequency{};
    T quadrature{};

    static constexpr auto fields() {
        using R = ConventionalReport;
        return std::tuple{
            channel("rate_estimate", &R::rate, "omega0", "estimate of the angular rate: skew part of Omega"),
            channel("drive_amplitude", &R::amplitude, "q0", "amplitude of the drive axis"),
            channel("drive_frequency", &R::frequency, "omega0", "frequency of the phase-locked loop"),
            channel("quadrature", &R::quadrature, "omega0", "quadrature, as the angular rate that it would be"),
        };
    }
};

template <Scalar T, bool rebalanced>
struct ConventionalGyroscope {
    using Value = T;
    using Params = std::conditional_t<rebalanced, RebalanceParams, ConventionalParams>;
    using Report = ConventionalReport<T>;
    static constexpr bool measures_velocity = false;
    static constexpr bool drives_a_sine = true;  // on x, at the reference's frequency

    struct Coefficients {
        typename Reference<T>::Coefficients reference{};
        T limit{};
        bool limited = false;
        T step{}, amplitude{}, frequency{}, largest_detuning{};  // A_r, ω; maximum deviation of ω̂h from ωh
        Vec2<T> turn{}, lead{};                                  // cosine and sine of ωh, and of ωh (½ + delay)
        T lead_steps{};
        T demodulation{};  // 2μ
        T phase_gain{}, phase_step{}, amplitude_gain{}, amplitude_step{};
        T damping{}, stiffness{};  // ½dyy, kyy
        T rebalance_gain{}, rebalance_step{}, output{};
    };
    // A complex number is stored as cosine and sine, or real and imaginary part.
    struct State {
        typename Reference<T>::State reference{};
        Vec2<T> oscillator{T(1.0), T(0.0)};  // e^jθ
        Vec2<T> drive{}, sense{};            // b and -a, for x and y
        T detuning{}, force{};               // integral parts: ω̂ - ω, and F
        Vec2<T> rebalance{};                 // integral part of W
        T rate{}, quadrature{}, frequency{};
    };

    static Coefficients prepare(const Params& all, const Common& common) {
        const ConventionalParams& p = loop_of(all);
        const double h = common.step, w = common.reference.frequency.x();
        const double lead = 0.5 + static_cast<double>(p.datasheet.delay) + p.lag / h;
        const double amplitude_gain = 2.0 * w * p.amplitude_bandwidth;
        double held = 0.0;
        if constexpr (rebalanced) {
            held = all.bandwidth;
        }
        const bool limited = common.force_limit < std::numeric_limits<double>::infinity();
        return {.reference = Reference<T>::prepare(common.reference, h),
                .limit = T(limited ? common.force_limit : static_cast<double>(std::numeric_limits<float>::max())),
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
                .damping = T(0.5 * common.nominal.damping.yy()),
                .stiffness = T(common.nominal.stiffness.yy()),
                .rebalance_gain = T(held),
                .rebalance_step = T(0.25 * h * held * held),
                .output = T(1.0 - exponential(-p.output_bandwidth * h))};
    }

    static Report report(const State& state, const Coefficients& c) {
        return {.rate = state.rate,
                .amplitude = norm(state.drive),
                .frequency = c.frequency + state.frequency,
                .quadrature = state.quadrature};
    }
    static bool sound(const State&, const Coefficients&) { return true; }  // numbers only
    static std::uint64_t steps(const State& state) { return state.reference.steps; }
    // Keeps the frequency found if the estimates are kept; the phase is acquired again.
    static void start_over(State& state, bool keep_estimates) {
        State fresh{};
        fresh.reference = state.reference;
        fresh.oscillator = state.oscillator;
        if (keep_estimates) {
            fresh.detuning = state.detuning;
            fresh.frequency = state.frequency;
            fresh.rate = state.rate;
            fresh.quadrature = state.quadrature;
        }
        state = fresh;
    }

    // Without a measurement all amplitudes keep their values.
    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        if (state.reference.steps == 0) {
            const auto start = PhaseOf<T>::sine_cosine(c.reference.phases.start[0]);
            state.oscillator = {start.cosine, start.sine};
        }
        const T zero = T(0.0), one = T(1.0);
        ReferencePoint<T> r = Reference<T>::update(state.reference, c.reference);
        // The sense axis is held at rest or free: it follows no reference.
        r = {{r.position.x(), zero}, {r.velocity.x(), zero}, {r.acceleration.x(), zero}};
        Signals<T, Report> signals{.reference = r, .report = report(state, c)};
        const T known = c.frequency + state.frequency;
        if (missing == nullptr) {
            demodulate(state.drive, c, state.oscillator, measured.position.x());
            demodulate(state.sense, c, state.oscillator, measured.position.y());
            const auto speed = [&](const Vec2<T>& phasor) { return -(known * product(phasor, state.oscillator).y()); };
            const Motion<T> seen{.position = measured.position, .velocity = {speed(state.drive), speed(state.sense)}};
            signals.error = tracking_error(seen, signals.reference);
        } else {
            signals.error = *missing;
        }

        // x = A sin θ in lock: b = 0 and a = A.
        const T a = -state.drive.y(), b = state.drive.x(), size = norm(state.drive);
        const T side = with_sign_of(b, one);
        const T phase = if_less(zero, a, b / maximum(size, T(1e-9)), side);
        const T most = c.largest_detuning;
        state.detuning = clamp(state.detuning + c.phase_step * phase, -most, most);
        state.frequency = clamp(state.detuning + c.phase_gain * phase, -most, most);
        const T frequency = c.frequency + state.frequency;

        const T lacks = c.amplitude - size;
        const T wanted = c.amplitude_gain * lacks + state.force;
        const T drive = clamp(wanted, zero, c.limit);
        const T winds_up = (wanted - drive) * lacks;
        state.force = clamp(state.force + if_less(zero, winds_up, zero, c.amplitude_step) * lacks, zero, c.limit);

        const T extra = c.step * state.frequency;  // extra phase over this step
        const Vec2<T> ahead = product(state.oscillator, product(c.lead, small_turn(c.lead_steps * extra)));  // e^jθ′
        Vec2<T> force{drive * ahead.x(), zero};

        // Avoids a division by 0 without a reference.
        const auto sound_divisor = [&](T a) { return if_less(absolute(a), T(1e-9), one, a); };
        const T double_speed = T(2.0) * frequency, per_rate = one / sound_divisor(double_speed * c.amplitude);
        Vec2<T> coupling;  // minus the force on y due to the rate
        if constexpr (rebalanced) {
            const Vec2<T> held = -(c.rebalance_gain * state.sense) - state.rebalance;  // W
            coupling = double_speed * turned(held);
            const T asked = product(coupling, ahead).x();
            const T acts = clamp(asked, -c.limit, c.limit);
            force = {force.x(), acts};
            signals.excess = {zero, asked - acts};
            const T saturated = if_less(zero, absolute(asked - acts), zero, one);
            state.rebalance = state.rebalance + (saturated * c.rebalance_step) * state.sense;
        } else {
            const T split = (c.stiffness - frequency * frequency) / sound_divisor(double_speed);
            coupling = -(double_speed * turned(product(Vec2<T>{c.damping, -split}, state.sense)));
        }
        signals.excess = {wanted - drive, signals.excess.y()};
        if (!c.limited) {
            signals.excess = {};
        }
        signals.force = force;
        state.rate = state.rate + c.output * (per_rate * coupling.x() - state.rate);
        state.quadrature = state.quadrature + c.output * (per_rate * coupling.y() - state.quadrature);

        const Vec2<T> next = product(state.oscillator, product(c.turn, small_turn(extra)));
        state.oscillator = (T(1.5) - T(0.5) * squared_norm(next)) * next;  // normalized to length 1
        return signals;
    }

private:
    static const ConventionalParams& loop_of(const Params& p) {
        if constexpr (rebalanced) {
            return p.loop;
        } else {
            return p;
        }
    }
    // Product of complex numbers.
    static Vec2<T> product(const Vec2<T>& a, const Vec2<T>& b) {
        return {a.x() * b.x() - a.y() * b.y(), a.x() * b.y() + a.y() * b.x()};
    }
    // e^jx for |x| far below 1.
    static Vec2<T> small_turn(T x) {
        const T square = x * x;
        return {T(1.0) - square * (T(0.5) - T(1.0 / 24.0) * square),
                x * (T(1.0) - square * (T(1.0 / 6.0) - T(1.0 / 120.0) * square))};
    }
    // z = Re(Y e^jθ), with Y = b - ja: a += 2μ ε sin θ, b += 2μ ε cos θ.
    static void demodulate(Vec2<T>& phasor, const Coefficients& c, const Vec2<T>& oscillator, T z) {
        const T missed = z - (phasor.x() * oscillator.x() - phasor.y() * oscillator.y());
        const T move = c.demodulation * missed;
        phasor = {phasor.x() + move * oscillator.x(), phasor.y() - move * oscillator.y()};
    }
};

// Open-loop gyroscope: the x axis is driven at its resonance, y swings freely, and its motion gives the rate.
//
// Use it when you need the simplest conventional gyroscope as a baseline, for slow rates.
//
//        u_y = 0        F_c = 2jω̂ (½dyy - jδ) Y        Ω̂z = -Re F_c/(2 A_r ω̂)        δ = (kyy - ω̂²)/(2ω̂)
template <Scalar T>
using OpenLoop = ConventionalGyroscope<T, false>;
// Force-rebalance gyroscope: the x axis is driven at its resonance, and the force that holds y at rest gives the rate.
//
// Use it when you compare with the industry's usual loop, or sense the rate with few operations.
//
//        W = -w_L Y - ∫ ¼ w_L² Y        Ω̂z = Re F_y/(2 A_r ω̂)        quadrature = Im F_y
template <Scalar T>
using ForceRebalance = ConventionalGyroscope<T, true>;

}  // namespace fracgyro
