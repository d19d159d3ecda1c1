// Joint adaptation in a closed loop, for tests.
#pragma once

#include "scalars.hpp"

#include "fracgyro/hardware/guard.hpp"
#include "fracgyro/plant/disturbance.hpp"
#include "fracgyro/plant/gyroscope.hpp"

#include "fracgyro/controllers/sliding_mode.hpp"

#include <functional>
#include <vector>

namespace fracgyro::testing {

// A gyroscope driven at its resonances, in units of these, with thermal noise and noisy sensors.
struct Case {
    GyroscopeParams plant{.damping = {2e-4, 5e-5, 2e-3},
                          .stiffness = {1.0, 0.002, 1.027},
                          .rate = 2e-4,
                          .initial_position = {0.0, 1.0},
                          .initial_velocity = {1.0, 0.0}};
    Common common{.step = 0.05,
                  .reference = {.frequency = {1.0, 1.0135}, .phase = {0.0, 1.5707963267948966}},
                  .nominal = {.damping = {2e-4, 0.0, 2e-3}, .stiffness = {1.001, 0.0, 1.026}},
                  .force_limit = 0.01};
    SlidingModeParams law{};
    double force_noise = 1e-7, position_noise = 1e-5, velocity_noise = 1e-5;
    std::size_t delay = 0;

    Case() {
        law.surface.fractional_gain = {1.0, 1.0};
        law.surface.terminal_gain = {0.02, 0.02};
        law.control.layer_thickness = 0.001;
        law.adaptation.kind = AdaptationKind::joint;
        law.adaptation.initial_bound = {0.003, 0.0, 0.0};
        law.datasheet = {
            .force_noise = force_noise, .position_noise = position_noise, .velocity_noise = velocity_noise};
    }
};

// Sensing noise slows the filter down; here it is far below the force noise.
inline Case finely_sensed() {
    Case a;
    a.law.datasheet.force_noise = a.force_noise = 1e-6;
    a.law.datasheet.position_noise = a.position_noise = 1e-7;
    a.law.datasheet.velocity_noise = a.velocity_noise = 1e-7;
    return a;
}

template <Scalar T>
using Both = SlidingModeController<T, LinearSurface, JointAdaptation>;
template <Scalar T>
using Positions = SlidingModeController<T, LinearSurface, JointFromPositions>;

template <class C>
struct Loop {
    using T = typename C::Value;
    using Filter = typename C::AdaptationType::Filter;
    typename C::Coefficients c;
    typename C::State state{};
    Gyroscope<double>::Coefficients map;
    Motion<double> motion;
    Disturbance force, position, velocity;
    std::vector<Vec2<double>> late;
    std::int64_t n = 0;
    Vec2<double> asked{};
    Motion<double> seen{};
    Signals<T, typename C::Report> signals{};

    explicit Loop(const Case& a, std::uint64_t seed = 1)
        : c(C::prepare(a.law, a.common)),
          map(Gyroscope<double>::prepare(a.plant, a.common.step)),
          motion(Gyroscope<double>::start(a.plant)),
          force(noise(a.force_noise, seed, 0), a.common.step),
          position(noise(a.position_noise, seed, 1), a.common.step),
          velocity(noise(a.velocity_noise, seed, 2), a.common.step),
          late(a.delay) {}

    static DisturbanceParams noise(double deviation, std::uint64_t seed, std::uint32_t stream) {
        return {.kind = DisturbanceKind::noise, .standard_deviation = deviation, .seed = seed, .stream = stream};
    }

    // One step; `change` may corrupt the measurements.
    void step(const std::function<void(Motion<double>&)>& change = {}, bool missing = false) {
        seen = {.position = motion.position + position(n), .velocity = motion.velocity + velocity(n)};
        if (change) {
            change(seen);
        }
        const auto vec2 = [](const Vec2<double>& a) { return Vec2<T>{T(a.x()), T(a.y())}; };
        const Sample<T> none{};
        signals = C::step(state, c, {.position = vec2(seen.position), .velocity = vec2(seen.velocity)},
                          missing ? &none : nullptr);
        if (!missing) {  // else it is held
            asked = {number(signals.force.x()), number(signals.force.y())};
        }
        Vec2<double> acts = asked;
        if (!late.empty()) {
            std::swap(acts, late[static_cast<std::size_t>(n) % late.size()]);
        }
        Gyroscope<double>::step(motion, map, acts, force(n));
        ++n;
    }
    Loop& run(int steps) {
        for (int i = 0; i < steps; ++i) {
            step();
        }
        return *this;
    }
    double rate() const { return number(C::report(state, c).rate); }
    double deviation() const { return number(C::report(state, c).rate_deviation); }
    double refused() const { return number(C::report(state, c).sample_refused); }
    double trusted() const { return number(C::report(state, c).rate_trusted); }
};

}  // namespace fracgyro::testing
