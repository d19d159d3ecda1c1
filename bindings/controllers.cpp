#include "controllers.hpp"

namespace fracgyro::bindings {

std::unique_ptr<AnyController<double>> make_double(const Setup& setup) {
    return make_controller<double>(setup.controller, setup.common);
}

std::unique_ptr<GuardedController> make_guarded(const Setup& setup, bool single) {
    if (single) {
        return make_single(setup);
    }
    return fracgyro::make_guarded(make_double(setup), setup.common);
}

std::unique_ptr<AnyController<double>> filtered_user(UserController& user, const Common& common) {
    return behind_wrappers<double>(user, common);
}

}  // namespace fracgyro::bindings
