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
                                         const Vec2<double>* coming, NextRow& next) {
    record_part<C>(state, c, end, coming, next);
}

std::int64_t record_erased(const PlantSetup& setup, std::int64_t every, double* rows, FillNoise noise) {
    return record_any(setup, *make_double(setup), every, 0, noise,
                      [&](std::size_t width) { return std::exchange(rows, rows + width); });
}

}  // namespace

std::int64_t record_run(const PlantSetup& setup, std::int64_t every, double* rows, FillNoise noise) {
    std::int64_t samples = 0;
    with_controller<double>(setup.controller, [&]<class C>() {
        if (setup.model != nullptr) {
            samples = record_erased(setup, every, rows, noise);
        } else if constexpr (has_copies<C>) {
            samples = record<C>(setup, every, rows, noise, &part_of<C>);
        } else {
            samples = record<C>(setup, every, rows, noise);
        }
    });
    return samples;
}

}  // namespace fracgyro::bindings
