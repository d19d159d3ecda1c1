// Active disturbance rejection control (ADRC): an extended state observer estimates, from positions, the acceleration f
// missing from its model of the plant, and the force cancels it.
//
// Use it when only positions are measured and the plant is hardly known.
//
//        u = r̈ - ω² (q̂ - r) - 2ω (v̂ - ṙ) - f + (D̂₀ + 2Ω̂₀) v̂ + K̂₀ q̂
//
//    The observer is the one of observer.hpp. With `nominal_model` it contains the nominal plant; without it, no plant,
//    and the last two terms are missing, so that f is the whole action of the plant.
//
//    The angular rate (our form of their demodulation) is the part of f on y that follows the velocity of x:
//
//        Ω̂z = Ω̂₀ - LP(f_y w)/(2 LP(w²))        w = G v̂_x
//
//    G is the response of the observer from a missing acceleration to f at the reference's frequency, which f lags by
//    some 3ω/ω_o, and LP is a first-order low-pass filter. Without the model Ω̂₀ is 0 here.
//
// Source: Zheng, Dong and Gao 2007, doi 10.1109/CCA.2007.4389216 (abstract read).
#pragma once

#include "fracgyro/control/shared_fields.hpp"
#include "fracgyro/control/saturation.hpp"
#include "fracgyro/hardware/observer.hpp"

namespace fracgyro {

struct DisturbanceRejectionParams {
    double natural_frequency = 200.0;  // ω
    double extended_observer = 600.0;  // ω_o
    double rate_bandwidth = 1.0;       // bandwidth of LP
    bool nominal_model = true;

    static constexpr std::string_view switches[] = {"false", "true"};
    static constexpr auto fields() {
        using P = DisturbanceRejectionParams;
        return Fields{
            loop_frequency_field(&P::natural_frequency),
            field("extended_observer_bandwidth", &P::extended_observer, "omega0", above_0,
                  "omega_o, unit omega0, > 0: of the extended state observer. Times run.step below about 0.8."),
            field("rate_bandwidth", &P::rate_bandwidth, "omega0", above_0,
                  "Unit omega0, > 0: of the filters that demodulate the angular rate."),
            choice("nominal_model", &P::nominal_model, switches,
                   "The observer and the force have the nominal plant. false: off, all of the plant is a disturbance."),
        };
    }
};

template <Scalar T>
struct DisturbanceRejectionReport {
    T rate{};
    Vec2<T> lacking{};  // f

    static constexpr auto fields() {
        using R = DisturbanceRejectionReport;
        return Fields{
            channel("rate_estimate", &R::rate, "omega0", "estimate of the angular rate: skew part of Omega"),
            channel("lacking_acceleration", &R::lacking, "omega0^2*q0",
                    "acceleration that the observer's model of the plant lacks"),
        };
    }
};

template <Scalar T>
struct DisturbanceRejection {
    using Value = T;
    using Params = DisturbanceRejectionParams;
    using Report = DisturbanceRejectionReport<T>;
    using Watch = Observer<T>;
    static constexpr bool measures_velocity = false;

    struct Coefficients {
        typename Reference<T>::Coefficients reference{};
        typename Saturation<T>::Coefficients saturation{};
        typename Watch::Coefficients observer{};
        T position_gain{}, velocity_gain{};
        T in_phase{}, in_quadrature{};  // w = in_phase v̂ + in_quadrature q̂
        T filter{}, nominal_rate{};     // 1 - e^(-h/τ)
    };
    struct State {
        typename Reference<T>::State reference{};
        typename Watch::State observer{};
        Vec2<T> force{};        // the acting force
        T product{}, square{};  // LP(f_y w), LP(w²)
    };

    static Coefficients prepare(const Params& p, const Common& common) {
        const double h = common.step, frequency = equivalent_sine(common.reference).frequency.x();
        const PlantModel<double> model = p.nominal_model ? common.nominal : PlantModel<double>{};
        const SineCosine<double> response = of_missing(p.extended_observer * h, frequency * h);
        return {.reference = Reference<T>::prepare(common.reference, h),
                .saturation = Saturation<T>::prepare(common.force_limit),
                .observer = Watch::prepare(model, p.extended_observer, h),
                .position_gain = T(p.natural_frequency * p.natural_frequency),
                .velocity_gain = T(2.0 * p.natural_frequency),
                .in_phase = T(response.cosine),
                .in_quadrature = T(-frequency * response.sine),
                .filter = T(1.0 - exponential(-p.rate_bandwidth * h)),
                .nominal_rate = T(model.rate)};
    }

    static Report report(const State& state, const Coefficients& c) {
        const T known = maximum(state.square, T(1e-12));
        return {.rate = c.nominal_rate - T(0.5) * (state.product / known), .lacking = state.observer.acceleration};
    }
    static bool sound(const State& state, const Coefficients&) { return fracgyro::sound(state.observer.started); }
    static std::uint64_t steps(const State& state) { return state.reference.steps; }
    static void start_over(State& state, bool keep_estimates) {
        state.observer = {};
        state.force = {};
        if (!keep_estimates) {
            state.product = state.square = T(0.0);
        }
    }

    // Without a measurement the last force is held, and the observer predicts.
    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        Signals<T, Report> signals{.reference = Reference<T>::update(state.reference, c.reference),
                                   .report = report(state, c)};
        const ReferencePoint<T>& r = signals.reference;
        if (missing == nullptr) {
            Watch::correct(state.observer, c.observer, measured.position);
        }
        const Motion<T>& seen = state.observer.motion;
        const Sample<T>& e = signals.error = missing == nullptr ? tracking_error(seen, r) : *missing;
        const Vec2<T>& f = state.observer.acceleration;
        const Vec2<T> coriolis = c.observer.twice_rate * turned(seen.velocity);
        const Vec2<T> plant = c.observer.damping * seen.velocity + coriolis + c.observer.stiffness * seen.position;
        const Vec2<T> wanted = r.acceleration - c.position_gain * e.value - c.velocity_gain * e.derivative - f + plant;
        Saturation<T>::apply(signals, c.saturation, wanted, e.value);
        if (missing == nullptr) {
            state.force = signals.force;
            const T w = c.in_phase * seen.velocity.x() + c.in_quadrature * seen.position.x();
            state.product = state.product + c.filter * (f.y() * w - state.product);
            state.square = state.square + c.filter * (w * w - state.square);
        }
        Watch::predict(state.observer, c.observer, state.force);
        return signals;
    }

private:
    // Response of the observer from a missing acceleration to f as corrected: with z = e^(jωh) and the gains of
    // observer.hpp, from its three equations. Its real part is `cosine`, its imaginary part `sine`.
    static SineCosine<double> of_missing(double bandwidth, double angle) {
        struct Complex {
            double re, im;
            Complex operator+(Complex b) const { return {re + b.re, im + b.im}; }
            Complex operator*(Complex b) const { return {re * b.re - im * b.im, re * b.im + im * b.re}; }
            Complex operator/(Complex b) const {
                const double size = b.re * b.re + b.im * b.im;
                return {(re * b.re + im * b.im) / size, (im * b.re - re * b.im) / size};
            }
        };
        if (angle == 0.0) {
            return {.sine = 0.0, .cosine = 1.0};
        }
        const double forgets = exponential(-bandwidth), part = 1.0 - forgets, cube = forgets * forgets * forgets;
        const double second = 1.5 * (1.0 - forgets * forgets) * part, third = part * part * part;
        const auto turn = sine_cosine<double>(phase_of(angle));
        const Complex z{turn.cosine, turn.sine}, one{1.0, 0.0}, sum = one / Complex{turn.cosine - 1.0, turn.sine};
        const auto times = [](double a, Complex b) { return Complex{a * b.re, a * b.im}; };
        // Position error over h² f.
        const Complex above = Complex{0.5, 0.0} + sum;
        const Complex below =
            z + Complex{second + 0.5 * third - cube, 0.0} + times(second + 1.5 * third, sum) + times(third, sum * sum);
        // The missing acceleration changes while it is held: its mean over the step is half a step ahead.
        const auto ahead = sine_cosine<double>(phase_of(0.5 * angle));
        const Complex found = times(third, z * sum) * (above / below) * Complex{ahead.cosine, ahead.sine};
        return {.sine = found.im, .cosine = found.re};
    }
};

}  // namespace fracgyro
