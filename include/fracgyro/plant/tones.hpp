// Gaussian vibration with a given power spectral density, realized as a sum of sines.
//
// The sines have equal power, one in each part of the spectrum that holds a 64th of the power, of random frequency and
// phase (Shinozuka and Jan, "Digital simulation of random processes and its applications", 1972). The mean square is
// the integral of the density, and the density on average that of the spectrum at every frequency.
#pragma once

#include "fracgyro/core/phase.hpp"
#include "fracgyro/plant/random.hpp"

#include <algorithm>
#include <span>

namespace fracgyro {

// The spectrum: rows of frequency, in rad per unit of time, and one-sided density, a power of the frequency from row to
// row. Its integral is the mean square.
class Tones {
public:
    static constexpr std::size_t count = 64;

    Tones() = default;
    Tones(std::span<const double> frequencies, std::span<const double> densities, std::uint64_t seed,
          std::uint32_t stream, std::uint32_t axis, double step)
        : amplitude_(std::sqrt(2.0 * power(frequencies, densities) / double{count})) {
        if (amplitude_ == 0.0) {
            return;
        }
        const double of_each = 0.5 * amplitude_ * amplitude_;
        std::size_t row = 1;
        double before = 0.0;  // power of the parts before
        Part part(frequencies, densities, row);
        for (std::uint32_t i = 0; i < count; ++i) {
            const PhiloxBlock words = philox(seed, {i, axis, stream, 1});
            const double wanted = of_each * (static_cast<double>(i) + static_cast<double>(words[0]) * 0x1p-32);
            while (wanted > before + part.power && row + 1 < frequencies.size()) {
                before += part.power;
                part = Part(frequencies, densities, ++row);
            }
            increment_[i] = phase_of(part.frequency_at(wanted - before) * step);
            phase_[i] = std::uint64_t{words[1]} << 32;
            const auto turn = sine_cosine<double>(increment_[i]);
            turn_sine_[i] = turn.sine;
            turn_cosine_[i] = turn.cosine;
        }
    }

    // The integral of a spectrum.
    static double power(std::span<const double> frequencies, std::span<const double> densities) {
        double total = 0.0;
        for (std::size_t row = 1; row < frequencies.size(); ++row) {
            total += Part(frequencies, densities, row).power;
        }
        return total;
    }

    // Calls put(i, value) with the values at `size` samples from `first` on. Sines are computed from their phases at
    // multiples of `kept` samples and rotated from there on: the values do not depend on `first`.
    template <class Put>
    void each(std::int64_t first, std::size_t size, Put&& put) const {
        constexpr std::int64_t kept = 64;
        if (amplitude_ == 0.0) {
            return;
        }
        const auto turn_sine = std::bit_cast<InRegisters>(turn_sine_);
        const auto turn_cosine = std::bit_cast<InRegisters>(turn_cosine_);
        const std::int64_t end = first + static_cast<std::int64_t>(size);
        for (std::int64_t block = first - first % kept; block < end; block += kept) {
            PerTone at_block_sine, at_block_cosine;
            for (std::size_t i = 0; i < count; ++i) {
                const auto found = sine_cosine<double>(phase_[i] + static_cast<std::uint64_t>(block) * increment_[i]);
                at_block_sine[i] = found.sine;
                at_block_cosine[i] = found.cosine;
            }
            auto sine = std::bit_cast<InRegisters>(at_block_sine), cosine = std::bit_cast<InRegisters>(at_block_cosine);
            for (std::int64_t n = block; n < std::min(block + kept, end); ++n) {
                Lane sums{};
                for (std::size_t k = 0; k < lanes; ++k) {
                    sums += sine[k];
                    const Lane turned = sine[k] * turn_cosine[k] + cosine[k] * turn_sine[k];
                    cosine[k] = cosine[k] * turn_cosine[k] - sine[k] * turn_sine[k];
                    sine[k] = turned;
                }
                if (n >= first) {
                    double sum = 0.0;
                    for (std::size_t j = 0; j < width; ++j) {
                        sum += sums[j];
                    }
                    put(static_cast<std::size_t>(n - first), amplitude_ * sum);
                }
            }
        }
    }

private:
    static constexpr std::size_t width = 8, lanes = count / width;
    using Lane [[gnu::vector_size(width * sizeof(double))]] = double;
    using InRegisters = std::array<Lane, lanes>;
    using PerTone = std::array<double, count>;

    // The spectrum between two rows, S = density (w/low)^p.
    struct Part {
        double low, high, density, ratio = 0.0, exponent = 0.0, power;  // ratio: ln(high/low), exponent: (p + 1) ratio

        Part(std::span<const double> w, std::span<const double> s, std::size_t row)
            : low(w[row - 1]), high(w[row]), density(s[row - 1]) {
            if (s[row] == density) {
                power = density * (high - low);
                return;
            }
            ratio = logarithm(high / low);
            exponent = logarithm(s[row] / density) + ratio;
            const double mean = absolute(exponent) < small ? 1.0 + exponent * (0.5 + exponent / 6.0)
                                                           : (exponential(exponent) - 1.0) / exponent;
            power = density * low * ratio * mean;
        }
        // The frequency below which the part holds this power.
        double frequency_at(double below) const {
            if (ratio == 0.0) {
                return minimum(density > 0.0 ? low + below / density : low, high);
            }
            const double share = below / (density * low * ratio), y = share * exponent;
            const double found =
                absolute(exponent) < small ? share * (1.0 - y * (0.5 - y / 3.0)) : logarithm_of_one_plus(y) / exponent;
            return minimum(low * exponential(ratio * found), high);
        }
        static constexpr double small = 1e-4;
    };

    double amplitude_ = 0.0;
    std::array<std::uint64_t, count> increment_{}, phase_{};  // per step, and at t = 0; in 2^-64 turns
    PerTone turn_sine_{}, turn_cosine_{};                     // by one increment
};

}  // namespace fracgyro
