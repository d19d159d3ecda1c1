// Numbers of a run by name: for integrations that pass numbers and not structs.
//
// They are listed in the order of the fields() of its structs, under the names of the scenario's fields, with [0] or .x
// or .xx for their parts. Values are nondimensional, as in the core; a switch is 0 or 1 and a choice its index in the
// list of choices. The exponentials' poles and weights are passed separately.
#pragma once

#include "fracgyro/sim/device_loop.hpp"

namespace fracgyro {

// Calls visit(table, field, part, number) for each number of a struct, of any type that a double can be cast to.
template <class Struct, class Visit>
constexpr void for_each_setting_of(std::string_view table, Struct& fields, Visit&& visit) {
    for_each_field(table, fields, [&](std::string_view inner, const auto& field, auto& value) {
        for_each_part(value, [&](std::string_view part, auto& number) { visit(inner, field, part, number); });
    });
}

// Numbers of a run on an ideal device, with a controller of any kind or of one.
template <class SetupLike, class Visit>
constexpr void for_each_setting(SetupLike& setup, Visit&& visit) {
    const auto of = [&](std::string_view table, auto& fields) { for_each_setting_of(table, fields, visit); };
    constexpr auto step =
        settable(Settable::beforehand, field("step", 0, "1/omega0", above_0, "h: time from one step to the next."));
    constexpr auto steps = settable(Settable::never, field("steps", 0, "1", at_least_0, "Steps of the run."));
    visit(std::string_view("run"), step, std::string_view(), setup.common.step);
    visit(std::string_view("run"), steps, std::string_view(), setup.steps);
    of("controller", setup.common);
    if constexpr (requires { setup.controller.index(); }) {
        with_params(setup.controller, [&](auto& params, auto) { of("controller", params); });
    } else {
        of("controller", setup.controller);
    }
    of("plant", setup.plant);
    of("disturbance", setup.disturbance);
}

// Additional numbers of a dynamic rate and a real device. Their profiles, which are lists, are passed separately.
template <class SetupLike, class Visit>
constexpr void for_each_device_setting(SetupLike& setup, Visit&& visit) {
    for_each_setting_of("rate", setup.rate, visit);
    for_each_setting_of("device", setup.device, visit);
}

template <class Params>
std::size_t setting_count(const SetupOf<Params>& setup) {
    std::size_t count = 0;
    for_each_setting(setup, [&](std::string_view, const auto&, std::string_view, const auto&) { ++count; });
    return count;
}
inline std::size_t device_setting_count() {
    std::size_t count = 0;
    const DeviceSetup setup;
    for_each_device_setting(setup, [&](std::string_view, const auto&, std::string_view, const auto&) { ++count; });
    return count;
}

namespace detail {
struct TakeFrom {
    const double*& values;
    template <class Field, class Number>
    constexpr void operator()(std::string_view, const Field&, std::string_view, Number& number) const {
        number = static_cast<Number>(*values++);
    }
};
}  // namespace detail

// Takes every number from `values`, in that order. The setup must be of the same kind.
template <class Params>
void take_settings(SetupOf<Params>& setup, const double* values) {
    for_each_setting(setup, detail::TakeFrom{values});
    prepare_reference(setup);
}
template <class Params>
void take_device_settings(DeviceSetupOf<Params>& setup, const double* values) {
    for_each_device_setting(setup, detail::TakeFrom{values});
}

// Lists of a reference from numbers: amplitude, frequency and phase of each term, each x, y; time, position, velocity
// and acceleration of each row.
inline ReferenceLists lists_from(std::span<const double> terms, std::span<const double> rows) {
    ReferenceLists lists;
    for (; terms.size() >= 6; terms = terms.subspan(6)) {
        lists.terms.push_back({{terms[0], terms[1]}, {terms[2], terms[3]}, {terms[4], terms[5]}});
    }
    for (; rows.size() >= 7; rows = rows.subspan(7)) {
        lists.rows.push_back({rows[0], {rows[1], rows[2]}, {rows[3], rows[4]}, {rows[5], rows[6]}});
    }
    return lists;
}

// Takes the terms of the disturbance from one list: for each the numbers of its fields(), the number of its rows, and
// their places, x and y values.
inline void take_terms(DisturbanceParams& disturbance, std::span<const double> numbers) {
    disturbance.terms.clear();
    for (const double *at = numbers.data(), *const end = at + numbers.size(); at != end;) {
        DisturbanceTerm& term = disturbance.terms.emplace_back();
        for_each_setting_of("disturbance", term, detail::TakeFrom{at});
        const auto rows = static_cast<std::ptrdiff_t>(*at++);
        for (std::vector<double>* const column : {&term.places, &term.x_values, &term.y_values}) {
            column->assign(at, at + rows);
            at += rows;
        }
    }
}

// Takes Ωx and Ωy over time from one list: those of the plant, then times in steps, all Ωx and all Ωy.
inline void take_transverse(AngularRateParams& rate, std::span<const double> numbers) {
    if (numbers.size() < 2) {
        return;
    }
    rate.across_mean = {numbers[0], numbers[1]};
    const std::size_t count = (numbers.size() - 2) / 3;
    const auto part = [&](std::size_t place) {
        const double* const from = numbers.data() + 2 + place * count;
        return std::vector<double>(from, from + count);
    };
    rate.across = {Profile{part(0), part(1)}, Profile{part(0), part(2)}};
}

// Takes a device in volts from one list: units of mass, length and rate; the numbers of [electronics]; how many
// electrodes, and the numbers of each; those of [trim], and the lag of readings and forces, s; frequencies and quality
// factors of the common mode, and the acceleration that moves it, as take_terms reads it.
template <class Params>
void take_volts(DeviceSetupOf<Params>& setup, std::span<const double> numbers) {
    const double *at = numbers.data(), *const end = at + numbers.size();
    const auto take = [&](double& number) { number = *at++; };
    VoltsParams& volts = setup.volts = {.present = true};
    take(volts.mass), take(volts.length), take(volts.rate);
    for_each_setting_of("electronics", volts.electronics, detail::TakeFrom{at});
    volts.electrodes.resize(static_cast<std::size_t>(*at++));
    for (ElectrodeParams& each : volts.electrodes) {
        for_each_setting_of("electrodes", each, detail::TakeFrom{at});
    }
    TrimSettings trim;
    for_each_setting_of("trim", trim, detail::TakeFrom{at});
    volts.tuned = trim.tuning == TrimTuning::split;
    volts.nulled = trim.on();
    setup.trim = trim_of(trim, volts, *at++);
    for (Vec2<double>* const pair : {&volts.common.frequency, &volts.common.quality}) {
        const double x = *at++, y = *at++;
        *pair = {x, y};
    }
    take_terms(volts.common.acceleration, {at, end});
}

// Parts around a controller as numbers: the bandwidth of observer and filter, 0 without it;
// noise of force, position and velocity, and the delay, that the filter assumes; threshold and share of the trigger, 0
// without it; errors of the pick-offs' gains, and their angle; bandwidth of the disturbance observer, 0 without it.
using SensingNumbers = std::array<double, 12>;
inline SensingNumbers sensing_of(const Common& common) {
    const FilterParams& f = common.filter;
    const AxesParams& pickoffs = common.pickoffs;
    return {common.observer_bandwidth, f.bandwidth,
            f.assumed.force_noise,     f.assumed.position_noise,
            f.assumed.velocity_noise,  static_cast<double>(f.assumed.delay),
            common.trigger.threshold,  common.trigger.share,
            pickoffs.gain_error.x(),   pickoffs.gain_error.y(),
            pickoffs.misalignment,     common.compensation_bandwidth};
}
inline void take_sensing(Common& common, const SensingNumbers& numbers) {
    common.observer_bandwidth = numbers[0];
    common.filter = {.bandwidth = numbers[1],
                     .assumed = {.force_noise = numbers[2],
                                 .position_noise = numbers[3],
                                 .velocity_noise = numbers[4],
                                 .delay = static_cast<std::int64_t>(numbers[5])}};
    common.trigger = {.threshold = numbers[6], .share = numbers[7]};
    common.pickoffs = {.gain_error = {numbers[8], numbers[9]}, .misalignment = numbers[10]};
    common.compensation_bandwidth = numbers[11];
}

// A setup of this kind from its numbers, the bandwidth of the observer and its exponentials.
template <class SetupLike = Setup>  // so that only a file that calls it compiles it
SetupLike setup_from(std::size_t kind, std::span<const double> numbers, double observer_bandwidth,
                     std::span<const double> poles, std::span<const double> weights) {
    SetupLike setup{.controller = params_of_kind(kind)};
    take_settings(setup, numbers.data());
    setup.common.observer_bandwidth = observer_bandwidth;
    if (ExponentialSum* const kernel = kernel_of(setup.controller)) {
        for (std::size_t k = 0; k < poles.size(); ++k) {
            kernel->poles[k] = poles[k];
            kernel->weights[k] = weights[k];
        }
    }
    return setup;
}

}  // namespace fracgyro
