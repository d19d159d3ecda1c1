#include "paper.hpp"

#include "fracgyro/sim/recorder.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <vector>

namespace fracgyro::testing {
namespace {

// Copies compiled like the loop in include/fracgyro/sim/cpu_dispatch.hpp. They differ only if everything is inlined.
#if defined(__x86_64__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__)

template <class C>
[[gnu::flatten, gnu::noinline]] void record_anywhere(const Setup& setup, double* rows) {
    record<C>(setup, 1, rows);
}
template <class C>
[[gnu::target("avx2"), gnu::flatten, gnu::noinline]] void record_with_avx2(const Setup& setup, double* rows) {
    record<C>(setup, 1, rows);
}
#if __GNUC__ >= 12
template <class C>
[[gnu::target("arch=x86-64-v4"), gnu::flatten, gnu::noinline]] void record_with_avx512(const Setup& setup,
                                                                                       double* rows) {
    record<C>(setup, 1, rows);
}
#endif

template <class C>
void expect_the_same_bits(const Setup& setup) {
    std::vector<double> anywhere(static_cast<std::size_t>(setup.steps + 1) * row_width<typename C::Report>);
    const auto same = [&](auto record_with) {
        std::vector<double> with(anywhere.size());
        record_with(setup, with.data());
        return std::memcmp(with.data(), anywhere.data(), with.size() * sizeof(double)) == 0;
    };
    record_anywhere<C>(setup, anywhere.data());
    if (__builtin_cpu_supports("avx2")) {
        EXPECT_TRUE(same(record_with_avx2<C>));
    }
#if __GNUC__ >= 12
    if (__builtin_cpu_supports("x86-64-v4")) {
        EXPECT_TRUE(same(record_with_avx512<C>));
    }
#endif
}

TEST(ClosedLoop, EveryProcessorComputesTheSameBits) {
    if (!__builtin_cpu_supports("avx2")) {
        GTEST_SKIP() << "this processor has no AVX2";
    }
    auto setup = paper(5000);
    expect_the_same_bits<SlidingModeController<double, FractionalFastTerminalSurface>>(setup);
    law(setup).adaptation.kind = AdaptationKind::composite;
    expect_the_same_bits<SlidingModeController<double, FractionalFastTerminalSurface, CompositeAdaptation>>(setup);
}

#endif

}  // namespace
}  // namespace fracgyro::testing
