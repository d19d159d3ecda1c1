// The loop of loop.hpp for runs whose rate moves or whose device is not ideal: slower, and in double precision alone. Where
// nothing of that is so, its samples are those of loop.hpp, bit for bit.
#pragma once

#include "device.hpp"
#include "loop.hpp"
#include "metrics.hpp"
#include "record.hpp"
#include "varying_plant.hpp"

namespace fracgyro {

// One run whose rate may move and whose device may not be ideal.
struct DeviceSetup : Setup {
    RateParams rate{};
    DeviceParams device{};
};

inline bool plant_varies(const DeviceSetup& s) {
    const Vec2<double>& cubic = s.device.cubic_stiffness;
    return s.rate.kind != RateKind::constant || s.device.stiffness_drift != 0.0 || cubic.x != 0.0 || cubic.y != 0.0;
}

inline bool is_ideal(const DeviceSetup& s) {
    const DeviceParams& d = s.device;
    return !plant_varies(s) && !(d.position_noise > 0.0) && !(d.velocity_noise > 0.0) && !d.position.on() &&
           !d.velocity.on() && !d.actuator.on() && d.delay == 0 && s.common.observer_bandwidth == 0.0;
}

// As a Snapshot; position, velocity and error are the true ones, `signals.force` is what the controller asks for.
template <class Report>
struct DeviceSnapshot : Snapshot<double, Report> {
    double rate;                     // Ωz, after a jump
    double stiffness_drift;          // what K has grown by, as a fraction
    const Motion<double>& measured;  // what the controller goes by
    const Vec2<double>& applied;     // the force that acts
};

// Calls observe(DeviceSnapshot) at every sample; as run_loop.
template <Controller C, class Observe>
std::int64_t run_device_loop(const DeviceSetup& setup, Observe&& observe) {
    const double step = setup.common.step;
    const auto controller = prepare<C>(setup.controller, setup.common);
    typename C::State state{};
    const bool varies = plant_varies(setup);
    const auto plant = Plant<double>::prepare(setup.plant, step);
    const auto varying = VaryingPlant::prepare({setup.plant, setup.device.cubic_stiffness, setup.rate.inertial}, step);
    const Rate rate(setup.rate, setup.plant.rate, step, setup.steps);
    const auto drift = [&](std::int64_t n, int halves) {
        return setup.device.stiffness_drift * setup.device.temperature.within(n, halves);
    };
    Device device(setup.device, setup.disturbance.seed, step);
    Disturbance disturbance(setup.disturbance, step);
    Motion<double> motion = Plant<double>::start(setup.plant);
    for (std::int64_t n = 0; n <= setup.steps; ++n) {
        if (!(absolute(motion.position.x) + absolute(motion.position.y) < divergence_limit)) {
            return n;
        }
        Vec2<double> force;
        disturbance.fill(n, {&force, 1});
        Motion<double> measured = device.sense(motion, n);
        auto signals = C::step(state, controller, measured);  // 1 to 5
        if constexpr (!measures_velocity<C>) {
            measured.velocity = signals.reference.velocity + signals.error.rate;  // the observer's
        }
        signals.error = tracking_error(motion, signals.reference);
        const Vec2<double> applied = device.actuate(signals.force, n);
        observe(
            DeviceSnapshot<typename C::Report>{{.step = n, .motion = motion, .signals = signals, .disturbance = force},
                                               rate.at(n),
                                               drift(n, 0),
                                               measured,
                                               applied});
        if (varies) {  // 6
            VaryingPlant::Course course{.rate_before = rate.before(n) - setup.plant.rate};
            for (int halves = 0; halves < 3; ++halves) {
                course.at[static_cast<std::size_t>(halves)] = {.rate = rate.within(n, halves) - setup.plant.rate,
                                                               .stiffness = drift(n, halves)};
            }
            VaryingPlant::step(motion, varying, applied, force, course);
        } else {
            Plant<double>::step(motion, plant, applied, force);
        }
    }
    return setup.steps + 1;
}

// What is recorded of these runs behind the channels of record.hpp.
inline constexpr std::array<Channel, 5> device_channels{
    {{"angular_rate", 1, "omega0", "angular rate Omega_z", ""},
     {"stiffness_drift", 1, "1", "what the stiffness has grown by, as a fraction", ""},
     {"measured_position", 2, "q0", "position as the controller has it"},
     {"measured_velocity", 2, "q0*omega0", "velocity as the controller has it, measured or observed"},
     {"applied_control", 2, "m*omega0^2*q0", "force that the actuator gives for u"}}};
inline constexpr std::size_t device_width = 8;

// As record(), with rows longer by device_width.
inline std::int64_t record_device(const DeviceSetup& setup, std::int64_t every, double* rows) {
    std::int64_t samples = 0;
    with_controller<double>(setup.controller, setup.common.observer_bandwidth > 0.0, [&]<class C>() {
        using Report = typename C::Report;
        samples = run_device_loop<C>(setup, [&](const DeviceSnapshot<Report>& at) {
            if (at.step % every == 0) {
                write_row<double, Report>(at, rows);
                const Motion<double>& m = at.measured;
                const std::array<double, 8> more{at.rate,      at.stiffness_drift, m.position.x, m.position.y,
                                                 m.velocity.x, m.velocity.y,       at.applied.x, at.applied.y};
                std::copy(more.begin(), more.end(), rows + row_width<Report>);
                rows += row_width<Report> + device_width;
            }
        });
    });
    return samples;
}

// The metrics of one such run. Errors of estimates are against what is true at that sample; the rate has settled within a
// tolerance of its largest size.
inline std::array<double, metric_names.size()> measure_device(const DeviceSetup& setup, const MetricsParams& params) {
    const std::int64_t steady_from = first_steady_sample(params, setup);
    const Rate rate(setup.rate, setup.plant.rate, setup.common.step, setup.steps);
    double largest = 0.0;
    for (std::int64_t n = 0; n <= setup.steps; ++n) {
        largest = std::max(largest, absolute(rate.at(n)));
    }
    MetricsSums<double> sums{.error_bound_squared = params.error_bound * params.error_bound,
                             .surface_bound_squared = params.surface_bound * params.surface_bound,
                             .rate_bound = params.rate_tolerance * largest};
    MetricsTotals totals{};
    LastReport last{};
    double bound_halfway = 0.0;
    DeviceSetup at_end = setup;  // what is true at the last sample
    std::int64_t samples = 0;
    with_controller<double>(setup.controller, setup.common.observer_bandwidth > 0.0, [&]<class C>() {
        samples = run_device_loop<C>(setup, [&](const DeviceSnapshot<typename C::Report>& at) {
            sums.rate = at.rate;
            sums.add(at.signals);
            totals.add(sums.stretch, at.step, steady_from);
            sums.stretch = {};
            last = LastReport::of(at.signals.report, [](double a) { return a; });
            bound_halfway = at.step <= setup.steps / 2 ? last.bound[0] : bound_halfway;
            at_end.plant.rate = at.rate;
            at_end.plant.stiffness =
                setup.plant.stiffness + at.stiffness_drift * (setup.plant.stiffness + setup.plant.stiffness_deviation);
        });
    });
    return metric_values(params, at_end, totals, last, bound_halfway, samples);
}

}  // namespace fracgyro
