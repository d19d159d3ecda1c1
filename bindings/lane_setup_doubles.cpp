#include "fracgyro/sim/lane_setup.hpp"

namespace fracgyro {

template const BlockType<Lanes<double, 2>>& block_type_of(const ControllerParams&);
template const BlockType<Lanes<double, 4>>& block_type_of(const ControllerParams&);
template const BlockType<Lanes<double, 8>>& block_type_of(const ControllerParams&);

}  // namespace fracgyro
