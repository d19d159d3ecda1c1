#include "made.hpp"

namespace fracgyro {

template std::unique_ptr<AnyController<double>> make_controller(const ControllerParams&, const Common&);
template std::unique_ptr<AnyController<float>> make_controller(const ControllerParams&, const Common&);

}  // namespace fracgyro
