// Compiled with the flags of this kind of processor (CMakeLists.txt).
#include "fracgyro/block.hpp"

namespace fracgyro {

const Kernels<2>& kernels_for_any_processor() {
    static constexpr Kernels<2> kernels = detail::KernelsOf<Controllers<Lanes<2>>>::all();
    return kernels;
}

}  // namespace fracgyro
