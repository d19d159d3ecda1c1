#include "measure_run.hpp"

namespace fracgyro::bindings {

MetricValues measure_double(const Setup& setup, const MetricsParams& params, FillNoise noise) {
    return measure_by_itself<double>(setup, params, noise);
}

}  // namespace fracgyro::bindings
