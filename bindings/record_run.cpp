#include "runs.hpp"

#include "fracgyro/sim/cpu_dispatch.hpp"

namespace fracgyro::bindings {

namespace {

// A function for each controller: in one for all, compilers optimize none of them well.
template <Controller C>
FRACGYRO_FOR_EACH_PROCESSOR std::int64_t record_one(const Setup& setup, std::int64_t every, double* rows,
                                                    FillNoise noise) {
    return record<C>(setup, every, rows, noise);
}

}  // namespace

std::int64_t record_run(const Setup& setup, std::int64_t every, double* rows, FillNoise noise) {
    std::int64_t samples = 0;
    with_controller<double>(setup.controller, [&]<class C>() {
        if constexpr (has_copies<C>) {
            samples = record_one<C>(setup, every, rows, noise);
        } else {
            samples = record<C>(setup, every, rows, noise);
        }
    });
    return samples;
}

}  // namespace fracgyro::bindings
