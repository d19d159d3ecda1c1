// The recorded channels: one row of doubles a sample.
#pragma once

#include "loop.hpp"

namespace fracgyro {

struct Channel {
    std::string_view name;
    int width = 0;
};

// In the order in which `write_row` writes them.
inline constexpr std::array<Channel, 15> channels{{{"position", 2},
                                                   {"velocity", 2},
                                                   {"reference", 2},
                                                   {"error", 2},
                                                   {"error_rate", 2},
                                                   {"surface", 2},
                                                   {"control", 2},
                                                   {"disturbance", 2},
                                                   {"damping_estimate", 3},
                                                   {"stiffness_estimate", 3},
                                                   {"rate_estimate", 1},
                                                   {"rate_symmetric_estimate", 3},
                                                   {"bound_estimate", 3},
                                                   {"rate_deviation", 1},
                                                   {"rate_trusted", 1}}};

inline constexpr std::size_t row_width = [] {
    std::size_t width = 0;
    for (const Channel& c : channels) {
        width += static_cast<std::size_t>(c.width);
    }
    return width;
}();

template <Scalar T>
void write_row(const Snapshot<T>& at, double* row) {
    const auto put = [&row](auto... values) { ((*row++ = static_cast<double>(values)), ...); };
    const auto put2 = [&](const Vec2<T>& a) { put(a.x, a.y); };
    const auto put3 = [&](const Sym2<T>& a) { put(a.xx, a.xy, a.yy); };
    const Signals<T>& s = at.signals;
    put2(at.motion.position);
    put2(at.motion.velocity);
    put2(s.reference.position);
    put2(s.error.value);
    put2(s.error.rate);
    put2(s.surface);
    put2(s.force);
    put2(at.disturbance);
    put3(s.estimates.damping);
    put3(s.estimates.stiffness);
    put(s.estimates.rate);
    put3(s.estimates.rate_symmetric);
    put(s.estimates.bound[0], s.estimates.bound[1], s.estimates.bound[2]);
    put(s.rate_quality.deviation, s.rate_quality.trusted);
}

// Rows of row_width doubles at the samples 0, every, 2·every, …; room for setup.steps / every + 1 of them.
// Returns the number of samples before divergence.
template <Scalar T>
std::int64_t record(const Setup& setup, std::int64_t every, double* rows) {
    std::int64_t samples = 0;
    with_controller<T>(setup.kind, setup.controller.adaptation.composite, [&]<class Controller>() {
        std::int64_t until_next = 0;
        samples = run_loop<Controller>(setup, [&](const Snapshot<T>& at) {
            if (until_next == 0) {
                write_row(at, rows);
                rows += row_width;
                until_next = every;
            }
            --until_next;
        });
    });
    return samples;
}

}  // namespace fracgyro
