// Arrays for users' C functions.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <utility>
#include <vector>

namespace fracgyro {

// Numbers passed to a C function, followed by NaN: a function that reads beyond them gets NaN, which its force shows,
// and one that writes beyond them is detected, without harm elsewhere.
class PaddedNumbers {
public:
    static constexpr std::size_t padding = 64;

    explicit PaddedNumbers(std::span<const double> numbers)
        : lines_((numbers.size() + padding) / width + 1), count_(numbers.size()) {
        std::fill_n(data(), lines_.size() * width, std::numeric_limits<double>::quiet_NaN());
        std::ranges::copy(numbers, data());
    }
    double* data() { return lines_.front().numbers.data(); }
    const double* data() const { return lines_.front().numbers.data(); }
    std::size_t count() const { return count_; }
    std::span<double> numbers() { return {data(), count_}; }
    // Index of the last number written beyond them; if there is none, of their last one.
    std::size_t written() const {
        std::size_t end = count_ + padding;
        while (end > count_ && std::isnan(data()[end - 1])) {
            --end;
        }
        return end;
    }

private:
    static constexpr std::size_t width = 8;
    // A line of the cache: a pair of numbers is never in two.
    struct alignas(width * sizeof(double)) Line {
        std::array<double, width> numbers{};
    };

    std::vector<Line> lines_;
    std::size_t count_;
};

}  // namespace fracgyro
