// Adaptive dynamic sliding mode control: the law states the rate of the force, so that switching and noise reach the
// force through an integral.
//
// Use it when chattering must be small and the velocity is measured, with few operations.
//
//        σ = ë + (λ + κ) ė + λ κ e        ë = u - (D̂ + 2Ω̂) v - K̂ q - r̈
//        dσ/dt = -k σ - k_s sat(σ/δ)
//
//    ë is that of the model: the acceleration is not measured. Then σ = u - u_PD, with the force u_PD of the model that
//    places the poles -λ and -κ, so the force follows that of a PD at the rate k, and the model moves it in between.
//    The held force of a step is the one that leaves, by the model, of σ at its end
//
//        σ⁺ = e^(-k h) σ - sat(e^(-k h) (1 - e^(-k_s h/δ)) σ)        |sat| <= k_s h
//
//    which overshoots for no value of the gains. The state is the force less the feedforward at the held point
//    (reference.hpp). At the force limit it is the force that acts, so nothing winds up. The estimates follow the laws
//    (44), with s = ė + λ e; they rest while the limit removes force that acts against σ. Without a sample, only the
//    feedforward moves on.
//
// Source: doi 10.3390/mi12020190 (abstract read); docs/decisions/0053.
#pragma once

#include "fracgyro/control/shared_fields.hpp"
#include "fracgyro/controllers/adaptive.hpp"

namespace fracgyro {

struct DynamicSlidingParams {
    double surface_gain = 30.0;      // λ
    double reaching_rate = 90.0;     // κ
    double force_bandwidth = 400.0;  // k
    double switching_rate = 0.0;     // k_s; 0: off
    double layer_thickness = 100.0;  // δ
    AdaptationParams adaptation{};   // the bounds are not used

    static constexpr auto fields() {
        using P = DynamicSlidingParams;
        return Fields{
            surface_gain_field(&P::surface_gain),
            reaching_rate_field(&P::reaching_rate),
            field("force_bandwidth", &P::force_bandwidth, "omega0", above_0,
                  "k, unit omega0, > 0: decay of sigma, and the rate at which the force follows that of the model."),
            field("switching_rate", &P::switching_rate, "m*omega0^3*q0", at_least_0,
                  "k_s, unit m omega0^3 q0: largest rate at which the force switches against sigma. 0.0: off."),
            field("switching_layer", &P::layer_thickness, "q0*omega0^2", above_0,
                  "delta, unit q0 omega0^2, > 0: |sigma| below which the switching is proportional to it."),
            Inner{"adaptation", &P::adaptation, AdaptationParams::plant_fields()},
        };
    }
};

template <Scalar T>
struct DynamicSlidingReport : SlidingReport<T> {
    Vec2<T> dynamic{};  // σ

    static constexpr auto fields() {
        using R = DynamicSlidingReport;
        return joined(
            SlidingReport<T>::fields(),
            Fields{momentary(channel("dynamic_surface", &R::dynamic, "q0*omega0^2", "dynamic surface sigma"))});
    }
};

template <Scalar T>
struct DynamicSliding {
    using Value = T;
    using Params = DynamicSlidingParams;
    using Report = DynamicSlidingReport<T>;
    using Base = Adaptive<T>;

    struct Coefficients {
        typename Base::Coefficients base{};
        T surface_gain{}, velocity_gain{}, position_gain{};  // λ, λ + κ, λ κ
        T step{}, half_step{};
        T share{};               // 1/(1 + (λ + κ) h + λ κ h²/2): change of σ by a step of ë
        T decay{};               // 1 - e^(-k h)
        T layer_gain{}, most{};  // e^(-k h) (1 - e^(-k_s h/δ)), k_s h
    };
    struct State {
        typename Base::State base{};
        Vec2<T> force{};  // u less the feedforward
    };

    static Coefficients prepare(const Params& p, const Common& common) {
        const double h = common.step, sum = p.surface_gain + p.reaching_rate;
        const double product = p.surface_gain * p.reaching_rate, keeps = exponential(-p.force_bandwidth * h);
        const double switches = p.switching_rate * h;
        return {.base = Base::prepare(p.adaptation, common),
                .surface_gain = T(p.surface_gain),
                .velocity_gain = T(sum),
                .position_gain = T(product),
                .step = T(h),
                .half_step = T(0.5 * h),
                .share = T(1.0 / (1.0 + h * (sum + 0.5 * h * product))),
                .decay = T(1.0 - keeps),
                .layer_gain = T(keeps * (1.0 - exponential(-switches / p.layer_thickness))),
                .most = T(switches)};
    }

    static Report report(const State& state, const Coefficients& c) { return {{Base::report(state.base, c.base)}}; }
    static bool sound(const State&, const Coefficients&) { return true; }  // numbers only
    static std::uint64_t steps(const State& state) { return state.base.reference.steps; }
    static void start_over(State& state, bool keep_estimates) {
        Base::start_over(state.base, keep_estimates);
        state.force = {};
    }

    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        Signals<T, Report> signals{.report = report(state, c)};
        const Motion<T> motion = Base::begin(state.base, c.base, signals, measured, missing);
        const Sample<T>& e = signals.error;
        const Vec2<T> s = signals.report.surface = e.derivative + c.surface_gain * e.value;
        const ReferencePoint<T> held = Reference<T>::held(state.base.reference, c.base.reference);
        const Vec2<T> along =
            plant_force<T>(signals.report, {.position = held.position, .velocity = held.velocity}, held.acceleration);
        // The plant's force on the error, and its rate, with ë of the last force.
        const Vec2<T> on_error = plant_force<T>(signals.report, {e.value, e.derivative}, {});
        const Vec2<T> accelerates = state.force - on_error;
        const Vec2<T> sigma = signals.report.dynamic =
            accelerates + c.velocity_gain * e.derivative + c.position_gain * e.value;
        const Vec2<T> mean = e.derivative + c.half_step * accelerates;
        const Vec2<T> rate = plant_force<T>(signals.report, {mean, accelerates}, {}) - c.position_gain * e.derivative;
        const Vec2<T> reached = c.decay * sigma + clamp(c.layer_gain * sigma, -c.most, c.most);
        const Vec2<T> next = on_error + c.share * (accelerates + c.step * rate - reached);
        const Vec2<T> wanted = along + (missing == nullptr ? next : state.force);
        const T active = Saturation<T>::apply(signals, c.base.saturation, wanted, sigma);
        if (missing == nullptr) {
            state.force = next - signals.excess;
            Base::learn(state.base, c.base, motion, active * s);
        }
        return signals;
    }
};

}  // namespace fracgyro
