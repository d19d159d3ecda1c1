#include "arrays.hpp"
#include "bindings.hpp"
#include "controllers.hpp"
#include "run_setup.hpp"
#include "runs.hpp"

#include "fracgyro/sim/batch.hpp"
#include "fracgyro/sim/rate_means.hpp"

#include <nanobind/stl/string_view.h>
#include <nanobind/stl/vector.h>

#include <condition_variable>
#include <mutex>
#include <optional>

namespace fracgyro::bindings {

namespace {

// Doubles per register, for the kinds of processor whose code this one can run, fastest last.
std::vector<std::size_t> lane_counts() {
    std::vector<std::size_t> counts{2};
#ifdef FRACGYRO_LANES_X86
    if (__builtin_cpu_supports("avx2")) {
        counts.push_back(4);
    }
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl")) {
        counts.push_back(8);
    }
#endif
    return counts;
}

using Setups = std::vector<const RunSetup*>;

// Controllers of runs: users' controllers, one for each run, or else the setups' own, made when a run begins.
class Controllers {
public:
    Controllers(const Setups& setups, const Users& users, const std::vector<const Units*>& units)
        : setups_(setups), users_(users) {
        if (setups.empty()) {
            throw nb::value_error("there is nothing to run");
        }
        if (!users.empty() && (users.size() != setups.size() || units.size() != setups.size())) {
            throw nb::value_error("there must be one controller and one set of units for each run");
        }
        for (const RunSetup* s : setups) {
            threaded_ = threaded_ && (s->model == nullptr || s->model->runs_on_any_thread());
        }
        for (std::size_t i = 0; i < users.size(); ++i) {
            users[i]->begin(*units[i], setups[i]->common);
            threaded_ = threaded_ && users[i]->runs_on_any_thread();
        }
    }

    // True if no run calls Python.
    bool run_on_any_thread() const { return threaded_; }
    // Throws if a user's code wrote beyond its arrays in this run, which has finished.
    void check(std::size_t i) const {
        if (!users_.empty()) {
            users_[i]->check();
        }
        if (setups_[i]->model != nullptr) {
            setups_[i]->model->check();
        }
    }

    // Calls run(i, controller) for every run, without the GIL if no controller needs it.
    template <class Run>
    void each(unsigned threads, Run&& run) const {
        std::optional<nb::gil_scoped_release> unlocked;
        if (threaded_) {
            unlocked.emplace();
        }
        parallel_for(setups_.size(), threaded_ ? threads : 1, one(run));
    }
    // The same for long runs: `stop` ends them if a key is pressed.
    template <class Run>
    void each(unsigned threads, std::atomic<bool>& stop, Run&& run) const {
        if (threaded_) {
            interruptible_for(setups_.size(), threads, stop, one(run));
        } else {
            each(threads, run);
        }
    }

private:
    template <class Run>
    auto one(Run& run) const {
        return [&](std::size_t i) {
            if (users_.empty()) {
                run(i, *make_double(*setups_[i]));
            } else if (const auto filtered = filtered_user(*users_[i], setups_[i]->common)) {
                run(i, *filtered);
            } else {
                run(i, *users_[i]);
            }
            check(i);
        };
    }

    const Setups& setups_;
    const Users& users_;
    bool threaded_ = true;
};

// Rows of all runs, (runs, samples, width), NaN after a run has diverged; and the number of samples of each run.
// `device`: numbers of device_loop.hpp, whose loop non-ideal runs need: none, device_width, or volts_width more.
nb::tuple record_runs(const Setups& setups, std::int64_t every, unsigned threads, std::size_t device,
                      const Users& users, const std::vector<const Units*>& units) {
    const Controllers controllers(setups, users, units);
    const std::int64_t steps = setups.front()->steps;
    for (const RunSetup* s : setups) {
        if (s->steps != steps) {
            throw nb::value_error("all runs must have the same number of steps");
        }
        if (users.empty() && row_width_of(s->controller) != row_width_of(setups.front()->controller)) {
            throw nb::value_error("the controllers of all runs must report the same");
        }
    }
    const auto rows = static_cast<std::size_t>(steps / every + 1);
    Rows data;
    std::size_t width = 0;
    std::once_flag known;
    const auto begin = [&](std::size_t of_row) {
        std::call_once(known, [&] {
            width = of_row;
            data.resize(setups.size() * rows * width);
        });
        if (of_row != width) {
            throw std::domain_error("report() of the controller returned other names than in the run before");
        }
    };
    if (users.empty()) {
        begin(row_width_of(setups.front()->controller) + device);
    }
    auto lasted = std::make_unique<std::int64_t[]>(setups.size());
    const FillNoise noise = fastest_noise();
    const auto record_one = [&](std::size_t i, AnyController<double>& controller) {
        std::size_t written = 0;
        lasted[i] = record_any(*setups[i], controller, every, device, noise, [&](std::size_t of_row) {
            begin(of_row);
            return data.data() + (i * rows + written++) * width;
        });
    };
    if (users.empty() && device == 0 && controllers.run_on_any_thread()) {
        nb::gil_scoped_release unlocked;
        parallel_for(setups.size(), threads, [&](std::size_t i) {
            lasted[i] = record_run(*setups[i], every, data.data() + i * rows * width, noise);
            controllers.check(i);
        });
    } else {
        controllers.each(threads, record_one);
    }
    for (std::size_t i = 0; i < setups.size(); ++i) {
        const auto written = lasted[i] > 0 ? static_cast<std::size_t>((lasted[i] - 1) / every + 1) : 0;
        double* const first = data.data() + i * rows * width;
        std::fill(first + written * width, first + rows * width, std::numeric_limits<double>::quiet_NaN());
    }
    return nb::make_tuple(owned_rows<3>(std::move(data), {setups.size(), rows, width}),
                          owned<std::int64_t, 1>(std::move(lasted), {setups.size()}));
}

// Means of the rate estimate, (runs, blocks), and the number of samples of each run. `device`: by the loop of
// device_loop.hpp.
nb::tuple rate_means(const Setups& setups, std::int64_t every, std::int64_t block, unsigned threads, bool device,
                     const Users& users, const std::vector<const Units*>& units) {
    const Controllers controllers(setups, users, units);
    std::atomic<bool> stop{false};
    const RateBlocks blocks{.every = every, .block = block, .stop = &stop};
    const std::size_t count = blocks.count(setups.front()->steps);
    auto means = std::make_unique<double[]>(setups.size() * count);
    auto lasted = std::make_unique<std::int64_t[]>(setups.size());
    const FillNoise noise = fastest_noise();
    controllers.each(threads, stop, [&](std::size_t i, AnyController<double>& controller) {
        lasted[i] = rate_means_any(*setups[i], controller, blocks, device, noise,
                                   std::span<double>(means.get() + i * count, count));
    });
    return nb::make_tuple(owned<double, 2>(std::move(means), {setups.size(), count}),
                          owned<std::int64_t, 1>(std::move(lasted), {setups.size()}));
}

void write_metrics(const Metrics& metrics, double* row) {
    for_each_number(metrics, [&](double number) { *row++ = number; });
}

// Metrics of all runs, (runs, metrics). `lanes`: one of lane_counts(), counted in doubles, or 1: every run by itself,
// with the same bits. Non-ideal runs are measured one by one, in double precision.
nb::ndarray<nb::numpy, double> measure_runs(const Setups& setups, const MetricsParams& params, unsigned threads,
                                            std::size_t lanes_or_one, bool single_precision) {
    const auto counts = lane_counts();
    if (lanes_or_one != 1 && std::find(counts.begin(), counts.end(), lanes_or_one) == counts.end()) {
        throw nb::value_error("this processor has no registers of that many lanes");
    }
    std::vector<const Setup*> ideal;
    std::vector<std::size_t> places, others;
    for (std::size_t i = 0; i < setups.size(); ++i) {
        if (is_ideal(*setups[i]) && setups[i]->model == nullptr) {
            ideal.push_back(setups[i]);
            places.push_back(i);
        } else {
            others.push_back(i);
        }
    }
    const auto measure = [&]<std::size_t Bytes>(const KernelsOfWidth<Bytes>& kernels) {
        if (single_precision) {
            return measure_all(kernels.floats, ideal, params, threads);
        }
        return measure_all(kernels.doubles, ideal, params, threads);
    };
    auto data = std::make_unique<double[]>(setups.size() * metrics_width);
    {
        nb::gil_scoped_release unlocked;
        const auto measured = [&] {
            if (lanes_or_one == 1 && !single_precision) {
                std::vector<Metrics> values(ideal.size());
                const FillNoise noise = fastest_noise();
                parallel_for(ideal.size(), threads,
                             [&](std::size_t i) { values[i] = measure_double(*ideal[i], params, noise); });
                return values;
            }
            const std::size_t lanes = single_precision && lanes_or_one == 1 ? counts.back() : lanes_or_one;
#ifdef FRACGYRO_LANES_X86
            if (lanes == 8) {
                return measure(kernels_for_avx512());
            }
            if (lanes == 4) {
                return measure(kernels_for_avx2());
            }
#endif
            return measure(kernels_for_any_processor());
        }();
        const auto keep = [&](std::size_t place, const Metrics& values) {
            write_metrics(values, data.get() + place * metrics_width);
        };
        for (std::size_t i = 0; i < places.size(); ++i) {
            keep(places[i], measured[i]);
        }
        parallel_for(others.size(), threads, [&](std::size_t i) {
            const RunSetup& setup = *setups[others[i]];
            keep(others[i], measure_any(setup, *make_double(setup), params));
        });
    }
    return owned<double, 2>(std::move(data), {setups.size(), metrics_width});
}

// The same with the loop of device_loop.hpp, in double precision, with controllers of users or of the setups.
nb::ndarray<nb::numpy, double> measure_device_runs(const Setups& setups, const MetricsParams& params, unsigned threads,
                                                   const Users& users, const std::vector<const Units*>& units) {
    const Controllers controllers(setups, users, units);
    auto data = std::make_unique<double[]>(setups.size() * metrics_width);
    controllers.each(threads, [&](std::size_t i, AnyController<double>& controller) {
        write_metrics(measure_any(*setups[i], controller, params), data.get() + i * metrics_width);
    });
    return owned<double, 2>(std::move(data), {setups.size(), metrics_width});
}

}  // namespace

FillNoise fastest_noise() {
#ifdef FRACGYRO_LANES_X86
    switch (lane_counts().back()) {
        case 8:
            return kernels_for_avx512().doubles.fill_noise;
        case 4:
            return kernels_for_avx2().doubles.fill_noise;
    }
#endif
    return kernels_for_any_processor().doubles.fill_noise;
}

void interruptible_for(std::size_t count, unsigned threads, std::atomic<bool>& stop,
                       const std::function<void(std::size_t)>& task) {
    std::mutex mutex;
    std::condition_variable ended;
    bool done = false;
    std::exception_ptr failure;
    bool interrupted = false;
    {
        nb::gil_scoped_release unlocked;
        const std::jthread all([&] {
            try {
                parallel_for(count, threads, task);
            } catch (const Stopped&) {
            } catch (...) {
                failure = std::current_exception();
            }
            const std::lock_guard lock(mutex);
            done = true;
            ended.notify_one();
        });
        std::unique_lock lock(mutex);
        while (!ended.wait_for(lock, std::chrono::milliseconds(100), [&] { return done; })) {
            lock.unlock();
            {
                const nb::gil_scoped_acquire locked;
                interrupted = interrupted || PyErr_CheckSignals() != 0;
            }
            stop = interrupted;
            lock.lock();
        }
    }
    if (interrupted) {
        nb::raise_python_error();
    }
    if (failure) {
        std::rethrow_exception(failure);
    }
}

void bind_batch(nb::module_& m) {
    nb::class_<MetricsParams>(m, "MetricsParams")
        .def(nb::init<>())
        .def_rw("transient", &MetricsParams::transient)
        .def_rw("error_bound", &MetricsParams::error_bound)
        .def_rw("surface_bound", &MetricsParams::surface_bound)
        .def_rw("rate_tolerance", &MetricsParams::rate_tolerance);
    m.def("record_runs", &record_runs, nb::arg("setups"), nb::arg("every"), nb::arg("threads"), nb::arg("device") = 0,
          nb::arg("users") = Users(), nb::arg("units") = std::vector<const Units*>());
    m.def("rate_means", &rate_means, nb::arg("setups"), nb::arg("every"), nb::arg("block"), nb::arg("threads"),
          nb::arg("device"), nb::arg("users") = Users(), nb::arg("units") = std::vector<const Units*>());
    m.def("lane_counts", &lane_counts);
    m.def("measure_runs", &measure_runs, nb::arg("setups"), nb::arg("params"), nb::arg("threads"), nb::arg("lanes"),
          nb::arg("single_precision") = false);
    m.def("measure_device_runs", &measure_device_runs, nb::arg("setups"), nb::arg("params"), nb::arg("threads") = 1,
          nb::arg("users") = Users(), nb::arg("units") = std::vector<const Units*>());
    const auto all_described = [](const auto& all) {
        nb::list found;
        for (const Channel& c : all) {
            found.append(described(c));
        }
        return nb::tuple(found);
    };
    nb::list metrics;
    for_each_reported<Metrics>([&](const Channel& c) { metrics.append(described(c)); });
    m.attr("metrics") = nb::tuple(metrics);
    m.attr("loop_channels") = all_described(loop_channels);
    m.attr("device_channels") = all_described(device_channels);
    m.attr("volts_channels") = all_described(volts_channels);
}

}  // namespace fracgyro::bindings
