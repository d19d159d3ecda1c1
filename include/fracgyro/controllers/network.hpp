// Network sliding mode control: a linear surface, and a network of functions of the motion that learns the force that
// the nominal plant lacks.
//
// Use it when you study neural and fuzzy control of a gyroscope; with its constant basis it is integral action.
//
//        u = û - λ ė - κ s - k_s sat(s/δ) + Wᵀ φ(x)        s = ė + λ e
//        dW/dt = -ωₐ² φ sᵀ/max(‖φ‖², M) - (ℓ + ℓ_s ‖s‖) W
//        û = (D̂₀ + 2Ω̂₀) v + K̂₀ q + r̈
//
//    with q, v and r̈ moved along the reference to the held point (feedforward.hpp), φ of basis.hpp for this motion or
//    for the reference, and M the largest ‖φ‖² on the orbit of the reference: ωₐ is the frequency of the loop that W
//    and s make, whatever the basis. Sampled, it is stable for h ωₐ² < κ; ωₐ² is at most 0.9 κ/h. The leak is exact.
//
//    With a prediction (composite learning), W also learns from the error z of a model of ė under the acting force:
//    s + g z in place of s, with dm/dt = u - û - Wᵀ φ + β z and z = ė - m. z is true at the force limit, too, and
//    starts over after missing samples. Sampled, it is stable for h ωₐ² (1/κ + g/β̄) < 1, β̄ = (1 - e^(-β h))/h: g is
//    at most what makes this 0.9.
//
//    Settings of the basis make it a fuzzy, a recurrent or a gated network, and let centers and widths move as they
//    learn, from what W learns from. Loops and gate rest without a sample.
//
//    `minimal` learns one number instead of W, a bound of its norm: u has -½ θ s min(‖φ‖²/M, 1) instead of Wᵀ φ, with
//    dθ/dt = ½ ωₐ² ‖s‖² min(‖φ‖²/M, 1) - ℓ θ, so that the gain of s is at most 0.8/h. At the force limit, and without a
//    sample, nothing is learned.
//
// Source: radial basis functions after doi 10.1155/2014/159047, minimal learning after Mathematical Problems in
// Engineering 2017, prediction after doi 10.1109/TNNLS.2019.2919931 (abstracts read); docs/decisions/0053.
#pragma once

#include "fracgyro/control/basis.hpp"
#include "fracgyro/control/controller.hpp"
#include "fracgyro/control/feedforward.hpp"
#include "fracgyro/control/saturation.hpp"
#include "fracgyro/control/shared_fields.hpp"

namespace fracgyro {

enum class NetworkInputs { measured, reference };

struct NetworkParams {
    double surface_gain = 30.0, reaching_rate = 90.0;       // λ, κ
    double switching_force = 0.0, layer_thickness = 0.06;   // k_s, δ
    double learning_frequency = 30.0;                       // ωₐ
    double leak = 0.0, error_leak = 0.0;                    // ℓ, ℓ_s
    double prediction_rate = 5.0, prediction_weight = 0.0;  // β, g
    bool minimal = false, nominal_model = true;
    NetworkInputs inputs = NetworkInputs::measured;
    BasisParams basis{};

    static constexpr std::string_view switches[] = {"false", "true"}, sources[] = {"measured", "reference"};
    static constexpr auto fields() {
        using P = NetworkParams;
        return Fields{
            surface_gain_field(&P::surface_gain),
            reaching_rate_field(&P::reaching_rate),
            field("switching_force", &P::switching_force, "m*omega0^2*q0", at_least_0,
                  "k_s, unit m omega0^2 q0: largest switching force. 0.0: off."),
            field("surface_layer", &P::layer_thickness, "q0*omega0", above_0,
                  "delta, unit q0 omega0, > 0: |s| below which the switching is proportional to it."),
            field("learning_frequency", &P::learning_frequency, "omega0", above_0,
                  "omega_a, unit omega0, > 0: frequency of the loop that weights and s make, whatever the basis; times "
                  "run.step below about 0.15. At most (0.9 kappa/run.step)^(1/2) is used."),
            field("weight_leak", &P::leak, "omega0", at_least_0,
                  "l, unit omega0: rate at which the weights return to 0. 0.0: off."),
            field("error_leak", &P::error_leak, "1/q0", at_least_0,
                  "l_s, unit 1/q0: the same for each unit of ||s||. 0.0: off."),
            field("prediction_rate", &P::prediction_rate, "omega0", above_0,
                  "beta, unit omega0, > 0: rate at which the model of de/dt follows it."),
            field("prediction_weight", &P::prediction_weight, "1", at_least_0,
                  "g: weight of the error of that model in what the weights learn from, next to s; not more is used "
                  "than a sampled loop bears. minimal true, or 0.0: off."),
            choice("minimal", &P::minimal, switches,
                   "true: one number for the norm of the weights is learned, which is a gain. false: off, the "
                   "weights."),
            choice("model", &P::nominal_model, switches,
                   "The force has that of the nominal plant. false: off, the network has to learn all of the plant."),
            settable(Settable::beforehand, choice("network_inputs", &P::inputs, sources,
                                                  "Motion that phi sees: measured, or the reference without noise.")),
            Inner{"controller", &P::basis},
        };
    }
};

template <Scalar T>
struct NetworkReport {
    Vec2<T> surface{}, learned{};
    T norm{}, gain{};

    static constexpr auto fields() {
        using R = NetworkReport;
        return Fields{
            momentary(channel("surface", &R::surface, "q0*omega0", "sliding surface s")),
            momentary(channel("learned_force", &R::learned, "m*omega0^2*q0", "force of the network")),
            channel("weight_norm", &R::norm, "m*omega0^2*q0", "norm of the weights of the network"),
            channel("learned_gain", &R::gain, "omega0", "gain that minimal learning has found"),
        };
    }
};

template <Scalar T>
struct Network {
    using Value = T;
    using Params = NetworkParams;
    using Report = NetworkReport<T>;
    using Functions = Basis<T>;

    struct Prediction {
        T step{}, follows{}, weight{};  // h, 1 - e^(-β h), g
        bool on = false;
    };
    struct Coefficients {
        typename Reference<T>::Coefficients reference{};
        typename Saturation<T>::Coefficients saturation{};
        typename Feedforward<T>::Coefficients nominal{};
        typename Functions::Coefficients basis{};
        Prediction prediction{};
        T surface_gain{}, reaching_gain{}, inverse_layer{}, most{};  // λ, κ, k_s/δ, k_s
        T rate{}, largest{}, inverse_largest{};                      // h ωₐ², M, 1/M
        T leak{}, error_leak{};                                      // -h ℓ, -h ℓ_s
        T keep{}, room{};                                            // e^(-h ℓ), 2 (0.8/h - κ)
        bool minimal = false, of_reference = false, leaks_by_error = false, leaks = false;
    };
    struct State {
        typename Reference<T>::State reference{};
        std::array<Vec2<T>, Functions::most> weights{};
        T gain{};             // θ
        Vec2<T> predicted{};  // m
        typename Functions::Memory memory{};
        Kept<T, bool> predicts = false;
    };

    static Coefficients prepare(const Params& p, const Common& common) {
        const double h = common.step, largest = Functions::largest_on_orbit(p.basis, common.reference);
        const double square = minimum(p.learning_frequency * p.learning_frequency, 0.9 * p.reaching_rate / h);
        const double follows = 1.0 - exponential(-h * p.prediction_rate);
        const double most = maximum(0.9 / (h * square) - 1.0 / p.reaching_rate, 0.0) * follows / h;
        return {.reference = Reference<T>::prepare(common.reference, h),
                .saturation = Saturation<T>::prepare(common.force_limit),
                .nominal = Feedforward<T>::prepare(p.nominal_model ? common.nominal : PlantModel<double>{}),
                .basis = Functions::prepare(p.basis, common.reference),
                .prediction = {.step = T(h),
                               .follows = T(follows),
                               .weight = T(minimum(p.prediction_weight, most)),
                               .on = p.prediction_weight > 0.0 && !p.minimal},
                .surface_gain = T(p.surface_gain),
                .reaching_gain = T(p.reaching_rate),
                .inverse_layer = T(p.switching_force / p.layer_thickness),
                .most = T(p.switching_force),
                .rate = T(h * square),
                .largest = T(largest),
                .inverse_largest = T(1.0 / largest),
                .leak = T(-h * p.leak),
                .error_leak = T(-h * p.error_leak),
                .keep = T(exponential(-h * p.leak)),
                .room = T(maximum(2.0 * (0.8 / h - p.reaching_rate), 0.0)),
                .minimal = p.minimal,
                .of_reference = p.inputs == NetworkInputs::reference,
                .leaks_by_error = p.error_leak > 0.0,
                .leaks = p.leak > 0.0 || p.error_leak > 0.0};
    }

    static Report report(const State& state, const Coefficients& c) {
        T sum = T(0.0);
        for (std::size_t j = 0; j < c.basis.count; ++j) {
            sum = sum + squared_norm(state.weights[j]);
        }
        return {.norm = square_root(sum), .gain = T(0.5) * state.gain};
    }
    static bool sound(const State& state, const Coefficients&) { return fracgyro::sound(state.predicts); }
    static std::uint64_t steps(const State& state) { return state.reference.steps; }
    static void start_over(State& state, bool keep_estimates) {
        state.predicts = false;
        state.memory.values = {};
        state.memory.force = {};
        if (!keep_estimates) {
            state.memory = {};
            state.weights = {};
            state.gain = T(0.0);
        }
    }

    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        Signals<T, Report> signals{.reference = Reference<T>::update(state.reference, c.reference),
                                   .report = report(state, c)};
        const ReferencePoint<T>& r = signals.reference;
        const Sample<T>& e = signals.error = missing == nullptr ? tracking_error(measured, r) : *missing;
        const Vec2<T> s = signals.report.surface = e.derivative + c.surface_gain * e.value;
        const ReferencePoint<T> held = Reference<T>::held(state.reference, c.reference);
        const ReferencePoint<T> there{.position = held.position + e.value,
                                      .velocity = held.velocity + e.derivative,
                                      .acceleration = held.acceleration};
        const ReferencePoint<T>& seen = c.of_reference ? held : there;
        typename Functions::Values phi;
        const Motion<T> x =
            Functions::inputs(c.basis, state.memory, {.position = seen.position, .velocity = seen.velocity});
        const T square = Functions::evaluate(c.basis, state.memory, x, phi);
        const T share = minimum(c.inverse_largest * square, T(1.0));
        const Vec2<T> learned = signals.report.learned =
            c.minimal ? -(T(0.5) * (state.gain * share)) * s : sum(state, c, phi);
        const Vec2<T> keeps = Feedforward<T>::force(c.nominal, there);
        const Vec2<T> wanted = keeps - c.surface_gain * e.derivative - c.reaching_gain * s -
                               clamp(c.inverse_layer * s, -c.most, c.most) + learned;
        // The weights move the force against s.
        const T active = Saturation<T>::apply(signals, c.saturation, wanted, s);
        state.predicts = state.predicts && missing == nullptr;
        if (missing == nullptr) {
            Vec2<T> learned_from = active * s;
            if (c.prediction.on) {
                learned_from = learned_from +
                               c.prediction.weight * missed(state, c.prediction, e, signals.force - keeps - learned);
            }
            if (c.basis.moving.on) {
                Functions::move(state.memory, c.basis, x, phi, state.weights, c.prediction.step * learned_from);
            }
            learn(state, c, phi, square, share, learned_from, s);
            Functions::remember(state.memory, c.basis, phi, learned);
        }
        return signals;
    }

private:
    static Vec2<T> sum(const State& state, const Coefficients& c, const typename Functions::Values& phi) {
        Vec2<T> force{};
        for (std::size_t j = 0; j < c.basis.count; ++j) {
            force = force + phi[j] * state.weights[j];
        }
        return force;
    }
    // z, of which the model forgets its share in a step under this acceleration.
    static Vec2<T> missed(State& state, const Prediction& c, const Sample<T>& error, const Vec2<T>& accelerates) {
        if (!state.predicts) {
            state.predicted = error.derivative;
            state.predicts = true;
        }
        const Vec2<T> z = error.derivative - state.predicted;
        state.predicted = state.predicted + c.follows * z + c.step * accelerates;
        return z;
    }
    // `from`: 0 where it would wind up, s, or s + g z.
    static void learn(State& state, const Coefficients& c, const typename Functions::Values& phi, T square, T share,
                      const Vec2<T>& from, const Vec2<T>& s) {
        if (c.minimal) {
            const T grows = T(0.5) * c.rate * (share * squared_norm(from));
            state.gain = minimum(c.keep * state.gain + grows, c.room);
            return;
        }
        const Vec2<T> moves = (c.rate / maximum(square, c.largest)) * from;
        T keep = c.keep;
        if (c.leaks_by_error) {
            keep = exponential(c.leak + c.error_leak * norm(s));
        }
        for (std::size_t j = 0; j < c.basis.count; ++j) {
            const Vec2<T> left = c.leaks ? keep * state.weights[j] : state.weights[j];
            state.weights[j] = left - phi[j] * moves;
        }
    }
};

}  // namespace fracgyro
