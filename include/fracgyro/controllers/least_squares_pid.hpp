// Certainty-equivalence PID: the PID of pid.hpp on the plant estimated by least squares, once its angular rate is
// trusted.
//
// Use it when velocities are measured with little noise, and rate, damping and stiffness are wanted with few gains.
//
//        u = (D̂ + 2Ω̂) ṙ + K̂ r + r̈ - ω² e - 2ζω ė - I        dI/dt = ωᵢ ω² e
//
//    with the feedforward at the held point (reference.hpp). D̂, K̂ and Ω̂z are the estimates of composite.hpp, and the
//    nominal plant until the rate is trusted. It has no sliding surface, and no law driven by s.
//
// Source: textbook (certainty equivalence); least squares: docs/decisions/0016.
#pragma once

#include "fracgyro/controllers/pid.hpp"
#include "fracgyro/estimation/composite.hpp"

namespace fracgyro {

struct LeastSquaresPidParams {
    PidParams pid{};
    AdaptationParams adaptation{};  // only forgetting is used

    static constexpr auto fields() {
        using P = LeastSquaresPidParams;
        return Fields{Inner{"controller", &P::pid},
                      Inner{"adaptation", &P::adaptation, AdaptationParams::forgetting_fields()}};
    }
};

template <Scalar T>
struct LeastSquaresPid {
    using Value = T;
    using Params = LeastSquaresPidParams;
    using Report = LearnedPlantReport<T>;
    using Learning = CompositeAdaptation<T>;
    using Law = Pid<T>;

    struct Coefficients {
        typename Law::Coefficients pid{};
        typename Learning::Coefficients learning{};
    };
    struct State {
        typename Law::State pid{};
        typename Learning::State learning{};
    };

    static Coefficients prepare(const Params& p, const Common& common) {
        return {.pid = Law::prepare(p.pid, common),
                .learning = Learning::prepare(p.adaptation.without_bounds(), common.nominal, common.step)};
    }

    static Report report(const State& state, const Coefficients& c) {
        const auto found = Learning::report(state.learning, c.learning);
        return {{found.damping, found.stiffness, found.rate},
                found.rate_deviation,
                found.rate_trusted,
                found.sample_refused};
    }
    static bool sound(const State& state, const Coefficients& c) { return Learning::sound(state.learning, c.learning); }
    static std::uint64_t steps(const State& state) { return Law::steps(state.pid); }
    static void start_over(State& state, bool keep_estimates) {
        Law::start_over(state.pid, keep_estimates);
        if (keep_estimates) {
            Learning::rest(state.learning);
        } else {
            state.learning = {};
        }
    }

    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        const Report known = report(state, c);
        const Estimates<T> believed = Learning::control_estimates(state.learning, c.learning, {});
        const auto law = Law::step(state.pid, c.pid, measured, missing,
                                   {believed.damping, believed.stiffness, T(2.0) * believed.rate});
        if (missing == nullptr) {
            Learning::update(state.learning, c.learning, measured, {}, {}, law.force);
        } else {
            Learning::rest(state.learning);
        }
        return {law.reference, law.error, law.force, law.excess, known};
    }
};

}  // namespace fracgyro
