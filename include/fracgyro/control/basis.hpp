// Basis functions φ(x) of networks and fuzzy rules, for the motion x in units of the reference: a position of 1 is its
// amplitude, a velocity of 1 is its peak.
//
//        constant     1
//        linear       1, and each of the four inputs
//        gaussian     exp(-‖x - c‖²/(2b²)) for each center c
//        chebyshev    1, and T₁ … T_k of each input within ±1
//
//    The centers are on the orbit of the reference, one after the other in time, or, as in many printed programs, on
//    the diagonal from -1 to 1 in all inputs. The orbit is that of the equivalent sines (reference.hpp).
#pragma once

#include "fracgyro/control/reference.hpp"

#include <array>

namespace fracgyro {

enum class BasisKind { constant, linear, gaussian, chebyshev };
enum class Layout { orbit, diagonal };

struct BasisParams {
    BasisKind kind = BasisKind::gaussian;
    Layout layout = Layout::orbit;
    std::int64_t nodes = 16;  // gaussian
    double width = 1.0;       // b
    std::int64_t degree = 2;  // k of chebyshev

    static constexpr std::string_view kinds[] = {"constant", "linear", "gaussian", "chebyshev"},
                                      layouts[] = {"orbit", "diagonal"};
    static constexpr auto fields() {
        using P = BasisParams;
        return Fields{
            settable(Settable::beforehand,
                     choice("basis", &P::kind, kinds,
                            "phi(x): constant, 1, which is integral action; linear, 1 and positions and velocities; "
                            "gaussian, nodes with centers; chebyshev, polynomials of each input.")),
            settable(Settable::beforehand,
                     choice("layout", &P::layout, layouts,
                            "Centers of gaussian nodes: orbit, on the motion of the reference; diagonal, from -1 to 1 "
                            "in all inputs at once, far from the motion.")),
            settable(Settable::beforehand,
                     field("nodes", &P::nodes, "1", Range{.low = 1.0, .high = 32.0, .whole = true},
                           "Number of gaussian nodes, at most 32.")),
            settable(Settable::beforehand, field("node_width", &P::width, "1", above_0,
                                                 "b, > 0, in units of the reference's amplitude and peak velocity: "
                                                 "width of a gaussian node.")),
            settable(Settable::beforehand,
                     field("polynomial_degree", &P::degree, "1", Range{.low = 1.0, .high = 7.0, .whole = true},
                           "k, at most 7: largest degree of chebyshev.")),
        };
    }
};

template <Scalar T>
struct Basis {
    static constexpr std::size_t most = 32;
    using Values = std::array<T, most>;

    struct Coefficients {
        bool linear = false, gaussian = false, polynomial = false;  // else constant
        std::uint32_t count = 1;
        Vec2<T> per_position{}, per_velocity{};  // 1 over amplitude and peak
        T narrows{};                             // -1/(2b²)
        std::array<Motion<T>, most> centers{};
    };

    static Coefficients prepare(const BasisParams& p, const ReferenceParams& reference) {
        const EquivalentSine sine = equivalent_sine(reference);
        const auto per = [](double a) { return T(a < 0.0 || 0.0 < a ? 1.0 / absolute(a) : 1.0); };
        const Vec2<double> peak = sine.amplitude * sine.frequency;
        Coefficients c{.linear = p.kind == BasisKind::linear,
                       .gaussian = p.kind == BasisKind::gaussian,
                       .polynomial = p.kind == BasisKind::chebyshev,
                       .count = count(p),
                       .per_position = {per(sine.amplitude.x()), per(sine.amplitude.y())},
                       .per_velocity = {per(peak.x()), per(peak.y())},
                       .narrows = T(-0.5 / (p.width * p.width))};
        const double nodes = static_cast<double>(p.nodes);
        for (std::size_t j = 0; j < c.count; ++j) {
            const double place = static_cast<double>(j);
            const Motion<double> at =
                p.layout == Layout::orbit ? on_orbit(reference, place / nodes) : on_diagonal(place, nodes);
            c.centers[j] = {.position = cast<T>(at.position), .velocity = cast<T>(at.velocity)};
        }
        return c;
    }

    // The motion in units of the reference.
    static Motion<T> inputs(const Coefficients& c, const Motion<T>& motion) {
        return {.position = c.per_position * motion.position, .velocity = c.per_velocity * motion.velocity};
    }

    // The first `count` values; returns the sum of their squares.
    static T evaluate(const Coefficients& c, const Motion<T>& x, Values& values) {
        values[0] = T(1.0);
        if (c.linear) {
            put(values, 1, x.position, x.velocity);
        } else if (c.gaussian) {
            for (std::size_t j = 0; j < c.count; ++j) {
                const Motion<T>& center = c.centers[j];
                const T distance =
                    squared_norm(x.position - center.position) + squared_norm(x.velocity - center.velocity);
                values[j] = exponential(c.narrows * distance);
            }
        } else if (c.polynomial) {
            polynomials(c, x, values);
        }
        T sum = values[0] * values[0];
        for (std::size_t j = 1; j < c.count; ++j) {
            sum = sum + values[j] * values[j];
        }
        return sum;
    }

    // The largest ‖φ‖² on the orbit, of 256 points.
    static double largest_on_orbit(const BasisParams& p, const ReferenceParams& reference) {
        const auto c = Basis<double>::prepare(p, reference);
        typename Basis<double>::Values values{};
        double largest = 0.0;
        for (int k = 0; k < 256; ++k) {
            largest = maximum(largest, Basis<double>::evaluate(c, on_orbit(reference, k / 256.0), values));
        }
        return largest;
    }

private:
    static constexpr std::uint32_t count(const BasisParams& p) {
        switch (p.kind) {
            case BasisKind::linear:
                return 5;
            case BasisKind::gaussian:
                return static_cast<std::uint32_t>(p.nodes);
            case BasisKind::chebyshev:
                return 1 + 4 * static_cast<std::uint32_t>(p.degree);
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
