// 4  The control force: equivalent control plus a switching term with its boundary layer,
//    eqs. (18)-(20), (33)-(36), (46).
//
//        u    = (D̂ + 2Ω̂) v + K̂ q + r̈ - drift - (s/‖s‖) ρ        outside the layer, ‖s‖ >= δ
//        ρ    = b̂₀ + b̂₁ ‖q‖ + b̂₂ ‖v‖
//        inside the layer the last term is   (s/δ) ρ              linear, the usual layer
//                                            (s/δ²) ‖s‖ ρ         quadratic, as printed: no gain at s = 0
//    With known parameters the estimates are the true values and the same formula is eqs. (20) and (34).
#pragma once

#include "adaptation.hpp"
#include "error.hpp"
#include "surface.hpp"

namespace fracgyro {

enum class Layer { linear, quadratic };

struct ControlParams {
    double layer_thickness = 0.06;  // δ; 0: no layer, the force switches
    Layer layer = Layer::linear;
    double force_limit = std::numeric_limits<double>::infinity();  // |u| on each axis; infinity: off
};

template <Scalar T>
struct Control {
    struct Coefficients {
        T thickness{}, linear_gain{}, quadratic_gain{};  // inside the layer: s (linear_gain + quadratic_gain ‖s‖) ρ
        T force_limit{};
    };

    static Coefficients prepare(const ControlParams& p) {
        const bool layered = p.layer_thickness > 0.0;
        const bool linear = p.layer == Layer::linear;
        const double inverse = layered ? 1.0 / p.layer_thickness : 0.0;
        return {.thickness = T(p.layer_thickness),
                .linear_gain = T(linear ? inverse : 0.0),
                .quadratic_gain = T(linear ? 0.0 : inverse * inverse),
                .force_limit = T(p.force_limit)};
    }

    static Vec2<T> force(const Coefficients& c, const Estimates<T>& estimates, const Motion<T>& motion,
                         const ReferencePoint<T>& reference, const SurfacePoint<T>& surface) {
        const Vec2<T> q = motion.position;
        const Vec2<T> v = motion.velocity;
        // 2Ω̂v: the skew part is the Coriolis force, the symmetric part exists under the printed rate law only.
        const Vec2<T> coriolis = T(2.0) * Vec2<T>{-(estimates.rate * v.y), estimates.rate * v.x};
        const Vec2<T> equivalent = (estimates.damping + T(2.0) * estimates.rate_symmetric) * v + coriolis +
                                   estimates.stiffness * q + reference.acceleration - surface.drift;
        const T bound = estimates.bound[0] + estimates.bound[1] * norm(q) + estimates.bound[2] * norm(v);
        const Vec2<T> force = equivalent - (switching_gain(c, norm(surface.s)) * bound) * surface.s;
        return {clamp(force.x, -c.force_limit, c.force_limit), clamp(force.y, -c.force_limit, c.force_limit)};
    }

private:
    // 1/‖s‖ outside the layer; at s = 0 any finite value will do, since s multiplies it.
    static T switching_gain(const Coefficients& c, T size) {
        const T inside = c.linear_gain + c.quadratic_gain * size;
        const bool positive = T(0.0) < size;
        const T outside = T(1.0) / select(positive, size, T(1.0));
        return select(size < c.thickness, inside, outside);
    }
};

}  // namespace fracgyro
