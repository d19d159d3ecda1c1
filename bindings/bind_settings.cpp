#include "arrays.hpp"
#include "bindings.hpp"
#include "run_setup.hpp"

#include "fracgyro/sim/settings.hpp"

#include <nanobind/stl/pair.h>
#include <nanobind/stl/vector.h>

#include <functional>

namespace fracgyro::bindings {

namespace {

// Copies of a setup, each with a row of values in these places of fields_of_kind, which ascend. The reference is kept.
std::vector<RunSetup> with_settings(const RunSetup& base, const std::vector<std::size_t>& places,
                                    const nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>& rows) {
    if (rows.shape(1) != places.size() ||
        std::adjacent_find(places.begin(), places.end(), std::greater_equal()) != places.end()) {
        throw nb::value_error("there must be one column for each place, and the places must ascend");
    }
    std::vector<RunSetup> made(rows.shape(0), base);
    const double* value = rows.data();
    for (RunSetup& setup : made) {
        std::size_t at = 0, next = 0;
        for_each_setting(setup, [&]<class Number>(std::string_view, const auto&, std::string_view, Number& number) {
            if (next < places.size() && places[next] == at++) {
                number = static_cast<Number>(value[next++]);
            }
        });
        value += places.size();
    }
    return made;
}

}  // namespace

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
    m.def("with_settings", &with_settings, nb::arg("setup"), nb::arg("places"), nb::arg("rows"),
          "Copies of a setup, each with a row of numbers in these places of fields_of_kind, which ascend.");
}

}  // namespace fracgyro::bindings
