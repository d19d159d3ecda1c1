// Divisors that make the numbers of a run nondimensional: all 1, or SI units.
#pragma once

namespace fracgyro {

struct Units {
    double time = 1.0, length = 1.0, velocity = 1.0, acceleration = 1.0, force = 1.0, rate = 1.0;
};

}  // namespace fracgyro
