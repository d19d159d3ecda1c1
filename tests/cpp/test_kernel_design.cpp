#include "scalars.hpp"

#include "fracgyro/core/kernel_design.hpp"

#include <memory>

namespace fracgyro::testing {
namespace {

double relative_error(const KernelDesign& found, double order, double time) {
    long double sum = 0.0L;
    for (std::size_t j = 0; j < found.count; ++j) {
        sum += static_cast<long double>(found.weights[j]) *
               std::exp(-static_cast<long double>(found.poles[j]) * static_cast<long double>(time));
    }
    const auto a = static_cast<long double>(order);
    return static_cast<double>(sum * std::tgamma(1.0L - a) * std::pow(static_cast<long double>(time), a) - 1.0L);
}

// K(1/√2) is Γ(1/4)²/(4√π); K(k) → ln(4/√(1-k²)) as k → 1, here with 1-k² = 1/R².
TEST(KernelDesign, StartsFromTheQuarterPeriodOfEllipticFunctions) {
    EXPECT_NEAR(quarter_period(std::sqrt(2.0) - 1.0), 1.85407467730137191843, 1e-14);
    EXPECT_NEAR(quarter_period(1e5), std::log(4.0 * (1.0 + 1e5)), 1e-9);
    EXPECT_NEAR(quarter_period(0.0), 0.5 * std::acos(-1.0), 1e-15);
}

TEST(KernelDesign, IsPositiveAscendingAndWithinItsCertifiedErrorBetweenSamplesToo) {
    const auto found = std::make_unique<KernelDesign>();
    for (const double order : {5e-324, 1e-300, 1e-9, 1e-3, 0.1, 0.5, 0.9, 0.999, 1.0 - 0x1p-53}) {
        for (const double ratio : {1.0 + 1e-12, 1.5, 1e3, 1e6, 1e10}) {
            for (const double tolerance : {1e-10, 1e-6, 1e-1}) {
                found->design(order, 1e-3, 1e-3 * ratio, tolerance);
                ASSERT_GE(found->count, 1U) << order << " " << ratio << " " << tolerance;
                EXPECT_LE(found->error, tolerance);
                for (std::size_t j = 0; j < found->count; ++j) {
                    EXPECT_GT(found->poles[j], j == 0 ? 0.0 : found->poles[j - 1]);
                    EXPECT_GT(found->weights[j], 0.0);
                }
                double worst = 0.0;
                for (int i = 0; i <= 300; ++i) {
                    const double time = 1e-3 * std::pow(ratio, i / 300.0);
                    worst = std::max(worst, std::abs(relative_error(*found, order, time)));
                }
                EXPECT_LE(worst, found->error + 1e-15) << order << " " << ratio << " " << tolerance;
            }
        }
    }
}

TEST(KernelDesign, StaysNormalAtTheEndsOfItsRange) {
    const auto found = std::make_unique<KernelDesign>();
    for (const double order : {5e-324, 1e-12, 0.5, 1.0 - 0x1p-53}) {
        for (const double shortest : {KernelDesign::earliest, KernelDesign::latest}) {
            found->design(order, shortest, 1e10 * shortest, 1e-6);
            ASSERT_GE(found->count, 1U);
            for (std::size_t j = 0; j < found->count; ++j) {
                EXPECT_TRUE(std::isnormal(found->poles[j]) && std::isnormal(found->weights[j]));
            }
        }
    }
}

TEST(KernelDesign, FindsNothingOutsideItsRange) {
    const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
    const auto found = std::make_unique<KernelDesign>();
    const auto count = [&](double order, double shortest, double longest, double tolerance) {
        found->design(order, shortest, longest, tolerance);
        return found->count;
    };
    EXPECT_EQ(count(0.5, 1.0, 10.0, 1e-6), 6U);
    for (const double order : {0.0, 1.0, -0.1, nan}) {
        EXPECT_EQ(count(order, 1.0, 10.0, 1e-6), 0U);
    }
    for (const double longest : {1.0, 0.5, 1.1e10, infinity, nan}) {
        EXPECT_EQ(count(0.5, 1.0, longest, 1e-6), 0U);
    }
    EXPECT_EQ(count(0.5, 1e-201, 1e-200, 1e-6), 0U);
    EXPECT_EQ(count(0.5, 1e201, 1e202, 1e-6), 0U);
    EXPECT_EQ(count(0.5, 1.0, 10.0, 1e-12), 0U);
    EXPECT_EQ(count(0.5, 1.0, 10.0, 0.2), 0U);
    EXPECT_EQ(count(0.5, 1.0, 10.0, nan), 0U);
}

// A hash over every bit of many designs: any compiler and processor must find this very number.
TEST(KernelDesign, HasTheSameBitsOnEveryProcessor) {
    const auto found = std::make_unique<KernelDesign>();
    std::uint64_t hash = 0xcbf29ce484222325U;  // FNV-1a, by words
    const auto add = [&](double value) { hash = (hash ^ std::bit_cast<std::uint64_t>(value)) * 0x100000001b3U; };
    for (int percent = 1; percent < 100; percent += 7) {
        for (const double ratio : {2.0, 80'000.0, 1e6, 1e9}) {
            for (const double tolerance : {1e-9, 1e-6, 1e-2}) {
                found->design(percent / 100.0, 1e-3, 1e-3 * ratio, tolerance);
                add(found->error);
                for (std::size_t j = 0; j < found->count; ++j) {
                    add(found->poles[j]);
                    add(found->weights[j]);
                }
            }
        }
    }
    EXPECT_EQ(hash, 0x7cc411bd6e9df4eeU);
}

TEST(DesignedModes, CoverAtLeastTenStepsAndAreNoneForIntegerOrders) {
    const auto room = std::make_unique<KernelDesign>();
    const ExponentialSum brief = designed_kernel(*room, 0.5, 1e-3, 1e-3, 1e-6);
    room->design(0.5, 1e-3, 1e-2, 1e-6);
    EXPECT_EQ(brief.count, room->count);
    EXPECT_EQ(brief.error, room->error);
    EXPECT_EQ(brief.poles[0], room->poles[0]);
    for (const double order : {0.0, 1.0}) {
        const ExponentialSum none = designed_kernel(*room, order, 1e-3, 80.0, 1e-6);
        EXPECT_EQ(none.count, 0U);
        EXPECT_EQ(none.gamma, 1.0);
        EXPECT_EQ(none.error, 0.0);
    }
    EXPECT_EQ(designed_kernel(*room, 0.999, 1e-3, 1e7, 1e-11).count, 0U);  // would be 71, more than there is room for
}

}  // namespace
}  // namespace fracgyro::testing
