// Times a study's lanes: prints the nanoseconds of processor time that one step of one run takes, the best of three.
//
//     lanes 32|64 double|float CASE      bytes of a register; the cases are those of lane_contraction.py
#include "fracgyro/batch.hpp"
#include "fracgyro/kernel_design.hpp"

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string_view>

using namespace fracgyro;

namespace {

void fill(Disturbance& disturbance, std::int64_t first, std::span<Vec2<double>> out) { disturbance.fill(first, out); }

Setup paper(int which) {
    constexpr double pi = 3.14159265358979323846;
    Setup s;
    s.steps = 20'000;
    s.controller.reference = {.frequency = {pi, pi / 2}, .phase = {0.0, pi / 2}};
    s.controller.surface.modes = designed_modes(*std::make_unique<KernelDesign>(), 0.9, 1e-3, 80.0, 1e-6);
    s.controller.surface.terminal_exponent = which == 0 ? 0.5 : 0.7;
    s.controller.adaptation.composite = which == 2;
    s.plant = {.damping = {0.01, 0.002, 0.01}, .stiffness = {63.955 / 0.18, 12.779 / 0.18, 95.92 / 0.18}, .rate = 0.1};
    s.plant.initial.position = {0.5, 0.5};
    s.controller.adaptation.initial = {.damping = 0.95 * s.plant.damping,
                                       .stiffness = 0.95 * s.plant.stiffness,
                                       .rate = 0.95 * s.plant.rate,
                                       .bound = {0.1, 0.2, 0.3}};
    s.disturbance.kind = DisturbanceKind::noise;
    return s;
}

double processor_seconds() {
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace

int main(int count, char** words) {
    if (count != 4) {
        return 2;
    }
    const bool wide = std::atoi(words[1]) == 64, single = std::string_view(words[2]) == "float";
    const Setup setup = paper(std::atoi(words[3]));
    const std::vector<const Setup*> runs(32, &setup);
    const auto measure = [&]<std::size_t Bytes>(const KernelsOfWidth<Bytes>& kernels) {
        return (single ? measure_all<float, Bytes / 4>(kernels.floats, fill, runs, MetricsParams{}, 1)
                       : measure_all<double, Bytes / 8>(kernels.doubles, fill, runs, MetricsParams{}, 1))[0][0];
    };
    double best = std::numeric_limits<double>::infinity(), kept = 0.0;
    for (int repeat = 0; repeat < 4; ++repeat) {
        const double start = processor_seconds();
        kept += wide ? measure(kernels_for_avx512()) : measure(kernels_for_avx2());
        if (repeat > 0) {  // the first one warms up
            best = std::min(best, processor_seconds() - start);
        }
    }
    std::printf("%.4f\n", 1e9 * best / static_cast<double>(32 * (setup.steps + 1)));
    return kept > 0.0 ? 0 : 1;
}
