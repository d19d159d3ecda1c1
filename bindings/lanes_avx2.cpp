// Compiled with the flags of this kind of processor (CMakeLists.txt).
#include "fracgyro/block.hpp"

namespace fracgyro {

const Kernels<4>& kernels_for_avx2() {
    static constexpr Kernels<4> kernels = detail::KernelsOf<Controllers<Lanes<4>>>::all();
    return kernels;
}

}  // namespace fracgyro
