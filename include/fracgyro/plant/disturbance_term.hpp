// One term of a disturbance that is a sum: noise, a sine, a step, a half-sine pulse, random vibration or a table.
//
// A term acts at the samples from `start` to before `end`; its value at sample n is d(n h).
#pragma once

#include "fracgyro/core/fields.hpp"
#include "fracgyro/plant/tones.hpp"

#include <vector>

namespace fracgyro {

enum class TermKind { noise, sine, step, pulse, vibration, table };

struct DisturbanceTerm {
    TermKind kind = TermKind::noise;
    double start = 0.0, end = std::numeric_limits<double>::infinity();  // steps; not always whole
    std::uint32_t stream = 0;
    double standard_deviation = 1.0;
    std::int64_t hold = 1;                                 // steps
    Vec2<double> amplitude{}, frequency{}, phase{};        // pulse and step: amplitude
    double width = 1.0;                                    // steps
    std::vector<double> places{}, x_values{}, y_values{};  // rows: steps since start and d; frequencies and S

    static constexpr std::string_view kinds[] = {"noise", "sine", "step", "pulse", "vibration", "table"};
    // Fields, without the rows.
    static constexpr auto fields() {
        using P = DisturbanceTerm;
        constexpr Range count{.low = 1.0, .high = 1e9, .whole = true}, streams{.low = 0.0, .high = 1e9, .whole = true};
        return Fields{
            fixed(choice("kind", &P::kind, kinds,
                         "noise: white; sine: amplitude*sin(frequency*t + phase); step: amplitude; pulse: a half-sine "
                         "of amplitude; vibration: Gaussian, with a spectrum; table: rows.")),
            fixed(field("start_steps", &P::start, "h", at_least_0, "First step of the term.")),
            fixed(field("end_steps", &P::end, "h", {.low = 0.0, .infinite = true}, "The term acts before this step.")),
            fixed(field("stream", &P::stream, "1", streams, "Independent stream of disturbance.seed.")),
            fixed(field("standard_deviation", &P::standard_deviation, "m*omega0^2*q0", at_least_0,
                        "Of each held value of the noise.")),
            fixed(field("hold_steps", &P::hold, "1", count, "Steps from one noise draw to the next.")),
            fixed(field("amplitude", &P::amplitude, "m*omega0^2*q0", any_number, "Of sine, step and pulse.")),
            fixed(field("frequency", &P::frequency, "omega0", any_number, "Of the sine.")),
            fixed(field("phase", &P::phase, "rad", any_number, "Of the sine.")),
            fixed(field("width_steps", &P::width, "h", above_0, "Duration of the pulse.")),
        };
    }

    friend auto operator<=>(const DisturbanceTerm&, const DisturbanceTerm&) = default;
};

// The values of a term, except noise, which disturbance.hpp draws.
class TermValues {
public:
    TermValues(const DisturbanceTerm& term, std::uint64_t seed, double step)
        : term_(term), phases_(SteadyPhases<double>::prepare(term.frequency, term.phase, step)) {
        const auto ceiling = [](double a) {
            const auto below = static_cast<std::int64_t>(minimum(a, 0x1p62));
            return below + (static_cast<double>(below) < a && a < 0x1p62 ? 1 : 0);
        };
        first_ = ceiling(term.start);
        last_ = ceiling(term.end);
        if (term.kind == TermKind::vibration) {
            x_ = Tones(term.places, term.x_values, seed, term.stream, 0, step);
            y_ = Tones(term.places, term.y_values, seed, term.stream, 1, step);
        }
    }

    const DisturbanceTerm& term() const { return term_; }
    std::int64_t first() const { return first_; }  // sample
    std::int64_t last() const { return last_; }    // sample after the last one

    // Adds the values at the samples first, first + 1, …, which must be from first() to before last().
    void add(std::int64_t first, std::span<Vec2<double>> out) const {
        if (term_.kind == TermKind::vibration) {
            x_.each(first, out.size(), [&](std::size_t i, double x) { out[i] = out[i] + Vec2<double>{x, 0.0}; });
            y_.each(first, out.size(), [&](std::size_t i, double y) { out[i] = out[i] + Vec2<double>{0.0, y}; });
            return;
        }
        for (std::size_t i = 0; i < out.size(); ++i) {
            out[i] = out[i] + at(first + static_cast<std::int64_t>(i));
        }
    }

private:
    Vec2<double> at(std::int64_t n) const {
        const double passed = static_cast<double>(n) - term_.start;
        switch (term_.kind) {
            case TermKind::sine:
                return term_.amplitude * phases_.at(static_cast<std::uint64_t>(n)).sine;
            case TermKind::step:
                return term_.amplitude;
            case TermKind::pulse:
                return passed < term_.width ? half_sine(passed / term_.width) * term_.amplitude : Vec2<double>{};
            case TermKind::table:
                return row_at(passed);
            default:
                return {};
        }
    }
    static double half_sine(double share) {
        return sine_cosine<double>(static_cast<std::uint64_t>(share * 0x1p63)).sine;
    }
    // Linear between rows, zero before the first and after the last.
    Vec2<double> row_at(double t) const {
        const auto& places = term_.places;
        const auto found = std::upper_bound(places.begin(), places.end(), t);
        if (found == places.begin() || t > places.back()) {
            return {};
        }
        const auto row = static_cast<std::size_t>(found - places.begin()) - 1,
                   next = std::min(row + 1, places.size() - 1);
        const double part = next == row ? 0.0 : (t - places[row]) / (places[next] - places[row]);
        const auto between = [&](const std::vector<double>& a) { return a[row] + part * (a[next] - a[row]); };
        return {between(term_.x_values), between(term_.y_values)};
    }

    DisturbanceTerm term_;
    SteadyPhases<double> phases_;
    std::int64_t first_ = 0, last_ = 0;
    Tones x_{}, y_{};
};

}  // namespace fracgyro
