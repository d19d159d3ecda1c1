// A block: as many runs as there are lanes, moved together. What differs from run to run lies in lanes; what does not,
// such as the number of steps, is one number.
#pragma once

#include "lanes.hpp"
#include "metrics.hpp"

namespace fracgyro {

inline constexpr std::size_t longest_stretch = 64;  // samples

template <class Controller>
struct Block {
    using T = typename Controller::Value;
    typename Controller::Coefficients controller{};
    typename Plant<T>::Coefficients plant{};
    typename Controller::State state{};
    Motion<T> motion{};
    MetricsSums<T> sums{};
    T alive = T(1.0);                                    // 0 where the motion has diverged
    std::array<Vec2<T>, longest_stretch> disturbance{};  // of the coming stretch
};

template <class Controller>
bool diverged(const Block<Controller>& block) {
    using T = typename Controller::Value;
    const T size = absolute(block.motion.position.x) + absolute(block.motion.position.y);
    return !always_less(if_less(T(0.0), block.alive, size, T(0.0)), T(divergence_limit));  // also true for NaN
}

// The closed loop, as in loop.hpp, over the samples from `n` to before `end` of the stretch. Returns where it stopped: before
// `end` when a run has diverged. Compiled once for each kind of processor, in bindings/lanes_*.cpp; everything is inlined,
// so that nothing of it serves another.
template <class Controller>
[[gnu::flatten]] std::int64_t move(Block<Controller>& block, std::int64_t n, std::int64_t end) {
    using T = typename Controller::Value;
    do {
        const Signals<T> signals = Controller::step(block.state, block.controller, block.motion);  // 1 to 5
        block.sums.add(signals);
        Plant<T>::step(block.motion, block.plant, signals.force, block.disturbance[static_cast<std::size_t>(n)]);  // 6
        ++n;
    } while (n < end && !diverged(block));
    return n;
}

template <class Controller>
using Move = std::int64_t (*)(Block<Controller>&, std::int64_t, std::int64_t);

namespace detail {
template <class List>
struct KernelsOf;
template <class... Entries>
struct KernelsOf<std::tuple<Entries...>> {
    using Type = std::tuple<Move<typename Entries::Type>..., Move<Composite<typename Entries::Type>>...>;
    static constexpr Type all() {
        return {&move<typename Entries::Type>..., &move<Composite<typename Entries::Type>>...};
    }
};
}  // namespace detail

// `move` for every controller in the list, in double and single precision. One of these for each kind of processor: whoever calls its own function below
// needs a processor of that kind.
template <class Number, std::size_t Count>
using Kernels = typename detail::KernelsOf<Controllers<Lanes<Number, Count>>>::Type;
template <std::size_t Bytes>  // of a register
struct KernelsOfWidth {
    Kernels<double, Bytes / sizeof(double)> doubles;
    Kernels<float, Bytes / sizeof(float)> floats;
    static constexpr KernelsOfWidth all() {
        return {.doubles = detail::KernelsOf<Controllers<Lanes<double, Bytes / sizeof(double)>>>::all(),
                .floats = detail::KernelsOf<Controllers<Lanes<float, Bytes / sizeof(float)>>>::all()};
    }
};
const KernelsOfWidth<16>& kernels_for_any_processor();
const KernelsOfWidth<32>& kernels_for_avx2();
const KernelsOfWidth<64>& kernels_for_avx512();

}  // namespace fracgyro
