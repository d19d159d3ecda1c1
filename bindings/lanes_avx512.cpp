// Compiled with the flags of this kind of processor (CMakeLists.txt).
#include "fracgyro/block.hpp"

namespace fracgyro {

const Kernels<8>& kernels_for_avx512() {
    static constexpr Kernels<8> kernels = detail::KernelsOf<Controllers<Lanes<8>>>::all();
    return kernels;
}

}  // namespace fracgyro
