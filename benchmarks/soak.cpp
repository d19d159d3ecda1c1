// The closed loops of soak.py, compiled for each NUMBER. Standard input: number of runs and of steps; then of each run
// the place of its kind, its settings (settings.hpp), and its exponentials. Standard output: lines at each mark.
//     without argument   up to eight runs in the lanes of a register, without contraction: the bits of single runs
//     one argument       one run from positions with noise of this deviation; plant in double, controller in NUMBER
#include "fracgyro/sim/lane_setup.hpp"
#include "fracgyro/sim/loop.hpp"
#include "fracgyro/sim/settings.hpp"

#include <cmath>
#include <cstdlib>
#include <iostream>
#include <string>
#include <vector>

namespace fracgyro {
namespace {

constexpr std::size_t lanes = 8;
constexpr std::int64_t window = 1'000'000;  // steps before a mark over which is averaged
constexpr std::int64_t stretch = 500;

// The next number of the input; >> does not read infinity.
double next_number() {
    std::string word;
    std::cin >> word;
    return std::strtod(word.c_str(), nullptr);
}

std::vector<Setup> read_runs(std::int64_t& steps) {
    std::size_t count = 0;
    std::cin >> count >> steps;
    std::vector<Setup> runs(count);
    for (Setup& run : runs) {
        std::size_t kind = 0;
        std::cin >> kind;
        run.controller = params_of_kind(kind);
        run.common.observer_bandwidth = next_number();
        std::vector<double> values(setting_count(run));
        for (double& value : values) {
            value = next_number();
        }
        take_settings(run, values.data());
        ExponentialSum* const kernel = kernel_of(run.controller);
        for (std::size_t i = 0; kernel != nullptr && i < kernel->count; ++i) {
            kernel->poles[i] = next_number();
            kernel->weights[i] = next_number();
        }
    }
    return runs;
}

// The next figures are due after 1e6, 1e7, … steps, half of them and all.
std::int64_t next_mark(std::int64_t n, std::int64_t steps) {
    std::int64_t mark = 10 * window;
    while (mark <= n) {
        mark = mark < steps / 2 ? std::min(mark * 10, steps / 2) : steps;
    }
    return n < window ? window : mark;
}

SwitchingParams control_of(const Setup& setup) {
    SwitchingParams control;
    with_params(setup.controller, [&](const auto& params, auto) {
        if constexpr (requires { params.control; }) {
            control = params.control;
        }
    });
    return control;
}

struct Sums {
    double error_x = 0.0, error_y = 0.0, rate = 0.0, rate_squared = 0.0, gain = 0.0, stated = 0.0, trusted = 0.0;
};

template <Controller C>
void soak(const std::vector<Setup>& runs, std::int64_t steps) {
    using T = typename C::Value;
    using Number = typename T::Number;
    typename C::Coefficients controller{};
    typename Gyroscope<T>::Coefficients plant{};
    typename C::State state{};
    Motion<T> motion{};
    std::size_t terms = 0;
    for (const Setup& run : runs) {
        terms = std::max(terms, kernel_terms(run));
    }
    std::vector<Disturbance> disturbances;
    T slope{};  // h/δ
    for (std::size_t k = 0; k < lanes; ++k) {
        const Setup& setup = runs[std::min(k, runs.size() - 1)];
        ControllerParams params = setup.controller;
        if (kernel_terms(setup) < terms) {
            fill_up(*kernel_of(params), terms);
        }
        const auto coefficients = prepare<C>(params, setup.common);
        if (k == 0) {
            controller = coefficients;
        }
        detail::set_lane<T>(controller, coefficients, k);
        detail::set_lane<T>(plant, Gyroscope<T>::prepare(setup.plant, setup.common.step), k);
        detail::set_lane<T>(motion, Gyroscope<T>::start(setup.plant), k);
        slope.lane[k] = static_cast<Number>(setup.common.step / control_of(setup).layer_thickness);
        disturbances.emplace_back(setup.disturbance, setup.common.step);
    }
    std::array<Sums, lanes> sums{};
    std::array<bool, lanes> alive{};
    alive.fill(true);
    std::array<std::array<Vec2<double>, stretch>, lanes> coming{};
    for (std::int64_t n = 0; n < steps;) {
        for (std::size_t k = 0; k < lanes; ++k) {
            disturbances[k].fill(n, coming[k]);
        }
        const std::int64_t mark = next_mark(n, steps);
        const bool counting = n >= mark - window;
        T x{}, y{}, rate{}, squared{}, gain{};
        Signals<T, typename C::Report> signals;
        for (std::int64_t i = 0; i < stretch; ++i, ++n) {
            signals = C::step(state, controller, motion);
            if (counting) {
                const Vec2<T> e = signals.error.value;
                x = x + e.x() * e.x();
                y = y + e.y() * e.y();
                rate = rate + signals.report.rate;
                squared = squared + signals.report.rate * signals.report.rate;
                const auto& b = signals.report.bound;
                const T rho = b[0] + b[1] * norm(motion.position) + b[2] * norm(motion.velocity);
                gain = maximum(gain, rho * slope);
            }
            Vec2<T> d;
            for (std::size_t k = 0; k < lanes; ++k) {
                d.first.lane[k] = static_cast<Number>(coming[k][static_cast<std::size_t>(i)].x());
                d.second.lane[k] = static_cast<Number>(coming[k][static_cast<std::size_t>(i)].y());
            }
            Gyroscope<T>::step(motion, plant, signals.force, d);
        }
        for (std::size_t k = 0; k < runs.size(); ++k) {
            const Setup& setup = runs[k];
            const double size =
                std::abs(double{motion.position.x().lane[k]}) + std::abs(double{motion.position.y().lane[k]});
            if (alive[k] && !(size < divergence_limit)) {
                alive[k] = false;
                std::cout << k << ' ' << n << " diverged\n";
            }
            if (!counting || !alive[k]) {
                continue;
            }
            Sums& s = sums[k];
            s.error_x += x.lane[k];
            s.error_y += y.lane[k];
            s.rate += rate.lane[k];
            s.rate_squared += squared.lane[k];
            s.gain = std::max(s.gain, std::min(double{gain.lane[k]}, control_of(setup).switching_limit));
            if (n == mark) {
                const double count = static_cast<double>(window), mean = s.rate / count;
                const auto& b = signals.report.bound;
                std::cout << k << ' ' << n << ' ' << std::sqrt(s.error_x / count) << ' ' << std::sqrt(s.error_y / count)
                          << ' ' << mean - setup.plant.rate << ' '
                          << std::sqrt(std::max(0.0, s.rate_squared / count - mean * mean)) << ' ' << b[0].lane[k]
                          << ' ' << b[1].lane[k] << ' ' << b[2].lane[k] << ' ' << s.gain << std::endl;
                s = {};
            }
        }
    }
}

template <Controller C>
void soak_joint(const Setup& setup, std::int64_t steps, double sensing) {
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
        const std::int64_t mark = next_mark(n, steps);
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

int run(const char* sensing) {
    std::int64_t steps = 0;
    const std::vector<Setup> runs = read_runs(steps);
    if (!std::cin || runs.empty() || runs.size() > lanes) {
        return 1;
    }
    std::cout.precision(6);
    bool soaked = false;
    if (sensing != nullptr) {
        with_controller<NUMBER>(runs[0].controller, true, [&]<class C>() {
            if constexpr (requires(typename C::Report report) { report.rate, report.rate_deviation; }) {
                soak_joint<C>(runs[0], steps, std::atof(sensing));
                soaked = true;
            }
        });
    } else {
        with_controller<Lanes<NUMBER, lanes>>(runs[0].controller, [&]<class C>() {
            if constexpr (requires(typename C::Report report) { report.rate, report.bound; }) {
                soak<C>(runs, steps);
                soaked = true;
            }
        });
    }
    return soaked ? 0 : 1;
}

}  // namespace
}  // namespace fracgyro

int main(int, char** arguments) { return fracgyro::run(arguments[1]); }
