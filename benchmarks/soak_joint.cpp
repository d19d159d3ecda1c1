// The closed loop of soak_joint.py: one run, from positions with noise of this standard deviation, the first argument;
// the plant in double, the controller in NUMBER. Standard output: one line at each mark.
#include "soak_input.hpp"

#include "fracgyro/sim/loop.hpp"

#include <cmath>
#include <cstdlib>

namespace fracgyro {
namespace {

constexpr std::int64_t window = 1'000'000;  // steps before a mark over which is averaged

struct Sums {
    double error_x = 0.0, error_y = 0.0, rate = 0.0, rate_squared = 0.0, stated = 0.0, trusted = 0.0;
};

template <Controller C>
void soak(const Setup& setup, std::int64_t steps, double sensing) {
    using T = typename C::Value;
    const auto controller = prepare<C>(setup.controller, setup.common);
    const auto plant = Gyroscope<double>::prepare(setup.plant, setup.common.step);
    typename C::State state{};
    Motion<double> motion = Gyroscope<double>::start(setup.plant);
    Disturbance force(setup.disturbance, setup.common.step);
    DisturbanceParams of_sensor = setup.disturbance;
    of_sensor.standard_deviation = sensing;
    of_sensor.stream = 1;
    Disturbance sensor(of_sensor, setup.common.step);
    const auto number = [](T a) { return static_cast<double>(a); };
    Sums s;
    for (std::int64_t n = 0; n < steps;) {
        const std::int64_t mark = next_mark(n, window, steps);
        for (; n < mark; ++n) {
            const Vec2<double> seen = motion.position + sensor(n);
            const auto signals = C::step(state, controller, {.position = {T(seen.x()), T(seen.y())}, .velocity = {}});
            if (n >= mark - window) {
                const Vec2<T>& r = signals.reference.position;
                const double x = motion.position.x() - number(r.x()), y = motion.position.y() - number(r.y());
                const auto& report = signals.report;
                const double rate = number(report.rate) - setup.plant.rate;
                s.error_x += x * x;
                s.error_y += y * y;
                s.rate += rate;
                s.rate_squared += rate * rate;
                s.stated += number(report.rate_deviation);
                s.trusted += number(report.rate_trusted);
            }
            Gyroscope<double>::step(motion, plant, {number(signals.force.x()), number(signals.force.y())}, force(n));
        }
        if (!bounded(motion)) {
            std::cout << n << " diverged\n";
            return;
        }
        const double count = static_cast<double>(window), mean = s.rate / count;
        std::cout << n << ' ' << std::sqrt(s.error_x / count) << ' ' << std::sqrt(s.error_y / count) << ' ' << mean
                  << ' ' << std::sqrt(std::max(0.0, s.rate_squared / count - mean * mean)) << ' ' << s.stated / count
                  << ' ' << s.trusted / count << std::endl;
        s = {};
    }
}

int run(double sensing) {
    std::int64_t steps = 0;
    const std::vector<Setup> runs = read_runs(steps);
    if (!std::cin || runs.empty()) {
        return 1;
    }
    std::cout.precision(6);
    bool soaked = false;
    with_controller<NUMBER>(runs[0].controller, true, [&]<class C>() {
        if constexpr (requires(typename C::Report report) { report.rate, report.rate_deviation; }) {
            soak<C>(runs[0], steps, sensing);
            soaked = true;
        }
    });
    return soaked ? 0 : 1;
}

}  // namespace
}  // namespace fracgyro

int main(int, char** arguments) { return fracgyro::run(std::atof(arguments[1])); }
