// A block: as many runs as there are lanes, moved together. What differs from run to run lies in lanes; what does not,
// such as the number of steps, is one number.
#pragma once

#include "fracgyro/sim/lane_noise.hpp"
#include "fracgyro/sim/metrics.hpp"

namespace fracgyro {

template <Controller C>
struct Block {
    using T = typename C::Value;
    typename C::Coefficients controller{};
    typename Gyroscope<T>::Coefficients plant{};
    typename C::State state{};
    Motion<T> motion{};
    MetricsSums<T> sums{};
    T alive = T(1.0);                                    // 0 where the motion has diverged
    std::array<Vec2<T>, longest_stretch> disturbance{};  // of the coming stretch
};

template <Controller C>
bool diverged(const Block<C>& block) {
    using T = typename C::Value;
    const T size = absolute(block.motion.position.x()) + absolute(block.motion.position.y());
    return !always_less(if_less(T(0.0), block.alive, size, T(0.0)), T(divergence_limit));  // also true for NaN
}

// The closed loop, as in loop.hpp, over the samples from `n` to before `end` of the stretch. Returns where it stopped:
// before `end` when a run has diverged. Compiled once for each kind of processor, in bindings/lanes_*.cpp; everything
// is inlined, so that nothing of it serves another.
template <Controller C>
[[gnu::flatten]] std::int64_t advance_block(Block<C>& block, std::int64_t n, std::int64_t end) {
    using T = typename C::Value;
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

template <Controller C>
using AdvanceBlock = std::int64_t (*)(Block<C>&, std::int64_t, std::int64_t);

namespace detail {

template <class... Lists>
struct KernelsOf;
template <class... Controllers>
struct KernelsOf<List<Controllers...>> {
    using Type = std::tuple<AdvanceBlock<Controllers>...>;
    static constexpr Type all() { return {&advance_block<Controllers>...}; }
};
template <class... Some, class... Others, class... Lists>
struct KernelsOf<List<Some...>, List<Others...>, Lists...> : KernelsOf<List<Some..., Others...>, Lists...> {};

template <Scalar T, class Entries>
struct KernelsFor;
template <Scalar T, class... Entries>
struct KernelsFor<T, std::tuple<Entries...>> : KernelsOf<typename Entries::Type::template Types<T>...> {};

}  // namespace detail

// What is compiled for one kind of processor: `advance_block` for every controller of the registry, in double and
// single precision, and the noise. Whoever calls one of the functions below needs a processor of its kind.
template <class Number, std::size_t Count>
struct Kernels {
    using Advance = detail::KernelsFor<Lanes<Number, Count>, Registry>;
    typename Advance::Type advance = Advance::all();
    using Disturbances = std::span<Vec2<Lanes<Number, Count>>>;
    void (*fill_lanes)(const LaneNoise<Count>&, std::int64_t, Disturbances) = &fracgyro::fill_lanes<Number, Count>;
    void (*spread)(std::span<const Vec2<double>>, Disturbances) = &fracgyro::spread<Number, Count>;
    FillNoise fill_noise = &fracgyro::fill_noise<Count * sizeof(Number)>;
};
template <std::size_t Bytes>  // of a register
struct KernelsOfWidth {
    Kernels<double, Bytes / sizeof(double)> doubles;
    Kernels<float, Bytes / sizeof(float)> floats;
};
const KernelsOfWidth<16>& kernels_for_any_processor();
const KernelsOfWidth<32>& kernels_for_avx2();
const KernelsOfWidth<64>& kernels_for_avx512();

}  // namespace fracgyro
