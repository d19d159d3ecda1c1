// One instance of the FMU, whatever the version of FMI: fmi2.cpp and fmi3.cpp give it their names.
#pragma once

#include "exported.hpp"  // made by `fracgyro export fmu`: this FMU's variables, numbers and exponentials

#include "closed_loop.hpp"

#include "fracgyro/hardware/converters.hpp"
#include "fracgyro/hardware/guard.hpp"
#include "fracgyro/hardware/pickoffs.hpp"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>

namespace fracgyro {

using Registered = RegisteredController<exported::Number, exported::kind, exported::chosen>;
inline constexpr bool from_positions = exported::sensing[0] > 0.0, filtered = exported::sensing[1] > 0.0,
                      triggered = exported::sensing[6] > 0.0 || exported::sensing[7] > 0.0,
                      corrected =
                          exported::sensing[8] != 0.0 || exported::sensing[9] != 0.0 || exported::sensing[10] != 0.0,
                      compensated = exported::sensing[11] > 0.0;
using Unguarded = ForDevice<Registered, from_positions, filtered, triggered, corrected, compensated>::Type;
// A closed loop needs no guard: the measurements come from the FMU's own simulation and have no faults.
using ExportedController = std::conditional_t<exported::closed_loop, Unguarded, Guard<Unguarded>>;
using Loop = std::conditional_t<exported::ideal, IdealLoop<ExportedController>, DeviceLoop<ExportedController>>;

// A reference that comes from the importer. Its designs are those of the scenario's reference, which it replaces. Its
// held point is on the parabola through the present one, as the third derivative is not known.
struct InputReference : Course {
    ReferencePoint<double> point{};

    InputReference() {
        at = [](const Course& c, std::uint64_t, double lead) {
            const auto& [position, velocity, acceleration] = static_cast<const InputReference&>(c).point;
            const double ahead = lead * c.step;
            return ReferencePoint<double>{.position = position + ahead * (velocity + (0.5 * ahead) * acceleration),
                                          .velocity = velocity + ahead * acceleration,
                                          .acceleration = acceleration};
        };
    }
};

// Limit on the steps in one call of the importer: a few seconds of work.
inline constexpr double most_steps = 1e7;

class Instance {
public:
    enum class Phase : std::uint32_t { made, initializing, running, terminated };

    // All that changes. A plain value: copied, it resumes bit for bit.
    struct State {
        Phase phase = Phase::made;
        double start_time = 0.0;
        std::array<double, std::size(exported::variables)> values{};  // parameters and inputs, in the FMU's units
        typename Loop::State loop{};
        std::array<double, Loop::width> row{};
    };

    Instance(const Instance&) = delete;  // setup_ points to reference_
    Instance& operator=(const Instance&) = delete;
    Instance() {
        setup_.lists = Shared<ReferenceLists>(lists_from(exported::reference_terms, exported::reference_rows));
        reset();
    }

    const char* problem() const { return problem_; }
    // The reason why a sample of the last communication step was not accepted; nullptr: all were accepted.
    const char* warning() const { return warning_[0] == '\0' ? nullptr : warning_; }
    const State& state() const { return state_; }
    void restore(const State& saved) {
        state_ = saved;
        prepared_ = false;  // it may have other parameters
        gain_ = 0.0;
    }
    // A saved state of which only the size is known. Its numbers must be ones that could have been set: some become
    // integers.
    bool read(const unsigned char* bytes, std::size_t count, State& state) {
        if (bytes == nullptr || count <= sizeof exported::token ||
            std::memcmp(bytes, exported::token, sizeof exported::token) != 0) {
            return fail("the serialized state is not of this FMU");
        }
        bytes += sizeof exported::token;
        if (!Saved<State>::read(bytes, count - sizeof exported::token, state) || !sound(state)) {
            return fail("the serialized state is damaged: it is not as it was saved");
        }
        return true;
    }
    static constexpr std::size_t saved_size = sizeof exported::token + Saved<State>::size;
    static void write(const State& state, unsigned char* bytes) {
        std::memcpy(bytes, exported::token, sizeof exported::token);
        Saved<State>::write(state, bytes + sizeof exported::token);
    }
    void reset() {
        state_ = State{};
        for (std::size_t i = 0; i < state_.values.size(); ++i) {
            state_.values[i] = exported::variables[i].start;
        }
        prepared_ = false;
        gain_ = 0.0;
    }

    // These functions return true on success; otherwise `problem` returns the reason.
    bool start_at(double time) {
        if (!in(Phase::made, "the start time")) {
            return false;
        }
        if (!std::isfinite(time)) {
            return fail("the start time is %g: it must be a finite number", time);
        }
        state_.start_time = time;
        return true;
    }
    bool initialize() { return in(Phase::made, "the initialization") && on_to(Phase::initializing); }
    bool start() {
        if (!in(Phase::initializing, "the end of the initialization")) {
            return false;
        }
        look_ahead();
        return is_a_plant() && on_to(Phase::running);
    }
    bool terminate() {
        return (state_.phase == Phase::initializing || in(Phase::running, "the end")) && on_to(Phase::terminated);
    }

    // `integer`: by a function for integers.
    bool get(std::size_t reference, bool integer, double& value) {
        if (!known(reference, integer)) {
            return false;
        }
        const Variable& v = exported::variables[reference];
        if (v.role == Role::time) {
            value = now();
        } else if (v.role == Role::output) {
            if (state_.phase < Phase::running) {
                look_ahead();
            }
            value = state_.row[static_cast<std::size_t>(v.place)] * v.scale;
        } else {
            value = state_.values[reference];
        }
        return true;
    }
    bool set(std::size_t reference, bool integer, double value) {
        if (!known(reference, integer)) {
            return false;
        }
        const Variable& v = exported::variables[reference];
        if (!settable(v)) {
            return fail("%s cannot be set", v.name);
        }
        if (state_.phase == Phase::terminated) {
            return fail("%s cannot be set: the simulation is terminated", v.name);
        }
        if (v.role == Role::fixed && state_.phase == Phase::running) {
            return fail("%s is fixed: it can be set until the end of the initialization", v.name);
        }
        if (!std::isfinite(value)) {
            return fail("%s is %g: it must be a finite number", v.name, value);
        }
        if (!allowed(v, value)) {
            return outside(v, value);
        }
        state_.values[reference] = value;
        prepared_ = prepared_ && v.role == Role::input;
        return true;
    }

    // From `time` on by `length`, which takes as many internal steps as fit in exactly.
    bool advance(double time, double length) {
        if (!in(Phase::running, "a step")) {
            return false;
        }
        const double count = std::round(length / exported::step);
        if (count > most_steps) {
            return fail("the communication step is %.9g: it must be at most %.9g, ten million steps of the controller",
                        length, most_steps * exported::step);
        }
        if (!(count >= 1.0 && std::fabs(length / exported::step - count) < 1e-6)) {
            return fail("the communication step is %.9g: it must be a whole number of %.9g, the step of the controller",
                        length, exported::step);
        }
        if (!(std::fabs(time - now()) < 0.5 * exported::step)) {
            return fail("the communication point is %.9g: the next one is %.9g, and steps follow each other", time,
                        now());
        }
        prepare();
        if (!is_a_plant()) {
            return false;
        }
        warning_[0] = '\0';
        const Inputs inputs = read_inputs();
        reference_.point = inputs.reference;
        Vec2<exported::Number> volts{};
        for (double n = 0.0; n < count; ++n) {
            if constexpr (exported::closed_loop) {
                if (exported::reference_is_input) {
                    answer(state_.loop);
                } else {
                    Loop::advance(state_.loop, coefficients_, draw_);
                }
                if (!bounded(state_.loop.motion)) {
                    return diverged();
                }
                if (state_.loop.step % 256 == 0) {
                    look_at_bounds(setup_.controller, state_.loop.signals.report);
                }
            } else {
                state_.loop.motion = inputs.motion;
                state_.loop.signals =
                    ExportedController::step(state_.loop.controller, coefficients_.controller, state_.loop.motion);
                volts = drive(inputs.motion.position);
                warn(state_.loop.controller);
                ++state_.loop.step;
            }
        }
        if (!answers_inputs) {
            Loop::write(state_.loop, coefficients_, state_.row.data());
            if constexpr (exported::in_volts) {
                state_.row[exported::control] = static_cast<double>(volts.x());
                state_.row[exported::control + 1] = static_cast<double>(volts.y());
            }
        }
        return true;
    }

private:
    static constexpr bool answers_inputs = exported::closed_loop && exported::reference_is_input;

    // The driver's voltages for the force. A controller that filters the motion receives the force that they mean, as
    // in a simulation.
    template <class C = ExportedController>
    Vec2<exported::Number> drive([[maybe_unused]] const Vec2<exported::Number>& position) {
        if constexpr (!exported::in_volts) {
            return {};
        } else {
            using Number = exported::Number;
            using Driver = Converters<Number>;
            const auto number = [](std::size_t place) { return static_cast<Number>(exported::driver[place]); };
            const auto two = [&](std::size_t first) { return Vec2<Number>{number(first), number(first + 1)}; };
            const auto three = [&](std::size_t first) {
                return Sym2<Number>{number(first), number(first + 1), number(first + 2)};
            };
            const typename Driver::Coefficients c{.per_force = three(0),
                                                  .force = three(3),
                                                  .reach = two(6),
                                                  .step = two(8),
                                                  .levels = two(10),
                                                  .per_gap = two(12)};
            const auto driven = Driver::drive(c, state_.loop.signals.force, position);
            if constexpr (exported::knows_rounding) {
                C::acted(state_.loop.controller, coefficients_.controller, driven.force);
            }
            return driven.volts;
        }
    }

    // One step of a loop whose reference is known only now: first the sample, whose values are the outputs, then the
    // motion to the next.
    void answer(typename Loop::State& loop) {
        Loop::run(loop, coefficients_, loop.step + 1, draw_, [&](const auto& at) {
            loop.signals = at.signals;
            Loop::write(loop, coefficients_, state_.row.data());
        });
    }

    // ρ h/δ and the bound estimates, from the time when s was within the layer: they show why a loop diverged. Only for
    // controllers that have them.
    template <class Params, class Report>
    void look_at_bounds([[maybe_unused]] const Params& params, [[maybe_unused]] const Report& report) {
        if constexpr (requires {
                          params.adaptation.adaptive;
                          params.control;
                          report.surface;
                          report.bound;
                      }) {
            const auto number = [](auto a) { return static_cast<double>(a); };
            const auto size = [&](const auto& a) { return number(norm(a)); };
            const SwitchingParams& control = params.control;
            if (!params.adaptation.adaptive || !(size(report.surface) < control.layer_thickness)) {
                return;
            }
            for (std::size_t i = 0; i < bound_.size(); ++i) {
                bound_[i] = number(report.bound[i]);
            }
            const Motion<exported::Number>& motion = state_.loop.motion;
            const double rho = bound_[0] + bound_[1] * size(motion.position) + bound_[2] * size(motion.velocity);
            gain_ = std::min(rho * exported::step / control.layer_thickness, control.switching_limit);
        }
    }
    bool diverged() {
        if (gain_ > 1.0) {
            return fail(
                "the motion diverged after %.9g: the bound estimates had grown to [%.3g, %.3g, %.3g], so that rho "
                "h/delta "
                "was %.3g, and from about 2 on the sampled loop is unstable; controller.switching_limit = 0.5 bounds "
                "them",
                now(), bound_[0], bound_[1], bound_[2], gain_);
        }
        return fail("the motion diverged after %.9g: the step %.9g is too long for these gains and parameters", now(),
                    exported::step);
    }

    // Checks that a call is allowed in the present phase.
    bool in(Phase phase, const char* what) {
        static constexpr const char* names[] = {"before the initialization", "during the initialization",
                                                "between initialization and end", "after the end"};
        return state_.phase == phase || fail("%s can come only %s: this is %s", what, names[static_cast<int>(phase)],
                                             names[static_cast<int>(state_.phase)]);
    }
    bool on_to(Phase phase) {
        state_.phase = phase;
        return true;
    }

    static bool settable(const Variable& v) {
        return v.role == Role::fixed || v.role == Role::tunable || v.role == Role::input;
    }
    static bool allowed(const Variable& v, double value) {
        return v.strict ? v.low < value && value < v.high : v.low <= value && value <= v.high;
    }
    bool sound(const State& state) {
        bool good = state.phase <= Phase::terminated && std::isfinite(state.start_time) && state.loop.step >= 0 &&
                    static_cast<double>(state.loop.step) < longest;
        for (std::size_t i = 0; i < state.values.size(); ++i) {
            const Variable& v = exported::variables[i];
            good = good && (settable(v) ? std::isfinite(state.values[i]) && allowed(v, state.values[i])
                                        : state.values[i] == v.start);
        }
        prepare();
        return good && ExportedController::sound(state.loop.controller, coefficients_.controller);
    }
    static constexpr double longest = 9007199254740992.0;  // steps, 2^53: up to here time has each of them

    double now() const { return state_.start_time + static_cast<double>(state_.loop.step) * exported::step; }

    // Keeps the guard's warning. A controller in the FMU's own loop has no guard.
    template <class Controlled>
    void warn(const Controlled& controller) {
        if constexpr (requires { controller.status; }) {
            warn(controller.status);
        }
    }
    void warn(Status status) {
        const char* const what = status == Status::not_finite     ? "is not finite: the last force is held"
                                 : status == Status::out_of_range ? "is out of range: the last force is held"
                                 : status == Status::implausible
                                     ? "is not a motion of this plant: the last force is held"
                                 : status == Status::lost      ? "is not accepted: the force is feedforward only"
                                 : status == Status::restarted ? "resets the estimates: the controller starts again"
                                                               : nullptr;
        if (what != nullptr) {
            std::snprintf(warning_, sizeof warning_, "the sample at %.9g %s", now(), what);
        }
    }

    // The outputs before the first step, from the parameters as they stand.
    void look_ahead() {
        prepare();
        if constexpr (answers_inputs) {
            state_.loop = {Loop::begin(setup_)};
            reference_.point = read_inputs().reference;
            typename Loop::State ahead = state_.loop;
            return answer(ahead);
        } else if constexpr (exported::closed_loop) {
            state_.loop = Loop::start(setup_, coefficients_, draw_);
        } else {
            state_.loop = {};
            state_.loop.signals.report = ExportedController::report(state_.loop.controller, coefficients_.controller);
        }
        Loop::write(state_.loop, coefficients_, state_.row.data());
    }

    // The coefficients, if a parameter has changed.
    void prepare() {
        if (prepared_) {
            return;
        }
        auto numbers = exported::numbers;
        for (std::size_t i = 0; i < state_.values.size(); ++i) {
            const Variable& v = exported::variables[i];
            if (v.role == Role::fixed || v.role == Role::tunable) {
                // The largest number stands for infinity, which the description of an FMU cannot hold.
                const bool unlimited = state_.values[i] == std::numeric_limits<double>::max();
                numbers[static_cast<std::size_t>(v.place)] = unlimited ? infinity : state_.values[i] / v.scale;
            }
        }
        take_settings(setup_, numbers.data());
        take_kernel(setup_.controller);
        take_sensing(setup_.common, exported::sensing);
        take_terms(setup_.disturbance, exported::terms);
        Loop::take_device(setup_, numbers.data() + setting_count(setup_));
        if (exported::reference_is_input) {
            reference_.step = setup_.common.step;
            reference_.equivalent = equivalent_sine(setup_.common.reference);
            setup_.common.reference.course = &reference_;
        }
        coefficients_ = Loop::prepare(setup_);
        draw_ = Loop::draw(setup_);
        prepared_ = true;
    }

    template <class Params>
    static void take_kernel([[maybe_unused]] Params& params) {
        if constexpr (requires { params.kernel(); }) {
            std::copy(exported::poles.begin(), exported::poles.end(), params.kernel().poles.begin());
            std::copy(exported::weights.begin(), exported::weights.end(), params.kernel().weights.begin());
        }
    }

    // The rule of a scenario: D has no negative eigenvalue, K none that is not positive, rounding aside.
    bool is_a_plant() {
        if constexpr (exported::closed_loop) {
            const auto stiffness = matrix("plant.stiffness"), deviation = matrix("plant.stiffness_deviation");
            return definite("plant.damping", matrix("plant.damping"), "semidefinite") &&
                   definite("plant.stiffness", stiffness, "definite") &&
                   definite("plant.stiffness plus plant.stiffness_deviation", stiffness + deviation, "definite");
        }
        return true;
    }
    Sym2<double> matrix(const char* name) const {
        std::array<double, 3> entries{};
        for (std::size_t i = 0; i < state_.values.size(); ++i) {
            for (std::size_t k = 0; k < entries.size(); ++k) {
                static constexpr const char* ends[] = {".xx", ".xy", ".yy"};
                const char* const own = exported::variables[i].name;
                const std::size_t length = std::strlen(name);
                if (std::strncmp(own, name, length) == 0 && std::strcmp(own + length, ends[k]) == 0) {
                    entries[k] = state_.values[i];
                }
            }
        }
        return {entries[0], entries[1], entries[2]};
    }
    bool definite(const char* name, const Sym2<double>& a, const char* rule) {
        // Relative to the largest entry, so that no square overflows.
        const double largest = maximum(maximum(absolute(a.xx()), absolute(a.yy())), absolute(a.xy()));
        const double unit = largest > 0.0 ? largest : 1.0;
        const double xx = a.xx() / unit, xy = a.xy() / unit, yy = a.yy() / unit, half = 0.5 * (xx - yy);
        const double least = 0.5 * (xx + yy) - square_root(half * half + xy * xy), rounding = 1e-12;
        return (rule[0] == 's' ? least >= -rounding : least > rounding) ||
               fail("%s is [%.9g, %.9g, %.9g]: it must be positive %s", name, a.xx(), a.xy(), a.yy(), rule);
    }

    struct Inputs {
        Motion<exported::Number> motion{};
        ReferencePoint<double> reference{};
    };
    Inputs read_inputs() const {
        std::array<double, 10> a{};
        for (std::size_t i = 0; i < state_.values.size(); ++i) {
            const Variable& v = exported::variables[i];
            if (v.role == Role::input) {
                a[static_cast<std::size_t>(v.place)] = state_.values[i] / v.scale;
            }
        }
        const auto number = [](double value) { return static_cast<exported::Number>(value); };
        return {.motion = {.position = {number(a[0]), number(a[1])}, .velocity = {number(a[2]), number(a[3])}},
                .reference = {.position = {a[4], a[5]}, .velocity = {a[6], a[7]}, .acceleration = {a[8], a[9]}}};
    }

    bool known(std::size_t reference, bool integer) {
        if (reference >= state_.values.size()) {
            return fail("%.0f is not a value reference", static_cast<double>(reference));
        }
        const Variable& v = exported::variables[reference];
        return v.integer == integer || fail("%s is %s integer", v.name, v.integer ? "an" : "no");
    }
    bool outside(const Variable& v, double value) {
        const char* const is = "%s is %.9g: it must ";
        char format[80];
        const auto say = [&](const char* rule) { std::snprintf(format, sizeof format, "%s%s", is, rule); };
        if (v.low == -infinity) {
            say(v.strict ? "be less than %.9g" : "be at most %.9g");
            return fail(format, v.name, value, v.high);
        }
        if (v.high == infinity) {
            say(v.strict ? "be greater than %.9g" : "be at least %.9g");
            return fail(format, v.name, value, v.low);
        }
        say(v.strict ? "lie strictly between %.9g and %.9g" : "lie between %.9g and %.9g");
        return fail(format, v.name, value, v.low, v.high);
    }
    template <class... Values>
    bool fail(const char* format, Values... values) {
        if constexpr (sizeof...(Values) == 0) {
            std::snprintf(problem_, sizeof problem_, "%s", format);
        } else {
            std::snprintf(problem_, sizeof problem_, format, values...);
        }
        return false;
    }

    State state_{};
    bool prepared_ = false;  // the members below are up to date with state_.values
    InputReference reference_{};
    Loop::RunSetup setup_{};
    typename Loop::Coefficients coefficients_{};
    Loop::Draw draw_ = Loop::draw(setup_);
    std::array<double, 3> bound_{};
    double gain_ = 0.0;
    char problem_[300] = "", warning_[120] = "";
};

// malloc aligns for numbers, not for the registers of several that the exponentials are kept in.
template <class T, class... Arguments>
T* make(const Arguments&... arguments) {
    constexpr std::size_t alignment = alignof(T);
    static_assert(alignment < 256);
    auto* const block = static_cast<unsigned char*>(std::calloc(1, sizeof(T) + alignment));
    if (block == nullptr) {
        return nullptr;
    }
    const std::size_t shift = alignment - reinterpret_cast<std::uintptr_t>(block) % alignment;
    block[shift - 1] = static_cast<unsigned char>(shift);
    return new (block + shift) T(arguments...);
}
template <class T>
void destroy(T* made) {
    if (made != nullptr) {
        auto* const at = reinterpret_cast<unsigned char*>(made);
        std::free(at - at[-1]);
    }
}

}  // namespace fracgyro
