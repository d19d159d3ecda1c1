// A controller of any type on its own, behind its guard, as stepped by Python and the browser.
#pragma once

#include "fracgyro/hardware/guard.hpp"
#include "fracgyro/sim/any_controller.hpp"

namespace fracgyro {

class GuardedController {
public:
    virtual ~GuardedController() = default;
    virtual Vec2<double> step(const Motion<double>& measured) = 0;  // the force
    virtual void acted(const Vec2<double>& force) = 0;              // after `step`, where a converter rounds its force
    virtual std::vector<double> report() const = 0;
    virtual std::uint64_t steps() const = 0;
    virtual Status status() const = 0;
    virtual std::size_t saved_size() const = 0;
    virtual void save(unsigned char* bytes) const = 0;
    // Returns true if the bytes are as they were saved; otherwise the state stays unchanged.
    virtual bool restore(const unsigned char* bytes, std::size_t count) = 0;
};

namespace detail {

// C: the type that represents the controller.
template <Controller C>
class Guarded final : public GuardedController {
    using T = typename C::Value;
    using State = typename Guard<C>::State;
    using Bytes = SavedErased<State, T>;

public:
    Guarded(std::unique_ptr<AnyController<T>> controller, const Common& common)
        : controller_(std::move(controller)),
          coefficients_(Guard<C>::prepare({.controller = controller_.get()}, common)) {
        clear(state_);
    }

    Vec2<double> step(const Motion<double>& measured) override {
        Guard<C>::step(state_, coefficients_, {rounded(measured.position), rounded(measured.velocity)});
        return {static_cast<double>(state_.force.x()), static_cast<double>(state_.force.y())};
    }
    void acted(const Vec2<double>& force) override { Guard<C>::acted(state_, coefficients_, rounded(force)); }
    std::vector<double> report() const override { return controller_->report_between_steps(); }
    std::uint64_t steps() const override { return controller_->steps(); }
    Status status() const override { return state_.status; }
    std::size_t saved_size() const override { return Bytes::size(*controller_); }
    void save(unsigned char* bytes) const override { Bytes::write(state_, *controller_, bytes); }
    bool restore(const unsigned char* bytes, std::size_t count) override {
        return Bytes::read(bytes, count, state_, *controller_,
                           [&](const State& state, std::uint64_t) { return Guard<C>::sound(state, coefficients_); });
    }

private:
    static Vec2<T> rounded(const Vec2<double>& a) { return {T(a.x()), T(a.y())}; }

    std::unique_ptr<AnyController<T>> controller_;
    typename Guard<C>::Coefficients coefficients_;
    State state_;
};

}  // namespace detail

template <Scalar T>
std::unique_ptr<GuardedController> make_guarded(std::unique_ptr<AnyController<T>> controller, const Common& common) {
    std::unique_ptr<GuardedController> made;
    const AnyController<T>& any = *controller;
    with_erased(any, common,
                [&]<class C>() { made = std::make_unique<detail::Guarded<C>>(std::move(controller), common); });
    return made;
}

}  // namespace fracgyro
