// Lane key: the values that runs in one block must share, i.e. all except separate numbers in each lane. It is read
// from the coefficients themselves, so that no switch can be forgotten.
#pragma once

#include "fracgyro/sim/aggregate.hpp"
#include "fracgyro/sim/lanes.hpp"
#include "fracgyro/sim/loop.hpp"

#include <string>

namespace fracgyro {

namespace detail {

inline void append_bytes(std::string& key, const auto& value) {
    key.append(reinterpret_cast<const char*>(&value), sizeof value);
}

// Appends the numbers of a reference and its lists, which runs of one reference share.
inline void append_course(std::string& key, const Course* course) {
    append_bytes(key, course != nullptr);
    if (course != nullptr) {
        for_each_field("", course->params, [&](std::string_view, const auto&, const auto& value) {
            for_each_part(value, [&](std::string_view, const auto& number) { append_bytes(key, number); });
        });
        append_bytes(key, course->terms.data());
        append_bytes(key, course->rows.data());
    }
}

// Appends every count and switch in coefficients of lanes.
template <class T, class Value>
void append_switches(std::string& key, const Value& value) {
    if constexpr (std::is_arithmetic_v<Value> || std::is_enum_v<Value>) {
        append_bytes(key, value);
    } else if constexpr (std::is_same_v<Value, T> || std::is_same_v<Value, typename PhaseOf<T>::Type>) {
        // one in each lane
    } else if constexpr (std::is_same_v<Value, const Course*>) {
        append_course(key, value);
    } else if constexpr (requires { value.begin(); }) {
        for (const auto& each : value) {
            append_switches<T>(key, each);
        }
    } else {
        with_members(value, [&](const auto&... members) { (append_switches<T>(key, members), ...); });
    }
}

}  // namespace detail

// Runs with the same key may share a block. A controller with memory may have any number of exponentials, since missing
// ones are padded with weight 0; here one represents all, which takes the least time.
inline std::string lane_key(const Setup& setup) {
    using T = Lanes<double, 2>;
    std::string key;
    const auto append = [&](const auto& value) { detail::append_switches<T>(key, value); };
    append(setup.steps);
    append(setup.common.step);
    append(setup.controller.index());
    ControllerParams params = setup.controller;
    if (ExponentialSum* const kernel = kernel_of(params); kernel != nullptr && kernel->count > 0) {
        kernel->count = 1;
    }
    with_controller<T>(params, [&]<class C>() {
        with_params(params, [&](const auto& p, auto family) { append(family.chosen(p)); });
        append(prepare<C>(params, setup.common));
    });
    return key;
}

}  // namespace fracgyro
