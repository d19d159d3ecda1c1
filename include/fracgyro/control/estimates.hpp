// Estimates of an adaptation, and the norms shared by its laws and the force.
#pragma once

#include "fracgyro/control/error.hpp"
#include "fracgyro/core/linear.hpp"

namespace fracgyro {

// Estimates, (35). Ω̂ = [[0, -rate], [rate, 0]] + rate_symmetric.
template <Scalar T>
struct Estimates {
    Sym2<T> damping{}, stiffness{};
    T rate{};
    Sym2<T> rate_symmetric{};  // stays 0 unless the printed law is used
    std::array<T, 3> bound{};  // b̂₀, b̂₁, b̂₂

    friend constexpr Estimates operator+(const Estimates& a, const Estimates& b) {
        return {.damping = a.damping + b.damping,
                .stiffness = a.stiffness + b.stiffness,
                .rate = a.rate + b.rate,
                .rate_symmetric = a.rate_symmetric + b.rate_symmetric,
                .bound = {a.bound[0] + b.bound[0], a.bound[1] + b.bound[1], a.bound[2] + b.bound[2]}};
    }
    friend constexpr Estimates operator*(T f, const Estimates& a) {
        return {.damping = f * a.damping,
                .stiffness = f * a.stiffness,
                .rate = f * a.rate,
                .rate_symmetric = f * a.rate_symmetric,
                .bound = {f * a.bound[0], f * a.bound[1], f * a.bound[2]}};
    }
};

enum class RateLaw { skew, printed };

// ‖q‖, ‖v‖ and ‖s‖, used by the force and the laws.
template <Scalar T>
struct Norms {
    T position{}, velocity{}, surface{};
};
template <Scalar T>
Norms<T> norms_of(const Motion<T>& motion, const Vec2<T>& surface) {
    const Vec2<T> both = norms(motion.position, motion.velocity);
    return {.position = both.x(), .velocity = both.y(), .surface = norm(surface)};
}

}  // namespace fracgyro
