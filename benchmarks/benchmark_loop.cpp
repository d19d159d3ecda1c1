// Times the closed loop inside C++, the paper's scenario over 80 units of time, beside what the processor can do at best.
// Prints one JSON line:
//   seconds             one run, every channel recorded, noise drawn on the way
//   seconds_unrecorded  one run, nothing kept, noise from a prepared array
//   seconds_chain       as many steps of the chain that no step can avoid: two square roots and what links them
//   seconds_lanes       a block of runs side by side, per run: metrics gathered, the same noise for all
//   flops_peak          fused multiply-adds per second, two operations each, of one core; 0 without AVX2
#include "fracgyro/batch.hpp"
#include "fracgyro/processor.hpp"

#include <chrono>
#include <cstdio>
#include <cstdlib>

using namespace fracgyro;

namespace {

FRACGYRO_FOR_EACH_PROCESSOR
std::int64_t record_run(const Setup& setup, double* rows) { return record<double>(setup, 1, rows); }

// Modes of α = 0.9 from standard input, as the Python package designed them: count, then rate and weight of each.
Modes read_modes() {
    Modes modes;
    modes.order = 0.9;
    modes.gamma = std::tgamma(2.0 - modes.order);
    if (std::scanf("%zu", &modes.count) != 1 || modes.count > Modes::capacity) {
        std::exit(1);
    }
    for (std::size_t i = 0; i < modes.count; ++i) {
        if (std::scanf("%lf %lf", &modes.rates[i], &modes.weights[i]) != 2) {
            std::exit(1);
        }
    }
    return modes;
}

Setup paper(const Modes& modes) {
    constexpr double pi = 3.14159265358979323846;
    Setup s;
    s.steps = 80000;
    s.controller.reference = {.frequency = {pi, pi / 2}, .phase = {0.0, pi / 2}};
    s.controller.surface.modes = modes;
    s.plant = {.damping = {0.01, 0.002, 0.01}, .stiffness = {63.955 / 0.18, 12.779 / 0.18, 95.92 / 0.18}, .rate = 0.1};
    s.plant.initial.position = {0.5, 0.5};
    s.controller.adaptation.initial = {.damping = 0.95 * s.plant.damping,
                                       .stiffness = 0.95 * s.plant.stiffness,
                                       .rate = 0.95 * s.plant.rate,
                                       .bound = {0.1, 0.2, 0.3}};
    s.disturbance.kind = DisturbanceKind::noise;
    return s;
}

FRACGYRO_FOR_EACH_PROCESSOR
double run_unrecorded(const Setup& setup, const std::vector<Vec2<double>>& noise) {
    double last = 0.0;
    with_controller<double>(setup.kind, [&]<class Controller>() {
        run_loop<Controller>(
            setup, [&](std::int64_t n) { return noise[static_cast<std::size_t>(n)]; },
            [&](const Snapshot<double>& at) { last = at.signals.error.value.x; });
    });
    return last;
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

FRACGYRO_FOR_EACH_PROCESSOR
void fill(Disturbance& disturbance, std::int64_t first, std::span<Vec2<double>> out) { disturbance.fill(first, out); }

template <class Task>
double seconds(Task&& task) {
    const auto start = std::chrono::steady_clock::now();
    task();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

int main() {
    const Setup setup = paper(read_modes());
    std::vector<double> rows(static_cast<std::size_t>(setup.steps + 1) * row_width);
    std::int64_t samples = record_run(setup, rows.data());  // touches the memory
    const double recorded = seconds([&] { samples = record_run(setup, rows.data()); });

    std::vector<Vec2<double>> noise(static_cast<std::size_t>(setup.steps + 1));
    Disturbance(setup.disturbance, setup.controller.step).fill(0, noise);
    double kept = 0.0;  // printed, so that nothing is left out
    const double unrecorded = seconds([&] { kept += run_unrecorded(setup, noise); });
    const double least = wide() ? seconds([&] { kept += chain(setup.steps + 1, 1.3); }) : 0.0;

    const std::vector<const Setup*> block(wide() ? 4 : 2, &setup);
    const double lanes = seconds([&] {
        const auto metrics = [&] {
#ifdef FRACGYRO_LANES_X86
            if (wide()) {
                return measure_all<4>(kernels_for_avx2(), fill, block, MetricsParams{}, 1);
            }
#endif
            return measure_all<2>(kernels_for_any_processor(), fill, block, MetricsParams{}, 1);
        }();
        kept += metrics[0][0];
    });
    constexpr std::int64_t times = 300'000;
    const double adding = wide() ? seconds([&] { kept += multiply_add(times); }) : 1.0;

    std::printf(
        "{\"seconds\": %.9f, \"seconds_unrecorded\": %.9f, \"seconds_chain\": %.9f, \"seconds_lanes\": %.9f, "
        "\"flops_peak\": %.4g, \"samples\": %lld, \"modes\": %zu, \"last_x\": %.17g, \"kept\": %.3g}\n",
        recorded, unrecorded, least, lanes / static_cast<double>(block.size()),
        wide() ? 8.0 * accumulators * static_cast<double>(times) / adding : 0.0, static_cast<long long>(samples),
        setup.controller.surface.modes.count, rows[rows.size() - row_width], kept);
    return samples == setup.steps + 1 ? 0 : 1;
}
