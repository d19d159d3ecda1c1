// The numbers of a rate that moves and of a device that is not ideal, one after another, in the order of their structs:
// for faces that are handed numbers and not structs. They have no names there.
#pragma once

#include "fracgyro/sim/aggregate.hpp"
#include "fracgyro/sim/device_loop.hpp"

namespace fracgyro {

// Calls visit(number) for each, a double, and takes what it is then. Before the numbers of a list comes how many.
template <class Value, class Visit>
void for_each_device_setting(Value& value, Visit&& visit) {
    if constexpr (requires { value.resize(1); }) {
        auto count = value.size();
        for_each_device_setting(count, visit);
        value.resize(count);
        for (auto& each : value) {
            for_each_device_setting(each, visit);
        }
    } else if constexpr (std::is_arithmetic_v<Value> || std::is_enum_v<Value> || requires { value.x(); }) {
        for_each_part(value, [&](std::string_view, auto& part) {
            auto number = static_cast<double>(part);
            visit(number);
            part = static_cast<std::remove_reference_t<decltype(part)>>(number);
        });
    } else {
        with_members(value, [&](auto&... members) { (for_each_device_setting(members, visit), ...); });
    }
}

inline std::vector<double> device_settings(DeviceSetup setup) {
    std::vector<double> found;
    const auto keep = [&](double number) { found.push_back(number); };
    for_each_device_setting(setup.rate, keep);
    for_each_device_setting(setup.device, keep);
    return found;
}

inline void take_device_settings(DeviceSetup& setup, const double* values) {
    const auto next = [&](double& number) { number = *values++; };
    for_each_device_setting(setup.rate, next);
    for_each_device_setting(setup.device, next);
}

}  // namespace fracgyro
