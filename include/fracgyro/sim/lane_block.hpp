// A block: one run per lane, moved together. Values that differ from run to run are in lanes; common values, such as
// the number of steps, are single numbers.
#pragma once

#include "fracgyro/sim/lane_noise.hpp"
#include "fracgyro/sim/metrics.hpp"

namespace fracgyro {

template <class T>
struct BlockOf {
    typename Gyroscope<T>::Coefficients plant{};
    Motion<T> motion{};
    MetricsSums<T> sums{};
    T alive = T(1.0);                                    // 0 once the motion has diverged
    std::array<Vec2<T>, longest_segment> disturbance{};  // for the coming segment
};
template <Controller C>
struct Block final : BlockOf<typename C::Value> {
    typename C::Coefficients controller{};
    typename C::State state{};
};

template <class T>
bool diverged(const BlockOf<T>& block) {
    const T size = absolute(block.motion.position.x()) + absolute(block.motion.position.y());
    return !always_less(if_less(T(0.0), block.alive, size, T(0.0)), T(divergence_limit));  // also true for NaN
}

// The closed loop, as in loop.hpp, over the samples from `n` to before `end` of the segment. Returns the sample at
// which it stopped: before `end` if a run has diverged. Compiled once for each kind of processor, in
// bindings/lanes_*.cpp; everything is inlined, so that no other kind uses any of it.
template <Controller C, class T = typename C::Value>
[[gnu::flatten]] std::int64_t advance_block(BlockOf<T>& of_type, std::int64_t n, std::int64_t end) {
    auto& block = static_cast<Block<C>&>(of_type);
    do {
        auto signals = C::step(block.state, block.controller, block.motion);  // 1 to 5
        if constexpr (!measures_velocity<C>) {
            signals.error = tracking_error(block.motion, signals.reference);
        }
        block.sums.add(signals);
        Gyroscope<T>::step(block.motion, block.plant, signals.force,
                           block.disturbance[static_cast<std::size_t>(n)]);  // 6
        ++n;
    } while (n < end && !diverged(block));
    return n;
}

template <class T>
using AdvanceBlock = std::int64_t (*)(BlockOf<T>&, std::int64_t, std::int64_t);

namespace detail {

template <class... Lists>
struct KernelsOf;
template <class... Controllers>
struct KernelsOf<List<Controllers...>> {
    template <class T>
    static constexpr std::array<AdvanceBlock<T>, sizeof...(Controllers)> advance{&advance_block<Controllers>...};
    // The place of a controller's function.
    template <class C>
    static constexpr std::size_t place = [] {
        constexpr std::array<bool, sizeof...(Controllers)> same{std::is_same_v<C, Controllers>...};
        return static_cast<std::size_t>(std::find(same.begin(), same.end(), true) - same.begin());
    }();
};
template <class... Some, class... Others, class... Lists>
struct KernelsOf<List<Some...>, List<Others...>, Lists...> : KernelsOf<List<Some..., Others...>, Lists...> {};

template <Scalar T, class Entries>
struct KernelsFor;
template <Scalar T, class... Entries>
struct KernelsFor<T, std::tuple<Entries...>> : KernelsOf<typename Entries::Type::template Types<T>...> {};

}  // namespace detail

// Functions compiled for one kind of processor: `advance_block` for every controller of the registry, in double and
// single precision, and the noise. Callers of the functions below need a processor of that kind.
template <class Number, std::size_t Count>
struct Kernels {
    using T = Lanes<Number, Count>;
    std::span<const AdvanceBlock<T>> advance = detail::KernelsFor<T, Registry>::template advance<T>;
    using Disturbances = std::span<Vec2<T>>;
    void (*fill_lanes)(const LaneNoise<Count>&, std::int64_t, Disturbances) = &fracgyro::fill_lanes<Number, Count>;
    void (*spread)(std::span<const Vec2<double>>, Disturbances) = &fracgyro::spread<Number, Count>;
    FillNoise fill_noise = &fracgyro::fill_noise<Count * sizeof(Number)>;
};
template <std::size_t Bytes>  // bytes of a register
struct KernelsOfWidth {
    Kernels<double, Bytes / sizeof(double)> doubles;
    Kernels<float, Bytes / sizeof(float)> floats;
};
const KernelsOfWidth<16>& kernels_for_any_processor();
const KernelsOfWidth<32>& kernels_for_avx2();
const KernelsOfWidth<64>& kernels_for_avx512();

}  // namespace fracgyro
