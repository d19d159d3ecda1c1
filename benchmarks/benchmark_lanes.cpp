// Times a study's lanes: prints the nanoseconds of processor time that one step of one run takes, the best of three.
//
//     lanes 32|64 double|float CASE      bytes of a register; the cases are those of lane_contraction.py
#include "benchmark_setup.hpp"

#include "fracgyro/core/kernel_design.hpp"

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string_view>

using namespace fracgyro;

namespace {

Setup of_case(int which) {
    Setup s = paper(20'000, designed_kernel(*std::make_unique<KernelDesign>(), 0.9, 1e-3, 80.0, 1e-6));
    SlidingModeParams& p = *std::get_if<0>(&s.controller);
    p.surface.terminal_exponent = which == 0 ? 0.5 : 0.7;
    p.adaptation.kind = which == 2 ? AdaptationKind::composite : AdaptationKind::gradient;
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
    const Setup setup = of_case(std::atoi(words[3]));
    const std::vector<const Setup*> runs(32, &setup);
    double best = std::numeric_limits<double>::infinity(), kept = 0.0;
    for (int repeat = 0; repeat < 4; ++repeat) {
        const double start = processor_seconds();
        kept += wide ? run_lanes(kernels_for_avx512(), runs, single) : run_lanes(kernels_for_avx2(), runs, single);
        if (repeat > 0) {  // the first one warms up
            best = std::min(best, processor_seconds() - start);
        }
    }
    std::printf("%.4f\n", 1e9 * best / static_cast<double>(32 * (setup.steps + 1)));
    return kept > 0.0 ? 0 : 1;
}
