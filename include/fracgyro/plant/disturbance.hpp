// The disturbance d of eq. (9): nothing, a sine, or Gaussian noise redrawn every `hold` steps; and further terms.
//
// Noise is a function only of (seed, stream, index of the hold, axis): random.hpp.
#pragma once

#include "fracgyro/plant/disturbance_term.hpp"

namespace fracgyro {

enum class DisturbanceKind { none, noise, sine };

struct DisturbanceParams {
    DisturbanceKind kind = DisturbanceKind::none;
    double standard_deviation = 1.0;  // each held value; white noise of density S held for h has variance S/h
    std::int64_t hold = 1;            // steps
    std::uint64_t seed = 0;
    std::uint32_t stream = 0;  // independent stream of the seed: 0 the force, others in imperfections.hpp
    Vec2<double> amplitude{}, frequency{}, phase{};  // sine: amplitude·sin(frequency·t + phase)
    std::vector<DisturbanceTerm> terms{};            // added, in this order; noise from their own streams of the seed

    static constexpr std::string_view kinds[] = {"none", "noise", "sine"};
    // Fields, without the terms.
    static constexpr auto fields() {
        using P = DisturbanceParams;
        return Fields{
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

// Writes the noise of the steps first, first+1, … . One function for each kind of processor: all write the same bits.
using FillNoise = void (*)(const DisturbanceParams&, std::int64_t first, std::span<Vec2<double>>);

template <std::size_t Bytes>
[[gnu::flatten]] void fill_noise(const DisturbanceParams& p, std::int64_t first, std::span<Vec2<double>> out) {
    Normals<Bytes> drawn;
    const auto at = [&](std::size_t i) {
        return p.standard_deviation * Vec2<double>{static_cast<double>(drawn.x[i]), static_cast<double>(drawn.y[i])};
    };
    const auto each = static_cast<std::size_t>(p.hold);
    auto hold = static_cast<std::uint64_t>(first / p.hold);
    std::size_t past = static_cast<std::size_t>(first % p.hold);  // steps of this hold
    for (std::size_t done = 0; done < out.size();) {
        const std::size_t odd = hold % 2;
        const std::size_t wanted = odd + (past + (out.size() - done) + each - 1) / each;
        const std::size_t count = std::min(wanted, Normals<Bytes>::most);
        drawn.draw(p.seed, p.stream, hold - odd, count);
        hold += count - odd;
        if (each == 1) {
            for (std::size_t i = odd; i < count; ++i) {
                out[done + i - odd] = at(i);
            }
            done += count - odd;
            continue;
        }
        for (std::size_t i = odd; i < count; ++i) {
            const std::size_t steps = std::min(each - past, out.size() - done);
            std::fill_n(out.begin() + static_cast<std::ptrdiff_t>(done), steps, at(i));
            done += steps;
            past = 0;
        }
    }
}

// d at the requested steps, in any order.
class Disturbance {
public:
    [[gnu::noinline]] Disturbance(const DisturbanceParams& params, double step,
                                  FillNoise noise = &fill_noise<word_bytes>)
        : params_(params), phases_(SteadyPhases<double>::prepare(params.frequency, params.phase, step)), noise_(noise) {
        for (const DisturbanceTerm& term : params.terms) {
            terms_.emplace_back(term, params.seed, step);
        }
    }

    // One by one, fastest in ascending order.
    Vec2<double> operator()(std::int64_t n) {
        constexpr auto size = static_cast<std::int64_t>(std::tuple_size_v<decltype(kept_)>);
        const std::int64_t place = n % size;
        if (n - place != kept_from_) {
            kept_from_ = n - place;
            fill(kept_from_, kept_);
        }
        return kept_[static_cast<std::size_t>(place)];
    }

    // Writes d for the steps first, first+1, … .
    [[gnu::noinline]] void fill(std::int64_t first, std::span<Vec2<double>> out) const {
        fill_base(first, out);
        for (const TermValues& term : terms_) {
            const auto count = static_cast<std::int64_t>(out.size());
            const std::int64_t begin = std::clamp<std::int64_t>(term.first() - first, 0, count);
            const std::int64_t end = std::clamp<std::int64_t>(term.last() - first, begin, count);
            add(term, first + begin,
                out.subspan(static_cast<std::size_t>(begin), static_cast<std::size_t>(end - begin)));
        }
    }

private:
    void fill_base(std::int64_t first, std::span<Vec2<double>> out) const {
        switch (params_.kind) {
            case DisturbanceKind::none:
                std::fill(out.begin(), out.end(), Vec2<double>{});
                return;
            case DisturbanceKind::sine:
                for (std::size_t i = 0; i < out.size(); ++i) {
                    out[i] = params_.amplitude * phases_.at(static_cast<std::uint64_t>(first) + i).sine;
                }
                return;
            case DisturbanceKind::noise:
                noise_(params_, first, out);
        }
    }
    void add(const TermValues& values, std::int64_t first, std::span<Vec2<double>> out) const {
        const DisturbanceTerm& term = values.term();
        if (term.kind != TermKind::noise) {
            values.add(first, out);
            return;
        }
        const DisturbanceParams noise{.kind = DisturbanceKind::noise,
                                      .standard_deviation = term.standard_deviation,
                                      .hold = term.hold,
                                      .seed = params_.seed,
                                      .stream = term.stream};
        std::array<Vec2<double>, 64> drawn;
        for (std::size_t done = 0; done < out.size(); done += drawn.size()) {
            const auto part = out.subspan(done, std::min(drawn.size(), out.size() - done));
            noise_(noise, first + static_cast<std::int64_t>(done), std::span(drawn).first(part.size()));
            for (std::size_t i = 0; i < part.size(); ++i) {
                part[i] = part[i] + drawn[i];
            }
        }
    }

    DisturbanceParams params_;
    SteadyPhases<double> phases_;  // integers: the same bits everywhere
    FillNoise noise_;
    std::vector<TermValues> terms_;
    std::array<Vec2<double>, 64> kept_{};  // a block of steps
    std::int64_t kept_from_ = -1;
};

}  // namespace fracgyro
