// Users' plants: code that computes the derivative of a state. A step is the classical Runge-Kutta step of fourth
// order, over which the force is held.
#pragma once

#include "fracgyro/plant/units.hpp"
#include "fracgyro/sim/any_plant.hpp"
#include "fracgyro/sim/padded_numbers.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <string>

namespace fracgyro {

// Input of a user's plant alongside its state, in this order, in the units of the run. The force is the sum of control
// and disturbance.
struct PlantInput {
    double time = 0.0;
    Vec2<double> force{};
    double rate = 0.0;  // Ωz
};
static_assert(sizeof(PlantInput) == 4 * sizeof(double));

// A plant whose state is in the units of the run. One object for each run.
class UserPlant : public AnyPlant {
public:
    // Number of numbers of its state, 2 to 8.
    virtual std::size_t count() const = 0;

    // Before a run.
    virtual void begin(const Units& units, const Setup& setup) {
        units_ = units;
        step_ = setup.common.step;
    }
    void step(PlantState& state, const PlantStep& s) override {
        state = runge_kutta(state, length(), [&](int halves, const PlantState& x) {
            const PlantInput in = input(s, halves);
            const PlantState rates = derivative(in, x);
            if (!finite(rates) && bounded(motion(x))) {  // otherwise the motion diverges
                check();
                throw std::domain_error(no_derivative(in.time, rates));
            }
            return rates;
        });
    }
    Motion<double> motion(const PlantState& state) final {
        const Motion<double> own = own_motion(state);
        if (units_.length == 1.0 && units_.velocity == 1.0) {  // otherwise the controller would wait for divisions by 1
            return own;
        }
        return {.position = {own.position.x() / units_.length, own.position.y() / units_.length},
                .velocity = {own.velocity.x() / units_.velocity, own.velocity.y() / units_.velocity}};
    }

protected:
    virtual PlantState derivative(const PlantInput& in, const PlantState& state) = 0;
    virtual Motion<double> own_motion(const PlantState& state) = 0;
    // Length of a step, and the input at `halves` half steps after its beginning, in the units of the run.
    double length() const { return step_ * units_.time; }
    PlantInput input(const PlantStep& s, int halves) const {
        return {.time = (static_cast<double>(s.sample) + 0.5 * halves) * length(),
                .force = units_.force * (s.control + s.disturbance),
                .rate = units_.rate * s.rate[static_cast<std::size_t>(halves)]};
    }
    // Hint appended to the message about a derivative that is not finite.
    virtual std::string hint() const { return {}; }

    static bool finite(const PlantState& numbers) {
        return std::ranges::all_of(numbers, [](double number) { return std::isfinite(number); });
    }

private:
    std::string no_derivative(double time, const PlantState& rates) const {
        std::string listed;
        for (std::size_t i = 0; i < count(); ++i) {
            std::array<char, 32> one{};
            std::snprintf(one.data(), one.size(), "%s%.6g", i == 0 ? "" : ", ", rates[i]);
            listed += one.data();
        }
        std::array<char, 32> at{};
        std::snprintf(at.data(), at.size(), "%.9g", time);
        return "the plant returned [" + listed + "] at t = " + at.data() + ": it must return " +
               std::to_string(count()) + " finite numbers" + hint();
    }

    Units units_{};
    double step_ = 0.0;
};

// A C function as a plant, with the places of x, y, vx, vy among its states; -1: that one is 0.
using DerivativeFunction = void (*)(const double* in, const double* state, const double* parameters, double* out);
class NativePlant final : public UserPlant {
public:
    using Places = std::array<std::ptrdiff_t, 4>;

    // `initial` is empty: the motion with which the run begins.
    NativePlant(DerivativeFunction function, std::vector<double> parameters, std::size_t states, const Places& places,
                const std::vector<double>& initial)
        : function_(function),
          in_(std::vector<double>(sizeof(PlantInput) / sizeof(double))),
          state_(std::vector<double>(states)),
          parameters_(std::move(parameters)),
          out_(std::vector<double>(states)),
          places_(places),
          given_(!initial.empty()) {
        std::copy_n(initial.begin(), std::min(initial.size(), first_.size()), first_.begin());
    }

    std::size_t count() const override { return state_.count(); }
    void begin(const Units& units, const Setup& setup) override {
        UserPlant::begin(units, setup);
        const Vec2<double> q = units.length * setup.plant.initial_position;
        const Vec2<double> v = units.velocity * setup.plant.initial_velocity;
        const std::array<double, 4> moving{q.x(), q.y(), v.x(), v.y()};
        for (std::size_t i = 0; i < moving.size() && !given_; ++i) {
            if (places_[i] >= 0) {
                first_[static_cast<std::size_t>(places_[i])] = moving[i];
            }
        }
    }
    PlantState start() override { return first_; }
    void step(PlantState& state, const PlantStep& s) override {
        const PlantState next = count() == 4 ? stepped<4>(state, s) : stepped<8>(state, s);
        if (finite(next)) {
            state = next;
        } else {
            UserPlant::step(state, s);  // the same with checks
        }
    }
    void check() const override {
        const auto look = [](const PaddedNumbers& numbers, const std::string& name) {
            if (const std::size_t end = numbers.written(); end > numbers.count()) {
                throw std::domain_error("the plant wrote to " + name + "[" + std::to_string(end - 1) +
                                        "], which is beyond its " + std::to_string(numbers.count()) + " numbers");
            }
        };
        look(out_, "out");
        look(state_, "state");
        look(parameters_, "parameters");
        look(in_, "in");
    }

protected:
    PlantState derivative(const PlantInput& in, const PlantState& state) override { return called(in, state, count()); }
    Motion<double> own_motion(const PlantState& state) override {
        const auto at = [&](std::size_t i) {
            return places_[i] < 0 ? 0.0 : state[static_cast<std::size_t>(places_[i])];
        };
        return {.position = {at(0), at(1)}, .velocity = {at(2), at(3)}};
    }
    std::string hint() const override {
        return "; it reads NaN beyond its " + std::to_string(count()) + " states and " +
               std::to_string(parameters_.count()) + " parameters";
    }

private:
    // The derivative of `used` states. Numbers are passed one by one, and never two in a register: a load of two would
    // wait for both stores.
    template <std::size_t size>
    std::array<double, size> called(const PlantInput& in, const std::array<double, size>& state, std::size_t used) {
        double* const given = in_.data();
        given[0] = in.time;
        given[1] = in.force.x();
        given[2] = in.force.y();
        given[3] = in.rate;
        std::copy_n(state.begin(), used, state_.data());
        function_(given, state_.data(), parameters_.data(), out_.data());
        const volatile double* const out = out_.data();
        std::array<double, size> rates{};
        for (std::size_t i = 0; i < used; ++i) {
            rates[i] = out[i];
        }
        return rates;
    }
    // The step of at most `size` states.
    template <std::size_t size>
    PlantState stepped(const PlantState& from, const PlantStep& s) {
        using Part = std::array<double, size>;
        const std::size_t used = size == 4 ? 4 : count();
        Part x{};
        std::copy_n(from.begin(), size, x.begin());
        x = runge_kutta(x, length(), [&](int halves, const Part& at) { return called(input(s, halves), at, used); });
        PlantState next{};
        std::ranges::copy(x, next.begin());
        return next;
    }

    DerivativeFunction function_;
    PaddedNumbers in_, state_, parameters_, out_;
    Places places_;
    PlantState first_{};
    bool given_;
};

}  // namespace fracgyro
