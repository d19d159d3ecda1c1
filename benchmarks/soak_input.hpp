// What soak.py hands over on standard input: number of runs and of steps; then of each run the place of its kind, its
// settings (settings.hpp), and its exponentials.
#pragma once

#include "fracgyro/sim/settings.hpp"

#include <iostream>
#include <vector>

namespace fracgyro {

inline std::vector<Setup> read_runs(std::int64_t& steps) {
    std::size_t count = 0;
    std::cin >> count >> steps;
    std::vector<Setup> runs(count);
    for (Setup& run : runs) {
        std::size_t kind = 0;
        std::cin >> kind;
        run.controller = params_of_kind(kind);
        std::vector<double> values(setting_count(run));
        for (double& value : values) {
            std::cin >> value;
        }
        take_settings(run, values.data());
        ExponentialSum* const kernel = kernel_of(run.controller);
        for (std::size_t i = 0; kernel != nullptr && i < kernel->count; ++i) {
            std::cin >> kernel->poles[i] >> kernel->weights[i];
        }
    }
    return runs;
}

// Where the next figures are due: after 1e6, 1e7, … steps, half of them and all.
inline std::int64_t next_mark(std::int64_t n, std::int64_t window, std::int64_t steps) {
    std::int64_t mark = 10 * window;
    while (mark <= n) {
        mark = mark < steps / 2 ? std::min(mark * 10, steps / 2) : steps;
    }
    return n < window ? window : mark;
}

}  // namespace fracgyro
