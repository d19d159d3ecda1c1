// Times the closed loop inside C++, the paper's scenario over 80 units of time, and what the processor can do at
// best. Prints one JSON line, of everything the median of five, taken in turn:
//   seconds            one run, every channel recorded, noise drawn during the run
//   seconds_prepared   the same with noise from a prepared array
//   seconds_unkept     and nothing recorded
//   seconds_chain      as many steps of the chain that no step can avoid: two square roots and what links them
//   seconds_lanes      runs side by side, per run: metrics gathered, the same noise for all
//   seconds_own_noise  the same, each run with its own noise
//   seconds_single     as seconds_lanes, in single precision
//   flops_peak         operations per second of one core that does fused multiply-adds of doubles only; 0 without AVX2
#include "benchmark_setup.hpp"

#ifdef FRACGYRO_LANES_X86
#include <immintrin.h>
#endif

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <functional>

using namespace fracgyro;

namespace {

using Paper = SlidingModeController<double, FractionalFastTerminalSurface, GradientAdaptation>;  // the setup has it

// Built like the Python module, with noise in the widest registers.
FRACGYRO_FOR_EACH_PROCESSOR void paper_part(Stepper<Paper>::Pending& state,
                                            const Stepper<Paper>::Coefficients& __restrict c, std::int64_t end,
                                            const Vec2<double>* coming, NextRow& next) {
    record_part<Paper>(state, c, end, coming, next);
}
FillNoise fill_noise_here() {
#ifdef FRACGYRO_LANES_X86
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl")) {
        return kernels_for_avx512().doubles.fill_noise;
    }
    if (__builtin_cpu_supports("avx2")) {
        return kernels_for_avx2().doubles.fill_noise;
    }
#endif
    return kernels_for_any_processor().doubles.fill_noise;
}
std::int64_t record_run(const Setup& setup, double* rows) {
    return record<Paper>(setup, 1, rows, fill_noise_here(), &paper_part);
}

// Exponentials of α = 0.9 from standard input, as the Python package designed them: count, then pole and weight of
// each.
ExponentialSum read_kernel() {
    ExponentialSum kernel;
    kernel.order = 0.9;
    kernel.gamma = std::tgamma(2.0 - kernel.order);
    if (std::scanf("%zu", &kernel.count) != 1 || kernel.count > ExponentialSum::capacity) {
        std::exit(1);
    }
    for (std::size_t i = 0; i < kernel.count; ++i) {
        if (std::scanf("%lf %lf", &kernel.poles[i], &kernel.weights[i]) != 2) {
            std::exit(1);
        }
    }
    return kernel;
}

FRACGYRO_FOR_EACH_PROCESSOR double run_unkept(const Setup& setup, const std::vector<Vec2<double>>& noise) {
    double last = 0.0;
    run_loop<Paper>(
        setup, [&](std::int64_t n) { return noise[static_cast<std::size_t>(n)]; },
        [&](const auto& at) { last = at.signals.error.value.x(); });
    return last;
}
FRACGYRO_FOR_EACH_PROCESSOR void run_prepared(const Setup& setup, const std::vector<Vec2<double>>& noise,
                                              double* rows) {
    run_loop<Paper>(
        setup, [&](std::int64_t n) { return noise[static_cast<std::size_t>(n)]; },
        [&](const auto& at) {
            write_row(at, rows);
            rows += row_width<Paper::Report>;
        });
}

#ifdef FRACGYRO_LANES_X86
bool wide() { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"); }

// sub, sqrt, fma, norm, sqrt, fnma
[[gnu::target("avx2,fma"), gnu::noinline]] double chain(std::int64_t steps, double x) {
    for (std::int64_t n = 0; n < steps; ++n) {
        const double e = x - 0.25;
        const double s = __builtin_fma(0.5, __builtin_sqrt(__builtin_fabs(e)), e);
        x = __builtin_fma(-0.3, __builtin_sqrt(__builtin_fma(s, s, s * s)), 1.0);
    }
    return x;
}

constexpr int accumulators = 12;  // more than the latency of one times the number begun at once

[[gnu::target("avx2,fma"), gnu::noinline]] double multiply_add(std::int64_t times) {
    __m256d sums[accumulators];
    for (int k = 0; k < accumulators; ++k) {
        sums[k] = _mm256_set1_pd(0.1 * k);
    }
    const __m256d factor = _mm256_set1_pd(0.999999), term = _mm256_set1_pd(1e-7);
    for (std::int64_t n = 0; n < times; ++n) {
#pragma GCC unroll 12
        for (int k = 0; k < accumulators; ++k) {
            sums[k] = _mm256_fmadd_pd(sums[k], factor, term);
        }
    }
    double total = 0.0;
    for (const __m256d& sum : sums) {
        total += sum[0] + sum[1] + sum[2] + sum[3];
    }
    return total;
}
#else
bool wide() { return false; }
double chain(std::int64_t, double x) { return x; }
constexpr int accumulators = 1;
double multiply_add(std::int64_t) { return 0.0; }
#endif

// Uses the widest lanes of the processor.
double run_lanes(std::span<const Setup* const> runs, bool single) {
#ifdef FRACGYRO_LANES_X86
    if (wide()) {
        return fracgyro::run_lanes(kernels_for_avx2(), runs, single);
    }
#endif
    return fracgyro::run_lanes(kernels_for_any_processor(), runs, single);
}

struct Timed {
    const char* name;
    std::function<double()> task;  // its result is printed, so that the compiler removes nothing
    double per = 1.0;              // seconds are divided by this
    std::vector<double> seconds{};

    double median() {
        std::sort(seconds.begin(), seconds.end());
        return seconds[seconds.size() / 2] / per;
    }
};

}  // namespace

int main() {
    const Setup setup = paper(80'000, read_kernel());
    constexpr std::size_t width = row_width<Paper::Report>;
    bool is_paper = false;
    with_controller<double>(setup.controller, [&]<class C>() { is_paper = std::is_same_v<C, Paper>; });
    if (!is_paper) {
        return 1;
    }
    std::vector<double> rows(static_cast<std::size_t>(setup.steps + 1) * width);
    std::vector<Vec2<double>> noise(static_cast<std::size_t>(setup.steps + 1));
    Disturbance(setup.disturbance, setup.common.step).fill(0, noise);
    constexpr std::size_t runs = 16;
    const std::vector<const Setup*> shared(runs, &setup);
    std::vector<Setup> seeded(runs, setup);
    std::vector<const Setup*> own;
    for (Setup& one : seeded) {
        one.disturbance.seed = own.size();
        own.push_back(&one);
    }
    std::int64_t samples = record_run(setup, rows.data());  // touches the memory
    constexpr std::int64_t times = 300'000;
    std::vector<Timed> all{
        {"seconds", [&] { return static_cast<double>(samples = record_run(setup, rows.data())); }},
        {"seconds_prepared", [&] { return run_prepared(setup, noise, rows.data()), rows[0]; }},
        {"seconds_unkept", [&] { return run_unkept(setup, noise); }},
        {"seconds_chain", [&] { return chain(setup.steps + 1, 1.3); }},
        {"seconds_lanes", [&] { return run_lanes(shared, false); }, runs},
        {"seconds_own_noise", [&] { return run_lanes(own, false); }, runs},
        {"seconds_single", [&] { return run_lanes(shared, true); }, runs},
        {"seconds_peak", [&] { return multiply_add(times); }},
    };
    double kept = 0.0;
    for (int round = 0; round < 5; ++round) {
        for (Timed& one : all) {
            const auto start = std::chrono::steady_clock::now();
            kept += one.task();
            one.seconds.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
        }
    }
    std::printf("{");
    for (Timed& one : all) {
        std::printf("\"%s\": %.9f, ", one.name, one.median());
    }
    std::printf("\"flops_peak\": %.4g, \"samples\": %lld, \"terms\": %zu, \"last_x\": %.17g, \"kept\": %.3g}\n",
                wide() ? 8.0 * accumulators * static_cast<double>(times) / all.back().median() : 0.0,
                static_cast<long long>(samples), kernel_terms(setup), rows[rows.size() - width], kept);
    return samples == setup.steps + 1 ? 0 : 1;
}
