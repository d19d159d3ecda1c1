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
#include "fracgyro/control/vibration.hpp"

namespace fracgyro {

struct RebalanceParams {
    ConventionalParams loop{};
    double bandwidth = 0.02;  // w_L

    static constexpr auto fields() {
        using P = RebalanceParams;
        return Fields{
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
        return Fields{
            channel("rate_estimate", &R::rate, "omega0", "estimate of the angular rate: skew part of Omega"),
            channel("drive_amplitude", &R::amplitude, "q0", "amplitude of the drive axis"),
            channel("drive_frequency", &R::frequency, "omega0", "frequency of the phase-locked loop"),
            channel("quadrature", &R::quadrature, "omega0", "quadrature, as an angular rate: -kxy/(2 m omega)"),
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

    using Drive = Vibration<T>;
    struct Coefficients {
        typename Reference<T>::Coefficients reference{};
        typename Drive::Coefficients drive{};
        T damping{}, stiffness{};  // ½dyy, kyy
        T rebalance_gain{}, rebalance_step{};
    };
    // A complex number is stored as cosine and sine, or real and imaginary part.
    struct State {
        typename Reference<T>::State reference{};
        typename Drive::State loop{};
        Vec2<T> drive{}, sense{};  // b and -a, for x and y
        Vec2<T> rebalance{};       // integral part of W
        T rate{}, quadrature{};
    };

    static Coefficients prepare(const Params& all, const Common& common) {
        const double h = common.step;
        double held = 0.0;
        if constexpr (rebalanced) {
            held = all.bandwidth;
        }
        return {.reference = Reference<T>::prepare(common.reference, h),
                .drive = Drive::prepare(loop_of(all), common),
                .damping = T(0.5 * common.nominal.damping.yy()),
                .stiffness = T(common.nominal.stiffness.yy()),
                .rebalance_gain = T(held),
                .rebalance_step = T(0.25 * h * held * held)};
    }

    static Report report(const State& state, const Coefficients& c) {
        return {.rate = state.rate,
                .amplitude = Drive::amplitude(state.drive),
                .frequency = c.drive.frequency + state.loop.frequency,
                .quadrature = state.quadrature};
    }
    static bool sound(const State&, const Coefficients&) { return true; }  // numbers only
    static std::uint64_t steps(const State& state) { return state.reference.steps; }
    // Keeps the frequency found if the estimates are kept; the phase is acquired again.
    static void start_over(State& state, bool keep_estimates) {
        State fresh{};
        fresh.reference = state.reference;
        fresh.loop = Drive::started_over(state.loop, keep_estimates);
        if (keep_estimates) {
            fresh.rate = state.rate;
            fresh.quadrature = state.quadrature;
        }
        state = fresh;
    }

    // Without a measurement all amplitudes keep their values.
    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        if (state.reference.steps == 0) {
            Drive::start(state.loop, c.reference);
        }
        const T zero = T(0.0), one = T(1.0);
        ReferencePoint<T> r = Reference<T>::update(state.reference, c.reference);
        // The sense axis is held at rest or free: it follows no reference.
        r = {{r.position.x(), zero}, {r.velocity.x(), zero}, {r.acceleration.x(), zero}};
        Signals<T, Report> signals{.reference = r, .report = report(state, c)};
        if (missing == nullptr) {
            Drive::demodulate(state.drive, c.drive, state.loop, measured.position.x());
            Drive::demodulate(state.sense, c.drive, state.loop, measured.position.y());
            const auto speed = [&](const Vec2<T>& phasor) { return Drive::velocity(phasor, c.drive, state.loop); };
            const Motion<T> seen{.position = measured.position, .velocity = {speed(state.drive), speed(state.sense)}};
            signals.error = tracking_error(seen, signals.reference);
        } else {
            signals.error = *missing;
        }

        const auto driven = Drive::drive(state.loop, c.drive, state.drive);
        const T frequency = driven.frequency;
        const Vec2<T>& ahead = driven.ahead;
        Vec2<T> force{driven.force * ahead.x(), zero};

        const T double_speed = T(2.0) * frequency;
        const T per_rate = one / Drive::sound_divisor(double_speed * c.drive.amplitude);
        Vec2<T> coupling;  // minus the force on y due to the rate
        if constexpr (rebalanced) {
            const Vec2<T> held = -(c.rebalance_gain * state.sense) - state.rebalance;  // W
            coupling = double_speed * turned(held);
            const T asked = Drive::product(coupling, ahead).x();
            const T acts = clamp(asked, -c.drive.limit, c.drive.limit);
            force = {force.x(), acts};
            signals.excess = {zero, asked - acts};
            const T saturated = if_less(zero, absolute(asked - acts), zero, one);
            state.rebalance = state.rebalance + (saturated * c.rebalance_step) * state.sense;
        } else {
            const T split = (c.stiffness - frequency * frequency) / Drive::sound_divisor(double_speed);
            coupling = -(double_speed * turned(Drive::product(Vec2<T>{c.damping, -split}, state.sense)));
        }
        signals.excess = {driven.removed, signals.excess.y()};
        if (!c.drive.limited) {
            signals.excess = {};
        }
        signals.force = force;
        state.rate = state.rate + c.drive.output * (per_rate * coupling.x() - state.rate);
        state.quadrature = state.quadrature + c.drive.output * (per_rate * coupling.y() - state.quadrature);
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
