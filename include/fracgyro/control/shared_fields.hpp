// Parameters that several controllers have.
#pragma once

#include "fracgyro/core/fields.hpp"

namespace fracgyro {

// The natural frequency of a loop that holds the error by a spring and a damper.
template <class Member>
constexpr auto loop_frequency_field(Member member) {
    return field("natural_frequency", member, "omega0", above_0,
                 "omega_n, unit omega0, > 0: of the loop. omega_n times run.step must stay below about 0.6.");
}

template <class Member>
constexpr auto surface_gain_field(Member member) {
    return field("surface_gain", member, "omega0", above_0,
                 "lambda, unit omega0, > 0: decay of e on the surface s = de/dt + lambda e.");
}

template <class Member>
constexpr auto reaching_rate_field(Member member) {
    return field("reaching_rate", member, "omega0", above_0, "kappa, unit omega0, > 0: decay of s.");
}

}  // namespace fracgyro
