// Users' plants: code that computes the derivative of a state, or the state after a step. The force is held over a
// step, which with a derivative is the classical Runge-Kutta step of fourth order.
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
    void step(PlantState& state, Motion<double>& moved, const PlantStep& s) override {
        state = runge_kutta(state, length(), [&](int halves, const PlantState& x) {
            const PlantInput in = input(s, halves);
            const PlantState rates = derivative(in, x);
            refuse_if_not_finite(in.time, x, rates);
            return rates;
        });
        moved = motion(state);
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
    // Hint appended to the message about numbers that are not finite.
    virtual std::string hint() const { return {}; }

    // Throws if the numbers returned for this state are not finite, unless the motion diverges.
    void refuse_if_not_finite(double time, const PlantState& state, const PlantState& returned) {
        const auto finite = [](double number) { return std::isfinite(number); };
        if (!std::ranges::all_of(returned, finite) && bounded(motion(state))) {
            check();
            throw std::domain_error(not_finite(time, returned));
        }
    }

private:
    std::string not_finite(double time, const PlantState& returned) const {
        std::string listed;
        for (std::size_t i = 0; i < count(); ++i) {
            std::array<char, 32> one{};
            std::snprintf(one.data(), one.size(), "%s%.6g", i == 0 ? "" : ", ", returned[i]);
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

// A C function as a plant. It computes the derivative of its states, from the numbers of PlantInput; or the states
// after a step, from the time, the force, the angular rate at its beginning, middle and end, and its length.
using PlantFunction = void (*)(const double* in, const double* state, const double* parameters, double* out);
class NativePlant final : public UserPlant {
public:
    enum class Computes { derivative, step };
    using Places = std::array<std::ptrdiff_t, 4>;  // places of x, y, vx, vy among the states; -1: that one is 0

    // `initial` is empty: the motion with which the run begins.
    NativePlant(PlantFunction function, Computes computes, const std::vector<double>& parameters, std::size_t states,
                const Places& places, const std::vector<double>& initial)
        : function_(function),
          computes_(computes),
          in_(std::vector<double>(computes == Computes::step ? 7 : 4)),
          state_(std::vector<double>(states)),
          parameters_(parameters),
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
    void step(PlantState& state, Motion<double>& moved, const PlantStep& s) override {
        if (count() != 4 || !step_of_four(state, s)) {
            if (computes_ == Computes::derivative) {
                UserPlant::step(state, moved, s);
                return;
            }
            const PlantState next = after(state, s);
            refuse_if_not_finite(input(s, 0).time, state, next);
            state = next;
        }
        moved = motion(state);
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
    PlantState derivative(const PlantInput& in, const PlantState& state) override {
        give(in);
        return called(state);
    }
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
    // Numbers that the function wrote are loaded one by one: a load of two would wait for both stores.
    using Written = const volatile double*;

    void give(const PlantInput& in) {
        double* const given = in_.data();
        given[0] = in.time;
        given[1] = in.force.x();
        given[2] = in.force.y();
        given[3] = in.rate;
    }
    void give(const PlantStep& s) {
        give(input(s, 0));
        double* const given = in_.data();
        given[4] = input(s, 1).rate;
        given[5] = input(s, 2).rate;
        given[6] = length();
    }
    Written called() {
        function_(in_.data(), state_.data(), parameters_.data(), out_.data());
        return out_.data();
    }
    PlantState called(const PlantState& state) {
        std::copy_n(state.begin(), count(), state_.data());
        PlantState returned{};
        std::copy_n(called(), count(), returned.begin());
        return returned;
    }
    PlantState after(const PlantState& state, const PlantStep& s) {
        give(s);
        return called(state);
    }

    using Four = std::array<Vec2<double>, 2>;
    Four called(const Four& state) {
        copy_bytes(state_.data(), state.data(), sizeof state);
        const Written out = called();
        return {Vec2{out[0], out[1]}, Vec2{out[2], out[3]}};
    }
    // The same step of four states, in registers. Returns false, without a step, if a number is not finite.
    bool step_of_four(PlantState& state, const PlantStep& s) {
        const Four from{Vec2{state[0], state[1]}, Vec2{state[2], state[3]}};
        Four next;
        if (computes_ == Computes::step) {
            give(s);
            next = called(from);
        } else {
            next = runge_kutta(from, length(), [&](int halves, const Four& now) {
                give(input(s, halves));
                return called(now);
            });
        }
        const Vec2<double> zero = 0.0 * next[0] + 0.0 * next[1];  // NaN if one is not finite
        if (!(zero == Vec2{0.0, 0.0})) {
            return false;
        }
        copy_bytes(state.data(), next.data(), sizeof next);
        return true;
    }

    PlantFunction function_;
    Computes computes_;
    PaddedNumbers in_, state_, parameters_, out_;
    Places places_;
    PlantState first_{};
    bool given_;
};

}  // namespace fracgyro
