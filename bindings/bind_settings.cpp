#include "arrays.hpp"
#include "bindings.hpp"

#include "fracgyro/settings.hpp"

#include <nanobind/stl/pair.h>
#include <nanobind/stl/vector.h>

namespace fracgyro::bindings {

void bind_settings(nb::module_& m) {
    m.def(
        "setup_settings",
        [](const Setup& setup) {
            nb::dict settings;
            for_each_setting(setup, [&](std::string_view name, const auto& number) {
                settings[nb::str(name.data(), name.size())] = static_cast<double>(number);
            });
            return settings;
        },
        nb::arg("setup"), "The numbers of a run by name, in order; see settings.hpp.");
    m.def(
        "setup_modes",
        [](const Setup& setup) {
            const Modes& modes = setup.controller.surface.modes;
            const auto used = [&](const auto& all) {
                return std::vector<double>(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(modes.count));
            };
            return std::pair(used(modes.rates), used(modes.weights));
        },
        nb::arg("setup"), "The modes' rates and weights.");
}

}  // namespace fracgyro::bindings
