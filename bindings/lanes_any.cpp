// Compiled with the flags of this kind of processor (CMakeLists.txt).
#include "fracgyro/sim/lane_block.hpp"

namespace fracgyro {

const KernelsOfWidth<16>& kernels_for_any_processor() {
    static constexpr KernelsOfWidth<16> kernels{};
    return kernels;
}

}  // namespace fracgyro
