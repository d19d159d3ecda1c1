// Arrays for users' C functions.
#pragma once

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

    explicit PaddedNumbers(std::vector<double> numbers) : all_(std::move(numbers)), count_(all_.size()) {
        all_.resize(count_ + padding, std::numeric_limits<double>::quiet_NaN());
    }
    double* data() { return all_.data(); }
    std::size_t count() const { return count_; }
    std::span<double> numbers() { return {all_.data(), count_}; }
    // Index of the last number written beyond them, or of their last one.
    std::size_t written() const {
        std::size_t end = all_.size();
        while (end > count_ && std::isnan(all_[end - 1])) {
            --end;
        }
        return end;
    }

private:
    std::vector<double> all_;
    std::size_t count_;
};

}  // namespace fracgyro
