// The rate estimate averaged over blocks of samples during a run: hours of a rate sensor's output, in the memory of
// only that output.
#pragma once

#include "fracgyro/sim/any_run.hpp"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <limits>
#include <span>
#include <stdexcept>

namespace fracgyro {

// Blocks to average: of the samples 0, every, 2·every, … each `block` in a row; an incomplete block is left out.
struct RateBlocks {
    std::int64_t every = 1, block = 1;
    const std::atomic<bool>* stop = nullptr;  // ends a run that may take an hour: Stopped is thrown

    std::size_t count(std::int64_t steps) const { return static_cast<std::size_t>(steps / every / block); }
};

struct Stopped {};

class RateMeans {
public:
    // Means go to `out`, NaN for blocks that are not reached.
    RateMeans(const RateBlocks& blocks, std::span<double> out) : blocks_(blocks), out_(out) {
        std::fill(out.begin(), out.end(), std::numeric_limits<double>::quiet_NaN());
    }

    // Adds the next sample; rate() is called only if it counts.
    template <class Rate>
    void add(Rate&& rate) {
        if (until_next_ == 0) {
            until_next_ = blocks_.every;
            if (written_ < out_.size()) {
                sum_ += rate();
                if (++seen_ == blocks_.block) {
                    out_[written_++] = sum_ / static_cast<double>(blocks_.block);
                    sum_ = 0.0;
                    seen_ = 0;
                    if (blocks_.stop != nullptr && *blocks_.stop) {
                        throw Stopped{};
                    }
                }
            }
        }
        --until_next_;
    }

private:
    RateBlocks blocks_;
    std::span<double> out_;
    double sum_ = 0.0;
    std::size_t written_ = 0;
    std::int64_t seen_ = 0, until_next_ = 0;
};

// Means of the rate estimate; throws if the controller estimates none.
inline std::int64_t rate_means_any(const PlantSetup& setup, AnyController<double>& controller, const RateBlocks& blocks,
                                   bool device, FillNoise noise, std::span<double> out) {
    if (!controller.estimates_rate()) {
        throw std::invalid_argument("the controller estimates no rate");
    }
    RateMeans means(blocks, out);
    return run_any(setup, controller, device, noise,
                   [&](const auto&) { means.add([&] { return controller.rate(); }); });
}

}  // namespace fracgyro
