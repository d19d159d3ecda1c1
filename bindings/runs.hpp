// Whole runs on an ideal device, compiled for each kind of processor: in separate files, as they take longest to
// compile.
#pragma once

#include "fracgyro/sim/any_plant.hpp"
#include "fracgyro/sim/batch.hpp"

namespace fracgyro::bindings {

std::int64_t record_run(const PlantSetup& setup, std::int64_t every, double* rows, FillNoise noise);
Metrics measure_double(const Setup& setup, const MetricsParams& params, FillNoise noise);

}  // namespace fracgyro::bindings
