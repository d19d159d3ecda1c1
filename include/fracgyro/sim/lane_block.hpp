// A block: as many runs as there are lanes, moved together. What differs from run to run lies in lanes; what does not,
// such as the number of steps, is one number.
#pragma once

#include "fracgyro/sim/lanes.hpp"
#include "fracgyro/sim/metrics.hpp"

namespace fracgyro {

inline constexpr std::size_t longest_stretch = 64;  // samples

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
    const T size = absolute(block.motion.position.x) + absolute(block.motion.position.y);
    return !always_less(if_less(T(0.0), block.alive, size, T(0.0)), T(divergence_limit));  // also true for NaN
}

// The closed loop, as in loop.hpp, over the samples from `n` to before `end` of the stretch. Returns where it stopped:
// before `end` when a run has diverged. Compiled once for each kind of processor, in bindings/lanes_*.cpp; everything
// is inlined, so that nothing of it serves another.
template <Controller C>
[[gnu::flatten]] std::int64_t advance_block(Block<C>& block, std::int64_t n, std::int64_t end) {
    using T = typename C::Value;
    do {
        const auto signals = C::step(block.state, block.controller, block.motion);  // 1 to 5
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

// `advance_block` for every controller of the registry, in double and single precision. One of these for each kind of
// processor: whoever calls its own function below needs a processor of that kind.
template <class Number, std::size_t Count>
using Kernels = typename detail::KernelsFor<Lanes<Number, Count>, Registry>::Type;
template <std::size_t Bytes>  // of a register
struct KernelsOfWidth {
    Kernels<double, Bytes / sizeof(double)> doubles;
    Kernels<float, Bytes / sizeof(float)> floats;
    static constexpr KernelsOfWidth all() {
        return {.doubles = detail::KernelsFor<Lanes<double, Bytes / sizeof(double)>, Registry>::all(),
                .floats = detail::KernelsFor<Lanes<float, Bytes / sizeof(float)>, Registry>::all()};
    }
};
const KernelsOfWidth<16>& kernels_for_any_processor();
const KernelsOfWidth<32>& kernels_for_avx2();
const KernelsOfWidth<64>& kernels_for_avx512();

}  // namespace fracgyro
