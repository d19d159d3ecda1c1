// The paper's corrected controller in a closed loop with the gyroscope, in noise; prints the tracking error of x and y.
// Everything is nondimensional: lengths in q0, times in 1/ω0. `fracgyro simulate` runs the same.
#include <fracgyro/control/sliding_mode.hpp>
#include <fracgyro/core/kernel_design.hpp>
#include <fracgyro/plant/disturbance.hpp>
#include <fracgyro/plant/gyroscope.hpp>

#include <cmath>
#include <cstdio>
#include <numbers>

using namespace fracgyro;
using Controller = SlidingModeController<double, FractionalFastTerminalSurface>;

int main() {
    constexpr double pi = std::numbers::pi, step = 1e-3;
    constexpr int steps = 80'000;

    const GyroscopeParams gyroscope{.damping = {0.01, 0.002, 0.01},                             // D: xx, xy, yy
                                    .stiffness = {63.955 / 0.18, 12.779 / 0.18, 95.92 / 0.18},  // K = k/(m ω0²)
                                    .rate = 0.1,                                                // Ωz
                                    .initial_position = {0.5, 0.5}};
    static KernelDesign design;
    const Common common{.step = step,
                        .reference = {.frequency = {pi, pi / 2}, .phase = {0.0, pi / 2}},
                        .nominal = {.damping = 0.95 * gyroscope.damping,
                                    .stiffness = 0.95 * gyroscope.stiffness,
                                    .rate = 0.95 * gyroscope.rate}};
    SlidingModeParams params;
    params.surface.kernel = designed_kernel(design, 0.9, step, steps * step, 1e-6);  // order α, tolerance of the kernel

    const auto controller = Controller::prepare(params, common);
    const auto plant = Gyroscope<double>::prepare(gyroscope, step);
    Disturbance noise({.kind = DisturbanceKind::noise}, step);
    Controller::State state{};
    Motion<double> motion = Gyroscope<double>::start(gyroscope);
    Vec2<double> sum{};
    for (int n = 0; n <= steps; ++n) {
        const auto signals = Controller::step(state, controller, motion);
        Vec2<double> disturbance;
        noise.fill(n, {&disturbance, 1});
        Gyroscope<double>::step(motion, plant, signals.force, disturbance);
        sum = sum + signals.error.value * signals.error.value;
    }
    std::printf("RMSE: x %.9g, y %.9g\n", std::sqrt(sum.x() / (steps + 1)), std::sqrt(sum.y() / (steps + 1)));
}
