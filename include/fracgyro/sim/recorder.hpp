// The recorded channels: one row of doubles per sample.
#pragma once

#include "fracgyro/sim/loop.hpp"

#include "fracgyro/core/fields.hpp"

namespace fracgyro {

struct Channel {
    std::string_view name;
    int width = 0;
    std::string_view unit, meaning;  // nondimensional
    std::string_view part = ".x";    // part of its first column, as for_each_part names it
    bool momentary = false;
};

// Channels of every run, in the order of `write_row`; the channels reported by the controller follow.
inline constexpr std::array<Channel, 7> loop_channels{
    {{"position", 2, "q0", "position q"},
     {"velocity", 2, "q0*omega0", "velocity v"},
     {"reference", 2, "q0", "reference r"},
     {"error", 2, "q0", "tracking error e = q - r"},
     {"error_rate", 2, "q0*omega0", "derivative of the tracking error"},
     {"control", 2, "m*omega0^2*q0", "control force u"},
     {"disturbance", 2, "m*omega0^2*q0", "disturbance force d"}}};
inline constexpr std::size_t loop_width = 14;

template <class Report>
inline constexpr std::size_t row_width = loop_width + width_of<Report>();

// Calls visit(channel) for each channel of the report, in order.
template <class Report, class Visit>
constexpr void for_each_reported(Visit&& visit) {
    const Report report{};
    for_each_field("", report, [&](std::string_view, const auto& field, const auto& value) {
        int width = 0;
        std::string_view first;
        for_each_part(value, [&](std::string_view part, const auto&) { first = width++ == 0 ? part : first; });
        visit(Channel{field.name, width, field.unit, field.meaning, first, field.momentary});
    });
}

template <Scalar T, class Report>
void write_row(const Snapshot<T, Report>& at, double* row) {
    const auto put = [&row](auto value) { *row++ = static_cast<double>(value); };
    const auto put2 = [&](const Vec2<T>& a) { put(a.x()), put(a.y()); };
    put2(at.motion.position);
    put2(at.motion.velocity);
    put2(at.signals.reference.position);
    put2(at.signals.error.value);
    put2(at.signals.error.derivative);
    put2(at.signals.force);
    put2(at.disturbance);
    for_each_number(at.signals.report, put);
}

// Number of doubles in a row of these runs.
template <class Params>  // so that only a file that calls it compiles it
std::size_t row_width_of(const Params& controller) {
    std::size_t width = 0;
    with_controller<double>(controller, [&]<class C>() { width = row_width<typename C::Report>; });
    return width;
}

// Place and sample of the next row.
struct NextRow {
    double* row = nullptr;
    std::int64_t every = 1, left = 0;  // samples; none left: the coming one
};

// Runs the samples before `end` with their disturbances from `coming` on, and writes their rows.
template <Controller C>
void record_part(typename Stepper<C>::Pending& state, const typename Stepper<C>::Coefficients& __restrict c,
                 std::int64_t end, const Vec2<double>* coming, NextRow& next) {
    NextRow own = next;
    Stepper<C>::run_part(state, c, end, coming, [&](const auto& at) {
        if (own.left == 0) {
            write_row(at, own.row);
            own.row += row_width<typename C::Report>;
            own.left = own.every;
        }
        --own.left;
    });
    next = own;
}

// Rows at the samples 0, every, 2·every, …; room for setup.steps / every + 1 of them. `part`: record_part, or a copy of
// it for this processor. Returns the number of samples before divergence.
template <Controller C>
std::int64_t record(const Setup& setup, std::int64_t every, double* rows, FillNoise noise = &fill_noise<word_bytes>,
                    decltype(&record_part<C>) part = &record_part<C>) {
    using Loop = Stepper<C>;
    const Disturbance disturbance(setup.disturbance, setup.common.step, noise);
    const auto coefficients = Loop::prepare(setup);
    auto state = Loop::begin(setup);
    std::array<Vec2<double>, 512> coming;
    NextRow next{.row = rows, .every = every};
    while (state.step <= setup.steps && bounded(state.motion)) {
        const std::int64_t first = state.step;
        const std::int64_t end = std::min(first + static_cast<std::int64_t>(coming.size()), setup.steps + 1);
        disturbance.fill(first, std::span(coming).first(static_cast<std::size_t>(end - first)));
        part(state, coefficients, end, coming.data(), next);
    }
    return state.step;
}
// Uses the controller of the setup.
template <Scalar T>
std::int64_t record(const Setup& setup, std::int64_t every, double* rows, FillNoise noise = &fill_noise<word_bytes>) {
    std::int64_t samples = 0;
    with_controller<T>(setup.controller, [&]<class C>() { samples = record<C>(setup, every, rows, noise); });
    return samples;
}

}  // namespace fracgyro
