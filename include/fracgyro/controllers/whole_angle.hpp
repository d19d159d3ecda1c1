// The whole-angle gyroscope, from positions only: one vibration at a line that is free to turn, whose angle is the
// integral of the rate. A phase-locked loop (PLL) and an automatic gain control (AGC) keep it as in vibration.hpp.
//
//    The two positions are demodulated on one oscillator of phase θ, q = Re(Z e^jθ). A second oscillator of angle ϑ,
//    counted in 2⁻⁶⁴ turns, follows the line, p = (cos ϑ, sin ϑ), n = (-sin ϑ, cos ϑ):
//
//        Z = -j a p + b n        U = Z·p        V = Z·n        e = Re(U V*)/(|U|² + |V|²)
//        dϑ/dt = v + 1.4 w e + ∫ w² e
//
//    Under the force Re(F e^jθ′), F = 2jω̂ ((w_q - j a w_v) n - j w_E p), the line turns with the rate and drifts by the
//    dampers, whose axis is at ϑ_τ:
//
//        dϑ/dt = -Ωz + p sin 2(ϑ - ϑ_τ) + w_v        p = ½Δ(1/τ)
//        w_v = v - p̂ sin 2(ϑ - ϑ̂_τ)        w_q = -w_b b̄ - ∫ ¼ w_b² b̄        Ω̂z = v - dϑ/dt
//
//    b̄ is the mean of b over half a period: the ripple of b at twice the frequency would act through the loop as a
//    rate. w_E, by which the AGC makes up for the decay, is reported: its part at 2ϑ is ½Δ(1/τ), and shows ϑ_τ.
//
// Source: averaged equations after Lynch 1995 and IEEE Std 1431-2004 (bodies not read; derived in EQUATIONS.md).
#pragma once

#include "fracgyro/control/controller.hpp"
#include "fracgyro/control/vibration.hpp"

namespace fracgyro {

struct WholeAngleParams {
    ConventionalParams loop{};
    double angle_bandwidth = 0.02;        // w
    double quadrature_bandwidth = 0.005;  // w_b
    double virtual_rate = 0.0;            // v
    double damping_compensation = 0.0;    // p̂
    double damping_axis = 0.0;            // ϑ̂_τ
    double start_angle = 0.0;

    static constexpr auto fields() {
        using P = WholeAngleParams;
        return Fields{
            Inner{"controller", &P::loop},
            field("angle_bandwidth", &P::angle_bandwidth, "omega0", above_0,
                  "Unit omega0, > 0: natural frequency of the loop that follows the vibration's line."),
            field("quadrature_bandwidth", &P::quadrature_bandwidth, "omega0", above_0,
                  "Unit omega0, > 0: of the loop that keeps the vibration a line; at most 0.05."),
            field("virtual_rate", &P::virtual_rate, "omega0", any_number,
                  "Unit omega0: rate at which forces turn the line, added to the rotation. 0.0: off."),
            field("damping_compensation", &P::damping_compensation, "omega0", any_number,
                  "Unit omega0: largest drift by the dampers, half the difference of the decay rates of their axes, "
                  "which forces cancel. 0.0: off."),
            field("damping_axis", &P::damping_axis, "rad", any_number, "rad: angle of the axis that decays most."),
            fixed(field("start_angle", &P::start_angle, "rad", any_number,
                        "rad: angle of the vibration's line at the start.")),
        };
    }
};
struct VirtualRotationParams {
    WholeAngleParams angle{};
    double turns = 1.0;

    static constexpr auto fields() {
        using P = VirtualRotationParams;
        return Fields{
            Inner{"controller", &P::angle},
            field("reversal_turns", &P::turns, "1", above_0,
                  "> 0: turns of the line after which virtual_rate changes its sign; a multiple of 0.5."),
        };
    }
};

template <Scalar T>
struct WholeAngleReport {
    T angle{}, rate{}, amplitude{}, frequency{}, quadrature{}, decay{};

    static constexpr auto fields() {
        using R = WholeAngleReport;
        return Fields{
            channel("rate_estimate", &R::rate, "omega0", "estimate of the angular rate: skew part of Omega"),
            channel("drive_amplitude", &R::amplitude, "q0", "amplitude of the vibration along its line"),
            channel("drive_frequency", &R::frequency, "omega0", "frequency of the phase-locked loop"),
            channel("quadrature", &R::quadrature, "omega0", "quadrature, as the angular rate that it would be"),
            channel("pattern_angle", &R::angle, "rad", "angle of the vibration's line from x, from -pi to pi"),
            channel("decay_rate", &R::decay, "omega0", "rate of decay along the line, for which the drive makes up"),
        };
    }
};
template <Scalar T>
struct VirtualRotationReport : WholeAngleReport<T> {
    T scale_error{};

    static constexpr auto fields() {
        using R = VirtualRotationReport;
        return joined(WholeAngleReport<T>::fields(),
                      Fields{channel("virtual_rate_error", &R::scale_error, "1",
                                     "relative error of virtual_rate, from the last two reversals")});
    }
};

template <Scalar T, bool reverses>
struct WholeAngleGyroscope {
    using Value = T;
    using Params = std::conditional_t<reverses, VirtualRotationParams, WholeAngleParams>;
    using Report = std::conditional_t<reverses, VirtualRotationReport<T>, WholeAngleReport<T>>;
    using Phase = PhaseOf<T>;
    using Drive = Vibration<T>;
    static constexpr bool measures_velocity = false;
    static constexpr bool drives_a_sine = true;  // along the line, at the frequency of the reference of x

    struct Coefficients {
        typename Reference<T>::Coefficients reference{};
        typename Drive::Coefficients drive{};
        T angle_gain{}, angle_step{}, most{};  // most: |dϑ/dt| without v
        T turns_per_rate{};                    // h/2π
        T quadrature_gain{}, quadrature_step{};
        T virtual_rate{};
        Vec2<T> compensation{};  // p̂ (cos 2ϑ̂_τ, sin 2ϑ̂_τ)
        T least_energy{};        // below it the line is not followed as fast
        typename Phase::Type start{};
        // Turns of a virtual rotation; times that its loops need after a reversal, and until it reverses in any case.
        T turns{}, settling{}, longest{};
    };
    // Turns since the loops settled after a reversal, and the time since then, below 0 before.
    struct Turning {
        LongSum<T> way{}, time{};
        T direction = T(1.0);
        T ways{}, last{};   // passes so far, up to 3, and the mean rate of the last one
        T mean{}, error{};  // from the last two
    };
    struct Nothing {};
    // A complex number is stored as real and imaginary part.
    struct State {
        typename Reference<T>::State reference{};
        typename Drive::State loop{};
        Vec2<T> x{}, y{};  // Z
        typename Phase::Type angle{};
        T turning{};              // integral part of dϑ/dt
        T sum{}, held{}, wait{};  // b summed over this half period; w_q, integral part
        T rate{}, quadrature{}, decay{};
        [[no_unique_address]] std::conditional_t<reverses, Turning, Nothing> reversal{};
    };

    static Coefficients prepare(const Params& all, const Common& common) {
        const WholeAngleParams& p = angle_of(all);
        constexpr double turn = 6.28318530717958647693;
        const double h = common.step, amplitude = common.reference.amplitude.x();
        const double half_period = 0.5 * turn / common.reference.frequency.x();
        Coefficients c{.reference = Reference<T>::prepare(common.reference, h),
                       .drive = Drive::prepare(p.loop, common, true),
                       .angle_gain = T(1.4 * p.angle_bandwidth),
                       .angle_step = T(h * p.angle_bandwidth * p.angle_bandwidth),
                       .most = T(0.1 * common.reference.frequency.x()),
                       .turns_per_rate = T(h / turn),
                       .quadrature_gain = T(p.quadrature_bandwidth * h / half_period),
                       .quadrature_step = T(0.25 * h * p.quadrature_bandwidth * p.quadrature_bandwidth),
                       .virtual_rate = T(p.virtual_rate),
                       .compensation = T(p.damping_compensation) * turn_of<T>(2.0 * p.damping_axis),
                       .least_energy = T(1e-18 + 0.01 * amplitude * amplitude),
                       .start = typename Phase::Type{} + phase_of(p.start_angle)};
        if constexpr (reverses) {
            c.turns = T(all.turns);
            const double steps = 10.0 / minimum(p.angle_bandwidth, p.loop.demodulation_bandwidth) / h;
            c.settling = T(h * detail::round_to_nearest(minimum(steps, 1e15)));
            c.longest = T(4.0 * turn * all.turns / maximum(absolute(p.virtual_rate), 1e-12));
        }
        return c;
    }

    static Report report(const State& state, const Coefficients& c) {
        Report report{};
        report.angle = T(6.28318530717958647693) * Phase::turns(c.start + state.angle);
        report.rate = state.rate;
        report.amplitude = Drive::amplitude(projected(state, direction(state, c)).along);
        report.frequency = c.drive.frequency + state.loop.frequency;
        report.quadrature = state.quadrature;
        report.decay = state.decay;
        if constexpr (reverses) {
            const Turning& r = state.reversal;
            report.rate = if_less(r.ways, T(3.0), state.rate, r.mean);
            report.scale_error = r.error;
        }
        return report;
    }
    static bool sound(const State&, const Coefficients&) { return true; }  // numbers and a phase
    static std::uint64_t steps(const State& state) { return state.reference.steps; }
    // Keeps the frequency and the angle found if the estimates are kept; the phase is acquired again.
    static void start_over(State& state, bool keep_estimates) {
        State fresh{};
        fresh.reference = state.reference;
        fresh.loop = Drive::started_over(state.loop, keep_estimates);
        if (keep_estimates) {
            fresh.angle = state.angle;
            fresh.turning = state.turning;
            fresh.rate = state.rate;
            fresh.quadrature = state.quadrature;
            fresh.decay = state.decay;
        }
        state = fresh;
    }

    // Without a measurement the amplitudes keep their values.
    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        if (state.reference.steps == 0) {
            Drive::start(state.loop, c.reference);
        }
        const T zero = T(0.0), one = T(1.0);
        const Vec2<T> p = direction(state, c), n = turned(p);
        // The reference is along the line, in phase with the reference of x.
        ReferencePoint<T> r = Reference<T>::update(state.reference, c.reference);
        r = {r.position.x() * p, r.velocity.x() * p, r.acceleration.x() * p};
        Signals<T, Report> signals{.reference = r, .report = report(state, c)};
        if (missing == nullptr) {
            Drive::demodulate(state.x, c.drive, state.loop, measured.position.x());
            Drive::demodulate(state.y, c.drive, state.loop, measured.position.y());
            const auto speed = [&](const Vec2<T>& phasor) { return Drive::velocity(phasor, c.drive, state.loop); };
            const Motion<T> seen{.position = measured.position, .velocity = {speed(state.x), speed(state.y)}};
            signals.error = tracking_error(seen, signals.reference);
        } else {
            signals.error = *missing;
        }

        const auto [along, across] = projected(state, p);  // U, V
        const T energy = squared_norm(along) + squared_norm(across);
        const T e = dot(along, across) / maximum(energy, c.least_energy);
        state.turning = clamp(state.turning + c.angle_step * e, -c.most, c.most);
        const T seen = clamp(state.turning + c.angle_gain * e, -c.most, c.most);  // without the virtual rate
        const T asked_rate = virtual_rate(state, c);

        const T cosine = state.loop.oscillator.x();
        const auto driven = Drive::drive(state.loop, c.drive, along);
        state.sum = state.sum + across.x();
        const T half_over = cosine * state.loop.oscillator.x();  // below 0: cos θ has changed its sign
        const T quadrature = if_less(half_over, zero, -(c.quadrature_gain * state.sum + state.wait), state.held);

        const Vec2<T> twice{p.x() * p.x() - p.y() * p.y(), T(2.0) * p.x() * p.y()};                      // at 2ϑ
        const T turns = asked_rate - (c.compensation.x() * twice.y() - c.compensation.y() * twice.x());  // w_v
        const T double_speed = T(2.0) * driven.frequency;
        const T size = Drive::amplitude(along);
        const T sideways = double_speed * (size * turns * driven.ahead.x() - quadrature * driven.ahead.y());
        const Vec2<T> asked = (driven.force * driven.ahead.x()) * p + sideways * n;
        signals.force = clamp(asked, -c.drive.limit, c.drive.limit);
        if (c.drive.limited) {
            signals.excess = asked - signals.force;
        }
        const Vec2<T> beyond = absolute(asked - signals.force);
        const T unlimited = if_less(zero, beyond.x() + beyond.y(), zero, one);
        state.wait = if_less(half_over, zero, state.wait + (unlimited * c.quadrature_step) * state.sum, state.wait);
        state.sum = if_less(half_over, zero, zero, state.sum);
        state.held = quadrature;

        const T per_amplitude = one / Drive::sound_divisor(c.drive.amplitude);
        const T per_rate = one / Drive::sound_divisor(double_speed * c.drive.amplitude);
        state.rate = state.rate + c.drive.output * (-seen - state.rate);
        state.quadrature = state.quadrature + c.drive.output * (per_amplitude * quadrature - state.quadrature);
        state.decay = state.decay + c.drive.output * (per_rate * driven.force - state.decay);

        const T part = c.turns_per_rate * (asked_rate + seen);
        state.angle = Phase::after(state.angle, part);
        if constexpr (reverses) {
            reverse(state.reversal, c, part);
        }
        return signals;
    }

private:
    static const WholeAngleParams& angle_of(const Params& p) {
        if constexpr (reverses) {
            return p.angle;
        } else {
            return p;
        }
    }
    static Vec2<T> direction(const State& state, const Coefficients& c) {
        const SineCosine<T> at = Phase::sine_cosine(c.start + state.angle);
        return {at.cosine, at.sine};
    }
    struct Projected {
        Vec2<T> along{}, across{};
    };
    static Projected projected(const State& state, const Vec2<T>& p) {
        return {p.x() * state.x + p.y() * state.y, p.x() * state.y - p.y() * state.x};
    }
    static T virtual_rate(const State& state, const Coefficients& c) {
        if constexpr (reverses) {
            return state.reversal.direction * c.virtual_rate;
        } else {
            return c.virtual_rate;
        }
    }
    // Counts a step's part of a turn, and reverses after whole ones.
    static void reverse(Turning& r, const Coefficients& c, T part)
        requires reverses
    {
        // Half a step of margin: a sum of steps need not be exactly 0.
        r.way = r.way + if_less(r.time.value + T(0.5) * c.drive.step, T(0.0), T(0.0), part);
        r.time = r.time + c.drive.step;
        const T size = absolute(r.way.value);
        if (always_less(size, c.turns) && always_less(r.time.value, c.longest)) {
            return;
        }
        const T zero = T(0.0), one = T(1.0);
        const T goes_on = if_less(size, c.turns, if_less(r.time.value, c.longest, one, zero), zero);
        const auto choose = [&](T changed, T kept) { return if_less(zero, goes_on, kept, changed); };
        const T asked = r.direction * c.virtual_rate;
        const T mean = asked - T(6.28318530717958647693) * r.way.value / r.time.value;
        const T difference = (r.last - mean) / Drive::sound_divisor(T(2.0) * asked);
        const T one_more = if_less(r.ways, T(3.0), r.ways + one, r.ways);
        r.mean = choose(T(0.5) * (mean + r.last), r.mean);
        r.error = choose(if_less(one_more, T(3.0), zero, difference), r.error);
        r.last = choose(mean, r.last);
        r.ways = choose(one_more, r.ways);
        r.direction = choose(-r.direction, r.direction);
        r.way = {choose(zero, r.way.value), choose(zero, r.way.lost)};
        r.time = {choose(-c.settling, r.time.value), choose(zero, r.time.lost)};
    }
};

// Whole-angle gyroscope: the vibration is free to turn, so the angle is measured itself, and no rate is too large.
//
// Use it when the device has equal axes and a high quality factor, and the angle or a wide range matters.
template <Scalar T>
using WholeAngle = WholeAngleGyroscope<T, false>;
// Whole-angle gyroscope with virtual rotation: forces turn the vibration to and fro, and the mean of whole turns is the
// rate.
//
// Use it when slow rates matter: drifts that depend on the angle average out, and the line never locks to the dampers.
//
//    A pass in one direction, Δϑ in Δt, gives m₊, and one in the other m₋:
//
//        v = ±v₀        m = v - Δϑ/Δt        Ω̂z = ½(m₊ + m₋)
template <Scalar T>
using VirtualRotation = WholeAngleGyroscope<T, true>;

}  // namespace fracgyro
