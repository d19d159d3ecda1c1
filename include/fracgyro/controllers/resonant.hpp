// Resonant control: PID with a resonator at each frequency of the reference, which leaves no error there.
//
// Use it when the reference is sines, only tracking counts, and an unknown delay or few operations matter.
//
//        u = (D̂₀ + 2Ω̂₀) ṙ + K̂₀ r + r̈ - ω² e - 2ζω ė - I - Σ Re pᵢ        dI/dt = ωᵢ ω² e
//        dpᵢ/dt = j wᵢ pᵢ + cᵢ L(j wᵢ) e        L(s) = s² + (2ζω + d̂) s + ω² + k̂ + ωᵢ ω²/s
//
//    on each axis: the PID of pid.hpp less what the resonators hold. d̂ and k̂ are the diagonals of D̂₀ and K̂₀. A steady
//    error at the frequency wᵢ makes pᵢ grow until the force removes it, on any plant. L is the loop without
//    resonators, inverted: at frequencies near ω it has the phase lead that the loop needs. cᵢ, about k, is twice the
//    residue at jwᵢ of
//
//        C(s) = Π ((s + ½k)² + wᵢ²)/(s² + wᵢ²)
//
//    so that L(s) C(s) has the slow zeros -½k ± jwᵢ, which are the loop's poles, even if frequencies are closer than
//    k: the error decays at the rate k/2, if the gain k, times the number of frequencies, is far below ω. For one
//    frequency with k far below it and itself far below ω, this is the textbook's a' = k ω² e cos wt,
//    b' = k ω² e sin wt, with Re p = a cos wt + b sin wt.
//
//    Frequencies are those of sines and sums of sines on either axis, on both axes, as the plant couples them: the
//    first `max_frequencies` that differ by more than 0.1 %. Other references have none: it is then the PID. The
//    integral I is the resonator at 0. At the force limit I and p stop growing as in pid.hpp, and p turns on.
//
// Source: textbook (proportional-resonant control, internal model principle).
#pragma once

#include "fracgyro/controllers/pid.hpp"

#include <array>

namespace fracgyro {

struct ResonantParams {
    PidParams pid{};
    double resonator_gain = 1.0;  // k

    static constexpr auto fields() {
        using P = ResonantParams;
        return Fields{
            Inner{"controller", &P::pid},
            field("resonator_gain", &P::resonator_gain, "omega0", at_least_0,
                  "k, unit omega0: the error at the frequencies of the reference decays at the rate k/2. k times their "
                  "number must stay far below omega_n. 0.0: off."),
        };
    }
};

template <Scalar T>
struct Resonant {
    using Value = T;
    using Params = ResonantParams;
    using Report = EmptyReport;
    using Law = Pid<T>;
    static constexpr std::size_t max_frequencies = 8;
    template <class Each>
    using PerFrequency = std::array<Each, max_frequencies>;

    // A phasor on each axis.
    struct Phasor {
        Vec2<T> real{}, imaginary{};
    };
    struct Resonator {
        T cosine{}, sine{};  // the turn by wh
        Phasor gain{};       // h c L e^(1.5 jwh)
    };
    struct Coefficients {
        typename Law::Coefficients pid{};
        PerFrequency<Resonator> resonators{};
        std::size_t count = 0;
    };
    struct State {
        typename Law::State pid{};
        PerFrequency<Phasor> phasors{};
    };

    static Coefficients prepare(const Params& p, const Common& common) {
        const Frequencies all = frequencies(common.reference, 1.0 / common.step);
        Coefficients c{.pid = Law::prepare(p.pid, common), .count = all.count};
        for (std::size_t i = 0; i < all.count; ++i) {
            if (all.values[i] > 0.0) {
                c.resonators[i] = resonator(p, common, all, i);
            }
        }
        return c;
    }

    static Report report(const State&, const Coefficients&) { return {}; }
    static bool sound(const State& state, const Coefficients& c) { return Law::sound(state.pid, c.pid); }
    static std::uint64_t steps(const State& state) { return Law::steps(state.pid); }
    static void start_over(State& state, bool keep_estimates) {
        Law::start_over(state.pid, keep_estimates);
        if (!keep_estimates) {
            state.phasors = {};
        }
    }

    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        Signals<T, Report> signals{.reference = Reference<T>::update(state.pid.reference, c.pid.reference)};
        const ReferencePoint<T>& r = signals.reference;
        const Sample<T>& e = signals.error = missing == nullptr ? tracking_error(measured, r) : *missing;
        Vec2<T> known_force = state.pid.integral;
        for (std::size_t i = 0; i < c.count; ++i) {
            known_force = known_force + state.phasors[i].real;
        }
        const Vec2<T> feedforward =
            Feedforward<T>::force(c.pid.nominal, Reference<T>::held(state.pid.reference, c.pid.reference));
        const Vec2<T> wanted =
            feedforward - c.pid.position_gain * e.value - c.pid.velocity_gain * e.derivative - known_force;
        // I and p grow with e and move the force against it.
        const T active = Saturation<T>::apply(signals, c.pid.saturation, wanted, e.value);
        const T learns = T(missing == nullptr ? 1.0 : 0.0);
        const Vec2<T> learned = (learns * active) * e.value;
        state.pid.integral = state.pid.integral + c.pid.integral_step * learned;
        for (std::size_t i = 0; i < c.count; ++i) {
            const Resonator& known = c.resonators[i];
            Phasor& p = state.phasors[i];
            const Vec2<T> real = known.cosine * p.real - known.sine * p.imaginary + known.gain.real * learned;
            p.imaginary = known.cosine * p.imaginary + known.sine * p.real + known.gain.imaginary * learned;
            p.real = real;
        }
        return signals;
    }

private:
    struct Frequencies {
        PerFrequency<double> values{};
        std::size_t count = 0;

        void add(double frequency, double amplitude, double highest) {
            const double w = absolute(frequency);
            bool is_new = amplitude != 0.0 && 0.0 < w && w < highest && count < max_frequencies;
            for (std::size_t i = 0; i < count; ++i) {
                is_new = is_new && absolute(values[i] - w) > 1e-3 * w;
            }
            if (is_new) {
                values[count++] = w;
            }
        }
    };
    // Without a course the count is that of the axes, so that lanes with other frequencies share it.
    static Frequencies frequencies(const ReferenceParams& p, double highest) {
        Frequencies all{};
        for (std::size_t axis = 0; axis < 2; ++axis) {
            const auto of = [&](const Vec2<double>& both) { return axis == 0 ? both.x() : both.y(); };
            if (p.kind[axis] == ReferenceKind::sine) {
                all.add(of(p.frequency), of(p.amplitude), highest);
            } else if (p.kind[axis] == ReferenceKind::sines && p.course != nullptr) {
                for (const SineTerm& term : p.course->terms) {
                    all.add(term.frequency[axis], term.amplitude[axis], highest);
                }
            }
        }
        all.count = p.course == nullptr ? 2 : all.count;
        return all;
    }

    struct Complex {
        double real = 0.0, imaginary = 0.0;
        friend Complex operator*(Complex a, Complex b) {
            return {a.real * b.real - a.imaginary * b.imaginary, a.real * b.imaginary + a.imaginary * b.real};
        }
    };
    // cᵢ, twice the residue of C at jwᵢ.
    static Complex share(const Frequencies& all, std::size_t i, double k) {
        const double w = all.values[i], decay = 0.5 * k;
        // ((jw + k/2)² + w²)/(jw)
        Complex share{k, -decay * decay / w};
        for (std::size_t m = 0; m < all.count; ++m) {
            const double v = all.values[m], apart = v * v - w * w;
            if (m != i && v > 0.0) {
                share = share * Complex{1.0 + decay * decay / apart, k * w / apart};
            }
        }
        return share;
    }
    static Resonator resonator(const Params& p, const Common& common, const Frequencies& all, std::size_t i) {
        const double w = all.values[i], h = common.step;
        const double n = p.pid.natural_frequency, damper = 2.0 * p.pid.damping_ratio * n;
        const double spring = n * n - w * w, integral = p.pid.integral_frequency * n * n / w;
        const auto turn = sine_cosine<double>(phase_of(w * h)), held = sine_cosine<double>(phase_of(1.5 * w * h));
        const Complex factor = share(all, i, p.resonator_gain) * Complex{h * held.cosine, h * held.sine};
        const auto gain = [&](double d, double k) { return factor * Complex{spring + k, w * (damper + d) - integral}; };
        const Vec2<double> d = common.nominal.damping.diagonal, k = common.nominal.stiffness.diagonal;
        const Complex x = gain(d.x(), k.x()), y = gain(d.y(), k.y());
        return {.cosine = T(turn.cosine),
                .sine = T(turn.sine),
                .gain = {.real = {T(x.real), T(y.real)}, .imaginary = {T(x.imaginary), T(y.imaginary)}}};
    }
};

}  // namespace fracgyro
