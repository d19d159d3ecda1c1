// The natural frequency of the loop: a parameter of every controller that holds the error by a spring and a damper.
#pragma once

#include "fracgyro/core/fields.hpp"

namespace fracgyro {

template <class Member>
constexpr auto loop_frequency_field(Member member) {
    return field("natural_frequency", member, "omega0", above_0,
                 "omega_n, unit omega0, > 0: of the loop. omega_n times run.step must stay below about 0.6.");
}

}  // namespace fracgyro
