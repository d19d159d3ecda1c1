#include "fracgyro/sim/lane_setup.hpp"

namespace fracgyro {

template const BlockType<Lanes<float, 4>>& block_type_of(const ControllerParams&);
template const BlockType<Lanes<float, 8>>& block_type_of(const ControllerParams&);
template const BlockType<Lanes<float, 16>>& block_type_of(const ControllerParams&);

}  // namespace fracgyro
