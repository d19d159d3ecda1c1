// The numbers of a run by name, and the switches among them.
#pragma once

#include "paper.hpp"

#include "fracgyro/sim/settings.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <map>
#include <string>

namespace fracgyro::testing {

// Calls visit(name, field, number) for every number of a run.
template <class SetupLike, class Visit>
void for_each_named(SetupLike& setup, Visit&& visit) {
    for_each_setting(setup, [&](std::string_view table, const auto& field, std::string_view part, auto& number) {
        visit(std::string(table) + '.' + std::string(field.name) + std::string(part), field, number);
    });
}

// The run with one number set to another.
inline fracgyro::Setup with(fracgyro::Setup setup, const std::string& name, double value) {
    bool found = false;
    for_each_named(setup, [&](const std::string& each, const auto&, auto& number) {
        if (each == name) {
            number = static_cast<std::remove_reference_t<decltype(number)>>(value);
            found = true;
        }
    });
    EXPECT_TRUE(found) << name;
    return setup;
}

struct Switch {
    double off, on, also_on;
};
// Switches that apply to a whole block. All values that turn a feature on are equal.
inline const std::map<std::string, Switch> switches{
    {"run.step", {1e-3, 2e-3, 2e-3}},
    {"run.steps", {2000, 1999, 1999}},
    {"controller.force_limit", {std::numeric_limits<double>::infinity(), 100.0, 200.0}},
    {"controller.switching_limit", {std::numeric_limits<double>::infinity(), 0.5, 0.25}},
    {"controller.terminal_exponent", {0.5, 0.7, 0.25}},
    {"controller.rate_law", {0.0, 1.0, 1.0}},
    {"controller.feedforward", {0.0, 1.0, 1.0}},
    {"adaptation.leakage", {0.0, 1.0, 2.0}},
    {"adaptation.dead_zone", {0.0, 0.5, 0.25}},
    {"adaptation.projection", {0.0, 0.5, 0.25}},
    {"adaptation.kind", {0.0, 1.0, 1.0}},
};

}  // namespace fracgyro::testing
