#include "arrays.hpp"
#include "bindings.hpp"
#include "controllers.hpp"
#include "numbers.hpp"

#include "fracgyro/plant/units.hpp"
#include "fracgyro/sim/any_plant.hpp"

#include <nanobind/stl/string.h>
#include <nanobind/stl/string_view.h>
#include <nanobind/stl/vector.h>

namespace fracgyro::bindings {

namespace {

// A controller of any kind and precision, one sample at a time. Python frees it as an object of this type.
struct Stepped {
    std::unique_ptr<GuardedController> held;
    Shared<CourseWithLists> course;  // to which it points

    GuardedController* operator->() const { return held.get(); }
    nb::bytes state() const {
        std::vector<unsigned char> bytes(held->saved_size());
        held->save(bytes.data());
        return nb::bytes(bytes.data(), bytes.size());
    }
    void restore(const nb::bytes& saved) {
        if (!held->restore(static_cast<const unsigned char*>(saved.data()), saved.size())) {
            throw nb::value_error("state is damaged: it is not as it was saved");
        }
    }
};

// The force, in the units of the run, or None without any change if an argument is not a plain finite number or the
// time is not the time of the next step. `velocity`: None if it is not measured.
nb::object checked_step(const Stepped& self, double step, const Units& units, nb::handle time, nb::handle position,
                        nb::handle velocity) {
    double t = 0.0;
    Vec2<double> q, v;
    if (!take(time.ptr(), t) || !take(position.ptr(), q) || !(velocity.is_none() || take(velocity.ptr(), v)) ||
        !(absolute(t / units.time - static_cast<double>(self->steps()) * step) < 0.5 * step)) {
        return nb::none();
    }
    const Vec2<double> force = self->step({.position = {q.x() / units.length, q.y() / units.length},
                                           .velocity = {v.x() / units.velocity, v.y() / units.velocity}});
    return new_vector({force.x() * units.force, force.y() * units.force});
}

nb::str text(std::string_view a) { return nb::str(a.data(), a.size()); }

// Names in the order of Settable.
constexpr std::string_view settable[] = {"any_time", "at_start", "beforehand", "never"};

// Appends the description of a number of a run.
struct Describe {
    nb::list& all;

    template <class Field, class Number>
    void operator()(std::string_view table, const Field& field, std::string_view part, const Number& number) const {
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
        nb::list kinds;
        for (std::size_t k = 0; k < field.kinds.size(); ++k) {
            if ((field.mask >> k & 1U) != 0) {
                kinds.append(text(field.kinds[k]));
            }
        }
        one["kinds"] = nb::tuple(kinds);
        all.append(one);
    }
};

// Both in the order of settings.hpp.
nb::list fields_of_kind(std::size_t kind) {
    nb::list all;
    const Setup setup{.controller = params_of_kind(kind)};
    for_each_setting(setup, Describe{all});
    return all;
}
nb::list device_fields() {
    nb::list all;
    const DeviceSetup setup;
    for_each_device_setting(setup, Describe{all});
    return all;
}
nb::list term_fields() {
    nb::list all;
    const DisturbanceTerm term;
    for_each_setting_of("disturbance", term, Describe{all});
    return all;
}
nb::list electronics_fields() {
    nb::list all;
    const ElectronicsParams params;
    for_each_setting_of("electronics", params, Describe{all});
    return all;
}
nb::list trim_fields() {
    nb::list all;
    const TrimSettings settings;
    for_each_setting_of("trim", settings, Describe{all});
    return all;
}
nb::list electrode_fields() {
    nb::list all;
    const ElectrodeParams params;
    for_each_setting_of("electrodes", params, Describe{all});
    return all;
}
nb::list fields_of_plant(std::size_t kind) {
    nb::list all;
    for_each_own_number(kind, Describe{all});
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

    nb::class_<Stepped>(m, "Controller")
        .def(
            "__init__",
            [](Stepped* made, const Setup& setup, bool single) {
                new (made) Stepped{make_guarded(setup, single), setup.course};
            },
            nb::arg("setup"), nb::arg("single"))
        .def(
            "step",
            [](const Stepped& self, const Array2& position, const Array2& velocity) {
                return to_array(self->step({.position = to_vec2(position), .velocity = to_vec2(velocity)}));
            },
            nb::arg("position"), nb::arg("velocity"))
        .def("checked_step", &checked_step, nb::arg("step"), nb::arg("units"), nb::arg("time").none(),
             nb::arg("position").none(), nb::arg("velocity").none())
        .def(
            "acted", [](const Stepped& self, const Array2& force) { self->acted(to_vec2(force)); }, nb::arg("force"))
        .def_prop_ro("report", [](const Stepped& self) { return self->report(); })
        .def_prop_ro("steps", [](const Stepped& self) { return self->steps(); })
        .def_prop_ro("status", [](const Stepped& self) { return self->status(); })
        .def_prop_rw("state", &Stepped::state, &Stepped::restore);

    m.attr("controller_kinds") = nb::cast(controller_kinds);
    m.attr("controller_meanings") = nb::cast(controller_meanings);
    std::vector<std::string_view> driving, driving_both;
    [&]<class... Entries>(std::type_identity<std::tuple<Entries...>>) {
        ((drives_a_sine<Entries> ? driving.push_back(Entries::kind) : void()), ...);
        ((drives_sines<Entries> ? driving_both.push_back(Entries::kind) : void()), ...);
    }(std::type_identity<Registry>{});
    m.attr("sine_drives") = nb::cast(driving);
    m.attr("two_sine_drives") = nb::cast(driving_both);
    m.def("fields_of_kind", &fields_of_kind, nb::arg("kind"),
          "Descriptions of the numbers of a run of this kind, in order.");
    m.def("device_fields", &device_fields, "Descriptions of the numbers of a moving rate and a real device, in order.");
    m.def("term_fields", &term_fields, "Descriptions of the numbers of a term of the disturbance, in order.");
    m.def("electronics_fields", &electronics_fields, "Descriptions of the numbers of amplifiers and timing, in order.");
    m.def("electrode_fields", &electrode_fields, "Descriptions of the numbers of an electrode, in order.");
    m.def("trim_fields", &trim_fields, "Descriptions of the numbers of a trim, in order.");
    m.def("fields_of_plant", &fields_of_plant, nb::arg("kind"),
          "Descriptions of the numbers that plants of this kind have of their own, in order.");
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
    m.def(
        "filtered_types_of_kind",
        [](std::size_t kind) {
            std::vector<bool> takes;
            with_params(params_of_kind(kind), [&]<class Family>(const auto&, Family) {
                [&]<class... Types>(List<Types...>) {
                    (takes.push_back(takes_filter<Types>), ...);
                }(typename Family::template Types<double>{});
            });
            return takes;
        },
        nb::arg("kind"), "True for each of its types that takes a filter of the measured motions.");
    m.def(
        "force_aware_types_of_kind",
        [](std::size_t kind) {
            std::vector<bool> aware;
            with_params(params_of_kind(kind), [&]<class Family>(const auto&, Family) {
                [&]<class... Types>(List<Types...>) {
                    (aware.push_back(KnowsForce<Types>), ...);
                }(typename Family::template Types<double>{});
            });
            return aware;
        },
        nb::arg("kind"), "True for each of its types that takes the force that the code of a converter means.");
}

}  // namespace fracgyro::bindings
