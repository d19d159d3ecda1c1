#pragma once

#include "fracgyro/sim/recorder.hpp"

#include <nanobind/nanobind.h>

#include <atomic>
#include <functional>

namespace fracgyro::bindings {

// One function for each bound header.
void bind_fractional(nanobind::module_& m);
void bind_controller(nanobind::module_& m);
void bind_loop(nanobind::module_& m);
void bind_records(nanobind::module_& m);
void bind_settings(nanobind::module_& m);
void bind_batch(nanobind::module_& m);
void bind_disturbance(nanobind::module_& m);
void bind_firmware(nanobind::module_& m);
void bind_gyroscopes(nanobind::module_& m);
void bind_user_controller(nanobind::module_& m);
void bind_user_plant(nanobind::module_& m);
void bind_stepper(nanobind::module_& m);

// The fastest one on this processor.
FillNoise fastest_noise();

// parallel_for without the GIL, during which a user may press a key: `stop` is then set, for the tasks to end by
// throwing Stopped, and KeyboardInterrupt is raised.
void interruptible_for(std::size_t count, unsigned threads, std::atomic<bool>& stop,
                       const std::function<void(std::size_t)>& task);

// Name, width, unit and meaning.
nanobind::tuple described(const Channel& c);

}  // namespace fracgyro::bindings
