// Users' controllers: code that computes a force from a sample. The reference, the force limit and the observer are the
// same as for any other controller.
#pragma once

#include "fracgyro/plant/units.hpp"
#include "fracgyro/sim/any_controller.hpp"
#include "fracgyro/sim/padded_numbers.hpp"

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

// Input of a user's controller at one sample, in this order, in the units of the run.
struct UserInput {
    double time = 0.0;
    Vec2<double> position{}, velocity{};
    Vec2<double> reference{}, reference_velocity{}, reference_acceleration{};
};
static_assert(sizeof(UserInput) == 11 * sizeof(double));

// A user's controller has a memory of its own, so there is one object for each run.
class UserController : public AnyController<double> {
public:
    virtual Vec2<double> force(const UserInput& in) = 0;
    // Index of the angular rate in its report; -1: it reports none. Before the first sample only the controller may
    // know.
    virtual std::ptrdiff_t rate_place() const = 0;
    virtual bool runs_on_any_thread() const { return true; }
    // Throws if the controller did harm in the finished run.
    virtual void check() const {}
    // Hint appended to the message about a force that is not finite.
    virtual std::string hint() const { return {}; }

    // Before a run.
    void begin(const Units& units, const Common& common) {
        units_ = units;
        state_ = {};
        set({}, common);
    }

    Signals<double, EmptyReport> step(const Motion<double>& measured, const Sample<double>*) final {
        const double time = static_cast<double>(state_.steps) * step_ * units_.time;
        Signals<double, EmptyReport> signals{.reference = Reference<double>::update(state_, reference_)};
        const ReferencePoint<double>& r = signals.reference;
        signals.error = tracking_error(measured, r);
        const Vec2<double> given = force({.time = time,
                                          .position = units_.length * measured.position,
                                          .velocity = units_.velocity * measured.velocity,
                                          .reference = units_.length * r.position,
                                          .reference_velocity = units_.velocity * r.velocity,
                                          .reference_acceleration = units_.acceleration * r.acceleration});
        if (!(std::isfinite(given.x()) && std::isfinite(given.y()))) {
            check();
            throw std::domain_error(no_force(time, given));
        }
        Vec2<double> wanted = given;
        if (units_.force != 1.0) {  // otherwise the plant would wait for divisions by 1
            wanted = {given.x() / units_.force, given.y() / units_.force};
        }
        signals.force = Saturation<double>::within(saturation_, wanted);
        signals.excess = wanted - signals.force;
        return signals;
    }
    void start_over(bool) final {}
    std::uint64_t steps() const final { return state_.steps; }
    void set(const ControllerParams&, const Common& common) final {
        reference_ = Reference<double>::prepare(common.reference, common.step);
        saturation_ = Saturation<double>::prepare(common.force_limit);
        step_ = common.step;
    }

    double rate() final {
        const std::span<const double> numbers = report();
        return rate_place() < 0 ? CommonReport::nan : numbers[static_cast<std::size_t>(rate_place())] / units_.rate;
    }
    CommonReport common_report() final {
        CommonReport found;
        if (estimates_rate()) {
            found.rate = rate();
            found.has_rate = rate_place() >= 0;
        }
        return found;
    }
    CommonReport common_report_between_steps() const final { return {}; }
    std::vector<double> report_between_steps() const final { return {}; }

    // Its own memory is not included.
    std::size_t state_size() const final { return sizeof state_; }
    void save(unsigned char* bytes) const final { copy_bytes(bytes, &state_, sizeof state_); }
    bool restore(const unsigned char* bytes, std::uint64_t steps) final {
        const bool can = steps_of(bytes) == steps;
        if (can) {
            copy_bytes(&state_, bytes, sizeof state_);
        }
        return can;
    }
    std::uint64_t steps_of(const unsigned char* bytes) const final {
        Reference<double>::State read;
        copy_bytes(&read, bytes, sizeof read);
        return read.steps;
    }

private:
    std::string no_force(double time, const Vec2<double>& f) const {
        std::array<char, 160> text{};
        std::snprintf(text.data(), text.size(),
                      "the controller returned [%.6g, %.6g] at t = %.9g: it must return two finite numbers", f.x(),
                      f.y(), time);
        return text.data() + (std::isnan(f.x()) || std::isnan(f.y()) ? hint() : std::string());
    }

    Units units_{};
    Reference<double>::Coefficients reference_{};
    Reference<double>::State state_{};
    Saturation<double>::Coefficients saturation_{};
    double step_ = 0.0;
};

// A C function as a controller. The state is zero at first, and belongs to the function.
using UserFunction = void (*)(const double* in, double* state, const double* parameters, double* out);
class NativeController final : public UserController {
public:
    NativeController(UserFunction function, std::size_t state_size, const std::vector<double>& parameters,
                     std::size_t reports, std::ptrdiff_t rate_place)
        : function_(function),
          in_(std::vector<double>(sizeof(UserInput) / sizeof(double))),
          memory_(std::vector<double>(state_size)),
          parameters_(parameters),
          out_(std::vector<double>(2 + reports, CommonReport::nan)),
          reported_(reports),
          rate_place_(rate_place) {}

    Vec2<double> force(const UserInput& in) override {
        std::memcpy(in_.data(), &in, sizeof in);
        function_(in_.data(), memory_.data(), parameters_.data(), out_.data());
        return {out_.data()[0], out_.data()[1]};
    }
    std::span<const double> report() override {
        std::copy_n(out_.data() + 2, reported_.size(), reported_.begin());
        return reported_;
    }
    std::ptrdiff_t rate_place() const override { return rate_place_; }
    bool estimates_rate() const override { return rate_place_ >= 0; }
    std::span<double> memory() { return memory_.numbers(); }

    void check() const override {
        const auto look = [](const PaddedNumbers& numbers, const std::string& name, const std::string& beyond) {
            if (const std::size_t end = numbers.written(); end > numbers.count()) {
                throw std::domain_error("the controller wrote to " + name + "[" + std::to_string(end - 1) +
                                        "], which is beyond " + beyond);
            }
        };
        const std::string size = std::to_string(memory_.count());
        look(memory_, "state", "its state_size of " + size + ": state_size must be the number of doubles that it uses");
        look(out_, "out", "the force and its " + std::to_string(reported_.size()) + " reports");
        look(parameters_, "parameters", "its " + std::to_string(parameters_.count()) + " parameters");
        look(in_, "in", "the sample");
    }
    std::string hint() const override {
        return "; it reads NaN beyond its " + std::to_string(parameters_.count()) +
               " parameters and its state_size of " + std::to_string(memory_.count());
    }

private:
    UserFunction function_;
    PaddedNumbers in_, memory_, parameters_, out_;
    std::vector<double> reported_;
    std::ptrdiff_t rate_place_;
};

}  // namespace fracgyro
