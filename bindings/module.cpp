#include "bindings.hpp"

// The compiler of this module.
#if defined(__clang__)
static constexpr const char* compiler = "clang " __clang_version__;
#elif defined(__GNUC__)
static constexpr const char* compiler = "gcc " __VERSION__;
#else
static constexpr const char* compiler = "unknown";
#endif

NB_MODULE(_core, m) {
    m.doc() = "The compiled part of fracgyro: core/ and sim/. Use it through the Python package.";
    m.attr("compiler") = compiler;
    // An exception's traceback may still hold objects when Python ends: this is not a leak to warn about.
    nanobind::set_leak_warnings(false);
    fracgyro::bindings::bind_fractional(m);
    fracgyro::bindings::bind_disturbance(m);
    fracgyro::bindings::bind_controller(m);
    fracgyro::bindings::bind_user_controller(m);
    fracgyro::bindings::bind_user_plant(m);
    fracgyro::bindings::bind_loop(m);
    fracgyro::bindings::bind_stepper(m);
    fracgyro::bindings::bind_gyroscopes(m);
    fracgyro::bindings::bind_records(m);
    fracgyro::bindings::bind_settings(m);
    fracgyro::bindings::bind_batch(m);
    fracgyro::bindings::bind_firmware(m);
}
