#include "arrays.hpp"
#include "bindings.hpp"

#include "fracgyro/sim/settings.hpp"

#include <nanobind/stl/pair.h>
#include <nanobind/stl/vector.h>

namespace fracgyro::bindings {

void bind_settings(nb::module_& m) {
    m.def(
        "setup_settings",
        [](const Setup& setup) {
            std::vector<double> settings;
            for_each_setting(setup, [&](std::string_view, const auto&, std::string_view, const auto& number) {
                settings.push_back(static_cast<double>(number));
            });
            return settings;
        },
        nb::arg("setup"), "The numbers of a run, in the order of fields_of_kind.");
    m.def(
        "setup_kernel",
        [](const Setup& setup) {
            const ExponentialSum* const kernel = kernel_of(setup.controller);
            const auto used = [&](const auto& all) {
                return std::vector<double>(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(kernel->count));
            };
            return kernel == nullptr ? std::pair<std::vector<double>, std::vector<double>>()
                                     : std::pair(used(kernel->poles), used(kernel->weights));
        },
        nb::arg("setup"), "The exponentials' poles and weights; none where the controller has no memory.");
}

}  // namespace fracgyro::bindings
