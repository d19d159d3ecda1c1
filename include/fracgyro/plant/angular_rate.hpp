// The angular rate Ωz(t) to be sensed: constant, or one of the inputs with which gyroscopes are tested.
//
//    staircase   mean + amplitude · levels climbed, one every `hold` steps from `start` on; a step is one level
//    sine        mean + amplitude · sin(frequency · τ), τ the time since `start`
//    chirp       mean + amplitude · sin(frequency · τ + ½ (final_frequency - frequency) τ²/T), T up to the end
//    noise       mean + Gaussian noise of that standard deviation, its spectrum flat up to `frequency` and 0 above: 32
//                sines, one in each 32nd of the band, of random frequency and phase (Shinozuka and Jan, "Digital
//                simulation of random processes and its applications", 1972)
//    table       the values of a profile
//
// Jumps are at samples; within a step the rate is smooth. Phases are counted in integers, as in core/phase.hpp.
#pragma once

#include "fracgyro/plant/disturbance.hpp"

#include <vector>

namespace fracgyro {

// A function of time, by its values at ascending times; linear from sample to sample of the loop, constant before the
// first time and after the last.
struct Profile {
    std::vector<double> times{}, values{};  // times in steps

    // Value at sample n.
    double at(std::int64_t n) const {
        const double t = static_cast<double>(n);
        const auto after = static_cast<std::size_t>(std::upper_bound(times.begin(), times.end(), t) - times.begin());
        if (after == 0 || after == times.size()) {
            return values.empty() ? 0.0 : after == 0 ? values.front() : values.back();
        }
        const double part = (t - times[after - 1]) / (times[after] - times[after - 1]);
        return values[after - 1] + part * (values[after] - values[after - 1]);
    }
    // Value `halves` half steps after sample n.
    double within(std::int64_t n, int halves) const {
        return halves == 1 ? 0.5 * (at(n) + at(n + 1)) : at(n + halves / 2);
    }
};

enum class AngularRateKind { constant, staircase, sine, chirp, noise, table };

struct AngularRateParams {
    AngularRateKind kind = AngularRateKind::constant;
    double amplitude = 0.0;                         // height of a level, peak, or standard deviation
    std::int64_t start = 0, hold = 1, levels = 1;   // steps, steps, count
    double frequency = 0.0, final_frequency = 0.0;  // rad per unit of time
    std::uint64_t seed = 0;
    bool inertial = false;  // the centrifugal and Euler forces follow the rate (varying_gyroscope.hpp)
    Profile table{};
    // Ωx and Ωy over time, and those of the plant; without times they are these.
    std::array<Profile, 2> across{};
    Vec2<double> across_mean{};

    bool tilts() const { return !across[0].times.empty(); }

    static constexpr std::string_view kinds[] = {"constant", "staircase", "sine", "chirp", "noise", "table"},
                                      switches[] = {"false", "true"};
    // Fields, without the profiles.
    static constexpr auto fields() {
        using P = AngularRateParams;
        constexpr Range count{.low = 1.0, .high = 1e9, .whole = true}, steps{.low = 0.0, .high = 1e9, .whole = true};
        return Fields{
            choice("kind", &P::kind, kinds, "constant: plant.angular_rate; table: only its points; else their sum."),
            fixed(field("amplitude", &P::amplitude, "omega0", any_number,
                        "height of the step or of each level, peak of sine and chirp, standard deviation of the "
                        "noise.")),
            fixed(field("start_steps", &P::start, "h", steps, "Steps during which the rate is plant.angular_rate.")),
            fixed(field("hold_steps", &P::hold, "h", count, "Steps on each level of the staircase.")),
            fixed(field("levels", &P::levels, "1", count,
                        "How many levels the staircase climbs; it stays on the last one.")),
            fixed(field("frequency", &P::frequency, "omega0", at_least_0,
                        "of the sine, where the chirp begins, where the band of the noise ends. At most pi over the "
                        "step.")),
            fixed(field("final_frequency", &P::final_frequency, "omega0", at_least_0,
                        "where the chirp ends. At most pi over the step.")),
            fixed(field("seed", &P::seed, "1", {.low = 0.0, .whole = true},
                        "Seed of the noise: same seed, same rate; 0 to 2^63 - 1.")),
            settable(Settable::never, choice("inertial", &P::inertial, switches,
                                             "Centrifugal and Euler forces follow the rate: plant.centrifugal.")),
        };
    }
};

class AngularRate {
public:
    AngularRate(const AngularRateParams& p, double mean, double step, std::int64_t steps) : params_(p), mean_(mean) {
        const double half = 0.5 * step;
        if (p.kind == AngularRateKind::noise) {
            for (std::size_t i = 0; i < tones; ++i) {
                const PhiloxBlock words = philox(p.seed, {static_cast<std::uint32_t>(i), 0, stream, 0});
                const double place = (static_cast<double>(i) + static_cast<double>(words[0]) * 0x1p-32) / double{tones};
                increment_[i] = phase_of(place * p.frequency * half);
                phase_[i] = std::uint64_t{words[1]} << 32;
            }
            return;
        }
        const double sweep = p.kind == AngularRateKind::chirp ? p.final_frequency - p.frequency : 0.0;
        increment_[0] = phase_of(p.frequency * half);
        const auto passing = static_cast<double>(std::max<std::int64_t>(steps - p.start, 1));
        curvature_ = phase_of(0.25 * sweep * half / passing);  // ½ sweep τ²/T at the first half step
    }

    // Ωz `halves` half steps after sample n; 2: before a jump at the next sample.
    double within(std::int64_t n, int halves) const {
        if (params_.kind == AngularRateKind::table) {
            return params_.table.within(n, halves);
        }
        if (n < params_.start) {
            return mean_;
        }
        const auto passed = static_cast<std::uint64_t>(2 * (n - params_.start) + halves);
        const auto sine = [](std::uint64_t phase) { return sine_cosine<double>(phase).sine; };
        switch (params_.kind) {
            case AngularRateKind::staircase: {
                const std::int64_t climbed = std::min((n - params_.start) / params_.hold + 1, params_.levels);
                return mean_ + params_.amplitude * static_cast<double>(climbed);
            }
            case AngularRateKind::sine:
            case AngularRateKind::chirp:
                return mean_ + params_.amplitude * sine(passed * increment_[0] + passed * passed * curvature_);
            case AngularRateKind::noise: {
                double sum = 0.0;
                for (std::size_t i = 0; i < tones; ++i) {
                    sum += sine(phase_[i] + passed * increment_[i]);
                }
                return mean_ + params_.amplitude * (sum * 0.25);  // sqrt(2/32)
            }
            default:
                return mean_;
        }
    }
    // Stiffness that Ωx and Ωy add, eq. (1), beyond those of the plant.
    Sym2<double> tilted(std::int64_t n, int halves) const {
        if (!params_.tilts()) {
            return {};
        }
        return centrifugal({params_.across[0].within(n, halves), params_.across[1].within(n, halves)}) -
               centrifugal(params_.across_mean);
    }
    double at(std::int64_t n) const { return within(n, 0); }
    double before(std::int64_t n) const { return n > 0 ? within(n - 1, 2) : within(0, 0); }

private:
    static Sym2<double> centrifugal(const Vec2<double>& across) {
        const double x = across.x(), y = across.y();
        return {-(y * y), x * y, -(x * x)};
    }

    static constexpr std::size_t tones = 32;
    static constexpr std::uint32_t stream = 3;

    AngularRateParams params_;
    double mean_;
    std::array<std::uint64_t, tones> increment_{}, phase_{};  // per half step, and at `start`; in 2^-64 turns
    std::uint64_t curvature_ = 0;
};

}  // namespace fracgyro
