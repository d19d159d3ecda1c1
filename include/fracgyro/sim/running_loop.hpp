// A closed loop that is run in parts, tuned while it runs, saved and restored: what a program or a page holds on to.
#pragma once

#include "fracgyro/core/saved.hpp"
#include "fracgyro/sim/device_loop.hpp"

#include <memory>

namespace fracgyro {

// Whether a loop with one can go on with the other: the same type, with the same memory.
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
// Parameters of a controller that is not in the registry are of one type.
template <class Params>
bool same_controller(const Params&, const Params&) {
    return true;
}

// What surrounds the controller of a loop. Apart from its type, so that one copy of this code serves all.
template <class Setup>
struct Surroundings {
    Setup setup{};
    DeviceGyroscope::Draw draw;

    explicit Surroundings(const Setup& s) : draw(s) {}
    [[gnu::noinline]] void set(const Setup& other, DeviceGyroscope::Coefficients& gyroscope) {
        setup = other;
        draw = DeviceGyroscope::Draw(setup);
        gyroscope = DeviceGyroscope::prepare(setup);
    }
};

template <class C, class Setup>
class RunningLoop {
    using Loop = Stepper<C, DeviceGyroscope>;
    using Pending = typename Loop::Pending;

public:
    using Report = typename C::Report;
    static constexpr std::size_t saved_size = Saved<Pending>::size;

    explicit RunningLoop(const Setup& setup) : around_(setup), state_(Loop::begin(setup)) { take(setup); }

    const Setup& setup() const { return around_.setup; }
    std::int64_t step() const { return state_.step; }  // the coming sample

    // The coming samples, fewer where the motion diverges. Calls observe(DeviceSnapshot) at each.
    template <class Observe>
    void run(std::int64_t samples, Observe&& observe) {
        Loop::run(state_, coefficients_, state_.step + samples, around_.draw, observe);
    }
    // Other numbers from the coming sample on; what was learnt stays. Returns whether that is possible.
    bool set(const Setup& other) {
        const bool can = same_controller(setup().controller, other.controller);
        if (can) {
            take(other);
        }
        return can;
    }
    // An impulse on the mass, just before the coming sample: what it adds to the velocity.
    void kick(const Vec2<double>& velocity) { state_.motion.velocity = state_.motion.velocity + velocity; }

    void save(unsigned char* bytes) const { Saved<Pending>::write(state_, bytes); }
    // Returns whether they are those of a loop with these coefficients; if not, this one stays as it is.
    bool restore(const unsigned char* bytes, std::size_t count) {
        const auto read = std::make_unique<Pending>();
        if (!Saved<Pending>::read(bytes, count, *read) || read->step < 0 ||
            !C::sound(read->controller, coefficients_.controller) ||
            C::steps(read->controller) != static_cast<std::uint64_t>(read->step)) {
            return false;
        }
        state_ = *read;
        return true;
    }

private:
    void take(const Setup& setup) {
        around_.set(setup, coefficients_.gyroscope);
        coefficients_.controller = prepare<C>(setup.controller, setup.common);
    }

    Surroundings<Setup> around_;
    typename Loop::Coefficients coefficients_{};
    Pending state_;
};

}  // namespace fracgyro
