#include "arrays.hpp"
#include "bindings.hpp"

#include "fracgyro/batch.hpp"
#include "fracgyro/processor.hpp"

#include <nanobind/stl/string_view.h>
#include <nanobind/stl/vector.h>

namespace fracgyro::bindings {

namespace {

FRACGYRO_FOR_EACH_PROCESSOR
std::int64_t record_run(const Setup& setup, std::int64_t every, double* rows) {
    return record<double>(setup, every, rows);
}

FRACGYRO_FOR_EACH_PROCESSOR
void measure_run(const Setup& setup, const MetricsParams& params, double* out) {
    const auto values = measure<double>(setup, params);
    std::copy(values.begin(), values.end(), out);
}

// Rows of all runs, (runs, samples, row_width), NaN where a run had diverged; and the samples each run lasted.
nb::tuple record_runs(const std::vector<const Setup*>& setups, std::int64_t every, unsigned threads) {
    if (setups.empty()) {
        throw nb::value_error("there is nothing to run");
    }
    const std::int64_t steps = setups.front()->steps;
    for (const Setup* s : setups) {
        if (s->steps != steps) {
            throw nb::value_error("all runs must have the same number of steps");
        }
    }
    const auto rows = static_cast<std::size_t>(steps / every + 1);
    const std::size_t size = rows * row_width;
    std::unique_ptr<double[]> data(new double[setups.size() * size]);  // not zeroed: every page is written anyway
    auto lasted = std::make_unique<std::int64_t[]>(setups.size());
    {
        nb::gil_scoped_release unlocked;
        parallel_for(setups.size(), threads, [&](std::size_t i) {
            double* first = data.get() + i * size;
            lasted[i] = record_run(*setups[i], every, first);
            const auto written = static_cast<std::size_t>((lasted[i] + every - 1) / every);
            std::fill(first + written * row_width, first + size, std::numeric_limits<double>::quiet_NaN());
        });
    }
    return nb::make_tuple(owned<double, 3>(std::move(data), {setups.size(), rows, row_width}),
                          owned<std::int64_t, 1>(std::move(lasted), {setups.size()}));
}

nb::ndarray<nb::numpy, double> measure_runs(const std::vector<const Setup*>& setups, const MetricsParams& params,
                                            unsigned threads) {
    auto data = std::make_unique<double[]>(setups.size() * metric_names.size());
    {
        nb::gil_scoped_release unlocked;
        parallel_for(setups.size(), threads,
                     [&](std::size_t i) { measure_run(*setups[i], params, data.get() + i * metric_names.size()); });
    }
    return owned<double, 2>(std::move(data), {setups.size(), metric_names.size()});
}

}  // namespace

void bind_batch(nb::module_& m) {
    nb::class_<MetricsParams>(m, "MetricsParams")
        .def(nb::init<>())
        .def_rw("transient", &MetricsParams::transient)
        .def_rw("error_bound", &MetricsParams::error_bound)
        .def_rw("surface_bound", &MetricsParams::surface_bound)
        .def_rw("rate_tolerance", &MetricsParams::rate_tolerance);
    m.def("record_runs", &record_runs, nb::arg("setups"), nb::arg("every"), nb::arg("threads"));
    m.def("measure_runs", &measure_runs, nb::arg("setups"), nb::arg("params"), nb::arg("threads"));
    m.attr("metric_names") = nb::cast(std::vector<std::string_view>(metric_names.begin(), metric_names.end()));
    nb::list names;
    for (const Channel& c : channels) {
        names.append(nb::make_tuple(nb::cast(c.name), c.width));
    }
    m.attr("channels") = nb::tuple(names);
}

}  // namespace fracgyro::bindings
