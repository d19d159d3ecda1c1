// Basis functions φ(x) of networks and fuzzy rules, for the motion x in units of the reference: a position of 1 is its
// amplitude, a velocity of 1 is its peak.
//
//        constant     1
//        linear       1, and each of the four inputs
//        gaussian     exp(-‖x - c‖²/(2b²)) for each center c
//        chebyshev    1, and T₁ … T_k of each input within ±1
//        membership   exp(-(x_i - c)²/(2b²)) for each input i and equally spaced c from -1 to 1
//
//    The centers of Gaussian nodes are on the orbit of the reference, one after the other in time, or, as in many
//    printed programs, on the diagonal from -1 to 1 in all inputs. The orbit is that of the equivalent sines
//    (reference.hpp). Each of these is off by default:
//
//        normalized   φ/Σφ: with Gaussian nodes the product rules of a fuzzy system
//        inner loop   a node j sees x + w_i φ_j of the step before
//        outer loop   the positions of x have w_o f more, f the force of the network before, within ±1 of the
//                     reference's largest acceleration
//        gate         (1 - g) φ + g φ of the step before
//        moving       dc/dt = -η (Wᵀ s) φ (x - c)/b²    db/dt = -η_b (Wᵀ s) φ ‖x - c‖²/b³
//
//    Centers stay within 1 of their places and widths within 0.05 … 10, so that no η makes a step diverge.
#pragma once

#include "fracgyro/control/reference.hpp"

#include <array>

namespace fracgyro {

enum class BasisKind { constant, linear, gaussian, chebyshev, membership };
enum class Layout { orbit, diagonal };

struct BasisParams {
    BasisKind kind = BasisKind::gaussian;
    Layout layout = Layout::orbit;
    std::int64_t nodes = 16;  // gaussian and membership
    double width = 1.0;       // b
    std::int64_t degree = 2;  // k of chebyshev
    bool normalized = false;
    double inner = 0.0, outer = 0.0, gate = 0.0;  // w_i, w_o, g
    double center_rate = 0.0, width_rate = 0.0;   // η, η_b

    static constexpr std::string_view kinds[] = {"constant", "linear", "gaussian", "chebyshev", "membership"},
                                      layouts[] = {"orbit", "diagonal"}, switches[] = {"false", "true"};
    static constexpr auto fields() {
        using P = BasisParams;
        constexpr Range share{.low = 0.0, .high = 1.0}, below_1{.low = 0.0, .high = 0.99};
        return Fields{
            settable(Settable::beforehand,
                     choice("basis", &P::kind, kinds,
                            "phi(x): constant, 1, which is integral action; linear, 1 and positions and velocities; "
                            "gaussian, nodes with centers; chebyshev, polynomials of each input; membership, fuzzy "
                            "sets of each "
                            "input.")),
            settable(Settable::beforehand,
                     choice("layout", &P::layout, layouts,
                            "Centers of gaussian nodes: orbit, on the motion of the reference; diagonal, from -1 to 1 "
                            "in all inputs at once, far from the motion.")),
            settable(Settable::beforehand,
                     field("nodes", &P::nodes, "1", Range{.low = 1.0, .high = 32.0, .whole = true},
                           "Number of gaussian nodes, at most 32; of memberships, in fours, one for each input.")),
            settable(Settable::beforehand, field("node_width", &P::width, "1", above_0,
                                                 "b, > 0, in units of the reference's amplitude and peak velocity: "
                                                 "width of a gaussian node or a membership.")),
            settable(Settable::beforehand,
                     field("polynomial_degree", &P::degree, "1", Range{.low = 1.0, .high = 7.0, .whole = true},
                           "k, at most 7: largest degree of chebyshev.")),
            settable(Settable::beforehand,
                     choice("normalized", &P::normalized, switches,
                            "true: phi over its sum, the rules of a fuzzy system, for gaussian and membership. false: "
                            "off.")),
            settable(Settable::beforehand,
                     field("inner_loop", &P::inner, "1", share,
                           "w_i, at most 1: share of its last value that each gaussian node or membership adds to its "
                           "inputs. 0.0: off.")),
            settable(Settable::beforehand,
                     field("outer_loop", &P::outer, "1", share,
                           "w_o, at most 1: share of the network's last force, over the largest acceleration of the "
                           "reference and within 1, that is added to the positions among the inputs. 0.0: off.")),
            settable(Settable::beforehand,
                     field("gate", &P::gate, "1", below_1,
                           "g, at most 0.99: share of phi that is kept from the step before. 0.0: off.")),
            settable(Settable::beforehand,
                     field("center_rate", &P::center_rate, "1/(m*omega0^2*q0^2)", at_least_0,
                           "eta, unit 1/(m omega0^2 q0^2): rate at which gaussian centers and memberships move. 0.0: "
                           "off.")),
            settable(Settable::beforehand,
                     field("width_rate", &P::width_rate, "1/(m*omega0^2*q0^2)", at_least_0,
                           "eta_b, unit 1/(m omega0^2 q0^2): rate at which their widths change. 0.0: off.")),
        };
    }
};

template <Scalar T>
struct Basis {
    static constexpr std::size_t most = 32;
    using Values = std::array<T, most>;

    struct Loops {
        Vec2<T> per_force{};                   // 1 over the largest acceleration
        T inner{}, outer{}, gate{}, passes{};  // w_i, w_o, g, 1 - g
        bool inside = false, outside = false, gated = false;
    };
    struct Moving {
        T centers{}, widths{};        // η, η_b
        T width{}, narrow{}, wide{};  // b at the start, and its range
        bool on = false;
    };
    struct Coefficients {
        bool linear = false, gaussian = false, polynomial = false, sets = false;  // else constant
        bool normalized = false;
        std::uint32_t count = 1;
        Vec2<T> per_position{}, per_velocity{};  // 1 over amplitude and peak
        T narrows{};                             // -1/(2b²)
        Loops loops{};
        Moving moving{};
        std::array<Motion<T>, most> centers{};
    };
    // From the step before, and how far centers and widths have moved.
    struct Memory {
        Values values{};
        Vec2<T> force{};
        std::array<Motion<T>, most> centers{};
        Values widths{};
    };

    static Coefficients prepare(const BasisParams& p, const ReferenceParams& reference) {
        const EquivalentSine sine = equivalent_sine(reference);
        const auto per = [](double a) { return T(a < 0.0 || 0.0 < a ? 1.0 / absolute(a) : 1.0); };
        const Vec2<double> peak = sine.amplitude * sine.frequency, force = peak * sine.frequency;
        const bool sets = p.kind == BasisKind::membership, nodes_move = sets || p.kind == BasisKind::gaussian;
        Coefficients c{.linear = p.kind == BasisKind::linear,
                       .gaussian = nodes_move,
                       .polynomial = p.kind == BasisKind::chebyshev,
                       .sets = sets,
                       .normalized = p.normalized && nodes_move,
                       .count = count(p),
                       .per_position = {per(sine.amplitude.x()), per(sine.amplitude.y())},
                       .per_velocity = {per(peak.x()), per(peak.y())},
                       .narrows = T(-0.5 / (p.width * p.width)),
                       .loops = {.per_force = {per(force.x()), per(force.y())},
                                 .inner = T(p.inner),
                                 .outer = T(p.outer),
                                 .gate = T(p.gate),
                                 .passes = T(1.0 - p.gate),
                                 .inside = p.inner > 0.0,
                                 .outside = p.outer > 0.0,
                                 .gated = p.gate > 0.0},
                       .moving = {.centers = T(p.center_rate),
                                  .widths = T(p.width_rate),
                                  .width = T(p.width),
                                  .narrow = T(minimum(p.width, 0.05)),
                                  .wide = T(maximum(p.width, 10.0)),
                                  .on = nodes_move && (p.center_rate > 0.0 || p.width_rate > 0.0)}};
        const double nodes = sets ? 0.25 * c.count : static_cast<double>(p.nodes);
        for (std::size_t j = 0; j < c.count; ++j) {
            const double place = static_cast<double>(sets ? j / 4 : j);
            const Motion<double> at =
                p.layout == Layout::orbit && !sets ? on_orbit(reference, place / nodes) : on_diagonal(place, nodes);
            c.centers[j] = {.position = cast<T>(at.position), .velocity = cast<T>(at.velocity)};
        }
        return c;
    }

    // The motion in units of the reference.
    static Motion<T> inputs(const Coefficients& c, const Motion<T>& motion) {
        return {.position = c.per_position * motion.position, .velocity = c.per_velocity * motion.velocity};
    }
    // The same, with the network's last force.
    static Motion<T> inputs(const Coefficients& c, const Memory& memory, const Motion<T>& motion) {
        Motion<T> x = inputs(c, motion);
        if (c.loops.outside) {
            x.position = x.position + c.loops.outer * clamp(c.loops.per_force * memory.force, T(-1.0), T(1.0));
        }
        return x;
    }

    // The first `count` values; returns the sum of their squares.
    static T evaluate(const Coefficients& c, const Memory& memory, const Motion<T>& x, Values& values) {
        values[0] = T(1.0);
        if (c.linear) {
            put(values, 1, x.position, x.velocity);
        } else if (c.gaussian) {
            for (std::size_t j = 0; j < c.count; ++j) {
                const T distance = square(c, j, from_center(c, memory, j, x));
                if (c.moving.on) {
                    const T b = width(c, memory, j);
                    values[j] = exponential(T(-0.5) * distance / (b * b));
                } else {
                    values[j] = exponential(c.narrows * distance);
                }
            }
        } else if (c.polynomial) {
            polynomials(c, x, values);
        }
        if (c.normalized) {
            normalize(c, values);
        }
        if (c.loops.gated) {
            for (std::size_t j = 0; j < c.count; ++j) {
                values[j] = c.loops.passes * values[j] + c.loops.gate * memory.values[j];
            }
        }
        T sum = values[0] * values[0];
        for (std::size_t j = 1; j < c.count; ++j) {
            sum = sum + values[j] * values[j];
        }
        return sum;
    }

    // The largest ‖φ‖² on the orbit, of 256 points.
    static double largest_on_orbit(const BasisParams& p, const ReferenceParams& reference) {
        BasisParams plain = p;
        plain.inner = plain.outer = plain.gate = 0.0;
        const auto c = Basis<double>::prepare(plain, reference);
        const typename Basis<double>::Memory none{};
        typename Basis<double>::Values values{};
        double largest = 0.0;
        for (int k = 0; k < 256; ++k) {
            largest = maximum(largest, Basis<double>::evaluate(c, none, on_orbit(reference, k / 256.0), values));
        }
        return largest;
    }

    // Moves centers and widths for these weights; `s`: what they learn from, times the step.
    static void move(Memory& memory, const Coefficients& c, const Motion<T>& x, const Values& values,
                     const std::array<Vec2<T>, most>& weights, const Vec2<T>& s) {
        for (std::size_t j = 0; j < c.count; ++j) {
            const Motion<T> away = from_center(c, memory, j, x);
            const T b = width(c, memory, j);
            const T pull = -dot(weights[j], s) * values[j] / (b * b);
            const T moves = c.moving.centers * pull,
                    grows = c.moving.widths * pull * minimum(square(c, j, away), T(1e4)) / b;
            Motion<T>& center = memory.centers[j];
            center.position = clamp(center.position + moves * away.position, T(-1.0), T(1.0));
            center.velocity = clamp(center.velocity + moves * away.velocity, T(-1.0), T(1.0));
            memory.widths[j] = clamp(b + grows, c.moving.narrow, c.moving.wide) - c.moving.width;
        }
    }
    // Keeps values and force for the loops of the next step.
    static void remember(Memory& memory, const Coefficients& c, const Values& values, const Vec2<T>& force) {
        if (c.loops.inside || c.loops.gated) {
            for (std::size_t j = 0; j < c.count; ++j) {
                memory.values[j] = values[j];
            }
        }
        if (c.loops.outside) {
            memory.force = force;
        }
    }

private:
    // x less the center of node j, with its inner loop.
    static Motion<T> from_center(const Coefficients& c, const Memory& memory, std::size_t j, const Motion<T>& x) {
        Motion<T> away{.position = x.position - c.centers[j].position, .velocity = x.velocity - c.centers[j].velocity};
        if (c.moving.on) {
            away.position = away.position - memory.centers[j].position;
            away.velocity = away.velocity - memory.centers[j].velocity;
        }
        if (c.loops.inside) {
            const T more = c.loops.inner * memory.values[j];
            away.position = away.position + Vec2<T>{more, more};
            away.velocity = away.velocity + Vec2<T>{more, more};
        }
        return away;
    }
    static T square(const Coefficients& c, std::size_t j, const Motion<T>& away) {
        if (!c.sets) {
            return squared_norm(away.position) + squared_norm(away.velocity);
        }
        const Vec2<T>& both = j % 4 < 2 ? away.position : away.velocity;
        const T one = j % 2 == 0 ? both.x() : both.y();
        return one * one;
    }
    static T width(const Coefficients& c, const Memory& memory, std::size_t j) {
        return clamp(c.moving.width + memory.widths[j], c.moving.narrow, c.moving.wide);
    }
    static void normalize(const Coefficients& c, Values& values) {
        T sum = values[0];
        for (std::size_t j = 1; j < c.count; ++j) {
            sum = sum + values[j];
        }
        const T scale = T(1.0) / maximum(sum, T(1e-12));  // far from all nodes φ falls to 0
        for (std::size_t j = 0; j < c.count; ++j) {
            values[j] = scale * values[j];
        }
    }
    static constexpr std::uint32_t count(const BasisParams& p) {
        switch (p.kind) {
            case BasisKind::linear:
                return 5;
            case BasisKind::gaussian:
                return static_cast<std::uint32_t>(p.nodes);
            case BasisKind::chebyshev:
                return 1 + 4 * static_cast<std::uint32_t>(p.degree);
            case BasisKind::membership:
                return p.nodes < 4 ? 4 : 4 * static_cast<std::uint32_t>(p.nodes / 4);
            default:
                return 1;
        }
    }
    static void put(Values& values, std::size_t at, const Vec2<T>& a, const Vec2<T>& b) {
        values[at] = a.x();
        values[at + 1] = a.y();
        values[at + 2] = b.x();
        values[at + 3] = b.y();
    }
    // T_(k+1) = 2x T_k - T_(k-1)
    static void polynomials(const Coefficients& c, const Motion<T>& x, Values& values) {
        const Vec2<T> one{T(1.0), T(1.0)};
        const Vec2<T> q = clamp(x.position, T(-1.0), T(1.0)), v = clamp(x.velocity, T(-1.0), T(1.0));
        Vec2<T> position = q, velocity = v, position_before = one, velocity_before = one;
        for (std::size_t at = 1; at < c.count; at += 4) {
            put(values, at, position, velocity);
            const Vec2<T> position_next = T(2.0) * (q * position) - position_before;
            const Vec2<T> velocity_next = T(2.0) * (v * velocity) - velocity_before;
            position_before = position;
            velocity_before = velocity;
            position = position_next;
            velocity = velocity_next;
        }
    }

    // In units of the reference, after this share of the slower period.
    static Motion<double> on_orbit(const ReferenceParams& reference, double share) {
        const EquivalentSine sine = equivalent_sine(reference);
        const double x = absolute(sine.frequency.x()), y = absolute(sine.frequency.y());
        const double slow = minimum(x, y) > 0.0 ? minimum(x, y) : maximum(x, y);
        const auto of = [&](double amplitude, double frequency, double phase) {
            const double turns = slow > 0.0 ? share * 6.28318530717958647693 * frequency / slow : 0.0;
            const SineCosine<double> at = sine_cosine<double>(phase_of(turns + phase));
            const bool moves = amplitude < 0.0 || 0.0 < amplitude;
            const bool turning = moves && (frequency < 0.0 || 0.0 < frequency);
            const double sign = amplitude < 0.0 ? -1.0 : 1.0, direction = frequency < 0.0 ? -sign : sign;
            return Vec2<double>{moves ? sign * at.sine : 0.0, turning ? direction * at.cosine : 0.0};
        };
        const Vec2<double> a = of(sine.amplitude.x(), sine.frequency.x(), reference.phase.x());
        const Vec2<double> b = of(sine.amplitude.y(), sine.frequency.y(), reference.phase.y());
        return {.position = {a.x(), b.x()}, .velocity = {a.y(), b.y()}};
    }
    static Motion<double> on_diagonal(double place, double nodes) {
        const double at = nodes > 1.0 ? -1.0 + 2.0 * place / (nodes - 1.0) : 0.0;
        return {.position = {at, at}, .velocity = {at, at}};
    }
};

}  // namespace fracgyro
