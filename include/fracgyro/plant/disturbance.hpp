// The disturbance d of eq. (9): nothing, a sine, or Gaussian noise redrawn every `hold` steps.
//
// Noise is a function of only (seed, stream, index of the hold, axis), random.hpp.
#pragma once

#include "fracgyro/control/reference.hpp"
#include "fracgyro/plant/random.hpp"

#include <algorithm>
#include <span>

namespace fracgyro {

enum class DisturbanceKind { none, noise, sine };

struct DisturbanceParams {
    DisturbanceKind kind = DisturbanceKind::none;
    double standard_deviation = 1.0;  // of each held value; white noise of density S held for h has variance S/h
    std::int64_t hold = 1;            // steps
    std::uint64_t seed = 0;
    std::uint32_t stream = 0;  // of the seed's independent streams: 0 the force, others those of imperfections.hpp
    Vec2<double> amplitude{}, frequency{}, phase{};  // sine: amplitude·sin(frequency·t + phase)

    static constexpr std::string_view kinds[] = {"none", "noise", "sine"};
    static constexpr auto fields() {
        using P = DisturbanceParams;
        return std::tuple{
            choice("kind", &P::kind, kinds, "noise: Gaussian; sine: amplitude*sin(frequency*t + phase)."),
            field("standard_deviation", &P::standard_deviation, "m*omega0^2*q0", at_least_0, "Of each held value."),
            settable(Settable::beforehand, field("hold_steps", &P::hold, "1", {.low = 1.0, .high = 1e9, .whole = true},
                                                 "Steps from one noise draw to the next.")),
            fixed(field("seed", &P::seed, "1", {.low = 0.0, .whole = true}, "Same seed, same noise.")),
            field("amplitude", &P::amplitude, "m*omega0^2*q0", any_number, "Of the sine."),
            fixed(field("frequency", &P::frequency, "omega0", any_number, "Of the sine.")),
            fixed(field("phase", &P::phase, "rad", any_number, "Of the sine.")),
        };
    }

    friend auto operator<=>(const DisturbanceParams&, const DisturbanceParams&) = default;
};

// d for the steps asked for, in any order; fastest in rising order, as drawn noise is kept until it is used up.
class Disturbance {
public:
    Disturbance(const DisturbanceParams& params, double step)
        : params_(params),
          sine_(Reference<double>::prepare(
              {.amplitude = params.amplitude, .frequency = params.frequency, .phase = params.phase}, step)) {}

    Vec2<double> operator()(std::int64_t n) {
        Vec2<double> drawn;
        fill(n, {&drawn, 1});
        return drawn;
    }

    // Writes d for the steps first, first+1, … .
    void fill(std::int64_t first, std::span<Vec2<double>> out) {
        switch (params_.kind) {
            case DisturbanceKind::none:
                std::fill(out.begin(), out.end(), Vec2<double>{});
                return;
            case DisturbanceKind::sine:
                for (std::size_t i = 0; i < out.size(); ++i) {
                    out[i] = Reference<double>::position(sine_, static_cast<std::uint64_t>(first) + i);
                }
                return;
            case DisturbanceKind::noise:
                fill_noise(first, out);
        }
    }

private:
    static constexpr std::int64_t holds = 64;

    void fill_noise(std::int64_t first, std::span<Vec2<double>> out) {
        std::int64_t hold = first / params_.hold;
        std::int64_t left = params_.hold - first % params_.hold;
        Vec2<double> value = at(hold);
        for (auto& d : out) {
            if (left == 0) {
                value = at(++hold);
                left = params_.hold;
            }
            --left;
            d = value;
        }
    }

    Vec2<double> at(std::int64_t hold) {
        const std::int64_t block = hold / holds;
        if (block != drawn_block_) {
            drawn_.draw(params_.seed, static_cast<std::uint64_t>(block * holds), params_.stream);
            drawn_block_ = block;
        }
        const auto place = static_cast<std::size_t>(hold % holds);
        return params_.standard_deviation *
               Vec2<double>{static_cast<double>(drawn_.x[place]), static_cast<double>(drawn_.y[place])};
    }

    DisturbanceParams params_;
    Reference<double>::Coefficients sine_;  // by a phase in integers, as the reference: the same bits everywhere
    Normals<holds> drawn_;
    std::int64_t drawn_block_ = -1;
};

}  // namespace fracgyro
