// Compiled with the flags of this kind of processor (CMakeLists.txt).
#include "fracgyro/sim/lane_block.hpp"

namespace fracgyro {

const KernelsOfWidth<32>& kernels_for_avx2() {
    static constexpr KernelsOfWidth<32> kernels{};
    return kernels;
}

}  // namespace fracgyro
