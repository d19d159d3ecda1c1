// Compiled once for each kind of processor, whose registers have FRACGYRO_REGISTER_BYTES (CMakeLists.txt).
#include "lanes_by_processor.hpp"

#include "fracgyro/sim/lanes.hpp"

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

template struct LanesOf<double, FRACGYRO_REGISTER_BYTES>;
template struct LanesOf<float, FRACGYRO_REGISTER_BYTES>;

}  // namespace fracgyro::testing
