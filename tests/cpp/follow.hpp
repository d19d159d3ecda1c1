// A loop of a controller with stated noise and the paper's plant, in which noise, delay and missing samples are known.
#pragma once

#include "fracgyro/control/common.hpp"
#include "fracgyro/plant/gyroscope.hpp"

#include <cmath>
#include <deque>
#include <numbers>
#include <random>

namespace fracgyro::testing {

constexpr double pi = std::numbers::pi, h = 1e-3, noise = 7.07e-5;

// The paper's plant, 5 % stiffer than the nominal one.
template <class Params>
struct CaseOf {
    Params law = [] {
        Params p{};
        if constexpr (requires { p.datasheet; }) {
            p.datasheet = {.force_noise = 1.0, .position_noise = noise, .velocity_noise = noise};
        }
        return p;
    }();
    Common common{.step = h};
    GyroscopeParams plant{.damping = {0.01, 0.002, 0.01}, .stiffness = {355.3, 70.99, 532.9}, .rate = 0.1};
    double force_noise = 0.0, sensor_noise = 0.0;
    std::size_t delay = 0;

    CaseOf() {
        common.reference = {.frequency = {pi, 0.5 * pi}, .phase = {0.0, 0.5 * pi}};
        common.nominal = {.damping = 0.95 * plant.damping, .stiffness = 0.95 * plant.stiffness, .rate = 0.095};
        plant.initial_position = {0.5, 0.5};
    }
    static CaseOf in_noise() {
        CaseOf a;
        a.force_noise = 1.0;
        a.sensor_noise = noise;
        return a;
    }
};

template <class C, class At = CaseOf<typename C::Params>>
class Loop {
public:
    using Case = At;

    explicit Loop(const Case& a)
        : c(C::prepare(a.law, a.common)),
          at_(a),
          plant_(Gyroscope<double>::prepare(a.plant, a.common.step)),
          motion(Gyroscope<double>::start(a.plant)),
          late_(a.delay) {}

    // Returns the true error before the step. A missing sample holds the force.
    Vec2<double> step(Vec2<double> disturbance = {}, bool missing = false) {
        using T = typename C::Value;
        measured = {.position = motion.position + at_.sensor_noise * normal(),
                    .velocity = motion.velocity + at_.sensor_noise * normal()};
        const Motion<T> seen{.position = cast<T>(measured.position), .velocity = cast<T>(measured.velocity)};
        const Sample<T> none{};
        signals = C::step(state, c, seen, missing ? &none : nullptr);
        if (!missing) {
            force = cast<double>(signals.force);
        }
        late_.push_back(force);
        const Vec2<double> error = motion.position - cast<double>(signals.reference.position);
        Gyroscope<double>::step(motion, plant_, late_.front(), disturbance + at_.force_noise * normal());
        late_.pop_front();
        return error;
    }
    // RMS error of both axes over steps, after others.
    double rms(int before, int steps) {
        double sum = 0.0;
        for (int n = 0; n < before + steps; ++n) {
            const double square = squared_norm(step());
            sum += n < before ? 0.0 : square;
        }
        return std::sqrt(sum / steps);
    }
    // RMS error of each axis over ten units.
    Vec2<double> rms_of_axes() {
        Vec2<double> sum{};
        for (int n = 0; n < 10'000; ++n) {
            const Vec2<double> e = step();
            sum = sum + 1e-4 * (e * e);
        }
        return {std::sqrt(sum.x()), std::sqrt(sum.y())};
    }

    typename C::Coefficients c;

private:
    Case at_;
    typename Gyroscope<double>::Coefficients plant_;
    std::mt19937_64 random_{1};

    // The sum of twelve numbers between 0 and 1: the same in every C++ library.
    double one() {
        double sum = -6.0;
        for (int i = 0; i < 12; ++i) {
            sum += std::ldexp(static_cast<double>(random_() >> 11), -53);
        }
        return sum;
    }
    Vec2<double> normal() {
        const double x = one(), y = one();
        return {x, y};
    }

public:
    typename C::State state{};
    Motion<double> motion, measured{};
    Signals<typename C::Value, typename C::Report> signals{};
    Vec2<double> force{};

private:
    std::deque<Vec2<double>> late_;
};

}  // namespace fracgyro::testing
