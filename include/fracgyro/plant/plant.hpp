// The contract of a plant. A new one is its own file and one line in plants.hpp: loop, record, metrics, scenario and
// Python take any type that fits, such as this one, which a test compiles:
//
//     struct FreeMass {
//         struct Params {
//             double drag = 0.1;
//             static constexpr auto fields() {
//                 return Fields{field("drag", &Params::drag, "m*omega0", at_least_0, "Damping of both axes.")};
//             }
//         };
//         using State = std::array<double, 4>;
//         struct Coefficients { double drag = 0.0, step = 0.0; };
//         static Coefficients prepare(const Params& p, double step) { return {p.drag, step}; }
//         static State start(const Params&) { return {}; }
//         static Motion<double> motion(const State& s) { return {{s[0], s[1]}, {s[2], s[3]}}; }
//         static void step(State& state, const Coefficients& c, Vec2<double> control, Vec2<double> disturbance) {
//             const Vec2<double> u = control + disturbance;
//             state = runge_kutta(state, c.step, [&](int, const State& s) {
//                 return State{s[2], s[3], u.x() - c.drag * s[2], u.y() - c.drag * s[3]};
//             });
//         }
//     };
//
// All numbers are nondimensional. A member `GyroscopeParams linear` of Params receives the numbers that every scenario
// has, and that controllers may know: damping, stiffness, rate, initial motion.
#pragma once

#include "fracgyro/core/fields.hpp"
#include "fracgyro/core/linear.hpp"

#include <array>
#include <concepts>
#include <type_traits>

namespace fracgyro {

// Ωz at the beginning, middle and end of a step.
using RateCourse = std::array<double, 3>;

// A plant that a time-varying rate acts on.
template <class P, class T = double>
concept TakesRate = requires(typename P::State& state, const typename P::Coefficients& c, const Vec2<T>& force,
                             const RateCourse& rate) { P::step(state, c, force, force, rate); };

template <class P, class T = double>
concept Plant = std::is_trivially_copyable_v<typename P::State> && sizeof(typename P::State) >= 2 * sizeof(T) &&
                sizeof(typename P::State) <= 8 * sizeof(T) &&
                requires(typename P::State& state, const typename P::State& known, const typename P::Coefficients& c,
                         const typename P::Params& p, double step) {
                    P::Params::fields();
                    { P::prepare(p, step) } -> std::same_as<typename P::Coefficients>;
                    { P::start(p) } -> std::same_as<typename P::State>;
                    { P::motion(known) } -> std::convertible_to<Motion<T>>;
                } &&
                // Advances by one step, over which the controller's force and the disturbance are constant.
                (TakesRate<P, T> || requires(typename P::State& state, const typename P::Coefficients& c,
                                             const Vec2<T>& force) { P::step(state, c, force, force); });

// The classical Runge-Kutta step of fourth order for dx/dt = derivative(halves, x), at `halves` half steps after its
// beginning. The error is of order step⁵. Its states are numbers, or pairs of them.
template <class Part, std::size_t count, class Derivative>
std::array<Part, count> runge_kutta(const std::array<Part, count>& x, double step, Derivative&& derivative) {
    using State = std::array<Part, count>;
    const auto plus = [](const State& a, double h, const State& k) {
        State sum{};
        for (std::size_t i = 0; i < count; ++i) {
            sum[i] = a[i] + h * k[i];
        }
        return sum;
    };
    const State k1 = derivative(0, x);
    const State k2 = derivative(1, plus(x, 0.5 * step, k1));
    const State k3 = derivative(1, plus(x, 0.5 * step, k2));
    const State k4 = derivative(2, plus(x, step, k3));
    State next{};
    for (std::size_t i = 0; i < count; ++i) {
        next[i] = x[i] + step / 6.0 * ((k1[i] + k4[i]) + 2.0 * (k2[i] + k3[i]));
    }
    return next;
}

}  // namespace fracgyro
