#pragma once

#include "fracgyro/sim/recorder.hpp"

#include <nanobind/nanobind.h>

namespace fracgyro::bindings {

// One for each header that is bound.
void bind_fractional(nanobind::module_& m);
void bind_controller(nanobind::module_& m);
void bind_loop(nanobind::module_& m);
void bind_device(nanobind::module_& m);
void bind_settings(nanobind::module_& m);
void bind_batch(nanobind::module_& m);
void bind_disturbance(nanobind::module_& m);
void bind_firmware(nanobind::module_& m);
void bind_outside(nanobind::module_& m);
void bind_stepper(nanobind::module_& m);

// For this processor.
FillNoise fastest_noise();

// Name, width, unit and meaning.
nanobind::tuple described(const Channel& c);

}  // namespace fracgyro::bindings
