// A loop whose bounds the compiler knows, written out: a small loop costs a microcontroller more than its contents.
#pragma once

#include "fracgyro/core/scalar.hpp"

#include <utility>

namespace fracgyro {

// f(i) for i from `begin` to before `end`, each an integral constant.
template <std::size_t begin, std::size_t end, class F>
constexpr void unrolled(F&& f) {
    [&]<std::size_t... i>(std::index_sequence<i...>) {
        (f(std::integral_constant<std::size_t, begin + i>{}), ...);
    }(std::make_index_sequence<end - begin>{});
}

}  // namespace fracgyro
