#include "paper.hpp"
#include "scalars.hpp"

#include "fracgyro/batch.hpp"

#include <stdexcept>
#include <string>

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

TEST(Metrics, TheSteadyWindowBeginsAtTheFirstSampleThatIsNotBeforeIt) {
    auto setup = paper(1000);
    setup.controller.step = 0.1;
    EXPECT_EQ(first_steady_sample({.transient = 1.0}, setup), 10);
    EXPECT_EQ(first_steady_sample({.transient = 0.95}, setup), 10);
    EXPECT_EQ(first_steady_sample({.transient = 1.01}, setup), 11);
    EXPECT_EQ(first_steady_sample({.transient = 0.3}, setup), 3);  // though 3 * 0.1 is 0.30000000000000004
    EXPECT_EQ(first_steady_sample({.transient = 0.0}, setup), 0);
}

// Twenty runs of 2,000 steps, two of which go together, by any number of threads: also for the sanitizer of threads.
TEST(MeasureAll, GivesTheSameWhateverTheNumberOfThreads) {
    std::vector<fracgyro::Setup> setups;
    for (std::uint64_t i = 0; i < 20; ++i) {
        setups.push_back(paper(2000));
        setups.back().kind = controller_kinds[i / 2 % controller_kinds.size()];
        setups.back().disturbance.seed = i / 4;
    }
    std::vector<const fracgyro::Setup*> all;
    for (const auto& setup : setups) {
        all.push_back(&setup);
    }
    const auto fill = [](Disturbance& d, std::int64_t first, std::span<Vec2<double>> out) { d.fill(first, out); };
    const auto kernels = detail::KernelsOf<Controllers<Lanes<double, 2>>>::all();
    const auto measured = [&](unsigned threads) {
        return measure_all<double, 2>(kernels, fill, all, MetricsParams{.transient = 1.0}, threads);
    };
    const auto one = measured(1);
    const std::size_t size = one.size() * sizeof one[0];
    EXPECT_EQ(std::memcmp(measured(2).data(), one.data(), size), 0);
    EXPECT_EQ(std::memcmp(measured(7).data(), one.data(), size), 0);
}

}  // namespace
}  // namespace fracgyro::testing
