// The guarded controller in a closed loop with the exact plant, with sensor faults. Reads the files of
// scenario_files.hpp and prints JSON. KIND: its place in controller_kinds.
//
//     faults KIND float|double alarms STEPS                how often a sample is refused without any fault
//     faults KIND float|double run FROM UNTIL              effect of each fault on standard input
//     faults KIND float|double notice FROM UNTIL           samples until each fault is detected
//
// A fault is a line WHAT SIZE SAMPLES EVERY.
#include "scenario_files.hpp"

#include "fracgyro/hardware/guard.hpp"

#include <cmath>
#include <cstdio>
#include <iostream>
#include <string>
#include <vector>

using namespace fracgyro;

namespace {

using Measured = std::array<double, 4>;  // x, y and their rates

struct Fault {
    std::string what = "none";
    double size = 0.0;
    std::int64_t samples = 0, every = 0;  // every: period of repetition

    bool acts(std::int64_t since) const { return since >= 0 && (every > 0 ? since % every : since) < samples; }
    // `held`: the last sample before it.
    void apply(Measured& m, const Measured& held) const {
        const auto is = [&](const char* name) { return what == name; };
        constexpr double nan = std::numeric_limits<double>::quiet_NaN();
        m[0] += is("x") ? size : 0.0;
        m[1] += is("y") ? size : 0.0;
        m[2] += is("vx") ? size : 0.0;
        m[3] += is("vy") ? size : 0.0;
        if (is("nan")) {
            m[0] = nan;
        }
        if (is("stuck") || is("stuck x")) {
            m[0] = held[0];
        }
        if (is("stuck") || is("stuck vx")) {
            m[2] = held[2];
        }
        if (is("zero") || is("flip")) {
            const double factor = is("zero") ? 0.0 : -1.0;
            m[0] *= factor, m[2] *= factor;
        }
        if (is("zero y") || is("flip both")) {
            const double factor = is("zero y") ? 0.0 : -1.0;
            m[1] *= factor, m[3] *= factor;
        }
        if (is("flip both")) {
            m[0] *= -1.0, m[2] *= -1.0;
        }
        if (is("gain")) {
            m[0] *= size, m[2] *= size;
        }
    }
};

template <SensesRate Controller>
class Loop {
    using Safe = Guard<Controller>;
    using T = typename Controller::Value;

public:
    explicit Loop(const Setup& setup)
        : setup_(setup),
          coefficients_(prepare<Safe>(setup.controller, setup.common)),
          plant_(Gyroscope<double>::prepare(setup.plant, setup.common.step)),
          motion_(Gyroscope<double>::start(setup.plant)),
          disturbance_(setup.disturbance, setup.common.step) {}

    Status step(const Fault& fault, std::int64_t since) {
        Vec2<double> d;
        disturbance_.fill(n_, {&d, 1});
        Measured m{motion_.position.x(), motion_.position.y(), motion_.velocity.x(), motion_.velocity.y()};
        held_ = since < 0 ? m : held_;
        if (fault.acts(since)) {
            fault.apply(m, held_);
        }
        const auto signals =
            Safe::step(state_, coefficients_, {.position = {T(m[0]), T(m[1])}, .velocity = {T(m[2]), T(m[3])}});
        const double t = static_cast<double>(n_++) * setup_.common.step;
        const ReferenceParams& r = setup_.common.reference;
        error = std::hypot(motion_.position.x() - r.amplitude.x() * std::sin(r.frequency.x() * t + r.phase.x()),
                           motion_.position.y() - r.amplitude.y() * std::sin(r.frequency.y() * t + r.phase.y()));
        const double rate_error = std::abs(static_cast<double>(signals.report.rate) - setup_.plant.rate);
        off = rate_error / std::abs(setup_.plant.rate);
        if constexpr (requires { signals.report.rate_trusted; }) {
            const double deviation = static_cast<double>(signals.report.rate_deviation);
            deviations = static_cast<double>(signals.report.rate_trusted) > 0.5 ? rate_error / deviation : 0.0;
        }
        const Vec2<double> force{static_cast<double>(state_.force.x()), static_cast<double>(state_.force.y())};
        Gyroscope<double>::step(motion_, plant_, force, d);
        return state_.status;
    }

    double error = 0.0, off = 0.0;  // true values; relative rate error
    double deviations = 0.0;        // rate error over its stated deviation, while trusted

private:
    Setup setup_;
    typename Safe::Coefficients coefficients_;
    typename Safe::State state_{};
    Gyroscope<double>::Coefficients plant_;
    Motion<double> motion_;
    Measured held_{};
    Disturbance disturbance_;
    std::int64_t n_ = 0;
};

bool refused(Status s) { return s != Status::ok && s != Status::saturated; }

template <class Controller>
void alarms(const Setup& setup, std::int64_t steps) {
    Loop<Controller> loop(setup);
    std::int64_t count = 0, saturated = 0;
    double late = 0.0;
    for (std::int64_t n = 0; n < steps; ++n) {
        const Status status = loop.step({}, -1);
        count += refused(status);
        saturated += status == Status::saturated;
        late = n < steps / 2 ? 0.0 : std::max(late, loop.error);
    }
    std::printf("{\"refused\": %lld, \"saturated\": %lld, \"error\": %.9g, \"off\": %.9g}\n",
                static_cast<long long>(count), static_cast<long long>(saturated), late, loop.off);
}

// A run has recovered within 1.25 times the maximum of fault-free runs with eight seeds; the margin allows for the
// variation of a maximum over few seeds.
template <class Controller>
void run(Setup setup, std::int64_t from, std::int64_t until, const std::vector<Fault>& faults) {
    double error = 0.0, off = 0.0;
    const Setup first = setup;
    for (int seed = 0; seed < 8; ++seed, ++setup.disturbance.seed) {
        Loop<Controller> loop(setup);
        for (std::int64_t n = 0; n < until; ++n) {
            loop.step({}, -1);
            error = n < from ? error : std::max(error, loop.error);
            off = n < from ? off : std::max(off, loop.off);
        }
    }
    std::printf("{\"error\": %.9g, \"off\": %.9g}\n", error, off);
    error *= 1.25, off *= 1.25;
    for (const Fault& fault : faults) {
        Loop<Controller> loop(first);
        double most_error = 0.0, most_off = 0.0, most_deviations = 0.0;
        std::int64_t error_back = 0, off_back = 0, count = 0, noticed = -1;
        for (std::int64_t n = 0; n < until; ++n) {
            const Status status = loop.step(fault, n - from);
            if (n < from) {
                continue;
            }
            count += refused(status);
            noticed = noticed < 0 && refused(status) ? n - from : noticed;
            most_error = std::max(most_error, loop.error);
            most_off = std::max(most_off, loop.off);
            most_deviations = std::max(most_deviations, loop.deviations);
            error_back = loop.error <= error ? error_back : n - from + 1;  // also if NaN
            off_back = loop.off <= off ? off_back : n - from + 1;
        }
        std::printf(
            "{\"most_error\": %.9g, \"error_back\": %lld, \"most_off\": %.9g, \"off_back\": %lld, "
            "\"deviations\": %.9g, \"refused\": %lld, \"noticed\": %lld}\n",
            most_error, static_cast<long long>(error_back), most_off, static_cast<long long>(off_back), most_deviations,
            static_cast<long long>(count), static_cast<long long>(noticed));
    }
}

// Faults start at 200 evenly spaced times; -1: not detected within `samples`.
template <class Controller>
void notice(const Setup& setup, std::int64_t from, std::int64_t until, const std::vector<Fault>& faults) {
    Loop<Controller> loop(setup);
    std::vector<std::vector<std::int64_t>> after(faults.size());
    for (std::int64_t n = 0; n < until; ++n) {
        if (n >= from && (n - from) % ((until - from) / 200) == 0) {
            for (std::size_t i = 0; i < faults.size(); ++i) {
                Loop<Controller> faulty = loop;
                std::int64_t found = -1;
                for (std::int64_t k = 0; k < faults[i].samples && found < 0; ++k) {
                    found = refused(faulty.step(faults[i], k)) ? k : -1;
                }
                after[i].push_back(found);
            }
        }
        loop.step({}, -1);
    }
    for (const auto& counts : after) {
        for (std::size_t k = 0; k < counts.size(); ++k) {
            std::printf("%s%lld", k == 0 ? "[" : ", ", static_cast<long long>(counts[k]));
        }
        std::printf("]\n");
    }
}

}  // namespace

int main(int count, char** words) {
    Setup setup{.controller = params_of_kind(count < 5 ? 0 : std::stoul(words[1]))};
    if (count < 5 || !take_files(setup)) {
        return 2;
    }
    const std::string number = words[2], mode = words[3];
    const auto steps = [&](int i) { return std::int64_t{std::llround(std::stod(words[i]) / setup.common.step)}; };
    std::vector<Fault> faults;
    for (std::string line; mode != "alarms" && std::getline(std::cin, line);) {
        Fault fault;
        char what[40];
        long long samples = 0, every = 0;
        if (std::sscanf(line.c_str(), "%39[^,],%lf,%lld,%lld", what, &fault.size, &samples, &every) == 4) {
            fault.what = what, fault.samples = samples, fault.every = every;
            faults.push_back(fault);
        }
    }
    const auto act = [&]<class Controller>() {
        if constexpr (!SensesRate<Controller>) {
            std::fputs("this kind senses no rate\n", stderr);
        } else if (mode == "alarms") {
            alarms<Controller>(setup, std::stoll(words[4]));
        } else if (mode == "run") {
            run<Controller>(setup, steps(4), steps(5), faults);
        } else {
            notice<Controller>(setup, steps(4), steps(5), faults);
        }
    };
    number == "float" ? with_controller<float>(setup.controller, act) : with_controller<double>(setup.controller, act);
    return 0;
}
