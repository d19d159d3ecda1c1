// Controllers from outside: whoever computes a force from a sample. The reference, the force limit and the observer are
// those of any other controller.
#pragma once

#include "fracgyro/sim/device_loop.hpp"
#include "fracgyro/plant/units.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace fracgyro {

// What a law is given at a sample, in this order, in the units of the run.
struct LawInput {
    double time = 0.0;
    Vec2<double> position{}, velocity{};
    Vec2<double> reference{}, reference_velocity{}, reference_acceleration{};
};
static_assert(sizeof(LawInput) == 11 * sizeof(double));

// It remembers what it likes, so there is one for each run.
class Law {
public:
    virtual ~Law() = default;
    virtual Vec2<double> force(const LawInput& in) = 0;
    // What it reports besides, after the force: as many numbers at every sample.
    virtual const std::vector<double>& report() = 0;
    // The place of the angular rate among them; -1: it reports none. Before the first sample only the law may know.
    virtual std::ptrdiff_t rate_place() const = 0;
    virtual bool may_report_rate() const { return rate_place() >= 0; }
    // Throws where the law did harm in the run that is over.
    virtual void check() const {}
    // Hint to add to a sentence on a force that is not finite.
    virtual std::string reads() const { return {}; }
    double rate() {
        const auto& numbers = report();
        return rate_place() < 0 ? std::numeric_limits<double>::quiet_NaN()
                                : numbers[static_cast<std::size_t>(rate_place())];
    }
};

// Numbers that a C function is handed, with NaN behind them: a function that reads beyond them finds NaN, which its
// force shows, and one that writes beyond them is found out, having done no harm elsewhere.
class PaddedNumbers {
public:
    static constexpr std::size_t padding = 64;

    explicit PaddedNumbers(std::vector<double> numbers) : all_(std::move(numbers)), count_(all_.size()) {
        all_.resize(count_ + padding, std::numeric_limits<double>::quiet_NaN());
    }
    double* data() { return all_.data(); }
    std::size_t count() const { return count_; }
    std::span<double> numbers() { return {all_.data(), count_}; }
    // The place of the last number that was written beyond them, or that of the last one of them.
    std::size_t written() const {
        std::size_t end = all_.size();
        while (end > count_ && std::isnan(all_[end - 1])) {
            --end;
        }
        return end;
    }

private:
    std::vector<double> all_;
    std::size_t count_;
};

// A C function as a law. The state is zeros at first, and the function's own.
using LawFunction = void (*)(const double* in, double* state, const double* parameters, double* out);
class NativeLaw final : public Law {
public:
    NativeLaw(LawFunction function, std::size_t state_size, std::vector<double> parameters, std::size_t reports,
              std::ptrdiff_t rate_place)
        : function_(function),
          in_(std::vector<double>(sizeof(LawInput) / sizeof(double))),
          state_(std::vector<double>(state_size)),
          parameters_(std::move(parameters)),
          out_(std::vector<double>(2 + reports, std::numeric_limits<double>::quiet_NaN())),
          reported_(reports),
          rate_place_(rate_place) {}

    Vec2<double> force(const LawInput& in) override {
        std::memcpy(in_.data(), &in, sizeof in);
        function_(in_.data(), state_.data(), parameters_.data(), out_.data());
        return {out_.data()[0], out_.data()[1]};
    }
    const std::vector<double>& report() override {
        std::copy_n(out_.data() + 2, reported_.size(), reported_.begin());
        return reported_;
    }
    std::ptrdiff_t rate_place() const override { return rate_place_; }
    std::span<double> state() { return state_.numbers(); }

    void check() const override {
        const auto look = [](const PaddedNumbers& numbers, const std::string& name, const std::string& beyond) {
            if (const std::size_t end = numbers.written(); end > numbers.count()) {
                throw std::domain_error("the controller wrote to " + name + "[" + std::to_string(end - 1) +
                                        "], which is beyond " + beyond);
            }
        };
        const std::string size = std::to_string(state_.count());
        look(state_, "state", "its state_size of " + size + ": state_size must be the number of doubles that it uses");
        look(out_, "out", "the force and its " + std::to_string(reported_.size()) + " reports");
        look(parameters_, "parameters", "its " + std::to_string(parameters_.count()) + " parameters");
        look(in_, "in", "the sample");
    }
    std::string reads() const override {
        return "; it reads NaN beyond its " + std::to_string(parameters_.count()) +
               " parameters and its state_size of " + std::to_string(state_.count());
    }

private:
    LawFunction function_;
    PaddedNumbers in_, state_, parameters_, out_;
    std::vector<double> reported_;
    std::ptrdiff_t rate_place_;
};

struct LawParams {
    Law* law = nullptr;
    Units units{};

    static constexpr std::tuple<> fields() { return {}; }
};

// The sample at which a law gave no force.
class NoForce : public std::domain_error {
public:
    NoForce(double time, const Vec2<double>& force, const Law& law) : std::domain_error(sentence(time, force, law)) {}

private:
    static std::string sentence(double time, const Vec2<double>& f, const Law& law) {
        std::array<char, 160> text{};
        std::snprintf(text.data(), text.size(),
                      "the controller returned [%.6g, %.6g] at t = %.9g: it must return two finite numbers", f.x(),
                      f.y(), time);
        const bool unknown = std::isnan(f.x()) || std::isnan(f.y());
        return text.data() + (unknown ? law.reads() : std::string());
    }
};

// What is reported to metrics, which know only the rate; a record asks the law itself.
struct NothingReported {
    static constexpr std::tuple<> fields() { return {}; }
};
struct RateReported : NothingReported {
    double rate = std::numeric_limits<double>::quiet_NaN();
};

template <class ReportType>
struct OutsideController {
    using Value = double;
    using Params = LawParams;
    using Report = ReportType;
    struct Coefficients {
        Reference<double>::Coefficients reference{};
        Saturation<double>::Coefficients saturation{};
        LawParams law{};
        double step = 0.0;
    };
    // The law's own memory is not in it.
    struct State {
        Reference<double>::State reference{};
    };

    static Coefficients prepare(const Params& p, const Common& common) {
        return {.reference = Reference<double>::prepare(common.reference, common.step),
                .saturation = Saturation<double>::prepare(common.force_limit),
                .law = p,
                .step = common.step};
    }
    static Report report(const State&, const Coefficients&) { return {}; }
    static bool sound(const State&, const Coefficients&) { return true; }
    static std::uint64_t steps(const State& state) { return state.reference.steps; }
    static void start_over(State&, bool) {}

    // In simulations no sample is missing, and no guard is around a law.
    static Signals<double, Report> step(State& state, const Coefficients& c, const Motion<double>& measured,
                                        const Sample<double>* = nullptr) {
        const double time = static_cast<double>(state.reference.steps) * c.step * c.law.units.time;
        Signals<double, Report> signals{.reference = Reference<double>::update(state.reference, c.reference)};
        const ReferencePoint<double>& r = signals.reference;
        signals.error = tracking_error(measured, r);
        const Vec2<double> given =
            c.law.law->force({.time = time,
                              .position = c.law.units.length * measured.position,
                              .velocity = c.law.units.velocity * measured.velocity,
                              .reference = c.law.units.length * r.position,
                              .reference_velocity = c.law.units.velocity * r.velocity,
                              .reference_acceleration = c.law.units.acceleration * r.acceleration});
        if (!(std::isfinite(given.x()) && std::isfinite(given.y()))) {
            c.law.law->check();
            throw NoForce(time, given, *c.law.law);
        }
        const double unit = c.law.units.force;
        Vec2<double> wanted = given;
        if (unit != 1.0) {  // or the plant would wait for divisions by 1
            wanted = {given.x() / unit, given.y() / unit};
        }
        signals.force = Saturation<double>::within(c.saturation, wanted);
        signals.excess = wanted - signals.force;
        if constexpr (requires { signals.report.rate; }) {
            signals.report.rate = c.law.law->rate() / c.law.units.rate;
        }
        return signals;
    }
};

using OutsideSetup = DeviceSetupOf<LawParams>;

// The run of a setup, with this law in place of its controller.
inline OutsideSetup outside_setup(const DeviceSetup& s, Law* law, const Units& units) {
    return {{{.law = law, .units = units}, s.common, s.plant, s.disturbance, s.steps}, s.rate, s.device};
}

// Calls visit.template operator()<C>() for the controller of the law, behind an observer where there is one.
template <class Report, class Visit>
void with_law(const OutsideSetup& setup, Visit&& visit) {
    if (setup.common.observer_bandwidth > 0.0) {
        visit.template operator()<Observing<OutsideController<Report>>>();
    } else {
        visit.template operator()<OutsideController<Report>>();
    }
}

// Rows of a run: the loop's channels, what the law reports, in its own units, and the device's channels if `device`.
// Rows: a vector of doubles.
template <class Rows>
struct OutsideRecord {
    Rows rows{};
    std::size_t width = 0;
    std::int64_t samples = 0;  // before divergence
};
template <class Rows>
OutsideRecord<Rows> record_outside(const OutsideSetup& setup, std::int64_t every, bool device, FillNoise noise) {
    OutsideRecord<Rows> record;
    Law& law = *setup.controller.law;
    std::size_t written = 0;
    std::int64_t until_next = 0;
    const auto keep = [&](const auto& at, auto&& more) {
        if (until_next == 0) {
            const std::vector<double>& reported = law.report();
            if (record.width == 0) {
                record.width = loop_width + reported.size() + (device ? device_width : 0);
                record.rows.resize(static_cast<std::size_t>(setup.steps / every + 1) * record.width);
            }
            double* const row = record.rows.data() + written;
            write_row<double, NothingReported>(at, row);
            more(std::copy(reported.begin(), reported.end(), row + loop_width));
            written += record.width;
            until_next = every;
        }
        --until_next;
    };
    if (device) {
        with_law<NothingReported>(setup, [&]<class C>() {
            record.samples = run_device_loop<C>(setup, [&](const DeviceSnapshot<NothingReported>& at) {
                keep(at, [&](double* rest) { std::ranges::copy(device_row(at), rest); });
            });
        });
    } else {
        record.samples = run_loop<OutsideController<NothingReported>>(
            setup, Disturbance(setup.disturbance, setup.common.step, noise),
            [&](const Snapshot<double, NothingReported>& at) { keep(at, [](double*) {}); });
    }
    law.check();
    record.rows.resize(written);
    return record;
}

// As measure_device.
inline std::array<double, metric_names.size()> measure_outside(const OutsideSetup& setup, const MetricsParams& params) {
    std::array<double, metric_names.size()> values{};
    const auto measure = [&]<class C>() { values = measure_device<C>(setup, params); };
    if (setup.controller.law->may_report_rate()) {
        with_law<RateReported>(setup, measure);
    } else {
        with_law<NothingReported>(setup, measure);
    }
    setup.controller.law->check();
    if (setup.controller.law->rate_place() < 0) {
        for (std::size_t i = 0; i < values.size(); ++i) {
            if (metric_names[i].starts_with("rate_")) {
                values[i] = std::numeric_limits<double>::quiet_NaN();
            }
        }
    }
    return values;
}

}  // namespace fracgyro
