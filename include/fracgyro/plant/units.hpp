// What a number in the units of a run is divided by to be nondimensional: all 1, or those of SI.
#pragma once

namespace fracgyro {

struct Units {
    double time = 1.0, length = 1.0, velocity = 1.0, acceleration = 1.0, force = 1.0, rate = 1.0;
};

}  // namespace fracgyro
