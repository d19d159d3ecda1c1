#include "bindings.hpp"

NB_MODULE(_core, m) {
    m.doc() = "The compiled part of fracgyro: core/ and sim/. Use it through the Python package.";
    fracgyro::bindings::bind_fractional(m);
    fracgyro::bindings::bind_disturbance(m);
    fracgyro::bindings::bind_controller(m);
    fracgyro::bindings::bind_device(m);
    fracgyro::bindings::bind_loop(m);
    fracgyro::bindings::bind_settings(m);
    fracgyro::bindings::bind_batch(m);
    fracgyro::bindings::bind_firmware(m);
}
