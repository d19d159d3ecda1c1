// Records of runs on an ideal device, compiled for each kind of processor: in a separate file, as they take longest to
// compile.
#pragma once

#include "fracgyro/sim/any_plant.hpp"
#include "fracgyro/plant/disturbance.hpp"

namespace fracgyro::bindings {

std::int64_t record_run(const PlantSetup& setup, std::int64_t every, double* rows, FillNoise noise);

}  // namespace fracgyro::bindings
