#include "arrays.hpp"
#include "bindings.hpp"
#include "numbers.hpp"

#include "fracgyro/control/guard.hpp"
#include "fracgyro/sim/recorder.hpp"
#include "fracgyro/sim/settings.hpp"
#include "fracgyro/plant/units.hpp"

#include <nanobind/stl/string.h>
#include <nanobind/stl/string_view.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

namespace fracgyro::bindings {

namespace {

// A controller of whichever kind and precision, one sample at a time.
class AnyController {
public:
    virtual ~AnyController() = default;
    virtual Vec2<double> step(const Motion<double>& motion) = 0;  // the force
    virtual std::vector<double> report() const = 0;
    virtual std::uint64_t steps() const = 0;
    virtual Status status() const = 0;
    virtual nb::bytes state() const = 0;
    virtual void restore(const nb::bytes& saved) = 0;
};

template <class Controller>
class Holder final : public AnyController {
    using T = typename Controller::Value;
    using State = typename Controller::State;

public:
    explicit Holder(const Setup& s) : held_(new Held{.coefficients = prepare<Controller>(s.controller, s.common)}) {}

    Vec2<double> step(const Motion<double>& motion) override {
        const auto number = [](const Vec2<double>& a) { return Vec2<T>{T(a.x()), T(a.y())}; };
        const Vec2<T> force =
            Controller::step(held_->state, held_->coefficients,
                             {.position = number(motion.position), .velocity = number(motion.velocity)})
                .force;
        return {static_cast<double>(force.x()), static_cast<double>(force.y())};
    }
    std::vector<double> report() const override {
        std::vector<double> numbers;
        for_each_number<Reported::between_steps>(
            Controller::report(held_->state, held_->coefficients),
            [&](const T& number) { numbers.push_back(static_cast<double>(number)); });
        return numbers;
    }
    std::uint64_t steps() const override { return Controller::steps(held_->state); }
    Status status() const override { return held_->state.status; }
    nb::bytes state() const override {
        std::array<unsigned char, Saved<State>::size> bytes{};
        Saved<State>::write(held_->state, bytes.data());
        return nb::bytes(bytes.data(), bytes.size());
    }
    void restore(const nb::bytes& saved) override {
        State read;
        const auto* bytes = static_cast<const unsigned char*>(saved.data());
        if (!Saved<State>::read(bytes, saved.size(), read) || !Controller::sound(read, held_->coefficients)) {
            throw nb::value_error("state is damaged: it is not as it was saved");
        }
        held_->state = read;
    }

private:
    struct Held {
        typename Controller::Coefficients coefficients;
        State state{};
    };
    // Apart: its alignment is that of wide registers, and Python frees a controller as one of any kind.
    std::unique_ptr<Held> held_;
};

std::unique_ptr<AnyController> make_controller(const Setup& s, bool single) {
    std::unique_ptr<AnyController> made;
    const auto make = [&]<class Controller>() { made = std::make_unique<Holder<Guard<Controller>>>(s); };
    const bool observed = s.common.observer_bandwidth > 0.0;
    if (single) {
        with_controller<float>(s.controller, observed, make);
    } else {
        with_controller<double>(s.controller, observed, make);
    }
    return made;
}

// The force, in the units of the run, or None where an argument is not a plain finite number or the time is not that of
// the next step, and nothing happened. `velocity`: None where it is not measured.
nb::object checked_step(AnyController& self, double step, const Units& units, nb::handle time, nb::handle position,
                        nb::handle velocity) {
    double t = 0.0;
    Vec2<double> q, v;
    if (!take(time.ptr(), t) || !take(position.ptr(), q) || !(velocity.is_none() || take(velocity.ptr(), v)) ||
        !(absolute(t / units.time - static_cast<double>(self.steps()) * step) < 0.5 * step)) {
        return nb::none();
    }
    const Vec2<double> force = self.step({.position = {q.x() / units.length, q.y() / units.length},
                                          .velocity = {v.x() / units.velocity, v.y() / units.velocity}});
    return new_vector({force.x() * units.force, force.y() * units.force});
}

nb::str text(std::string_view a) { return nb::str(a.data(), a.size()); }

// By the places of Settable.
constexpr std::string_view settable[] = {"any_time", "at_start", "beforehand", "never"};

// What a kind's numbers are, in the order of settings.hpp.
nb::list fields_of_kind(std::size_t kind) {
    nb::list all;
    Setup setup{.controller = params_of_kind(kind)};
    for_each_setting(setup, [&](std::string_view table, const auto& field, std::string_view part, const auto& number) {
        nb::dict one;
        one["table"] = text(table);
        one["field"] = text(field.name);
        one["part"] = text(part);
        one["unit"] = text(field.unit);
        one["meaning"] = text(field.meaning);
        one["low"] = field.range.low;
        one["high"] = field.range.high;
        one["strict"] = field.range.strict;
        one["infinite"] = field.range.infinite;
        one["whole"] = field.range.whole;
        one["settable"] = text(settable[static_cast<std::size_t>(field.settable)]);
        one["default"] = static_cast<double>(number);
        nb::list choices;
        for (const std::string_view choice : field.choices) {
            choices.append(text(choice));
        }
        one["choices"] = nb::tuple(choices);
        all.append(one);
    });
    return all;
}

template <class... Types>
void report_of_each(List<Types...>, nb::list& all) {
    const auto append = [&]<class C>(std::type_identity<C>) {
        nb::list channels;
        for_each_reported<typename C::Report>([&](const Channel& c) { channels.append(described(c)); });
        all.append(nb::tuple(channels));
    };
    (append(std::type_identity<Types>{}), ...);
}

}  // namespace

nb::tuple described(const Channel& c) {
    return nb::make_tuple(text(c.name), c.width, text(c.unit), text(c.meaning), text(c.part), c.momentary);
}

void bind_controller(nb::module_& m) {
    nb::enum_<Status>(m, "Status")
        .value("ok", Status::ok)
        .value("saturated", Status::saturated)
        .value("not_finite", Status::not_finite)
        .value("out_of_range", Status::out_of_range)
        .value("restarted", Status::restarted)
        .value("implausible", Status::implausible)
        .value("lost", Status::lost);

    nb::class_<AnyController>(m, "Controller")
        .def(nb::new_(&make_controller), nb::arg("setup"), nb::arg("single"))
        .def(
            "step",
            [](AnyController& self, const Array2& position, const Array2& velocity) {
                return to_array(self.step({.position = to_vec2(position), .velocity = to_vec2(velocity)}));
            },
            nb::arg("position"), nb::arg("velocity"))
        .def("checked_step", &checked_step, nb::arg("step"), nb::arg("units"), nb::arg("time").none(),
             nb::arg("position").none(), nb::arg("velocity").none())
        .def_prop_ro("report", &AnyController::report)
        .def_prop_ro("steps", &AnyController::steps)
        .def_prop_ro("status", &AnyController::status)
        .def_prop_rw("state", &AnyController::state, &AnyController::restore);

    m.attr("controller_kinds") = nb::cast(controller_kinds);
    m.attr("controller_meanings") = nb::cast(controller_meanings);
    m.def("fields_of_kind", &fields_of_kind, nb::arg("kind"), "What each number of a run of this kind is, in order.");
    m.def(
        "reports_of_kind",
        [](std::size_t kind) {
            nb::list all;
            with_params(params_of_kind(kind), [&]<class Family>(const auto&, Family) {
                report_of_each(typename Family::template Types<double>{}, all);
            });
            return all;
        },
        nb::arg("kind"), "The channels that each of its types reports, as `chosen_type` counts them.");
}

}  // namespace fracgyro::bindings
