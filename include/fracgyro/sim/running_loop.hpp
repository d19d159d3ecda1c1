// A closed loop run in parts, tuned while it runs, saved and restored, as held by a program or a page.
#pragma once

#include "fracgyro/sim/any_run.hpp"

#include <optional>
#include <variant>

namespace fracgyro {

// Returns true if a loop with one controller can continue with the other: the same type, with the same memory.
inline bool same_controller(const ControllerParams& a, const ControllerParams& b) {
    const auto chosen = [](const ControllerParams& any) {
        std::size_t found = 0;
        with_params(any, [&](const auto& params, auto family) { found = family.chosen(params); });
        return found;
    };
    const ExponentialSum *const one = kernel_of(a), *const other = kernel_of(b);
    return a.index() == b.index() && chosen(a) == chosen(b) &&
           (one == nullptr || (one->count == other->count && one->poles == other->poles));
}

class RunningLoop {
public:
    // A controller of the setup or, if `same` is false, a user's, which no setup changes.
    RunningLoop(const PlantSetup& setup, AnyController<double>& controller, bool same = true)
        : setup_(setup), draw_(setup), controller_(&controller), checks_(same), part_(start(setup, controller)) {
        take(setup);
    }

    const PlantSetup& setup() const { return setup_; }
    AnyController<double>& controller() const { return *controller_; }
    std::int64_t step() const {  // the coming sample
        return std::visit([](const auto& part) { return part.state.step; }, part_);
    }

    // Runs the coming samples, fewer if the motion diverges. Calls observe(DeviceSnapshot) at each.
    template <class Observe>
    void run(std::int64_t samples, Observe&& observe) {
        std::visit(
            [&]<class C>(Part<C>& part) {
                Loop<C>::run(part.state, part.coefficients, part.state.step + samples, draw_, observe);
            },
            part_);
    }
    // Sets other numbers from the coming sample on; the estimates stay. Returns true if that is possible.
    bool set(const PlantSetup& other) {
        const FilterParams &one = setup_.common.filter, &next = other.common.filter;
        const bool can = (!checks_ || same_controller(setup_.controller, other.controller)) && one.on() == next.on() &&
                         one.assumed.delay == next.assumed.delay &&
                         setup_.common.trigger.on() == other.common.trigger.on() &&
                         (setup_.common.compensation_bandwidth > 0.0) == (other.common.compensation_bandwidth > 0.0);
        if (can) {
            controller_->set(other.controller, other.common);
            take(other);
        }
        return can;
    }
    // Applies an impulse to the mass of the gyroscope, just before the coming sample, which adds `velocity` to its
    // velocity. Other plants have no such function.
    void kick(const Vec2<double>& velocity) {
        std::visit([&](auto& part) { part.state.motion.velocity = part.state.motion.velocity + velocity; }, part_);
    }

    std::size_t saved_size() const {
        return std::visit([&]<class C>(const Part<C>&) { return Part<C>::Bytes::size(*controller_); }, part_);
    }
    void save(unsigned char* bytes) const {
        std::visit([&]<class C>(const Part<C>& part) { Part<C>::Bytes::write(part.state, *controller_, bytes); },
                   part_);
    }
    // Returns true if the bytes are the state of a loop with these coefficients; otherwise this one stays unchanged.
    bool restore(const unsigned char* bytes, std::size_t count) {
        return std::visit(
            [&]<class C>(Part<C>& part) {
                return Part<C>::Bytes::read(bytes, count, part.state, *controller_,
                                            [&](const typename Loop<C>::Pending& read, std::uint64_t steps) {
                                                return read.step >= 0 &&
                                                       C::sound(read.controller, part.coefficients.controller) &&
                                                       steps == static_cast<std::uint64_t>(read.step);
                                            });
            },
            part_);
    }

private:
    template <class C>
    using Loop = Stepper<C, DevicePlant>;
    template <class C>
    struct Part {
        using Bytes = SavedErased<typename Loop<C>::Pending, double>;
        typename Loop<C>::Coefficients coefficients{};
        typename Loop<C>::Pending state{};
    };

    using AnyPart =
        std::variant<Part<Corrected<Erased<double, true>>>, Part<Corrected<Observing<Erased<double, true>>>>,
                     Part<Corrected<Erased<double, false>>>>;

    static AnyPart start(const PlantSetup& setup, AnyController<double>& controller) {
        std::optional<AnyPart> part;
        with_erased(controller, setup.common, [&]<class C>() {
            Part<C> begun;
            begun.state = Loop<C>::begin(setup);
            part.emplace(std::move(begun));
        });
        return *part;
    }

    void take(const PlantSetup& setup) {
        setup_ = setup;
        draw_ = DeviceGyroscope::Draw(setup_);
        std::visit(
            [&]<class C>(Part<C>& part) { part.coefficients = Loop<C>::prepare(erased_setup(setup_, *controller_)); },
            part_);
    }

    PlantSetup setup_;
    DeviceGyroscope::Draw draw_;
    AnyController<double>* controller_;
    bool checks_;
    AnyPart part_;
};

}  // namespace fracgyro
