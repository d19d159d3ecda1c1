// Compiled with the flags of this kind of processor (CMakeLists.txt).
#include "fracgyro/sim/lane_block.hpp"

namespace fracgyro {

const KernelsOfWidth<64>& kernels_for_avx512() {
    static constexpr KernelsOfWidth<64> kernels{};
    return kernels;
}

}  // namespace fracgyro
