// Many runs on several threads: recorded one by one, measured in blocks of as many as the processor has lanes. Which thread
// takes what changes nothing in any result.
#pragma once

#include "block.hpp"
#include "record.hpp"

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
using FillDisturbance = void (*)(Disturbance&, std::int64_t, std::span<Vec2<double>>);

namespace detail {

// `to` becomes `from` in one lane. Whatever is no number in lanes, counts and switches, must be the same in both.
template <std::size_t Count, class Struct>
void take_lane(Struct& to, const Struct& from, std::size_t lane) {
    static_assert(std::is_trivially_copyable_v<Struct>);
    static_assert(alignof(Struct) == Count * sizeof(double));
    auto* out = reinterpret_cast<unsigned char*>(&to);
    const auto* in = reinterpret_cast<const unsigned char*>(&from);
    for (std::size_t at = lane * sizeof(double); at < sizeof(Struct); at += Count * sizeof(double)) {
        std::memcpy(out + at, in + at, sizeof(double));
    }
}

template <std::size_t Count>
Estimates<double> one_lane(const Estimates<Lanes<Count>>& e, std::size_t k) {
    const auto sym2 = [k](const Sym2<Lanes<Count>>& a) {
        return Sym2<double>{a.xx.lane[k], a.xy.lane[k], a.yy.lane[k]};
    };
    return {.damping = sym2(e.damping),
            .stiffness = sym2(e.stiffness),
            .rate = e.rate.lane[k],
            .rate_symmetric = sym2(e.rate_symmetric),
            .bound = {e.bound[0].lane[k], e.bound[1].lane[k], e.bound[2].lane[k]}};
}

template <std::size_t Count>
MetricsSums<double> one_lane(const MetricsSums<Lanes<Count>>& s, std::size_t k) {
    const auto vec2 = [k](const Vec2<Lanes<Count>>& a) { return Vec2<double>{a.x.lane[k], a.y.lane[k]}; };
    MetricsSums<double> one;
    one.transient = vec2(s.transient);
    one.steady = vec2(s.steady);
    one.force = vec2(s.force);
    one.steady_force = vec2(s.steady_force);
    one.bend = vec2(s.bend);
    one.error_outside = s.error_outside.lane[k];
    one.surface_outside = s.surface_outside.lane[k];
    one.rate_outside = s.rate_outside.lane[k];
    one.rate_squares = s.rate_squares.lane[k];
    one.peak_rate_error = s.peak_rate_error.lane[k];
    one.largest_force = s.largest_force.lane[k];
    return one;
}

}  // namespace detail

// Up to as many runs as there are lanes, alike in all that `alike` compares; values[k] receives the metrics of run k.
template <class Controller>
void measure_block(Move<Controller> move, FillDisturbance fill, std::span<const Setup* const> runs,
                   const MetricsParams& params, std::span<MetricValues* const> values) {
    constexpr std::size_t count = Controller::Value::count;
    const auto block = std::make_unique<Block<Controller>>();
    auto& sums = block->sums;
    std::size_t modes = 0;
    for (const Setup* run : runs) {
        modes = std::max(modes, run->controller.surface.modes.count);
    }
    std::array<bool, count> alive{};
    std::array<std::int64_t, count> steady_from{};
    std::vector<Disturbance> disturbances;
    for (std::size_t k = 0; k < count; ++k) {
        const Setup& run = *runs[std::min(k, runs.size() - 1)];  // lanes to spare repeat the last run, unheard
        alive[k] = k < runs.size();
        steady_from[k] = first_steady_sample(params, run);
        disturbances.emplace_back(run.disturbance, run.controller.step);
        ControllerParams controller = run.controller;
        Modes& own = controller.surface.modes;
        for (; own.count < modes; ++own.count) {  // modes of weight 0, to be as many as in the other lanes
            own.rates[own.count] = own.rates[own.count - 1];
            own.weights[own.count] = 0.0;
        }
        const auto coefficients = Controller::prepare(controller);
        const auto plant = Plant<typename Controller::Value>::prepare(run.plant, controller.step);
        const auto motion = Plant<typename Controller::Value>::start(run.plant);
        if (k == 0) {
            block->controller = coefficients;
        }
        detail::take_lane<count>(block->controller, coefficients, k);
        detail::take_lane<count>(block->plant, plant, k);
        detail::take_lane<count>(block->motion, motion, k);
        block->alive.lane[k] = alive[k] ? 1.0 : 0.0;
        sums.rate.lane[k] = run.plant.rate;
        sums.rate_bound.lane[k] = params.rate_tolerance * absolute(run.plant.rate);
    }
    using T = typename Controller::Value;
    sums.error_bound_squared = T(params.error_bound * params.error_bound);
    sums.surface_bound_squared = T(params.surface_bound * params.surface_bound);
    const bool shared = std::all_of(runs.begin(), runs.end(), [&](const Setup* run) {
        return run->disturbance == runs[0]->disturbance && run->controller.step == runs[0]->controller.step;
    });

    const std::int64_t samples = runs[0]->steps + 1;
    const std::int64_t half = runs[0]->steps / 2;
    std::array<double, count> bound_halfway{};
    Estimates<T> estimates{};  // of the last sample; where a run has diverged, of the one after
    std::int64_t n = 0;        // samples done
    const auto end_lane = [&](std::size_t k) {
        const Estimates<double> last = detail::one_lane<count>(estimates, k);
        *values[k] = metric_values(params, *runs[k], detail::one_lane<count>(sums, k), last,
                                   n <= half ? last.bound[0] : bound_halfway[k], n);
        alive[k] = false;
        block->alive.lane[k] = 0.0;
    };
    const auto end_diverged = [&] {
        estimates = Controller::estimates(block->state, block->controller);
        for (std::size_t k = 0; k < count; ++k) {
            const auto& q = block->motion.position;
            if (alive[k] && !(absolute(q.x.lane[k]) + absolute(q.y.lane[k]) < divergence_limit)) {
                end_lane(k);
            }
        }
    };
    if (diverged(*block)) {
        end_diverged();
    }
    std::array<Vec2<double>, longest_stretch> coming{};
    while (n < samples && std::find(alive.begin(), alive.end(), true) != alive.end()) {
        // A stretch ends where a run passes from one window to the next, and before the samples whose estimates count.
        std::int64_t end = std::min(n + static_cast<std::int64_t>(longest_stretch), samples);
        const auto stop_at = [&](std::int64_t sample) { end = n < sample ? std::min(end, sample) : end; };
        stop_at(half);
        stop_at(samples - 1);
        if (n == half || n == samples - 1) {
            estimates = Controller::estimates(block->state, block->controller);
        }
        for (std::size_t k = 0; n == half && k < count; ++k) {
            bound_halfway[k] = estimates.bound[0].lane[k];
        }
        for (std::size_t k = 0; k < count; ++k) {
            stop_at(steady_from[k]);
            stop_at(steady_from[k] + 2);
            sums.early.lane[k] = n < steady_from[k] ? 1.0 : 0.0;
            sums.late.lane[k] = n < steady_from[k] ? 0.0 : 1.0;
            sums.bending.lane[k] = n < steady_from[k] + 2 ? 0.0 : 1.0;
        }
        const auto stretch = std::span(coming).first(static_cast<std::size_t>(end - n));
        for (std::size_t k = 0; k < (shared ? 1 : count); ++k) {
            fill(disturbances[k], n, stretch);
            for (std::size_t i = 0; i < stretch.size(); ++i) {
                auto& d = block->disturbance[i];
                if (shared) {
                    d = {T(stretch[i].x), T(stretch[i].y)};
                } else {
                    d.x.lane[k] = stretch[i].x;
                    d.y.lane[k] = stretch[i].y;
                }
            }
        }
        n += move(*block, end - n);
        if (n < samples && diverged(*block)) {
            end_diverged();
        }
    }
    for (std::size_t k = 0; k < count; ++k) {
        if (alive[k]) {
            end_lane(k);
        }
    }
}

// What runs in one block must agree in: all that the core decides once and not lane by lane.
inline auto alike(const Setup& s) {
    const AdaptationParams& a = s.controller.adaptation;
    const ControllerParams& c = s.controller;
    return std::tuple(s.kind, s.steps, c.surface.modes.count > 0, c.surface.terminal_exponent == 0.5,
                      c.control.force_limit < std::numeric_limits<double>::infinity(), a.printed_rate_law,
                      a.leakage > 0.0, a.projection > 0.0);
}

// The metrics of every run, in order. Runs that are alike share blocks, those with equally many modes first.
template <std::size_t Count>
std::vector<MetricValues> measure_all(const Kernels<Count>& kernels, FillDisturbance fill,
                                      std::span<const Setup* const> runs, const MetricsParams& params,
                                      unsigned threads) {
    std::vector<std::size_t> order(runs.size());
    for (std::size_t i = 0; i < order.size(); ++i) {
        order[i] = i;
    }
    const auto key = [&](std::size_t i) { return std::pair(alike(*runs[i]), runs[i]->controller.surface.modes.count); };
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return key(a) < key(b); });
    std::vector<std::span<const std::size_t>> blocks;
    for (std::size_t begin = 0; begin < order.size();) {
        std::size_t end = begin + 1;
        while (end < order.size() && end - begin < Count && alike(*runs[order[end]]) == alike(*runs[order[begin]])) {
            ++end;
        }
        blocks.push_back(std::span(order).subspan(begin, end - begin));
        begin = end;
    }
    std::vector<MetricValues> values(runs.size());
    parallel_for(blocks.size(), threads, [&](std::size_t b) {
        std::vector<const Setup*> block;
        std::vector<MetricValues*> out;
        for (const std::size_t i : blocks[b]) {
            block.push_back(runs[i]);
            out.push_back(&values[i]);
        }
        with_controller<Lanes<Count>>(block[0]->kind, [&]<class Controller>() {
            measure_block<Controller>(std::get<Move<Controller>>(kernels), fill, block, params, out);
        });
    });
    return values;
}

}  // namespace fracgyro
