// The gyroscope with another mass on y, and with matrices that need not be symmetric:
//
//     [1, 0; 0, μ] q̈ + (D + ΔD + δ_D [0, 0; 1, 0] + 2Ω) q̇ + (K + ΔK + δ_K [0, 0; 1, 0]) q = u + d
//
// The Coriolis force is that of the mass of x, which y carries too. The step is exact, like that of the gyroscope. The
// motion may be unstable.
#pragma once

#include "fracgyro/plant/gyroscope.hpp"
#include "fracgyro/plant/plant.hpp"

namespace fracgyro {

struct General {
    struct Params {
        GyroscopeParams linear{};
        double mass_ratio = 1.0;                                    // μ
        double damping_asymmetry = 0.0, stiffness_asymmetry = 0.0;  // δ_D, δ_K

        static constexpr auto fields() {
            return Fields{
                field("mass_ratio", &Params::mass_ratio, "1", above_0, "mass of y over mass, which is that of x."),
                field("damping_asymmetry", &Params::damping_asymmetry, "m*omega0", any_number,
                      "added to yx of damping, but not to xy: the force on y by the velocity of x. 0.0: symmetric."),
                field("stiffness_asymmetry", &Params::stiffness_asymmetry, "m*omega0^2", any_number,
                      "added to yx of stiffness, but not to xy: the force on y by the position of x. 0.0: symmetric."),
            };
        }
    };
    using Coefficients = Gyroscope<double>::Coefficients;
    using State = Motion<double>;

    static Coefficients prepare(const Params& p, double step) {
        Matrix<6> a = Gyroscope<double>::system(p.linear);
        a[3][0] -= p.stiffness_asymmetry;
        a[3][2] -= p.damping_asymmetry;
        for (double& entry : a[3]) {
            entry /= p.mass_ratio;
        }
        return Gyroscope<double>::prepare(a, step);
    }
    static State start(const Params& p) { return Gyroscope<double>::start(p.linear); }
    static Motion<double> motion(const State& s) { return s; }
    static void step(State& s, const Coefficients& c, Vec2<double> control, Vec2<double> disturbance) {
        Gyroscope<double>::step(s, c, control, disturbance);
    }
};

}  // namespace fracgyro
