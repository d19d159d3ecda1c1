#include "controllers.hpp"
#include "runs.hpp"

#include "fracgyro/sim/any_run.hpp"
#include "fracgyro/sim/cpu_dispatch.hpp"

namespace fracgyro::bindings {

namespace {

// A function for each controller: in one for all, compilers optimize none of them well.
template <Controller C>
FRACGYRO_FOR_EACH_PROCESSOR Metrics measure_one(const Setup& setup, const MetricsParams& params, FillNoise noise) {
    return measure_alone<C>(setup, params, noise);
}

}  // namespace

Metrics measure_double(const Setup& setup, const MetricsParams& params, FillNoise noise) {
    Metrics values{};
    with_controller<double>(setup.controller, [&]<class C>() {
        if constexpr (has_copies<C>) {
            values = measure_one<C>(setup, params, noise);
        } else {
            values = measure_any_ideal(setup, *make_double(setup), params, noise);
        }
    });
    return values;
}

}  // namespace fracgyro::bindings
