// 4  The control force: equivalent control plus a switching term with its boundary layer,
//    eqs. (18)-(20), (33)-(36), (46).
//
//        u    = (D̂ + 2Ω̂) v + K̂ q + r̈ - drift - (s/‖s‖) ρ        outside the layer, ‖s‖ >= δ
//        ρ    = b̂₀ + b̂₁ ‖q‖ + b̂₂ ‖v‖
//        inside the layer the last term is   (s/δ) ρ              linear, the usual layer
//                                            (s/δ²) ‖s‖ ρ         quadratic, as printed: no gain at s = 0
//    With known parameters the estimates are the true values and the same formula is eqs. (20) and (34).
//
//    This is the force of continuous time, which, held for a step, acts half a step late. With held feedforward (ours)
//    it also has what the reference needs from the sample to the held point (feedforward.hpp).
//
//    Near s = 0 the held force removes ρ h/δ of s in one step, and from about 2 on the sampled loop is unstable. The
//    switching limit (ours) keeps ρ h/δ at or below a number, and b̂₀, b̂₁, b̂₂ at or below the ρ that this allows.
#pragma once

#include "fracgyro/control/estimates.hpp"
#include "fracgyro/control/feedforward.hpp"
#include "fracgyro/control/surfaces.hpp"

namespace fracgyro {

enum class Layer { linear, quadratic };
enum class ForceTime { continuous, held };

struct SwitchingParams {
    double layer_thickness = 0.06;  // δ; 0: no layer, the force switches
    Layer layer = Layer::linear;
    ForceTime feedforward = ForceTime::continuous;
    double switching_limit = std::numeric_limits<double>::infinity();  // limit of ρ h/δ; infinity: off

    static constexpr std::string_view layers[] = {"linear", "quadratic"}, times[] = {"continuous", "held"};
    static constexpr auto fields() {
        using P = SwitchingParams;
        return Fields{
            field("layer_thickness", &P::layer_thickness, "q0*omega0", at_least_0,
                  "delta, unit of s, eq. (33): layer that smooths the switching. 0.0: off, pure sign."),
            choice("layer", &P::layer, layers,
                   "Inside the layer: quadratic, -(s/delta^2)||s|| rho, as printed in (46); linear, -(s/delta) rho. "
                   "layer_thickness 0.0: off."),
            choice("feedforward", &P::feedforward, times,
                   "Force along the reference: continuous, at the sample, so that the hold makes it half a step late, "
                   "as in the paper; held, at the middle of the hold, datasheet.delay later."),
            field("switching_limit", &P::switching_limit, "1", limit,
                  "Largest rho h/delta, no unit, > 0: what one step takes back of s; with the linear layer the loop "
                  "diverges from about 2 on, and noise is enough to let the bound estimates grow until then. 0.5 suits "
                  "hardware. inf: off."),
        };
    }
};

// The maximum ρ that the switching limit allows; infinity if it is off.
inline double largest_bound(const SwitchingParams& p, double step) {
    const bool bounded = p.switching_limit < std::numeric_limits<double>::infinity();
    return bounded ? p.switching_limit * p.layer_thickness / step : p.switching_limit;
}

template <Scalar T>
struct Switching {
    struct Coefficients {
        T thickness_squared{}, linear_gain{}, quadratic_gain{};  // inside: s (linear_gain + quadratic_gain ‖s‖) ρ
        T largest_bound{};
        bool bounded = false, printed = false;  // printed rate law: Ω̂ has a symmetric part
        bool held = false;
    };

    static Coefficients prepare(const SwitchingParams& p, RateLaw rate_law = RateLaw::skew, double step = 1.0) {
        const bool layered = p.layer_thickness > 0.0;
        const bool linear = p.layer == Layer::linear;
        const double inverse = layered ? 1.0 / p.layer_thickness : 0.0;
        return {.thickness_squared = T(p.layer_thickness * p.layer_thickness),
                .linear_gain = T(linear ? inverse : 0.0),
                .quadratic_gain = T(linear ? 0.0 : inverse * inverse),
                .largest_bound = T(fracgyro::largest_bound(p, step)),
                .bounded = p.switching_limit < std::numeric_limits<double>::infinity(),
                .printed = rate_law == RateLaw::printed,
                .held = p.feedforward == ForceTime::held};
    }

    static Vec2<T> force(const Coefficients& c, const Estimates<T>& estimates, const Motion<T>& motion,
                         const ReferencePoint<T>& reference, const SurfacePoint<T>& surface, const Norms<T>& norms) {
        const Vec2<T> q = motion.position;
        const Vec2<T> v = motion.velocity;
        // 2Ω̂v: the skew part is the Coriolis force.
        const Vec2<T> coriolis = T(2.0) * (estimates.rate * turned(v));
        Vec2<T> equivalent =
            estimates.damping * v + coriolis + estimates.stiffness * q + reference.acceleration - surface.drift;
        if (c.printed) {
            equivalent = equivalent + T(2.0) * (estimates.rate_symmetric * v);
        }
        T bound = estimates.bound[0] + estimates.bound[1] * norms.position + estimates.bound[2] * norms.velocity;
        if (c.bounded) {
            bound = minimum(bound, c.largest_bound);
        }
        // Inside and outside the layer the switching term is s (gain + slope ‖s‖) ρ, with 1/‖s‖ = ‖s‖/‖s‖²: only the
        // product with ‖s‖ waits for the square root, and no division follows it.
        const T square = squared_norm(surface.s);
        // ‖s‖ below 1e-15 does not change the force, since s itself multiplies the result.
        const T outside = T(1.0) / maximum(square, T(1e-30));
        const Vec2<T> gains = if_less({square, square}, {c.thickness_squared, c.thickness_squared},
                                      {c.linear_gain, c.quadratic_gain}, Vec2<T>{T(0.0), outside});
        const Vec2<T> drive = bound * surface.s;
        return (equivalent - gains.x() * drive) - norms.surface * (gains.y() * drive);
    }

    // Force that held feedforward adds to it.
    static Vec2<T> of_hold(const Coefficients& c, const Estimates<T>& estimates, const ReferencePoint<T>& sampled,
                           const ReferencePoint<T>& held) {
        const Motion<T> way = moved<T>({}, sampled, held);
        const Vec2<T> force = plant_force<T>(estimates, way, held.acceleration - sampled.acceleration);
        return c.printed ? force + T(2.0) * (estimates.rate_symmetric * way.velocity) : force;
    }
};

}  // namespace fracgyro
