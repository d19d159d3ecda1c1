#include "controllers.hpp"
#include "runs.hpp"

#include "fracgyro/sim/any_run.hpp"
#include "fracgyro/sim/cpu_dispatch.hpp"

namespace fracgyro::bindings {

namespace {

// A function for each controller: in one for all, compilers optimize none of them well.
template <Controller C>
FRACGYRO_FOR_EACH_PROCESSOR void part_of(typename Stepper<C>::Pending& state,
                                         const typename Stepper<C>::Coefficients& __restrict c, std::int64_t end,
                                         const Vec2<double>* coming, MetricsSums<double>& sums) {
    measure_part<C>(state, c, end, coming, sums);
}

}  // namespace

Metrics measure_double(const Setup& setup, const MetricsParams& params, FillNoise noise) {
    Metrics values{};
    with_controller<double>(setup.controller, [&]<class C>() {
        if constexpr (has_copies<C>) {
            values = measure_alone<C>(setup, params, noise, &part_of<C>);
        } else {
            values = measure_any_ideal(setup, *make_double(setup), params, noise);
        }
    });
    return values;
}

}  // namespace fracgyro::bindings
