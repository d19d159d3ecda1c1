// Users' controllers in a program: a C function, and the errors that end a run.
#pragma once

#include "fracgyro/sim/padded_numbers.hpp"
#include "fracgyro/sim/user_law.hpp"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>

namespace fracgyro {

// Refuses a force that is not finite with an exception.
class UserController : public UserLaw {
public:
    virtual bool runs_on_any_thread() const { return true; }
    // Throws if the controller wrote beyond its arrays in the finished run.
    virtual void check() const {}
    // Hint appended to the message about a force that is not finite.
    virtual std::string hint() const { return {}; }

    void refused(double time, const Vec2<double>& f) const final {
        check();
        std::array<char, 160> text{};
        std::snprintf(text.data(), text.size(),
                      "the controller returned [%.6g, %.6g] at t = %.9g: it must return two finite numbers", f.x(),
                      f.y(), time);
        throw std::domain_error(text.data() + (std::isnan(f.x()) || std::isnan(f.y()) ? hint() : std::string()));
    }
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
