// Whole runs on an ideal device, compiled for each kind of processor: in files of their own, as they take longest to
// compile.
#pragma once

#include "fracgyro/sim/batch.hpp"
#include "fracgyro/sim/rate_means.hpp"

namespace fracgyro::bindings {

std::int64_t record_run(const Setup& setup, std::int64_t every, double* rows, FillNoise noise);
std::int64_t rate_means_of_run(const Setup& setup, const RateBlocks& blocks, std::span<double> out, FillNoise noise);

// In double and in single precision.
MetricValues measure_double(const Setup& setup, const MetricsParams& params, FillNoise noise);
MetricValues measure_single(const Setup& setup, const MetricsParams& params, FillNoise noise);

}  // namespace fracgyro::bindings
