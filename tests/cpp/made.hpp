// All controllers behind tables of functions, compiled once for the tests that need them, in made.cpp.
#pragma once

#include "fracgyro/sim/any_controller.hpp"

namespace fracgyro {

extern template std::unique_ptr<AnyController<double>> make_controller(const ControllerParams&, const Common&);
extern template std::unique_ptr<AnyController<float>> make_controller(const ControllerParams&, const Common&);

}  // namespace fracgyro
