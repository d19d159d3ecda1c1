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

}  // namespace
}  // namespace fracgyro::testing
