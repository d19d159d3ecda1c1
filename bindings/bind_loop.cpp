#include "arrays.hpp"
#include "bindings.hpp"
#include "run_setup.hpp"

#include "fracgyro/control/table_spline.hpp"
#include "fracgyro/sim/settings.hpp"
#include "fracgyro/sim/user_plant.hpp"

#include <nanobind/stl/array.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/vector.h>

namespace fracgyro::bindings {

// Times and values.
using Points = std::pair<std::vector<double>, std::vector<double>>;

namespace {

// Terms: amplitude, frequency and phase, each x, y. Rows: time, x, y.
ReferenceLists reference_lists(const std::vector<std::array<double, 6>>& terms,
                               const std::vector<std::array<double, 3>>& rows) {
    ReferenceLists lists;
    for (const auto& [ax, ay, fx, fy, px, py] : terms) {
        lists.terms.push_back({{ax, ay}, {fx, fy}, {px, py}});
    }
    for (const auto& [time, x, y] : rows) {
        lists.rows.push_back({.time = time, .position = {x, y}});
    }
    differentiate(lists.rows);
    return lists;
}

// Electronics, and each electrode, as numbers in the order of their fields.
VoltsParams volts_from(const std::vector<double>& electronics, const std::vector<std::vector<double>>& electrodes) {
    VoltsParams made{.present = true};
    const double* next = electronics.data();
    for_each_setting_of("electronics", made.electronics, detail::TakeFrom{next});
    for (const std::vector<double>& each : electrodes) {
        const double* own = each.data();
        for_each_setting_of("electrodes", made.electrodes.emplace_back(), detail::TakeFrom{own});
    }
    return made;
}
std::array<double, 3> entries(const Sym2<double>& a) { return {a.xx(), a.xy(), a.yy()}; }

}  // namespace

void bind_loop(nb::module_& m) {
    using Lists = Shared<ReferenceLists>;
    nb::class_<Lists>(m, "ReferenceLists")
        .def(
            "__init__",
            [](Lists* made, const std::vector<std::array<double, 6>>& terms,
               const std::vector<std::array<double, 3>>& rows) { new (made) Lists(reference_lists(terms, rows)); },
            nb::arg("terms"), nb::arg("rows"),
            "Terms of a sum of sines: amplitude, frequency and phase, each x, y. Rows of a table: time, x, y. All "
            "nondimensional.")
        .def_prop_ro("rows", [](const Lists& self) {
            std::vector<std::array<double, 7>> rows;
            for (const TableRow& r : self.get()->rows) {
                rows.push_back({r.time, r.position[0], r.position[1], r.velocity[0], r.velocity[1], r.acceleration[0],
                                r.acceleration[1]});
            }
            return rows;
        });
    m.def(
        "reference",
        [](const Setup& s, std::int64_t count, std::int64_t every) {
            using R = Reference<double>;
            const auto c = R::prepare(s.common.reference, s.common.step);
            R::State state{};
            std::vector<std::array<double, 6>> rows;
            for (std::int64_t n = 0; n < count; ++n) {
                if (c.course != nullptr) {
                    state.steps = static_cast<std::uint64_t>(n * every);
                }
                const auto r = R::update(state, c);
                for (std::int64_t skipped = 1; c.course == nullptr && skipped < every; ++skipped) {
                    R::update(state, c);
                }
                rows.push_back({r.position.x(), r.position.y(), r.velocity.x(), r.velocity.y(), r.acceleration.x(),
                                r.acceleration.y()});
            }
            return rows;
        },
        nb::arg("setup"), nb::arg("count"), nb::arg("every"),
        "Position, velocity and acceleration, each x, y, of the reference at the samples 0, every, …");
    m.def(
        "equivalent_sine",
        [](const Setup& s) {
            const EquivalentSine e = equivalent_sine(s.common.reference);
            return std::array<std::array<double, 2>, 2>{
                {{e.amplitude.x(), e.amplitude.y()}, {e.frequency.x(), e.frequency.y()}}};
        },
        nb::arg("setup"), "Amplitude and frequency, each x, y, of sines with the reference's mean squares.");
    m.def(
        "plant_map",
        [](const Setup& s) {
            const auto columns = Gyroscope<double>::prepare(s.plant, s.common.step).map;
            std::array<std::array<double, 6>, 4> rows{};
            for (std::size_t i = 0; i < 4; ++i) {
                for (std::size_t j = 0; j < 6; ++j) {
                    rows[i][j] = columns[j][i];
                }
            }
            return rows;
        },
        nb::arg("setup"), "Rows x, y, vx, vy after one step; columns x, y, vx, vy, force x, force y before it.");

    m.def(
        "at_bias",
        [](const std::vector<double>& electronics, const std::vector<std::vector<double>>& electrodes,
           const std::array<double, 2>& resonance) {
            const AtBias at = at_bias(volts_from(electronics, electrodes),
                                      {resonance[0] * resonance[0], resonance[1] * resonance[1]});
            return std::vector<std::array<double, 3>>{entries(at.softening),
                                                      entries(at.gain),
                                                      entries(at.charge),
                                                      {at.capacitance.x(), 0.0, at.capacitance.y()},
                                                      {at.noise.x(), 0.0, at.noise.y()}};
        },
        nb::arg("electronics"), nb::arg("electrodes"), nb::arg("resonance"),
        "In SI, each xx, xy, yy: softening in N/m, gain in N/V and charge in C/m as designed, capacitance of the "
        "pick-offs in F, noise of the position in m/sqrt(Hz). `resonance`: of x and y at bias, rad/s.");
    m.def(
        "pull_in_voltage",
        [](const std::vector<double>& electrode) {
            const double* next = electrode.data();
            ElectrodeParams p;
            for_each_setting_of("electrodes", p, detail::TakeFrom{next});
            return pull_in_voltage(p, 1.0);
        },
        nb::arg("electrode"), "Voltage at which plates pull in a spring of 1 N/m.");

    nb::class_<Setup>(m, "Setup")
        .def_prop_ro("kind", [](const Setup& s) { return s.controller.index(); })
        .def_ro("steps", &Setup::steps)
        .def_prop_ro("has_memory", [](const Setup& s) { return has_memory(s.controller); })
        .def_prop_rw(
            "kernel",
            [](const Setup& s) {
                const ExponentialSum* const kernel = kernel_of(s.controller);
                return kernel == nullptr ? ExponentialSum{} : *kernel;
            },
            [](Setup& s, const ExponentialSum& designed) {
                if (ExponentialSum* const kernel = kernel_of(s.controller)) {
                    *kernel = designed;
                }
            })
        .def_prop_rw(
            "sensing", [](const Setup& s) { return sensing_of(s.common); },
            [](Setup& s, const SensingNumbers& numbers) { take_sensing(s.common, numbers); },
            "Parts around the controller, as sensing_of in settings.hpp lists them.")
        .def_prop_rw(
            "seed", [](const Setup& s) { return s.disturbance.seed; },
            [](Setup& s, std::uint64_t seed) { s.disturbance.seed = seed; })
        .def(
            "set_terms", [](Setup& s, const std::vector<double>& numbers) { take_terms(s.disturbance, numbers); },
            nb::arg("numbers"), "The terms of the disturbance, as take_terms in settings.hpp reads them.");
    nb::class_<RunSetup, Setup>(m, "DeviceSetup")
        .def(
            "__init__",
            [](RunSetup* setup, std::size_t kind, const std::vector<double>& settings) {
                if (kind >= controller_kinds.size()) {
                    throw nb::value_error("no controller is of that kind");
                }
                new (setup) RunSetup{};
                setup->controller = params_of_kind(kind);
                if (settings.size() != setting_count(*setup)) {
                    throw nb::value_error("there must be one number for each field of the kind");
                }
                take_settings(*setup, settings.data());
            },
            nb::arg("kind"), nb::arg("settings"), "The kind's place in controller_kinds; numbers in its fields' order.")
        .def(nb::init<const RunSetup&>())
        .def(
            "set_reference",
            [](RunSetup& s, const Lists& lists) {
                s.lists = lists;
                prepare_reference(s);
            },
            nb::arg("lists"))
        .def(
            "set_device",
            [](RunSetup& s, const std::vector<double>& settings, const Points& rate, const Points& temperature,
               std::uint64_t seed) {
                if (settings.size() != device_setting_count()) {
                    throw nb::value_error("there must be one number for each of device_fields");
                }
                take_device_settings(s, settings.data());
                s.rate.table = {rate.first, rate.second};
                s.device.temperature = {temperature.first, temperature.second};
                s.rate.seed = seed;
            },
            nb::arg("settings"), nb::arg("rate"), nb::arg("temperature"), nb::arg("seed"),
            "Numbers of the rate and the device in the order of device_fields; times, in steps, and values of the rate "
            "and of the change of temperature; the seed of the rate.")
        .def(
            "set_transverse", [](RunSetup& s, const std::vector<double>& numbers) { take_transverse(s.rate, numbers); },
            nb::arg("numbers"), "Angular rates about x and y over time, as take_transverse in settings.hpp reads them.")
        .def(
            "set_volts", [](RunSetup& s, const std::vector<double>& numbers) { take_volts(s, numbers); },
            nb::arg("numbers"), "A device in volts, as take_volts in settings.hpp reads it.")
        .def_ro("touched", &RunSetup::touched_last,
                "1 + place of the electrode that the mass touched at the end of the last run, otherwise 0.")
        .def(
            "set_plant",
            [](RunSetup& s, std::size_t kind, const std::vector<double>& values) {
                if (kind >= plant_count || values.size() != own_number_count(kind)) {
                    throw nb::value_error("there must be one number for each of fields_of_plant");
                }
                s.set_model(make_plant(kind, s.plant, s.common.step, values));
            },
            nb::arg("kind"), nb::arg("values"), "Its place in plant_kinds, its own numbers as in fields_of_plant.")
        .def(
            "set_user_plant",
            [](RunSetup& s, std::shared_ptr<UserPlant> plant, const Units& units) {
                plant->begin(units, s);
                s.set_model(std::move(plant));
            },
            nb::arg("plant"), nb::arg("units"));
}

}  // namespace fracgyro::bindings
