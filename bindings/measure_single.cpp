#include "measure_run.hpp"

namespace fracgyro::bindings {

MetricValues measure_single(const Setup& setup, const MetricsParams& params, FillNoise noise) {
    return measure_by_itself<float>(setup, params, noise);
}

}  // namespace fracgyro::bindings
