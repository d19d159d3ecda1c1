// Many runs on several threads: recorded one by one, measured in blocks of as many as the processor has lanes. Which
// thread takes what changes nothing in any result.
#pragma once

#include "fracgyro/sim/lane_block.hpp"
#include "fracgyro/sim/lane_key.hpp"
#include "fracgyro/sim/recorder.hpp"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <exception>
#include <memory>
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

using MetricValues = std::array<double, metric_names.size()>;

namespace detail {

// `to` becomes `from` in one lane. Whatever is no number in lanes, counts and switches, must be the same in both.
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

// What the disturbance depends on in runs with the same lane key.
inline const DisturbanceParams& noise_key(const Setup& s) { return s.disturbance; }

inline std::size_t kernel_terms(const Setup& s) {
    const ExponentialSum* const kernel = kernel_of(s.controller);
    return kernel == nullptr ? 0 : kernel->count;
}

// Up to as many runs as there are lanes, of the same lane key; values[k] receives the metrics of run k.
// `drawn`: the disturbance of every sample, the same for all runs; empty to draw it on the way.
template <Controller C, class Number, std::size_t count>
void measure_block(const Kernels<Number, count>& kernels, std::span<const Setup* const> runs,
                   std::span<const Vec2<double>> drawn, const MetricsParams& params,
                   std::span<MetricValues* const> values) {
    using T = typename C::Value;
    const auto advance = std::get<AdvanceBlock<C>>(kernels.advance);
    const auto block = std::make_unique<Block<C>>();
    auto& sums = block->sums;
    std::size_t terms = 0;
    for (const Setup* run : runs) {
        terms = std::max(terms, kernel_terms(*run));
    }
    std::array<bool, count> alive{};
    std::vector<Disturbance> disturbances;
    std::array<DisturbanceParams, count> noises;
    for (std::size_t k = 0; k < count; ++k) {
        const Setup& run =
            *runs[std::min(k, runs.size() - 1)];  // unused lanes repeat the last run; their results are discarded
        alive[k] = k < runs.size();
        disturbances.emplace_back(run.disturbance, run.common.step, kernels.fill_noise);
        noises[k] = run.disturbance;
        ControllerParams controller = run.controller;
        if (kernel_terms(run) < terms) {  // as many as in the other lanes
            fill_up(*kernel_of(controller), terms);
        }
        const auto coefficients = prepare<C>(controller, run.common);
        const auto plant = Gyroscope<T>::prepare(run.plant, run.common.step);
        const auto motion = Gyroscope<T>::start(run.plant);
        if (k == 0) {
            block->controller = coefficients;
        }
        detail::set_lane<T>(block->controller, coefficients, k);
        detail::set_lane<T>(block->plant, plant, k);
        detail::set_lane<T>(block->motion, motion, k);
        block->alive.lane[k] = alive[k] ? Number(1) : Number(0);
        sums.rate.lane[k] = static_cast<Number>(run.plant.rate);
        sums.rate_bound.lane[k] = static_cast<Number>(params.rate_tolerance * absolute(run.plant.rate));
        sums.force_limit.lane[k] = static_cast<Number>(run.common.force_limit);
    }
    sums.error_bound_squared = T(params.error_bound * params.error_bound);
    sums.surface_bound_squared = T(params.surface_bound * params.surface_bound);
    const bool shared =
        std::all_of(runs.begin(), runs.end(), [&](const Setup* run) { return noise_key(*run) == noise_key(*runs[0]); });
    const auto noise = LaneNoise<count>::of(noises);

    const std::int64_t samples = runs[0]->steps + 1;
    const std::int64_t half = runs[0]->steps / 2;
    const std::int64_t steady_from = first_steady_sample(params, *runs[0]);
    std::array<MetricsTotals, count> totals{};
    std::array<double, count> bound_halfway{};
    typename C::Report report{};    // of the last sample; where a run has diverged, of the one after
    std::int64_t first = 0, n = 0;  // of the stretch; samples done
    const auto gather = [&](std::size_t k) {
        const auto stretch = stretch_of<T>(sums.stretch, [k](const T& a) { return static_cast<double>(a.lane[k]); });
        totals[k].add(stretch, first, steady_from);
    };
    const auto end_lane = [&](std::size_t k) {
        const auto last = LastReport::of(report, [k](const T& a) { return static_cast<double>(a.lane[k]); });
        *values[k] = metric_values(params, *runs[k], totals[k], last, n <= half ? last.bound[0] : bound_halfway[k], n);
        alive[k] = false;
        block->alive.lane[k] = Number(0);
    };
    const auto end_diverged = [&] {
        report = C::report(block->state, block->controller);
        for (std::size_t k = 0; k < count; ++k) {
            const auto& q = block->motion.position;
            const auto absolute_of = [k](const T& a) { return std::abs(static_cast<double>(a.lane[k])); };
            const double size = absolute_of(q.x()) + absolute_of(q.y());
            if (alive[k] && !(size < divergence_limit)) {
                gather(k);
                end_lane(k);
            }
        }
    };
    if (diverged(*block)) {
        end_diverged();
    }
    const auto any_alive = [&] { return std::find(alive.begin(), alive.end(), true) != alive.end(); };
    std::array<Vec2<double>, longest_stretch> coming{};
    while (n < samples && any_alive()) {
        // A stretch goes on when a run diverges: the others must not notice.
        first = n;
        const std::int64_t end = end_of_stretch(first, steady_from, *runs[0]);
        if (first == half || first == samples - 1) {
            report = C::report(block->state, block->controller);
        }
        for (std::size_t k = 0; first == half && k < count; ++k) {
            bound_halfway[k] =
                LastReport::of(report, [k](const T& a) { return static_cast<double>(a.lane[k]); }).bound[0];
        }
        const auto length = static_cast<std::size_t>(end - first);
        const auto stretch = std::span(coming).first(length);
        if (shared && !drawn.empty()) {
            kernels.spread(drawn.subspan(static_cast<std::size_t>(first), length), block->disturbance);
        } else if (shared) {
            disturbances[0].fill(first, stretch);
            kernels.spread(stretch, block->disturbance);
        } else if (noise) {
            kernels.fill_lanes(*noise, first, std::span(block->disturbance).first(length));
        } else {
            for (std::size_t k = 0; k < count; ++k) {
                disturbances[k].fill(first, stretch);
                for (std::size_t i = 0; i < length; ++i) {
                    block->disturbance[i].first.lane[k] = static_cast<Number>(stretch[i].x());
                    block->disturbance[i].second.lane[k] = static_cast<Number>(stretch[i].y());
                }
            }
        }
        while (n < end && any_alive()) {
            n = first + advance(*block, n - first, end - first);
            if (n < samples && diverged(*block)) {
                end_diverged();
            }
        }
        for (std::size_t k = 0; k < count; ++k) {
            gather(k);
        }
        sums.stretch = {};
    }
    for (std::size_t k = 0; k < count; ++k) {
        if (alive[k]) {
            end_lane(k);
        }
    }
}

// The runs by their places, as threads take them. A task is one block, of at most as many runs as there are lanes, or
// several full ones with the same disturbance, which is then drawn once for all of them. Runs with the same lane key
// share blocks: first those with the same disturbance, then what is left, those with equally many exponentials side by
// side. Which runs share a block does not depend on the number of threads.
inline std::vector<std::vector<std::size_t>> tasks_of(std::span<const Setup* const> runs, std::size_t lanes,
                                                      unsigned threads) {
    using Index = std::vector<std::size_t>;
    // So many that drawing takes no time that matters, and so few that every thread has some.
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

// The metrics of every run, in order.
template <class Number, std::size_t Count>
std::vector<MetricValues> measure_all(const Kernels<Number, Count>& kernels, std::span<const Setup* const> runs,
                                      const MetricsParams& params, unsigned threads) {
    constexpr std::int64_t longest_drawn = std::int64_t{1} << 20;  // samples kept: 16 MB
    const auto tasks = tasks_of(runs, Count, threads);
    std::vector<MetricValues> values(runs.size());
    parallel_for(tasks.size(), threads, [&](std::size_t t) {
        std::vector<const Setup*> all;
        std::vector<MetricValues*> out;
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
            with_controller<Lanes<Number, Count>>(block[0]->controller, [&]<class C>() {
                measure_block<C>(kernels, block, drawn, params,
                                 std::span<MetricValues* const>(out).subspan(begin, size));
            });
        }
    });
    return values;
}

}  // namespace fracgyro
