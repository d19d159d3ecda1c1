// Compiled once for each kind of processor, whose registers have FRACGYRO_REGISTER_BYTES (CMakeLists.txt).
#include "lanes_by_processor.hpp"

#include "fracgyro/sim/lane_noise.hpp"

namespace fracgyro::testing {
namespace {

template <class T, class Number>
T loaded(const Number* from) {
    T lanes;
    for (std::size_t k = 0; k < T::count; ++k) {
        lanes.lane[k] = from[k];
    }
    return lanes;
}

template <class T, class Number>
void store(const T& lanes, Number*& to) {
    for (std::size_t k = 0; k < T::count; ++k) {
        *to++ = lanes.lane[k];
    }
}

}  // namespace

template <class Number, std::size_t Bytes>
void LanesOf<Number, Bytes>::power(const Number* base, const Number* exponent, Number* found) {
    using T = Lanes<Number, count>;
    store(fracgyro::power(loaded<T>(base), loaded<T>(exponent)), found);
}

template <class Number, std::size_t Bytes>
void LanesOf<Number, Bytes>::arithmetic(const Number* a_numbers, const Number* b_numbers, Number* found) {
    using T = Lanes<Number, count>;
    const T a = loaded<T>(a_numbers), b = loaded<T>(b_numbers);
    for (const T& result : {a + b, a - b, a * b, -a, maximum(a, b), minimum(a, b), absolute(a),
                            with_sign_of(a, absolute(b)), if_less(a, b, T(1.0), T(2.0)), square_root(absolute(b))}) {
        store(result, found);
    }
}

template <class Number, std::size_t Bytes>
bool LanesOf<Number, Bytes>::each_is_less(const Number* a, const Number* b) {
    using T = Lanes<Number, count>;
    return always_less(loaded<T>(a), loaded<T>(b));
}

template <class Number, std::size_t Bytes>
[[gnu::flatten]] void LanesOf<Number, Bytes>::noise(std::uint64_t seed, std::uint32_t stream, std::int64_t hold,
                                                    std::int64_t first, std::size_t steps, double* found) {
    DisturbanceParams params;
    params.standard_deviation = 1.7;
    params.hold = hold;
    params.seed = seed;
    params.stream = stream;
    std::array<Vec2<double>, longest_noise> drawn;
    fill_noise<Bytes>(params, first, std::span(drawn).first(steps));
    for (std::size_t i = 0; i < steps; ++i) {
        *found++ = drawn[i].x();
        *found++ = drawn[i].y();
    }
}

template <class Number, std::size_t Bytes>
[[gnu::flatten]] void LanesOf<Number, Bytes>::noise_in_lanes(const std::uint64_t* seeds, const double* deviations,
                                                             std::int64_t hold, std::int64_t first, std::size_t steps,
                                                             Number* found) {
    LaneNoise<count> noise;
    noise.hold = hold;
    for (std::size_t k = 0; k < count; ++k) {
        noise.seed[k] = seeds[k];
        noise.standard_deviation[k] = deviations[k];
    }
    std::array<Vec2<Lanes<Number, count>>, longest_noise> drawn;
    fill_lanes<Number, count>(noise, first, std::span(drawn).first(steps));
    for (std::size_t i = 0; i < steps; ++i) {
        store(drawn[i].x(), found);
        store(drawn[i].y(), found);
    }
}

template struct LanesOf<double, FRACGYRO_REGISTER_BYTES>;
template struct LanesOf<float, FRACGYRO_REGISTER_BYTES>;

}  // namespace fracgyro::testing
