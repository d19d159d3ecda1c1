// Code of a user that computes a force from a sample, as a controller. The reference, the force limit and the observer
// are the same as for any other controller. Nothing here throws: the browser's module has no exceptions.
#pragma once

#include "fracgyro/plant/units.hpp"
#include "fracgyro/sim/any_controller.hpp"

#include <cmath>
#include <span>
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
class UserLaw : public AnyController<double> {
public:
    virtual Vec2<double> force(const UserInput& in) = 0;
    // Index of the angular rate in its report; -1: it reports none. Before the first sample only the controller may
    // know.
    virtual std::ptrdiff_t rate_place() const = 0;
    // Ends the run, after a force that is not finite.
    virtual void refused(double time, const Vec2<double>& given) const = 0;

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
            refused(time, given);
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
    Units units_{};
    Reference<double>::Coefficients reference_{};
    Reference<double>::State state_{};
    Saturation<double>::Coefficients saturation_{};
    double step_ = 0.0;
};

}  // namespace fracgyro
