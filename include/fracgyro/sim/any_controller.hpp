// A controller of any type, behind one table of functions. All code that is neither timed nor shipped uses it: runs on
// non-ideal devices, loops in parts, Python's Controller, users' controllers, the browser. Timed or shipped code uses
// the type itself (with_controller).
#pragma once

#include "fracgyro/core/saved.hpp"
#include "fracgyro/hardware/pickoffs.hpp"
#include "fracgyro/sim/cpu_dispatch.hpp"
#include "fracgyro/sim/metrics.hpp"

#include <cstring>
#include <memory>
#include <new>
#include <span>
#include <vector>

namespace fracgyro {

template <Scalar T>
class AnyController {
public:
    virtual ~AnyController() = default;

    // Functions of a Controller (controller.hpp). The report of the step is kept until it is requested.
    virtual Signals<T, EmptyReport> step(const Motion<T>& measured, const Sample<T>* missing) = 0;
    // The force that the last step requested acts as this one.
    virtual void acted(const Vec2<T>&) {}
    virtual void start_over(bool keep_estimates) = 0;
    virtual std::uint64_t steps() const = 0;
    virtual bool needs_velocity() const { return true; }
    // True if a filter between the sensors and the controller would be useful (motion_filter.hpp).
    virtual bool takes_filter() const { return true; }
    // Sets other parameters, of the same type, from the coming step on.
    virtual void set(const ControllerParams& params, const Common& common) = 0;

    // Numbers reported for the last step, valid until the next call.
    virtual std::span<const double> report() = 0;
    virtual CommonReport common_report() = 0;
    virtual double rate() = 0;
    virtual bool estimates_rate() const = 0;
    // Numbers that are reported between steps.
    virtual std::vector<double> report_between_steps() const = 0;
    virtual CommonReport common_report_between_steps() const = 0;

    // The state as bytes, without a checksum.
    virtual std::size_t state_size() const = 0;
    virtual void save(unsigned char* bytes) const = 0;
    // Returns true if the bytes are a possible state after `steps` steps; otherwise the state stays unchanged.
    virtual bool restore(const unsigned char* bytes, std::uint64_t steps) = 0;
    // Number of steps of a state, for callers that do not know it.
    virtual std::uint64_t steps_of(const unsigned char* bytes) const = 0;
};

// The initial state, with zeros between its members: equal states are equal bytes.
template <class State>
void clear(State& state) {
    static_assert(std::is_trivially_copyable_v<State>);
    std::memset(static_cast<void*>(&state), 0, sizeof state);
    new (&state) State{};
}

// A controller of one type.
template <Controller C>
class ControllerOf final : public AnyController<typename C::Value> {
    using T = typename C::Value;
    using State = typename C::State;

public:
    ControllerOf(const ControllerParams& params, const Common& common) {
        clear(state_);
        set(params, common);
    }

    Signals<T, EmptyReport> step(const Motion<T>& measured, const Sample<T>* missing) override {
        if constexpr (has_copies<C>) {
            return stepped_here(measured, missing);
        } else {
            return stepped(measured, missing);
        }
    }
    void acted(const Vec2<T>& force) override {
        if constexpr (KnowsForce<C>) {
            C::acted(state_, coefficients_, force);
        }
    }
    void start_over(bool keep_estimates) override { C::start_over(state_, keep_estimates); }
    std::uint64_t steps() const override { return C::steps(state_); }
    bool needs_velocity() const override { return measures_velocity<C>; }
    bool takes_filter() const override { return fracgyro::takes_filter<C>; }
    void set(const ControllerParams& params, const Common& common) override {
        coefficients_ = prepare<C>(params, common);
    }

    std::span<const double> report() override {
        double* next = numbers_.data();
        for_each_number(report_, [&](const T& number) { *next++ = static_cast<double>(number); });
        return numbers_;
    }
    CommonReport common_report() override { return CommonReport::of(report_, to_double); }
    CommonReport common_report_between_steps() const override {
        return CommonReport::of(C::report(state_, coefficients_), to_double);
    }
    double rate() override {
        if constexpr (SensesRate<C>) {
            return static_cast<double>(report_.rate);
        } else {
            return CommonReport::nan;
        }
    }
    bool estimates_rate() const override { return SensesRate<C>; }
    std::vector<double> report_between_steps() const override {
        std::vector<double> numbers;
        for_each_number<Reported::between_steps>(
            C::report(state_, coefficients_), [&](const T& number) { numbers.push_back(static_cast<double>(number)); });
        return numbers;
    }

    std::size_t state_size() const override { return sizeof(State); }
    void save(unsigned char* bytes) const override { copy_bytes(bytes, &state_, sizeof(State)); }
    bool restore(const unsigned char* bytes, std::uint64_t steps) override {
        const auto read = std::make_unique<State>();
        copy_bytes(read.get(), bytes, sizeof(State));
        const bool can = C::sound(*read, coefficients_) && C::steps(*read) == steps;
        if (can) {
            state_ = *read;
        }
        return can;
    }
    std::uint64_t steps_of(const unsigned char* bytes) const override {
        const auto read = std::make_unique<State>();
        copy_bytes(read.get(), bytes, sizeof(State));
        return C::steps(*read);
    }

private:
    Signals<T, EmptyReport> stepped(const Motion<T>& measured, const Sample<T>* missing) {
        const auto s = C::step(state_, coefficients_, measured, missing);
        report_ = s.report;
        return {.reference = s.reference, .error = s.error, .force = s.force, .excess = s.excess};
    }
    // The copy for this processor.
    FRACGYRO_FOR_EACH_PROCESSOR Signals<T, EmptyReport> stepped_here(const Motion<T>& measured,
                                                                     const Sample<T>* missing) {
        return stepped(measured, missing);
    }
    static double to_double(const T& number) { return static_cast<double>(number); }

    typename C::Coefficients coefficients_{};
    State state_;
    typename C::Report report_{};
    std::array<double, width_of<typename C::Report>()> numbers_{};
};

// Another controller with a part around it: filter, trigger, disturbance observer. The state of the part comes before
// that of the controller.
template <Scalar T, class Part>
class AroundController final : public AnyController<T> {
    using State = typename Part::State;
    static constexpr bool filters = requires { Part::measures_velocity; };

public:
    AroundController(AnyController<T>& controller, const Common& common, std::unique_ptr<AnyController<T>> owned)
        : controller_(controller), owned_(std::move(owned)), coefficients_(Part::prepare(common)) {
        clear(state_);
    }

    Signals<T, EmptyReport> step(const Motion<T>& measured, const Sample<T>* missing) override {
        const auto signals = Part::step(state_, coefficients_, measured, missing != nullptr,
                                        [&](const Motion<T>& seen) { return controller_.step(seen, missing); });
        if (!filters && missing == nullptr) {  // without a sample the guard holds the last force
            controller_.acted(signals.force);
        }
        return signals;
    }
    void acted(const Vec2<T>& force) override {
        if constexpr (requires { Part::acted(state_, coefficients_, force); }) {
            Part::acted(state_, coefficients_, force);
        }
        controller_.acted(force);
    }
    void start_over(bool keep_estimates) override {
        controller_.start_over(keep_estimates);
        Part::start_over(state_, keep_estimates);
    }
    std::uint64_t steps() const override { return controller_.steps(); }
    bool needs_velocity() const override {
        if constexpr (filters) {
            return Part::measures_velocity;
        } else {
            return fracgyro::needs_velocity<Part> || controller_.needs_velocity();
        }
    }
    bool takes_filter() const override { return !filters && controller_.takes_filter(); }
    void set(const ControllerParams& params, const Common& common) override {
        controller_.set(params, common);
        coefficients_ = Part::prepare(common);
    }

    std::span<const double> report() override { return controller_.report(); }
    CommonReport common_report() override { return controller_.common_report(); }
    double rate() override { return controller_.rate(); }
    bool estimates_rate() const override { return controller_.estimates_rate(); }
    std::vector<double> report_between_steps() const override { return controller_.report_between_steps(); }
    CommonReport common_report_between_steps() const override { return controller_.common_report_between_steps(); }

    std::size_t state_size() const override { return sizeof(State) + controller_.state_size(); }
    void save(unsigned char* bytes) const override {
        copy_bytes(bytes, &state_, sizeof(State));
        controller_.save(bytes + sizeof(State));
    }
    bool restore(const unsigned char* bytes, std::uint64_t steps) override {
        State read;
        copy_bytes(&read, bytes, sizeof(State));
        const bool can = Part::sound(read) && controller_.restore(bytes + sizeof(State), steps);
        if (can) {
            state_ = read;
        }
        return can;
    }
    std::uint64_t steps_of(const unsigned char* bytes) const override {
        return controller_.steps_of(bytes + sizeof(State));
    }

private:
    AnyController<T>& controller_;
    std::unique_ptr<AnyController<T>> owned_;
    typename Part::Coefficients coefficients_{};
    State state_;
};

// The controller with disturbance observer, event trigger and filter around it; nullptr if it has none of them.
template <Scalar T>
std::unique_ptr<AnyController<T>> behind_wrappers(AnyController<T>& controller, const Common& common,
                                                  std::unique_ptr<AnyController<T>> owned = nullptr) {
    std::unique_ptr<AnyController<T>> made;
    AnyController<T>* inner = &controller;
    const auto put = [&]<class Part>() {
        made = std::make_unique<AroundController<T, Part>>(*inner, common,
                                                           made == nullptr ? std::move(owned) : std::move(made));
        inner = made.get();
    };
    if (common.compensation_bandwidth > 0.0) {
        put.template operator()<Compensation<T>>();
    }
    if (common.trigger.on()) {
        put.template operator()<Trigger<T>>();
    }
    if (common.filter.on() && controller.takes_filter()) {
        if (common.observer_bandwidth > 0.0) {
            put.template operator()<MotionFilter<T, false>>();
        } else {
            put.template operator()<MotionFilter<T, true>>();
        }
    }
    return made;
}

// The controller with these parameters, and all around it; for a device without velocity sensors, one that needs none
// or that will be put behind an observer (with_erased).
template <Scalar T>
std::unique_ptr<AnyController<T>> make_controller(const ControllerParams& params, const Common& common) {
    std::unique_ptr<AnyController<T>> made;
    with_controller<T>(params, [&]<class C>() {
        using WithoutVelocity = typename FromPositions<C>::Type;
        if constexpr (!std::is_same_v<WithoutVelocity, Observing<C>>) {
            if (common.observer_bandwidth > 0.0) {
                made = std::make_unique<ControllerOf<WithoutVelocity>>(params, common);
                return;
            }
        }
        made = std::make_unique<ControllerOf<C>>(params, common);
    });
    if (common.compensation_bandwidth > 0.0 || common.trigger.on() || (common.filter.on() && made->takes_filter())) {
        AnyController<T>& plain = *made;
        return behind_wrappers<T>(plain, common, std::move(made));
    }
    return made;
}

// Any controller as a Controller, for the templates of observer, guard and loop. Its state is its own; this one only
// holds a pointer to it, which is not saved.
template <Scalar T>
struct ErasedParams {
    AnyController<T>* controller = nullptr;
    static constexpr Fields<> fields() { return {}; }
};
template <Scalar T, bool velocity>
struct Erased {
    using Value = T;
    using Params = ErasedParams<T>;
    using Report = EmptyReport;
    static constexpr bool measures_velocity = velocity;
    using Coefficients = Params;
    struct State {
        AnyController<T>* controller = nullptr;  // since the first step
    };

    static Coefficients prepare(const Params& p, const Common&) { return p; }
    static Report report(const State&, const Coefficients&) { return {}; }
    static bool sound(const State&, const Coefficients&) { return true; }
    static std::uint64_t steps(const State& state) {
        return state.controller == nullptr ? 0 : state.controller->steps();
    }
    static void start_over(State& state, bool keep_estimates) {
        if (state.controller != nullptr) {
            state.controller->start_over(keep_estimates);
        }
    }
    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        state.controller = c.controller;
        return c.controller->step(measured, missing);
    }
    static void acted(State&, const Coefficients& c, const Vec2<T>& force) { c.controller->acted(force); }
};

// Calls visit.template operator()<C>() with the type that represents this controller: behind an observer if the device
// senses no velocity and the controller needs it, and behind the correction of measurements.
template <Scalar T, class Visit>
void with_erased(const AnyController<T>& controller, const Common& common, Visit&& visit) {
    if (!controller.needs_velocity()) {
        visit.template operator()<Corrected<Erased<T, false>>>();
    } else if (common.observer_bandwidth > 0.0) {
        visit.template operator()<Corrected<Observing<Erased<T, true>>>>();
    } else {
        visit.template operator()<Corrected<Erased<T, true>>>();
    }
}

// A state that contains an Erased one, with the state behind it: a checksum, both states.
template <class Outer, Scalar T>
struct SavedErased {
    static_assert(std::is_trivially_copyable_v<Outer>);
    static constexpr std::size_t header = sizeof(std::uint32_t), inner_at = header + sizeof(Outer);

    static std::size_t size(const AnyController<T>& controller) { return inner_at + controller.state_size(); }

    static void write(const Outer& outer, const AnyController<T>& controller, unsigned char* bytes) {
        const auto kept = std::make_unique<Outer>(outer);
        erased(*kept).controller = nullptr;
        copy_bytes(bytes + header, kept.get(), sizeof(Outer));
        controller.save(bytes + inner_at);
        const std::uint32_t sum = checksum(bytes + header, size(controller) - header);
        copy_bytes(bytes, &sum, sizeof sum);
    }
    // Returns true if the bytes are as they were written, and `sound(outer, steps of the controller)`; otherwise both
    // stay unchanged.
    template <class Sound>
    static bool read(const unsigned char* bytes, std::size_t count, Outer& outer, AnyController<T>& controller,
                     Sound&& sound) {
        std::uint32_t sum = 0;
        if (count != size(controller)) {
            return false;
        }
        copy_bytes(&sum, bytes, sizeof sum);
        if (sum != checksum(bytes + header, count - header)) {
            return false;
        }
        const auto read = std::make_unique<Outer>();
        copy_bytes(read.get(), bytes + header, sizeof(Outer));
        erased(*read).controller = &controller;
        const std::uint64_t steps = controller.steps_of(bytes + inner_at);
        if (!sound(*read, steps) || !controller.restore(bytes + inner_at, steps)) {
            return false;
        }
        outer = *read;
        return true;
    }

private:
    template <class State>
    static auto& erased(State& state) {
        if constexpr (requires { state.controller.controller; }) {
            return erased(state.controller);
        } else {
            return state;
        }
    }
};

}  // namespace fracgyro
