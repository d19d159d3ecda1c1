// Whole runs of any controller, with any plant on any device: recorded or measured.
#pragma once

#include "fracgyro/sim/any_controller.hpp"
#include "fracgyro/sim/any_plant.hpp"

namespace fracgyro {

using ErasedSetup = PlantSetupOf<ErasedParams<double>>;

// The run of a setup, with this controller.
inline ErasedSetup erased_setup(const PlantSetup& s, AnyController<double>& controller) {
    return {{{{.controller = &controller}, s.common, s.plant, s.disturbance, s.steps},
             s.rate,
             s.device,
             s.volts,
             s.trim,
             s.touched},
            s.model};
}

// Calls observe(DeviceSnapshot) at every sample, like run_loop.
template <Controller C, class Observe>
std::int64_t run_plant_loop(const ErasedSetup& setup, Observe&& observe) {
    using Loop = Stepper<C, DevicePlant>;
    const auto coefficients = Loop::prepare(setup);
    auto state = Loop::begin(setup);
    Loop::run(state, coefficients, setup.steps + 1, DeviceGyroscope::Draw(setup), observe);
    if (setup.touched != nullptr) {
        *setup.touched = state.volts.touched;
    }
    return state.step;
}

// Calls observe(DeviceSnapshot) at every sample, or observe(Snapshot) if the loop is the one of an ideal device, which
// is faster. Returns the number of samples before the motion diverged.
template <class Observe>
std::int64_t run_any(const PlantSetup& setup, AnyController<double>& controller, bool device, FillNoise noise,
                     Observe&& observe) {
    const ErasedSetup erased = erased_setup(setup, controller);
    std::int64_t samples = 0;
    with_erased(controller, setup.common, [&]<class C>() {
        if (device) {
            samples = run_plant_loop<C>(erased, observe);
        } else {
            Disturbance disturbance(setup.disturbance, setup.common.step, noise);
            samples = setup.model == nullptr
                          ? run_loop<C>(erased, disturbance, observe)
                          : run_loop<C, WithPlant<IdealGyroscope<double>>>(erased, disturbance, observe);
        }
    });
    return samples;
}

// Writes one row to row_of(width): the loop's channels, the channels reported by the controller, and `device` numbers
// of the device: none, device_width, or volts_width more, which are NaN without electrodes.
template <class AtSample, class RowOf>
void write_any_row(const AtSample& at, AnyController<double>& controller, std::size_t device, RowOf&& row_of) {
    const std::span<const double> reported = controller.report();
    double* const row = row_of(loop_width + reported.size() + device);
    write_row<double, EmptyReport>(at, row);
    double* const rest = std::ranges::copy(reported, row + loop_width).out;
    if constexpr (requires { at.volts; }) {
        if (device > 0) {
            double* const volts = std::ranges::copy(device_row(at), rest).out;
            if (device > device_width) {
                std::ranges::copy(volts_row(at.volts), volts);
            }
        }
    }
}

// Rows at the samples 0, every, 2·every, … Returns the number of samples before divergence.
template <class RowOf>
std::int64_t record_any(const PlantSetup& setup, AnyController<double>& controller, std::int64_t every,
                        std::size_t device, FillNoise noise, RowOf&& row_of) {
    std::int64_t until_next = 0;
    return run_any(setup, controller, device > 0, noise, [&](const auto& at) {
        if (until_next == 0) {
            write_any_row(at, controller, device, row_of);
            until_next = every;
        }
        --until_next;
    });
}

// The metrics of one run on an ideal device, with the bits of measure_alone.
inline Metrics measure_any_ideal(const Setup& setup, AnyController<double>& controller, const MetricsParams& params,
                                 FillNoise noise) {
    Metrics values{};
    with_erased(controller, setup.common, [&]<class C>() {
        const auto part = [&](auto& state, const auto& c, std::int64_t end, const Vec2<double>* coming, auto& sums) {
            Stepper<C>::run_part(state, c, end, coming,
                                 [&](const auto& at) { sums.add(at.signals, controller.common_report()); });
        };
        values =
            measure_segments<C>(erased_setup({{setup}}, controller), params, noise, part,
                                [&](const auto&, const auto&) { return controller.common_report_between_steps(); });
    });
    return values;
}

// Metrics of one run on any device. Errors of estimates refer to the true values at that sample; the rate has settled
// within a tolerance of its maximum magnitude.
inline Metrics measure_any(const PlantSetup& setup, AnyController<double>& controller, const MetricsParams& params) {
    const std::int64_t steady_from = first_steady_sample(params, setup);
    const AngularRate rate(setup.rate, setup.plant.rate, setup.common.step, setup.steps);
    double largest = 0.0;
    for (std::int64_t n = 0; n <= setup.steps; ++n) {
        largest = std::max(largest, absolute(rate.at(n)));
    }
    MetricsSums<double> sums{.error_bound_squared = params.error_bound * params.error_bound,
                             .surface_bound_squared = params.surface_bound * params.surface_bound,
                             .rate_bound = params.rate_tolerance * largest,
                             .force_limit = setup.common.force_limit};
    MetricsTotals totals{};
    CommonReport last{};
    double bound_halfway = 0.0;
    auto at_end = setup;  // true values at the last sample
    const auto add = [&](const auto& at) {
        last = controller.common_report();
        sums.rate = at.rate;
        sums.add(at.signals, last);
        totals.add(sums.segment, at.step, steady_from);
        sums.segment = {};
        bound_halfway = at.step <= setup.steps / 2 ? last.bound[0] : bound_halfway;
        at_end.plant.rate = at.rate;
        const Sym2<double> stiffness = setup.plant.stiffness + setup.plant.stiffness_deviation;
        const Sym2<double> damping = setup.plant.damping + setup.plant.damping_deviation;
        at_end.plant.stiffness = setup.plant.stiffness + at.stiffness_drift * stiffness;
        at_end.plant.damping = setup.plant.damping + at.damping_drift * damping;
        if (const ThermalParams& thermal = setup.device.thermal; thermal.moves_plant()) {
            at_end.plant.stiffness = at_end.plant.stiffness + at.warmer * stiffness_per_kelvin(thermal, stiffness);
            at_end.plant.damping = at_end.plant.damping + at.warmer * damping_per_kelvin(thermal, damping);
        }
        at_end.plant.stiffness = at_end.plant.stiffness - at.softened;
    };
    std::int64_t samples = 0;
    const ErasedSetup erased = erased_setup(setup, controller);
    with_erased(controller, setup.common, [&]<class C>() { samples = run_plant_loop<C>(erased, add); });
    return metric_values(params, at_end, totals, last, bound_halfway, samples);
}

}  // namespace fracgyro
