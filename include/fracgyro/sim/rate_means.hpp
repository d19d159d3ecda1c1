// The rate estimate averaged over blocks of samples while a run goes on: hours of a rate sensor's output, in the memory
// of only that output.
#pragma once

#include "fracgyro/sim/law.hpp"

#include <atomic>
#include <span>
#include <stdexcept>

namespace fracgyro {

// What is averaged: of the samples 0, every, 2·every, … each `block` in a row; a block that is not full is left out.
struct RateBlocks {
    std::int64_t every = 1, block = 1;
    const std::atomic<bool>* stop = nullptr;  // ends a run that may take an hour: Stopped is thrown

    std::size_t count(std::int64_t steps) const { return static_cast<std::size_t>(steps / every / block); }
};

struct Stopped {};

class RateMeans {
public:
    // Means go to `out`, NaN where none is reached.
    RateMeans(const RateBlocks& blocks, std::span<double> out) : blocks_(blocks), out_(out) {
        std::fill(out.begin(), out.end(), std::numeric_limits<double>::quiet_NaN());
    }

    // The next sample; rate() is called where it counts.
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

// These of a run on an ideal device; returns the number of samples before the motion diverged.
template <Controller C>
std::int64_t rate_means(const Setup& setup, const RateBlocks& blocks, std::span<double> out, FillNoise noise) {
    if constexpr (requires(typename C::Report report) { report.rate; }) {
        RateMeans means(blocks, out);
        return run_loop<C>(setup, Disturbance(setup.disturbance, setup.common.step, noise),
                           [&](const auto& at) { means.add([&] { return at.signals.report.rate; }); });
    } else {
        throw std::invalid_argument("the controller estimates no rate");
    }
}
// Of a run on any device.
inline std::int64_t device_rate_means(const DeviceSetup& setup, const RateBlocks& blocks, std::span<double> out) {
    std::int64_t samples = 0;
    with_controller<double>(setup.controller, setup.common.observer_bandwidth > 0.0, [&]<class C>() {
        if constexpr (requires(typename C::Report report) { report.rate; }) {
            RateMeans means(blocks, out);
            samples =
                run_device_loop<C>(setup, [&](const auto& at) { means.add([&] { return at.signals.report.rate; }); });
        } else {
            throw std::invalid_argument("the controller estimates no rate");
        }
    });
    return samples;
}
// Of a law from outside, which is asked for its report only at the samples that count.
inline std::int64_t outside_rate_means(const OutsideSetup& setup, const RateBlocks& blocks, std::span<double> out) {
    std::int64_t samples = 0;
    const LawParams& p = setup.controller;
    with_law<NothingReported>(setup, [&]<class C>() {
        RateMeans means(blocks, out);
        samples =
            run_device_loop<C>(setup, [&](const auto&) { means.add([&] { return p.law->rate() / p.units.rate; }); });
    });
    p.law->check();
    return samples;
}

}  // namespace fracgyro
