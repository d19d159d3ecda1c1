// Times the closed loop inside C++: the paper's scenario, 80 units of time, every channel recorded. Prints one JSON line.
#include "fracgyro/processor.hpp"
#include "fracgyro/record.hpp"

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
    s.plant = {.damping = {0.01, 0.002, 0.01}, .stiffness = {355.3, 70.99, 532.9}, .rate = 0.1};
    s.plant.initial.position = {0.5, 0.5};
    s.controller.adaptation.initial = {.damping = 0.95 * s.plant.damping,
                                       .stiffness = 0.95 * s.plant.stiffness,
                                       .rate = 0.95 * s.plant.rate,
                                       .bound = {0.1, 0.2, 0.3}};
    s.disturbance.kind = DisturbanceKind::noise;
    return s;
}

}  // namespace

int main() {
    const Setup setup = paper(read_modes());
    std::vector<double> rows(static_cast<std::size_t>(setup.steps + 1) * row_width);
    const auto start = std::chrono::steady_clock::now();
    const std::int64_t samples = record_run(setup, rows.data());
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    // Once more, with the memory already touched.
    const auto again = std::chrono::steady_clock::now();
    record_run(setup, rows.data());
    const std::chrono::duration<double> warm = std::chrono::steady_clock::now() - again;
    std::printf("{\"seconds_first\": %.9f, \"seconds\": %.9f, \"samples\": %lld, \"modes\": %zu, \"last_x\": %.17g}\n",
                took.count(), warm.count(), static_cast<long long>(samples), setup.controller.surface.modes.count,
                rows[rows.size() - row_width]);
    return samples == setup.steps + 1 ? 0 : 1;
}
