// A rate sensor off its model: the guarded controller in a closed loop with the device, under faults of its sensors.
// Reads the files of scenario_files.hpp and "device", "rate" and "temperature" (off_model.py), and prints one line for
// each fault on standard input, WHAT,SIZE,SAMPLES:
//
//     off_model KIND position|both|composite checked|unchecked FROM UNTIL
//
// Shares of samples that are trusted, and of those the share beyond four stated deviations, during the fault and after
// it; the steps from its end until 99 % of all later samples are trusted and within four deviations, -1: never; RMS
// error and mean stated deviation after it.
#include "scenario_files.hpp"

#include "fracgyro/hardware/guard.hpp"

#include <cmath>
#include <cstdio>
#include <iostream>
#include <string>
#include <vector>

using namespace fracgyro;

namespace {

constexpr std::int64_t remembered = 64;  // samples

struct Fault {
    std::string what = "none";
    double size = 0.0;
    std::int64_t samples = 0;

    // The sample n, the one before the fault, and the last ones.
    void apply(std::int64_t n, std::int64_t since, Motion<double>& m, const Motion<double>& held,
               const std::vector<Motion<double>>& past) const {
        const auto is = [&](const char* name) { return what == name; };
        const auto scale = [&](double x, double y) {
            const Vec2<double> by{x, y};
            m = {.position = by * m.position, .velocity = by * m.velocity};
        };
        const auto add = [&](double x, double y) { m.position = m.position + Vec2<double>{x, y}; };
        const double sine = std::sin(size), cosine = std::cos(size), t = static_cast<double>(n);
        const auto turned_by = [&](const Vec2<double>& a) {
            return Vec2<double>{cosine * a.x() + sine * a.y(), cosine * a.y() - sine * a.x()};
        };
        const auto stuck = [&](bool x, bool y) {
            m.position = {x ? held.position.x() : m.position.x(), y ? held.position.y() : m.position.y()};
            m.velocity = {x ? held.velocity.x() : m.velocity.x(), y ? held.velocity.y() : m.velocity.y()};
        };
        const auto noise = [&](std::uint32_t stream) {
            return Disturbance({.kind = DisturbanceKind::noise, .standard_deviation = size, .stream = stream}, 1.0)(n);
        };
        if (is("x")) {
            add(size, 0.0);
        } else if (is("y")) {
            add(0.0, size);
        } else if (is("x and y")) {
            add(size, size);
        } else if (is("x times")) {
            scale(size, 1.0);
        } else if (is("y times")) {
            scale(1.0, size);
        } else if (is("both times")) {
            scale(size, size);
        } else if (is("x stuck") || is("y stuck") || is("both stuck")) {
            stuck(!is("y stuck"), !is("x stuck"));
        } else if (is("x is NaN")) {
            m.position = {std::nan(""), m.position.y()};
        } else if (is("both are NaN")) {
            m.position = {std::nan(""), std::nan("")};
        } else if (is("axes turned by")) {
            m = {.position = turned_by(m.position), .velocity = turned_by(m.velocity)};
        } else if (is("axes swapped")) {
            m = {.position = {m.position.y(), m.position.x()}, .velocity = {m.velocity.y(), m.velocity.x()}};
        } else if (is("samples late")) {
            m = past[static_cast<std::size_t>((n + remembered - static_cast<std::int64_t>(size)) % remembered)];
        } else if (is("noise")) {
            m = {.position = m.position + noise(8), .velocity = m.velocity + noise(9)};
        } else if (is("every 2nd x") || is("every 10th x") || is("every 100th x")) {
            const std::int64_t every = is("every 2nd x") ? 2 : is("every 10th x") ? 10 : 100;
            add(since % every == 0 ? size : 0.0, 0.0);
        } else if (is("ramp of x to")) {
            add(size * static_cast<double>(since) / static_cast<double>(samples), 0.0);
        } else if (is("steps of")) {
            const auto rounded = [&](const Vec2<double>& a) {
                return Vec2<double>{size * std::round(a.x() / size), size * std::round(a.y() / size)};
            };
            m = {.position = rounded(m.position), .velocity = rounded(m.velocity)};
        } else if (is("clipped at")) {
            m.position = {std::clamp(m.position.x(), -size, size), std::clamp(m.position.y(), -size, size)};
        } else if (is("tone on x")) {
            add(size * std::sin(0.045 * t), 0.0);
        } else if (is("tone on y")) {
            add(0.0, size * std::sin(0.055 * t));
        }
    }
};

template <class Controller>
class Loop {
    using Safe = Guard<Controller>;
    using Device = DeviceGyroscope;

public:
    explicit Loop(const DeviceSetup& setup)
        : coefficients_(prepare<Safe>(setup.controller, setup.common)),
          device_(Device::prepare(setup)),
          gyroscope_(Device::start(setup)),
          draw_(setup),
          past_(remembered) {}

    void step(const Fault& fault, std::int64_t since) {
        Motion<double> measured = Device::sense(gyroscope_, device_, draw_(n_));
        past_[static_cast<std::size_t>(n_ % remembered)] = measured;
        held_ = since < 0 ? measured : held_;
        if (since >= 0 && since < fault.samples) {
            fault.apply(n_, since, measured, held_, past_);
        }
        const auto signals = Safe::step(state_, coefficients_, measured);
        error = static_cast<double>(signals.report.rate) - device_.rate.at(n_);
        deviation = static_cast<double>(signals.report.rate_deviation);
        trusted = static_cast<double>(signals.report.rate_trusted) > 0.5;
        Device::act(gyroscope_, device_, signals.force, n_);
        Device::step(gyroscope_, device_, n_);
        ++n_;
    }

    double error = 0.0, deviation = 0.0;
    bool trusted = false;

private:
    typename Safe::Coefficients coefficients_;
    typename Safe::State state_{};
    Device::Coefficients device_;
    Device::State gyroscope_;
    Device::Draw draw_;
    std::vector<Motion<double>> past_;
    Motion<double> held_{};
    std::int64_t n_ = 0;
};

struct Shares {
    std::int64_t samples = 0, trusted = 0, wrong = 0;

    void print(const char* name) const {
        const auto share = [](std::int64_t a, std::int64_t b) {
            return b == 0 ? 0.0 : static_cast<double>(a) / static_cast<double>(b);
        };
        std::printf("\"%s\": [%.9g, %.9g], ", name, share(trusted, samples), share(wrong, trusted));
    }
};

template <class Controller>
void run(const DeviceSetup& setup, std::int64_t from, std::int64_t until) {
    Loop<Controller> before(setup);
    for (std::int64_t n = 0; n < from; ++n) {
        before.step({}, -1);
    }
    for (std::string line; std::getline(std::cin, line);) {
        Fault fault;
        char what[40];
        long long samples = 0;
        if (std::sscanf(line.c_str(), "%39[^,],%lf,%lld", what, &fault.size, &samples) != 3) {
            continue;
        }
        fault.what = what, fault.samples = samples;
        Loop<Controller> loop = before;
        Shares during, after;
        std::vector<bool> good;
        double squares = 0.0, deviations = 0.0;
        for (std::int64_t n = from; n < until; ++n) {
            loop.step(fault, n - from);
            const bool within = std::abs(loop.error) <= 4.0 * loop.deviation;
            Shares& now = n - from < fault.samples ? during : after;
            ++now.samples, now.trusted += loop.trusted, now.wrong += loop.trusted && !within;
            if (&now == &after) {
                good.push_back(loop.trusted && within);
                squares += loop.error * loop.error, deviations += loop.deviation;
            }
        }
        std::int64_t back = -1, count = 0;
        for (std::size_t k = good.size(); k-- > 0;) {
            count += good[k];
            if (good[k] && static_cast<double>(count) >= 0.99 * static_cast<double>(good.size() - k)) {
                back = static_cast<std::int64_t>(k);
            }
        }
        const double size = static_cast<double>(good.size());
        std::printf("{");
        during.print("during");
        after.print("after");
        std::printf("\"back\": %lld, \"rms\": %.9g, \"deviation\": %.9g}\n", static_cast<long long>(back),
                    std::sqrt(squares / size), deviations / size);
        std::fflush(stdout);
    }
}

}  // namespace

int main(int count, char** words) {
    DeviceSetup setup{{.controller = params_of_kind(count < 6 ? 0 : std::stoul(words[1]))}};
    if (count < 6 || !take_files(setup)) {
        return 2;
    }
    const auto points = [](const std::vector<double>& both) {
        const auto half = both.begin() + static_cast<std::ptrdiff_t>(both.size() / 2);
        return Profile{{both.begin(), half}, {half, both.end()}};
    };
    take_device_settings(setup, read("device").data());
    setup.rate.table = points(read("rate"));
    setup.device.temperature = points(read("temperature"));
    setup.common.guard.checked = words[3] == std::string("checked");
    if (!setup.common.guard.checked) {
        setup.common.guard.patience = setup.common.guard.saturation_patience = 0.0;
    }
    const std::int64_t from = std::stoll(words[4]), until = std::stoll(words[5]);
    setup.steps = until;
    if (words[2] == std::string("position")) {
        run<SlidingModeController<double, FractionalFastTerminalSurface, JointFromPositions>>(setup, from, until);
    } else if (words[2] == std::string("both")) {
        run<SlidingModeController<double, FractionalFastTerminalSurface, JointAdaptation>>(setup, from, until);
    } else {
        run<SlidingModeController<double, FractionalFastTerminalSurface, CompositeAdaptation>>(setup, from, until);
    }
    return 0;
}
