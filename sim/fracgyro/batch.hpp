// Many runs on several threads. Which thread takes which run changes nothing in any result.
#pragma once

#include "metrics.hpp"
#include "record.hpp"

#include <atomic>
#include <exception>
#include <thread>

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

}  // namespace fracgyro
