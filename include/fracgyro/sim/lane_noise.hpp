// Noise of runs in parallel lanes.
#pragma once

#include "fracgyro/plant/disturbance.hpp"
#include "fracgyro/sim/lanes.hpp"

#include <optional>

namespace fracgyro {

// Differences between the runs of a block, if each has its own noise and all have the same hold.
template <std::size_t Count>
struct LaneNoise {
    std::array<std::uint64_t, Count> seed{};
    std::array<double, Count> standard_deviation{};
    std::uint32_t stream = 0;
    std::int64_t hold = 1;

    // Empty if the noise of the runs is not of this form.
    static std::optional<LaneNoise> of(const std::array<DisturbanceParams, Count>& runs) {
        LaneNoise noise{.stream = runs[0].stream, .hold = runs[0].hold};
        for (std::size_t k = 0; k < Count; ++k) {
            const DisturbanceParams& run = runs[k];
            if (run.kind != DisturbanceKind::noise || run.stream != noise.stream || run.hold != noise.hold ||
                !run.terms.empty()) {
                return std::nullopt;
            }
            noise.seed[k] = run.seed;
            noise.standard_deviation[k] = run.standard_deviation;
        }
        return noise;
    }
};

// Writes the noise of the steps first, first + 1, …, as fill_noise does for each run.
template <class Number, std::size_t Count>
[[gnu::flatten]] void fill_lanes(const LaneNoise<Count>& noise, std::int64_t first,
                                 std::span<Vec2<Lanes<Number, Count>>> out) {
    using T = Lanes<Number, Count>;
    using Drawn = Normals<Count * sizeof(Number)>;
    Drawn drawn;
    const auto in_lanes = [&](const auto& normals, std::size_t row) {
        std::array<Number, Count> values;
        for (std::size_t k = 0; k < Count; ++k) {
            const auto normal = static_cast<double>(normals[Drawn::template place<Count>(row, k)]);
            values[k] = static_cast<Number>(noise.standard_deviation[k] * normal);
        }
        return T::of(std::bit_cast<typename T::Register>(values));
    };
    auto hold = static_cast<std::uint64_t>(first / noise.hold);
    std::int64_t left = noise.hold - first % noise.hold;  // steps of this hold
    for (std::size_t done = 0; done < out.size();) {
        const std::size_t odd = hold % 2, rows = Drawn::most / Count;
        drawn.draw(noise.seed, noise.stream, hold - odd, rows);
        for (std::size_t row = odd; row < rows && done < out.size(); ++row, left = noise.hold) {
            const Vec2<T> value{in_lanes(drawn.x, row), in_lanes(drawn.y, row)};
            for (; left > 0 && done < out.size(); --left) {
                out[done++] = value;
            }
        }
        hold += rows - odd;
    }
}

// Writes the same disturbance into every lane.
template <class Number, std::size_t Count>
[[gnu::flatten]] void spread(std::span<const Vec2<double>> drawn, std::span<Vec2<Lanes<Number, Count>>> out) {
    using T = Lanes<Number, Count>;
    const auto in_lanes = [](double a) {
        std::array<Number, Count> values;
        values.fill(static_cast<Number>(a));
        return T::of(std::bit_cast<typename T::Register>(values));
    };
    for (std::size_t i = 0; i < drawn.size(); ++i) {
        out[i] = {in_lanes(drawn[i].x()), in_lanes(drawn[i].y())};
    }
}

}  // namespace fracgyro
