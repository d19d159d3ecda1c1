// Entry point of the simulator, and the only closed loop of single runs: the six steps of Figure 2, one sample at a
// time.
#pragma once

#include "fracgyro/plant/disturbance.hpp"
#include "fracgyro/plant/gyroscope.hpp"

#include "fracgyro/control/course.hpp"
#include "fracgyro/controllers/registry.hpp"
#include "fracgyro/sim/shared.hpp"

#include <vector>

namespace fracgyro {

// Numbers of a reference that are lists: those of a sum of sines and of a table.
struct ReferenceLists {
    std::vector<SineTerm> terms{};
    std::vector<TableRow> rows{};
};
struct CourseWithLists : Course {
    Shared<ReferenceLists> lists{};
    std::vector<ReferencePoint<double>> stepwise{};
};

// Points of a table on both axes with a row for every step, which are faster to look up than to evaluate.
inline std::vector<ReferencePoint<double>> stepwise_points(const Course& c) {
    std::vector<ReferencePoint<double>> points;
    if (c.params.kind[0] == ReferenceKind::table && c.params.kind[1] == ReferenceKind::table) {
        for (std::size_t n = 0; n < c.rows.size() && c.rows[n].time == static_cast<double>(n) * c.step; ++n) {
            points.push_back(c.at(c, n, 0.0));
        }
    }
    return points;
}

// One run. Nondimensional. Params: of any kind, or of one controller, which need not be in the registry.
template <class Params>
struct SetupOf {
    Params controller{};
    Common common{};
    GyroscopeParams plant{};
    DisturbanceParams disturbance{};
    std::int64_t steps = 0;  // the run has steps + 1 samples, at 0, h, …, steps·h
    Shared<ReferenceLists> lists{};
    Shared<CourseWithLists> course{};  // to which common.reference points
};
using Setup = SetupOf<ControllerParams>;

// To be called after a change of the reference, its lists or the step.
template <class Params>
void prepare_reference(SetupOf<Params>& setup) {
    ReferenceParams& reference = setup.common.reference;
    reference.course = nullptr;
    setup.course = {};
    if (needs_course(reference)) {
        const ReferenceLists none{}, &lists = setup.lists.get() == nullptr ? none : *setup.lists.get();
        CourseWithLists course{make_course(reference, setup.common.step, lists.terms, lists.rows), setup.lists};
        course.stepwise = stepwise_points(course);
        course.points = course.stepwise;
        setup.course = Shared<CourseWithLists>(std::move(course));
        reference.course = setup.course.get();
    }
}

// Values known at one sample, valid for the duration of that sample.
template <Scalar T, class Report>
struct Snapshot {
    std::int64_t step;
    const Motion<T>& motion;
    const Signals<T, Report>& signals;
    const Vec2<T>& disturbance;
};

// Motion beyond this is divergence: a tracked reference is of order 1.
inline constexpr double divergence_limit = 1e6;

// Also false for NaN.
template <Scalar T>
bool bounded(const Motion<T>& motion) {
    return absolute(motion.position.x()) + absolute(motion.position.y()) < T(divergence_limit);
}

// 6  The gyroscope on an ideal device: its motion is measured, and the requested force acts. For a non-ideal device see
// device_loop.hpp.
template <Scalar T>
struct IdealGyroscope {
    using Coefficients = typename Gyroscope<T>::Coefficients;
    using Drawn = Vec2<double>;  // at one sample
    struct State {
        Motion<T> motion{};
        Vec2<T> disturbance{};
    };

    template <class Params>
    static Coefficients prepare(const SetupOf<Params>& setup) {
        return Gyroscope<T>::prepare(setup.plant, setup.common.step);
    }
    template <class Params>
    static State start(const SetupOf<Params>& setup) {
        return {.motion = Gyroscope<T>::start(setup.plant)};
    }
    // The measurement at sample n, with the noise drawn for it.
    static const Motion<T>& sense(State& state, const Coefficients&, const Drawn& drawn) {
        state.disturbance = cast<T>(drawn);
        return state.motion;
    }
    // The response at sample n. The error is the true one, whatever the controller measures.
    template <class C, class Report>
    static void actuate(State& state, const Coefficients&, Signals<T, Report>& signals, std::int64_t) {
        if constexpr (!measures_velocity<C>) {
            signals.error = tracking_error(state.motion, signals.reference);
        }
    }
    // Advances to the next sample.
    template <class Report>
    static void step(State& state, const Coefficients& c, const Signals<T, Report>& signals, std::int64_t) {
        Gyroscope<T>::step(state.motion, c, signals.force, state.disturbance);
    }
    template <class LoopState, class Report>
    static Snapshot<T, Report> snapshot(const LoopState& state, const Coefficients&,
                                        const Signals<T, Report>& signals) {
        return {state.step, state.motion, signals, state.disturbance};
    }
};

// Compilers suppose that others may change what a function returns that is not inlined: a loop with a copy of its own
// keeps it in registers.
template <class Value>
Value copied(const Value& returned) {
    return returned;
}

template <Controller C, class Gyroscope = IdealGyroscope<typename C::Value>>
struct Stepper {
    using T = typename C::Value;
    using Report = typename C::Report;
    struct Coefficients {
        typename C::Coefficients controller{};
        typename Gyroscope::Coefficients gyroscope{};
    };
    // State before a sample, of which only the motion is known. A plain value: a copy resumes bit for bit.
    struct Pending : Gyroscope::State {
        std::int64_t step = 0;
        typename C::State controller{};
    };
    // State at one sample: known values, and the values needed by the next samples.
    struct State : Pending {
        Signals<T, Report> signals{};

        Snapshot<T, Report> snapshot() const { return {this->step, this->motion, signals, this->disturbance}; }
    };

    // Not inlined, as a run's loop is into copies for processors: they compile in a third of the time without it.
    template <class Setup>
    [[gnu::noinline]] static Coefficients prepare(const Setup& setup) {
        return {.controller = fracgyro::prepare<C>(setup.controller, setup.common),
                .gyroscope = Gyroscope::prepare(setup)};
    }

    // State before the sample at t = 0.
    template <class Setup>
    [[gnu::noinline]] static Pending begin(const Setup& setup) {
        return {Gyroscope::start(setup)};
    }

    // Runs every sample from this one to before `end`, or until the motion diverges; the state is then before the one
    // after. Calls observe(snapshot) at each. draw(n) draws the noise at sample n.
    template <class Draw, class Observe>
    static void run(Pending& state, const Coefficients& c, std::int64_t end, Draw&& draw, Observe&& observe) {
        for (; state.step < end && bounded(state.motion); ++state.step) {
            const auto signals = answer(state, c, draw);
            observe(Gyroscope::snapshot(state, c.gyroscope, signals));
            Gyroscope::step(state, c.gyroscope, signals, state.step);
        }
    }

    // The same with the noise of the coming samples, for a run's part. The loop keeps in registers what no call and no
    // write can change: it draws nothing and has a state of its own.
    template <class Drawn, class Observe>
    static void run_part(Pending& state, const Coefficients& c, std::int64_t end, const Drawn* coming,
                         Observe&& observe) {
        auto own = copied(state);
        run(own, c, end, [&, first = own.step](std::int64_t n) { return coming[n - first]; }, observe);
        state = own;
    }

    // Functions for callers that keep the clock themselves. The sample at t = 0:
    template <class Setup, class Draw>
    static State start(const Setup& setup, const Coefficients& c, Draw&& draw) {
        State state{begin(setup)};
        state.signals = answer(state, c, draw);
        return state;
    }
    // Advances to the next sample. Returns true if the motion is still bounded; if not, the rest of the state stays
    // behind it.
    template <class Draw>
    static bool advance(State& state, const Coefficients& c, Draw&& draw) {
        Gyroscope::step(state, c.gyroscope, state.signals, state.step);
        if (!bounded(state.motion)) {
            return false;
        }
        ++state.step;
        state.signals = answer(state, c, draw);
        return true;
    }

private:
    template <class Draw>
    static Signals<T, Report> answer(Pending& state, const Coefficients& c, Draw& draw) {
        const Motion<T>& measured = Gyroscope::sense(state, c.gyroscope, draw(state.step));
        auto signals = C::step(state.controller, c.controller, measured);  // 1 to 5
        Gyroscope::template actuate<C>(state, c.gyroscope, signals, state.step);
        if constexpr (KnowsForce<C> && requires { Gyroscope::code(state, c.gyroscope); }) {
            if (const Vec2<T>* const force = Gyroscope::code(state, c.gyroscope)) {
                C::acted(state.controller, c.controller, *force);
            }
        }
        return signals;
    }
};

}  // namespace fracgyro
