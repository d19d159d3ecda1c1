#include "arrays.hpp"
#include "bindings.hpp"

#include "fracgyro/controllers.hpp"
#include "fracgyro/guard.hpp"

#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/string_view.h>
#include <nanobind/stl/unique_ptr.h>

namespace fracgyro::bindings {

namespace {

// A controller of whichever kind and precision, one sample at a time.
class AnyController {
public:
    virtual ~AnyController() = default;
    virtual Vec2<double> step(const Motion<double>& motion) = 0;  // the force
    virtual Estimates<double> estimates() const = 0;
    virtual RateQuality<double> rate_quality() const = 0;
    virtual std::uint64_t steps() const = 0;
    virtual Status status() const = 0;
    virtual nb::bytes state() const = 0;
    virtual void restore(const nb::bytes& saved) = 0;
};

template <class T>
Estimates<double> in_double(const Estimates<T>& e) {
    const auto number = [](T a) { return static_cast<double>(a); };
    const auto sym2 = [&](const Sym2<T>& a) { return Sym2<double>{number(a.xx), number(a.xy), number(a.yy)}; };
    return {.damping = sym2(e.damping),
            .stiffness = sym2(e.stiffness),
            .rate = number(e.rate),
            .rate_symmetric = sym2(e.rate_symmetric),
            .bound = {number(e.bound[0]), number(e.bound[1]), number(e.bound[2])}};
}

template <class Controller>
class Holder final : public AnyController {
    using T = typename Controller::Value;
    using State = typename Controller::State;

public:
    explicit Holder(const ControllerParams& p) : held_(new Held{.coefficients = Controller::prepare(p)}) {}

    Vec2<double> step(const Motion<double>& motion) override {
        const auto number = [](const Vec2<double>& a) { return Vec2<T>{T(a.x), T(a.y)}; };
        const Vec2<T> force =
            Controller::step(held_->state, held_->coefficients,
                             {.position = number(motion.position), .velocity = number(motion.velocity)})
                .force;
        return {static_cast<double>(force.x), static_cast<double>(force.y)};
    }
    Estimates<double> estimates() const override {
        return in_double(Controller::estimates(held_->state, held_->coefficients));
    }
    RateQuality<double> rate_quality() const override {
        const RateQuality<T> quality = Controller::rate_quality(held_->state, held_->coefficients);
        return {.deviation = static_cast<double>(quality.deviation), .trusted = static_cast<double>(quality.trusted)};
    }
    std::uint64_t steps() const override { return Controller::steps(held_->state); }
    Status status() const override { return held_->state.status; }
    nb::bytes state() const override {
        std::array<unsigned char, Saved<State>::size> bytes{};
        Saved<State>::write(held_->state, bytes.data());
        return nb::bytes(bytes.data(), bytes.size());
    }
    void restore(const nb::bytes& saved) override {
        State read;
        const auto* bytes = static_cast<const unsigned char*>(saved.data());
        if (!Saved<State>::read(bytes, saved.size(), read) || !Controller::sound(read, held_->coefficients)) {
            throw nb::value_error("state is damaged: it is not as it was saved");
        }
        held_->state = read;
    }

private:
    struct Held {
        typename Controller::Coefficients coefficients;
        State state{};
    };
    // Apart: its alignment is that of wide registers, and Python frees a controller as one of any kind.
    std::unique_ptr<Held> held_;
};

std::unique_ptr<AnyController> make_controller(const std::string& kind, const ControllerParams& p, bool single) {
    std::unique_ptr<AnyController> made;
    const auto make = [&]<class Controller>() { made = std::make_unique<Holder<Guard<Controller>>>(p); };
    if (!(single ? with_controller<float>(kind, p, make) : with_controller<double>(kind, p, make))) {
        throw nb::value_error("there is no controller of that kind");
    }
    return made;
}

}  // namespace

void bind_controller(nb::module_& m) {
    auto reference = nb::class_<ReferenceParams>(m, "ReferenceParams").def(nb::init<>());
    def_vec2(reference, "amplitude", &ReferenceParams::amplitude);
    def_vec2(reference, "frequency", &ReferenceParams::frequency);
    def_vec2(reference, "phase", &ReferenceParams::phase);

    auto surface = nb::class_<SurfaceParams>(m, "SurfaceParams")
                       .def(nb::init<>())
                       .def_rw("terminal_exponent", &SurfaceParams::terminal_exponent)
                       .def_rw("singularity_floor", &SurfaceParams::singularity_floor)
                       .def_rw("riemann_liouville", &SurfaceParams::riemann_liouville)
                       .def_rw("modes", &SurfaceParams::modes);
    def_vec2(surface, "fractional_gain", &SurfaceParams::fractional_gain);
    def_vec2(surface, "terminal_gain", &SurfaceParams::terminal_gain);

    nb::enum_<Layer>(m, "Layer").value("linear", Layer::linear).value("quadratic", Layer::quadratic);
    nb::class_<ControlParams>(m, "ControlParams")
        .def(nb::init<>())
        .def_rw("layer_thickness", &ControlParams::layer_thickness)
        .def_rw("layer", &ControlParams::layer)
        .def_rw("force_limit", &ControlParams::force_limit)
        .def_rw("switching_limit", &ControlParams::switching_limit);

    auto estimates = nb::class_<Estimates<double>>(m, "Estimates")
                         .def(nb::init<>())
                         .def_rw("rate", &Estimates<double>::rate)
                         .def_rw("bound", &Estimates<double>::bound);
    def_sym2(estimates, "damping", &Estimates<double>::damping);
    def_sym2(estimates, "stiffness", &Estimates<double>::stiffness);
    def_sym2(estimates, "rate_symmetric", &Estimates<double>::rate_symmetric);

    nb::class_<AdaptationParams>(m, "AdaptationParams")
        .def(nb::init<>())
        .def_rw("adaptive", &AdaptationParams::adaptive)
        .def_rw("printed_rate_law", &AdaptationParams::printed_rate_law)
        .def_rw("damping_gain", &AdaptationParams::damping_gain)
        .def_rw("stiffness_gain", &AdaptationParams::stiffness_gain)
        .def_rw("rate_gain", &AdaptationParams::rate_gain)
        .def_rw("bound_gain", &AdaptationParams::bound_gain)
        .def_rw("initial", &AdaptationParams::initial)
        .def_rw("leakage", &AdaptationParams::leakage)
        .def_rw("dead_zone", &AdaptationParams::dead_zone)
        .def_rw("projection", &AdaptationParams::projection)
        .def_rw("composite", &AdaptationParams::composite)
        .def_rw("forgetting", &AdaptationParams::forgetting)
        .def_rw("rate_forgetting", &AdaptationParams::rate_forgetting);

    nb::class_<GuardParams>(m, "GuardParams")
        .def(nb::init<>())
        .def_rw("checked", &GuardParams::checked)
        .def_rw("plant_tolerance", &GuardParams::plant_tolerance)
        .def_rw("force_tolerance", &GuardParams::force_tolerance)
        .def_rw("position_tolerance", &GuardParams::position_tolerance)
        .def_rw("velocity_tolerance", &GuardParams::velocity_tolerance)
        .def_rw("patience", &GuardParams::patience)
        .def_rw("saturation_patience", &GuardParams::saturation_patience);
    nb::enum_<Status>(m, "Status")
        .value("ok", Status::ok)
        .value("saturated", Status::saturated)
        .value("not_finite", Status::not_finite)
        .value("out_of_range", Status::out_of_range)
        .value("restarted", Status::restarted)
        .value("implausible", Status::implausible)
        .value("lost", Status::lost);

    nb::class_<ControllerParams>(m, "ControllerParams")
        .def(nb::init<>())
        .def_rw("step", &ControllerParams::step)
        .def_rw("reference", &ControllerParams::reference)
        .def_rw("surface", &ControllerParams::surface)
        .def_rw("control", &ControllerParams::control)
        .def_rw("adaptation", &ControllerParams::adaptation)
        .def_rw("guard", &ControllerParams::guard)
        .def_rw("observer_bandwidth", &ControllerParams::observer_bandwidth);

    nb::class_<AnyController>(m, "Controller")
        .def(nb::new_(&make_controller), nb::arg("kind"), nb::arg("params"), nb::arg("single"))
        .def(
            "step",
            [](AnyController& self, const Array2& position, const Array2& velocity) {
                return to_array(self.step({.position = to_vec2(position), .velocity = to_vec2(velocity)}));
            },
            nb::arg("position"), nb::arg("velocity"))
        .def_prop_ro("estimates", &AnyController::estimates)
        .def_prop_ro("rate_quality",
                     [](const AnyController& self) {
                         const RateQuality<double> quality = self.rate_quality();
                         return std::pair(quality.deviation, quality.trusted != 0.0);
                     })
        .def_prop_ro("steps", &AnyController::steps)
        .def_prop_ro("status", &AnyController::status)
        .def_prop_rw("state", &AnyController::state, &AnyController::restore);

    m.attr("controller_kinds") = nb::cast(controller_kinds);
}

}  // namespace fracgyro::bindings
