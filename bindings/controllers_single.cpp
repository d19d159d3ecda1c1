#include "controllers.hpp"

namespace fracgyro::bindings {

std::unique_ptr<GuardedController> make_single(const Setup& setup) {
    return fracgyro::make_guarded(make_controller<float>(setup.controller, setup.common), setup.common);
}

}  // namespace fracgyro::bindings
