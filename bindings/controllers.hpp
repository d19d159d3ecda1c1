// Controllers of any type: compiled in a file for each precision, since each type is compiled once for all uses.
#pragma once

#include "fracgyro/sim/guarded_controller.hpp"
#include "fracgyro/sim/user_controller.hpp"

namespace fracgyro::bindings {

std::unique_ptr<AnyController<double>> make_double(const Setup& setup);
std::unique_ptr<GuardedController> make_guarded(const Setup& setup, bool single);
std::unique_ptr<GuardedController> make_single(const Setup& setup);

using Users = std::vector<UserController*>;
// A user's controller behind the filter of the setup; nullptr without one.
std::unique_ptr<AnyController<double>> filtered_user(UserController& user, const Common& common);

}  // namespace fracgyro::bindings
