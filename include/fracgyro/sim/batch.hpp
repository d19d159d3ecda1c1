// Many runs on several threads: recorded one by one, measured in blocks of as many as the processor has lanes. The
// assignment to threads does not change any result.
#pragma once

#include "fracgyro/sim/lane_block.hpp"
#include "fracgyro/sim/lane_key.hpp"
#include "fracgyro/sim/recorder.hpp"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <exception>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

namespace fracgyro {

// Calls task(i) for every i in [0, count). The first exception is rethrown when all threads have ended.
template <class Task>
void parallel_for(std::size_t count, unsigned threads, Task&& task) {
    std::atomic<std::size_t> next{0};
    std::exception_ptr failure;
    std::atomic<bool> failed{false};
    const auto work = [&] {
        for (std::size_t i = next++; i < count && !failed; i = next++) {
            try {
                task(i);
            } catch (...) {
                if (!failed.exchange(true)) {
                    failure = std::current_exception();
                }
            }
        }
    };
    std::vector<std::jthread> pool;
    for (unsigned t = 1; t < threads && t < count; ++t) {
        pool.emplace_back(work);
    }
    work();
    pool.clear();
    if (failure) {
        std::rethrow_exception(failure);
    }
}

namespace detail {

// `to` becomes `from` in one lane. Counts and switches, which are not numbers in lanes, must be the same in both.
template <class T, class Struct>
void set_lane(Struct& to, const Struct& from, std::size_t lane) {
    static_assert(std::is_trivially_copyable_v<Struct>);
    static_assert(alignof(Struct) == sizeof(T));
    auto* out = reinterpret_cast<unsigned char*>(&to);
    const auto* in = reinterpret_cast<const unsigned char*>(&from);
    constexpr std::size_t size = sizeof(typename T::Number);
    for (std::size_t at = lane * size; at < sizeof(Struct); at += sizeof(T)) {
        std::memcpy(out + at, in + at, size);
    }
}

}  // namespace detail

// Parameters of the disturbance in runs with the same lane key.
inline const DisturbanceParams& noise_key(const Setup& s) { return s.disturbance; }

inline std::size_t kernel_terms(const Setup& s) {
    const ExponentialSum* const kernel = kernel_of(s.controller);
    return kernel == nullptr ? 0 : kernel->count;
}

// Functions of a type of controller for measuring a block, in addition to advance_block.
template <class T>
using HeldBlock = std::unique_ptr<BlockOf<T>, void (*)(BlockOf<T>*)>;
template <class T>
struct BlockType {
    std::size_t place;  // in Kernels::advance
    HeldBlock<T> (*make)();
    // Prepares the controller of one more run, for this lane; the first prepares all lanes.
    void (*prepare)(BlockOf<T>&, const ControllerParams&, const Common&, std::size_t lane);
    // The report of every lane before the coming step.
    std::vector<CommonReport> (*report)(const BlockOf<T>&);
};

// That of the controller; defined in lane_setup.hpp.
template <class T>
const BlockType<T>& block_type_of(const ControllerParams& controller);

// At most one run per lane, of the same lane key, from t = 0 to their end; values[k] receives the metrics of run k.
template <class Number, std::size_t count>
class BlockRun {
    using T = Lanes<Number, count>;

public:
    // `drawn`: the disturbance of every sample, the same for all runs; empty to draw it during the run.
    BlockRun(const Kernels<Number, count>& kernels, std::span<const Setup* const> runs,
             std::span<const Vec2<double>> drawn, const MetricsParams& params, std::span<Metrics* const> values)
        : kernels_(kernels),
          runs_(runs),
          drawn_(drawn),
          params_(params),
          values_(values),
          samples_(runs[0]->steps + 1),
          half_(runs[0]->steps / 2),
          steady_from_(first_steady_sample(params, *runs[0])) {
        type_ = &block_type_of<T>(runs[0]->controller);
        advance_ = kernels.advance[type_->place];
        block_ = type_->make();
        fill_lanes();
    }

    void run() {
        if (diverged(*block_)) {
            end_diverged();
        }
        while (n_ < samples_ && any_alive()) {
            // A segment continues when a run diverges: the others must not be affected.
            first_ = n_;
            const std::int64_t end = end_of_segment(first_, steady_from_, *runs_[0]);
            report_at_start();
            draw(static_cast<std::size_t>(end - first_));
            while (n_ < end && any_alive()) {
                n_ = first_ + advance_(*block_, n_ - first_, end - first_);
                if (n_ < samples_ && diverged(*block_)) {
                    end_diverged();
                }
            }
            for (std::size_t k = 0; k < count; ++k) {
                gather(k);
            }
            block_->sums.segment = {};
        }
        for (std::size_t k = 0; k < count; ++k) {
            if (alive_[k]) {
                end_lane(k);
            }
        }
    }

private:
    // Unused lanes repeat the last run; their results are discarded.
    void fill_lanes() {
        std::size_t terms = 0;
        for (const Setup* run : runs_) {
            terms = std::max(terms, kernel_terms(*run));
        }
        auto& sums = block_->sums;
        for (std::size_t k = 0; k < count; ++k) {
            const Setup& run = *runs_[std::min(k, runs_.size() - 1)];
            alive_[k] = k < runs_.size();
            disturbances_.emplace_back(run.disturbance, run.common.step, kernels_.fill_noise);
            noises_[k] = run.disturbance;
            ControllerParams controller = run.controller;
            if (kernel_terms(run) < terms) {  // same number as in the other lanes
                fill_up(*kernel_of(controller), terms);
            }
            Common common = run.common;
            common.reference.course = runs_[0]->common.reference.course;  // with the same content
            type_->prepare(*block_, controller, common, k);
            detail::set_lane<T>(block_->plant, Gyroscope<T>::prepare(run.plant, run.common.step), k);
            detail::set_lane<T>(block_->motion, Gyroscope<T>::start(run.plant), k);
            block_->alive.lane[k] = alive_[k] ? Number(1) : Number(0);
            sums.rate.lane[k] = static_cast<Number>(run.plant.rate);
            sums.rate_bound.lane[k] = static_cast<Number>(params_.rate_tolerance * absolute(run.plant.rate));
            sums.force_limit.lane[k] = static_cast<Number>(run.common.force_limit);
        }
        sums.error_bound_squared = T(params_.error_bound * params_.error_bound);
        sums.surface_bound_squared = T(params_.surface_bound * params_.surface_bound);
        shared_ = std::all_of(runs_.begin(), runs_.end(),
                              [&](const Setup* run) { return noise_key(*run) == noise_key(*runs_[0]); });
        noise_ = LaneNoise<count>::of(noises_);
    }

    // Reports before the segment, if its first sample is one whose estimates count.
    void report_at_start() {
        if (first_ == half_ || first_ == samples_ - 1) {
            report_ = type_->report(*block_);
        }
        if (first_ == half_) {
            for (std::size_t k = 0; k < count; ++k) {
                bound_halfway_[k] = report_[k].bound[0];
            }
        }
    }

    // Draws the disturbance of the coming segment.
    void draw(std::size_t length) {
        const auto segment = std::span(coming_).first(length);
        if (shared_ && !drawn_.empty()) {
            kernels_.spread(drawn_.subspan(static_cast<std::size_t>(first_), length), block_->disturbance);
        } else if (shared_) {
            disturbances_[0].fill(first_, segment);
            kernels_.spread(segment, block_->disturbance);
        } else if (noise_) {
            kernels_.fill_lanes(*noise_, first_, std::span(block_->disturbance).first(length));
        } else {
            for (std::size_t k = 0; k < count; ++k) {
                disturbances_[k].fill(first_, segment);
                for (std::size_t i = 0; i < length; ++i) {
                    block_->disturbance[i].first.lane[k] = static_cast<Number>(segment[i].x());
                    block_->disturbance[i].second.lane[k] = static_cast<Number>(segment[i].y());
                }
            }
        }
    }

    void gather(std::size_t k) {
        const auto number = [k](const T& a) { return static_cast<double>(a.lane[k]); };
        totals_[k].add(segment_of<T>(block_->sums.segment, number), first_, steady_from_);
    }
    void end_lane(std::size_t k) {
        *values_[k] = metric_values(params_, *runs_[k], totals_[k], report_[k],
                                    n_ <= half_ ? report_[k].bound[0] : bound_halfway_[k], n_);
        alive_[k] = false;
        block_->alive.lane[k] = Number(0);
    }
    void end_diverged() {
        report_ = type_->report(*block_);
        for (std::size_t k = 0; k < count; ++k) {
            const auto& q = block_->motion.position;
            const auto absolute_of = [k](const T& a) { return std::abs(static_cast<double>(a.lane[k])); };
            const double size = absolute_of(q.x()) + absolute_of(q.y());
            if (alive_[k] && !(size < divergence_limit)) {
                gather(k);
                end_lane(k);
            }
        }
    }
    bool any_alive() const { return std::find(alive_.begin(), alive_.end(), true) != alive_.end(); }

    const Kernels<Number, count>& kernels_;
    std::span<const Setup* const> runs_;
    std::span<const Vec2<double>> drawn_;
    const MetricsParams& params_;
    std::span<Metrics* const> values_;
    std::int64_t samples_, half_, steady_from_;

    const BlockType<T>* type_ = nullptr;
    AdvanceBlock<T> advance_ = nullptr;
    HeldBlock<T> block_{nullptr, nullptr};
    std::vector<Disturbance> disturbances_;
    std::array<DisturbanceParams, count> noises_{};
    bool shared_ = false;
    std::optional<LaneNoise<count>> noise_;
    std::array<Vec2<double>, longest_segment> coming_{};

    std::array<bool, count> alive_{};
    std::array<MetricsTotals, count> totals_{};
    std::array<double, count> bound_halfway_{};
    std::vector<CommonReport> report_;  // at the last sample; if a run has diverged, at the one after
    std::int64_t first_ = 0, n_ = 0;    // start of the segment; samples done
};

// Runs by index, as threads take them. A task is one block, of at most one run per lane, or several full ones with the
// same disturbance, which is then drawn once for all of them. Runs with the same lane key share blocks: first those
// with the same disturbance, then the rest, grouped by number of exponentials. Which runs share a block does not depend
// on the number of threads.
inline std::vector<std::vector<std::size_t>> tasks_of(std::span<const Setup* const> runs, std::size_t lanes,
                                                      unsigned threads) {
    using Index = std::vector<std::size_t>;
    // Enough blocks to make drawing negligible, and few enough that every thread has some.
    const std::size_t most_blocks = std::clamp<std::size_t>(runs.size() / lanes / (4 * std::max(threads, 1U)), 1, 16);
    const auto sort = [](Index& order, auto&& by) {
        std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return by(a) < by(b); });
    };
    std::vector<std::string> keys(runs.size());
    parallel_for(runs.size(), threads, [&](std::size_t i) { keys[i] = lane_key(*runs[i]); });
    const auto terms = [&](std::size_t i) { return kernel_terms(*runs[i]); };
    const auto key = [&](std::size_t i) { return std::string_view(keys[i]); };
    const auto together = [&](std::size_t i) { return std::tuple(key(i), noise_key(*runs[i])); };
    Index order(runs.size());
    for (std::size_t i = 0; i < order.size(); ++i) {
        order[i] = i;
    }
    sort(order, [&](std::size_t i) { return std::tuple(together(i), terms(i)); });
    std::vector<Index> tasks;
    Index left;
    for (std::size_t begin = 0, end = 0; begin < order.size(); begin = end) {
        while (end < order.size() && together(order[end]) == together(order[begin])) {
            ++end;
        }
        for (; end - begin >= lanes; begin += tasks.back().size()) {
            const auto first = order.begin() + static_cast<std::ptrdiff_t>(begin);
            const std::size_t size = std::min((end - begin) / lanes, most_blocks) * lanes;
            tasks.emplace_back(first, first + static_cast<std::ptrdiff_t>(size));
        }
        for (; begin < end; ++begin) {
            left.push_back(order[begin]);
        }
    }
    sort(left, [&](std::size_t i) { return std::tuple(key(i), terms(i)); });
    for (std::size_t begin = 0; begin < left.size(); begin += tasks.back().size()) {
        tasks.emplace_back();
        for (std::size_t i = begin; i < left.size() && i < begin + lanes; ++i) {
            if (key(left[i]) == key(left[begin])) {
                tasks.back().push_back(left[i]);
            }
        }
    }
    return tasks;
}

// Metrics of every run, in order.
template <class Number, std::size_t Count>
std::vector<Metrics> measure_all(const Kernels<Number, Count>& kernels, std::span<const Setup* const> runs,
                                 const MetricsParams& params, unsigned threads) {
    constexpr std::int64_t longest_drawn = std::int64_t{1} << 20;  // samples kept: 16 MB
    const auto tasks = tasks_of(runs, Count, threads);
    std::vector<Metrics> values(runs.size());
    parallel_for(tasks.size(), threads, [&](std::size_t t) {
        std::vector<const Setup*> all;
        std::vector<Metrics*> out;
        for (const std::size_t i : tasks[t]) {
            all.push_back(runs[i]);
            out.push_back(&values[i]);
        }
        std::vector<Vec2<double>> drawn;
        if (all.size() > Count && all[0]->steps < longest_drawn) {
            drawn.resize(static_cast<std::size_t>(all[0]->steps + 1));
            Disturbance(all[0]->disturbance, all[0]->common.step, kernels.fill_noise).fill(0, drawn);
        }
        for (std::size_t begin = 0; begin < all.size(); begin += Count) {
            const std::size_t size = std::min(Count, all.size() - begin);
            const auto block = std::span<const Setup* const>(all).subspan(begin, size);
            BlockRun(kernels, block, drawn, params, std::span<Metrics* const>(out).subspan(begin, size)).run();
        }
    });
    return values;
}

}  // namespace fracgyro
