#include "scalars.hpp"
#include "switches.hpp"

#include "fracgyro/sim/lane_setup.hpp"

#include <map>
#include <chrono>
#include <stdexcept>
#include <string>
#include <thread>

namespace fracgyro::testing {
namespace {

TEST(ParallelFor, TakesEveryTaskOnce) {
    for (const unsigned threads : {1U, 2U, 5U}) {
        std::vector<std::atomic<int>> done(100);
        parallel_for(done.size(), threads, [&](std::size_t i) { ++done[i]; });
        for (const auto& times : done) {
            EXPECT_EQ(times.load(), 1);
        }
    }
}

TEST(ParallelFor, HandsOnWhatIsThrownInAnyThread) {
    for (const unsigned threads : {1U, 2U, 5U}) {
        try {
            parallel_for(100, threads, [](std::size_t i) {
                if (i == 7) {
                    throw std::runtime_error("task 7");
                }
            });
            FAIL() << "nothing was thrown";
        } catch (const std::runtime_error& error) {
            EXPECT_EQ(error.what(), std::string("task 7"));
        }
    }
}

// Two tasks that wait for each other; the caller's ends long before the other throws.
TEST(ParallelFor, HandsOnWhatIsThrownLast) {
    std::atomic<int> begun{0};
    const auto caller = std::this_thread::get_id();
    const auto task = [&](std::size_t) {
        for (++begun; begun < 2;) {
            std::this_thread::yield();
        }
        if (std::this_thread::get_id() != caller) {
            std::this_thread::sleep_for(std::chrono::milliseconds(50));
            throw std::runtime_error("late");
        }
    };
    EXPECT_THROW(parallel_for(2, 2, task), std::runtime_error);
}

TEST(Metrics, TheSteadyWindowBeginsAtTheFirstSampleThatIsNotBeforeIt) {
    auto setup = paper(1000);
    setup.common.step = 0.1;
    EXPECT_EQ(first_steady_sample({.transient = 1.0}, setup), 10);
    EXPECT_EQ(first_steady_sample({.transient = 0.95}, setup), 10);
    EXPECT_EQ(first_steady_sample({.transient = 1.01}, setup), 11);
    EXPECT_EQ(first_steady_sample({.transient = 0.3}, setup), 3);  // though 3 * 0.1 is 0.30000000000000004
    EXPECT_EQ(first_steady_sample({.transient = 0.0}, setup), 0);
}

std::vector<Metrics> measured(const std::vector<const fracgyro::Setup*>& runs, unsigned threads,
                              double transient = 1.0) {
    static constexpr Kernels<double, 2> kernels{};
    return measure_all(kernels, runs, MetricsParams{.transient = transient}, threads);
}

// Twenty runs of 2,000 steps, two of them in one block, and forty with the same noise, on any number of threads; also
// run under the thread sanitizer.
TEST(MeasureAll, GivesTheSameWhateverTheNumberOfThreads) {
    std::vector<fracgyro::Setup> setups;
    for (int i = 0; i < 40; ++i) {
        setups.push_back(paper(500));
        setups.back().plant.rate = 0.01 * i;
    }
    for (std::uint64_t i = 0; i < 20; ++i) {
        setups.push_back(paper(2000, controller_kinds[i / 2 % controller_kinds.size()]));
        setups.back().disturbance.seed = i / 4;
    }
    std::vector<const fracgyro::Setup*> all;
    for (const auto& setup : setups) {
        all.push_back(&setup);
    }
    const auto one = measured(all, 1);
    const std::size_t size = one.size() * sizeof one[0];
    EXPECT_EQ(std::memcmp(measured(all, 2).data(), one.data(), size), 0);
    EXPECT_EQ(std::memcmp(measured(all, 7).data(), one.data(), size), 0);
}

// Runs that differ in a switch, their exponentials or their noise, in one call: each has the metrics of its own call.
TEST(MeasureAll, RunsThatDifferDoNotDisturbEachOther) {
    std::vector<fracgyro::Setup> setups(4, paper(200));
    law(setups[0]).surface.kernel = log_trapezoid(0.5, 1e-3, 0.2, 0.8);
    law(setups[1]).surface.kernel = log_trapezoid(1.0, 1e-3, 0.2);
    setups[2].disturbance.seed = 5;
    setups[3].disturbance.seed = 6;
    for (const auto& [name, values] : switches) {
        setups.push_back(with(paper(200), name, values.off));
        setups.push_back(with(paper(200), name, values.on));
    }
    std::vector<const fracgyro::Setup*> all;
    for (const fracgyro::Setup& setup : setups) {
        all.push_back(&setup);
    }
    const auto together = measured(all, 1, 0.1);
    for (std::size_t i = 0; i < all.size(); ++i) {
        const auto single = measured({all[i]}, 1, 0.1);
        EXPECT_EQ(std::memcmp(&single[0], &together[i], sizeof single[0]), 0) << i;
    }
}

TEST(MeasureAll, RunsWithAnyDisturbancesShareABlock) {
    std::vector<fracgyro::Setup> setups(4, paper(200));
    setups[0].disturbance = {.kind = DisturbanceKind::sine, .amplitude = {9.0, 5.0}, .phase = {1.0, 2.0}};
    setups[1].disturbance = {.kind = DisturbanceKind::noise, .hold = 3, .seed = 8};
    setups[2].disturbance = {.kind = DisturbanceKind::noise, .seed = 9};
    setups[3].disturbance = {};
    for (const auto& first : setups) {
        for (const auto& second : setups) {
            const std::vector<const fracgyro::Setup*> both{&first, &second};
            ASSERT_EQ(tasks_of(both, 2, 1).size(), 1U);
            const auto together = measured(both, 1, 0.1);
            for (std::size_t i = 0; i < both.size(); ++i) {
                EXPECT_EQ(std::memcmp(&together[i], &measured({both[i]}, 1, 0.1)[0], sizeof together[i]), 0);
            }
        }
    }
}

TEST(MeasureAll, ANegativeRateThatIsKnownHasSettledFromTheStart) {
    for (const double rate : {0.1, -0.1}) {
        auto known = paper(100);
        known.plant.rate = known.common.nominal.rate = rate;
        law(known).adaptation.adaptive = false;
        EXPECT_EQ(measured({&known}, 1)[0].rate_settling_time, 0.0) << rate;
    }
}

// Number of tasks and their blocks, for runs with one seed or several.
TEST(Tasks, AreEnoughForAllThreadsWhateverTheNumberOfSeeds) {
    constexpr std::size_t lanes = 8;
    for (const std::uint64_t seeds : {1U, 3U, 128U}) {
        std::vector<fracgyro::Setup> setups(128, paper(10));
        std::vector<const fracgyro::Setup*> all;
        for (auto& setup : setups) {
            setup.disturbance.seed = all.size() % seeds;
            all.push_back(&setup);
        }
        const auto blocks_of = [&](unsigned threads) {
            std::vector<std::vector<std::size_t>> blocks;
            const auto tasks = tasks_of(all, lanes, threads);
            EXPECT_GE(tasks.size(), std::min<std::size_t>(threads, all.size() / lanes));
            for (const auto& task : tasks) {
                for (std::size_t begin = 0; begin < task.size(); begin += lanes) {
                    const auto first = task.begin() + static_cast<std::ptrdiff_t>(begin);
                    blocks.emplace_back(first,
                                        first + static_cast<std::ptrdiff_t>(std::min(lanes, task.size() - begin)));
                }
            }
            return blocks;
        };
        const auto one = blocks_of(1);
        EXPECT_EQ(one.size(), all.size() / lanes);
        for (const unsigned threads : {2U, 7U, 100U}) {
            EXPECT_EQ(blocks_of(threads), one);
        }
    }
}

// By name; NaN is equal to itself.
std::map<std::string, std::uint64_t> bits(const Metrics& metrics) {
    std::map<std::string, std::uint64_t> found;
    for_each_field("", metrics, [&](std::string_view, const auto& field, const auto& value) {
        for_each_part(value, [&](std::string_view part, double number) {
            found[std::string(field.name).append(part)] = std::bit_cast<std::uint64_t>(number);
        });
    });
    return found;
}

template <class Number>
void a_run_has_the_bits_of_a_lane(const fracgyro::Setup& setup, double transient) {
    constexpr std::size_t lanes = 16 / sizeof(Number);
    static constexpr Kernels<Number, lanes> kernels{};
    const MetricsParams params{.transient = transient, .error_bound = 0.3, .surface_bound = 3.0};
    const fracgyro::Setup* const run = &setup;
    const auto in_lane = measure_all<Number, lanes>(kernels, std::span(&run, 1), params, 1)[0];
    Metrics alone{};
    with_controller<Number>(setup.controller,
                            [&]<class C>() { alone = measure_alone<C>(setup, params, kernels.fill_noise); });
    EXPECT_EQ(bits(alone), bits(in_lane)) << setup.steps << " steps";
}
void a_run_has_the_bits_of_a_lane_in_either_precision(const fracgyro::Setup& setup, double transient = 0.05) {
    a_run_has_the_bits_of_a_lane<double>(setup, transient);
    a_run_has_the_bits_of_a_lane<float>(setup, transient);
}

TEST(MeasureAlone, HasTheBitsOfALane) {
    for (const std::string_view kind : controller_kinds) {
        a_run_has_the_bits_of_a_lane_in_either_precision(paper(300, kind));
    }
    auto setup = paper(300);
    law(setup).adaptation.kind = AdaptationKind::composite;
    setup.common.force_limit = 300.0;
    a_run_has_the_bits_of_a_lane_in_either_precision(setup);
    // Windows that end anywhere in a segment of 64 samples, or beyond the run.
    for (const double transient : {0.0, 0.001, 0.064, 0.0979, 0.3, 1.0}) {
        a_run_has_the_bits_of_a_lane_in_either_precision(paper(300), transient);
    }
    for (const std::int64_t steps : {0, 1, 2, 3, 63, 64, 65, 127, 128, 129}) {
        a_run_has_the_bits_of_a_lane_in_either_precision(paper(steps));
    }
}

TEST(MeasureAlone, HasTheBitsOfALaneUntilItDiverges) {
    auto wild = paper(3000);
    law(wild).surface.fractional_gain = {3000.0, 3000.0};
    for (const std::int64_t steps : {3000, 20}) {  // before half of the run, and after
        wild.steps = steps;
        a_run_has_the_bits_of_a_lane_in_either_precision(wild);
    }
    wild.plant.initial_position = {0.0, -2.0 * divergence_limit};
    a_run_has_the_bits_of_a_lane_in_either_precision(wild);
}

TEST(MeasureAll, ARunThatStartsBeyondTheLimitHasNoSample) {
    auto wild = paper(100);
    wild.plant.initial_position = {0.0, -2.0 * divergence_limit};
    const auto calm = paper(100);
    const auto found = measured({&wild, &calm}, 1);
    EXPECT_EQ(found[0].diverged_at, 0.0);
    EXPECT_TRUE(std::isnan(found[1].diverged_at));
}

}  // namespace
}  // namespace fracgyro::testing
