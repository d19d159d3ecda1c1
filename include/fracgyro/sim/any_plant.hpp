// A plant of any type, behind one table of functions, in place of the gyroscope of a loop, on an ideal or a real
// device. The gyroscope itself needs none: it runs in the loops of stepper.hpp and device_loop.hpp.
#pragma once

#include "fracgyro/core/saved.hpp"
#include "fracgyro/plant/plant.hpp"
#include "fracgyro/plant/plants.hpp"
#include "fracgyro/sim/settings.hpp"

#include <memory>

namespace fracgyro {

// The state of a plant, in its own form; the rest is 0.
using PlantState = std::array<double, 8>;

// One step of a plant.
struct PlantStep {
    Vec2<double> control{}, disturbance{};
    RateCourse rate{};
    std::int64_t sample = 0;  // at its beginning
};

class AnyPlant {
public:
    virtual ~AnyPlant() = default;
    virtual PlantState start() = 0;
    virtual Motion<double> motion(const PlantState& state) = 0;
    // Advances the state by one step, with its motion. Both are changed in place: a copy of a motion would wait for the
    // stores of its halves.
    virtual void step(PlantState& state, Motion<double>& motion, const PlantStep& step) = 0;
    virtual bool runs_on_any_thread() const { return true; }
    // Throws if the plant wrote beyond its arrays in the finished run.
    virtual void check() const {}
};

// A plant of one type. It keeps no state, so runs may share it.
template <Plant P>
class PlantOf final : public AnyPlant {
    using State = typename P::State;

public:
    PlantOf(const typename P::Params& params, double step) : params_(params), coefficients_(P::prepare(params, step)) {}

    PlantState start() override { return kept(P::start(params_)); }
    Motion<double> motion(const PlantState& state) override { return P::motion(own(state)); }
    void step(PlantState& state, Motion<double>& motion, const PlantStep& s) override {
        State now = own(state);
        if constexpr (TakesRate<P>) {
            P::step(now, coefficients_, s.control, s.disturbance, s.rate);
        } else {
            P::step(now, coefficients_, s.control, s.disturbance);
        }
        copy_bytes(state.data(), &now, sizeof now);
        motion = P::motion(now);
    }

private:
    static State own(const PlantState& state) {
        State read{};
        copy_bytes(&read, state.data(), sizeof read);
        return read;
    }
    static PlantState kept(const State& state) {
        PlantState written{};
        copy_bytes(written.data(), &state, sizeof state);
        return written;
    }

    typename P::Params params_;
    typename P::Coefficients coefficients_;
};

// Calls visit(table, field, part, number) for each number of the parameters that plants of this kind have of their own.
template <class Visit>
void for_each_own_number(std::size_t kind, Visit&& visit) {
    for_each_plant([&]<class Entry>(std::size_t place) {
        using Params = typename Entry::Type::Params;
        if constexpr (has_own_fields<Params>) {
            if (place == kind) {
                Params params{};
                for_each_setting_of("plant", params, visit);
            }
        }
    });
}
inline std::size_t own_number_count(std::size_t kind) {
    std::size_t count = 0;
    for_each_own_number(kind, [&](std::string_view, const auto&, std::string_view, const auto&) { ++count; });
    return count;
}

// The plant of this kind, an index into the registry, with its own parameters from `values`, in the order of its
// fields(); nullptr for the gyroscope.
inline std::shared_ptr<AnyPlant> make_plant(std::size_t kind, const GyroscopeParams& linear, double step,
                                            std::span<const double> values) {
    std::shared_ptr<AnyPlant> made;
    for_each_plant([&]<class Entry>(std::size_t place) {
        using P = typename Entry::Type;
        if constexpr (has_own_fields<typename P::Params>) {
            if (place == kind) {
                typename P::Params params{};
                const double* next = values.data();
                for_each_setting_of("plant", params, detail::TakeFrom{next});
                if constexpr (requires { params.linear; }) {
                    params.linear = linear;
                }
                made = std::make_shared<PlantOf<P>>(params, step);
            }
        }
    });
    return made;
}

// One run with any plant: nullptr is the gyroscope.
template <class Params>
struct PlantSetupOf : DeviceSetupOf<Params> {
    AnyPlant* model = nullptr;
};
using PlantSetup = PlantSetupOf<ControllerParams>;

// 6  A loop's gyroscope with the interface of IdealGyroscope (stepper.hpp) but any plant, on the device of `Base`:
// IdealGyroscope or DeviceGyroscope.
template <class Base>
struct WithPlant : Base {
    struct Coefficients : Base::Coefficients {
        AnyPlant* model = nullptr;
        double mean = 0.0;  // Ωz
    };
    struct State : Base::State {
        PlantState plant{};
    };

    template <class Params>
    static Coefficients prepare(const PlantSetupOf<Params>& s) {
        Coefficients c;
        static_cast<typename Base::Coefficients&>(c) = Base::prepare(s);
        c.model = s.model;
        c.mean = s.plant.rate;
        return c;
    }
    template <class Params>
    static State start(const PlantSetupOf<Params>& s) {
        State state{{Base::start(s)}};
        if (s.model != nullptr) {
            state.plant = s.model->start();
            state.motion = s.model->motion(state.plant);
        }
        return state;
    }
    template <class Report>
    static void step(State& state, const Coefficients& c, const Signals<double, Report>& signals, std::int64_t n) {
        if constexpr (on_device) {
            step(state, c, n);
        } else if (c.model == nullptr) {
            Base::step(state, c, signals, n);
        } else {
            move(state, c, {signals.force, state.disturbance, {c.mean, c.mean, c.mean}, n});
        }
    }
    // Advances by one step under the acting force of a real device.
    static void step(State& state, const Coefficients& c, std::int64_t n)
        requires requires { state.applied; }
    {
        if (c.model == nullptr) {
            Base::step(state, c, n);
            return;
        }
        PlantStep step{state.applied, state.disturbance, {c.mean, c.mean, c.mean}, n};
        if (c.varies) {
            for (int halves = 0; halves < 3; ++halves) {
                step.rate[static_cast<std::size_t>(halves)] = c.rate.within(n, halves) + state.device.bias;
            }
        }
        move(state, c, step);
    }

private:
    static constexpr bool on_device = requires(State& state) { state.applied; };

    static void move(State& state, const Coefficients& c, const PlantStep& step) {
        c.model->step(state.plant, state.motion, step);
    }
};
using DevicePlant = WithPlant<DeviceGyroscope>;

}  // namespace fracgyro
