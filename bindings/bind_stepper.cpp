#include "arrays.hpp"
#include "bindings.hpp"
#include "numbers.hpp"

#include "fracgyro/sim/law.hpp"
#include "fracgyro/sim/running_loop.hpp"

#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

namespace fracgyro::bindings {

namespace {

// What is measured, as Python has it: (time, position, velocity).
PyTypeObject* motion_type() {
    static PyStructSequence_Field fields[] = {{"time", "of the sample"},
                                              {"position", "as measured, (x, y)"},
                                              {"velocity", "as measured, (x, y); NaN where there is no sensor of it"},
                                              {nullptr, nullptr}};
    static PyStructSequence_Desc about{"fracgyro.Motion",
                                       "The motion that is measured at a sample, in the units of the run.\n\n"
                                       ">>> fg.Plant(fg.Scenario.paper()).motion.time\n0.0",
                                       fields, 3};
    static PyTypeObject* const type = PyStructSequence_NewType(&about);
    return type;
}

// The gyroscope and its device, one sample at a time.
class GyroscopeHolder {
public:
    GyroscopeHolder(const DeviceSetup& s, const Units& units)
        : coefficients_(DeviceGyroscope::prepare(s)),
          draw_(s),
          now_{.state = DeviceGyroscope::start(s)},
          units_(units),
          step_(s.common.step),
          senses_velocity_(!(s.common.observer_bandwidth > 0.0)) {
        sense();
    }

    nb::object motion() const {
        const auto pair = [](double unit, const Vec2<double>& a) { return new_pair(unit * a); };
        constexpr double nan = std::numeric_limits<double>::quiet_NaN();
        const Motion<double>& m = now_.state.measured;
        nb::object made = nb::steal(PyStructSequence_New(motion_type()));
        const std::array<PyObject*, 3> parts{
            PyFloat_FromDouble(time()), pair(units_.length, m.position),
            pair(units_.velocity, senses_velocity_ ? m.velocity : Vec2<double>{nan, nan})};
        for (std::size_t i = 0; i < parts.size(); ++i) {
            if (!made.is_valid() || parts[i] == nullptr) {
                nb::raise_python_error();
            }
            PyStructSequence_SetItem(made.ptr(), static_cast<Py_ssize_t>(i), parts[i]);
        }
        return made;
    }
    // None: the force is not two plain finite numbers, and nothing happened.
    nb::object step(nb::handle force) {
        Vec2<double> asked;
        if (!take(force.ptr(), asked)) {
            return nb::none();
        }
        if (!bounded(now_.state.motion)) {
            throw nb::value_error("the motion has diverged: the plant can go on no longer");
        }
        DeviceGyroscope::act(now_.state, coefficients_, {asked.x() / units_.force, asked.y() / units_.force}, now_.n);
        DeviceGyroscope::step(now_.state, coefficients_, now_.n);
        ++now_.n;
        sense();
        return motion();
    }

    nb::bytes state() const {
        std::vector<unsigned char> bytes(Saved<Now>::size);
        Saved<Now>::write(now_, bytes.data());
        return nb::bytes(bytes.data(), bytes.size());
    }
    void restore(const nb::bytes& saved) {
        const auto read = std::make_unique<Now>();
        if (!Saved<Now>::read(static_cast<const unsigned char*>(saved.data()), saved.size(), *read) || read->n < 0) {
            throw nb::value_error("state is damaged: it is not as it was saved");
        }
        now_ = *read;
    }

private:
    struct Now {
        DeviceGyroscope::State state{};
        std::int64_t n = 0;  // the sample
    };

    double time() const { return static_cast<double>(now_.n) * step_ * units_.time; }
    void sense() { DeviceGyroscope::sense(now_.state, coefficients_, draw_(now_.n)); }

    DeviceGyroscope::Coefficients coefficients_;
    DeviceGyroscope::Draw draw_;
    Now now_;
    Units units_;
    double step_;
    bool senses_velocity_;
};

// A closed loop of any controller that is run in parts.
class AnyLoop {
public:
    virtual ~AnyLoop() = default;
    // Rows of the next samples, fewer where the motion diverges.
    virtual nb::object run(std::int64_t samples, bool device) = 0;
    virtual std::int64_t step() const = 0;
    virtual nb::bytes state() const = 0;
    virtual void restore(const nb::bytes& saved) = 0;
    // Other numbers from the next sample on. Whether they can be: the controller is the same, with the same memory.
    virtual bool set(const DeviceSetup& setup) = 0;
};

template <class C, class Setup>
class HeldLoop final : public AnyLoop {
    using Loop = RunningLoop<C, Setup>;

public:
    explicit HeldLoop(const Setup& s) : loop_(new Loop(s)) {}

    nb::object run(std::int64_t samples, bool device) override {
        using Report = typename C::Report;
        Rows rows;
        std::size_t width = 0;
        loop_->run(samples, [&](const DeviceSnapshot<Report>& at) {
            std::array<double, row_width<Report>> row;
            write_row<double, Report>(at, row.data());
            rows.insert(rows.end(), row.begin(), row.end());
            if constexpr (of_law) {
                const auto& reported = loop_->setup().controller.law->report();
                rows.insert(rows.end(), reported.begin(), reported.end());
            }
            if (device) {
                const auto more = device_row(at);
                rows.insert(rows.end(), more.begin(), more.end());
            }
            if (width == 0) {
                width = rows.size();
                rows.reserve(width * static_cast<std::size_t>(samples));
            }
        });
        if constexpr (of_law) {
            loop_->setup().controller.law->check();
        }
        const std::size_t count = width == 0 ? 0 : rows.size() / width;
        return nb::cast(owned_rows<2>(std::move(rows), {count, width}));
    }
    std::int64_t step() const override { return loop_->step(); }
    nb::bytes state() const override {
        std::vector<unsigned char> bytes(Loop::saved_size);
        loop_->save(bytes.data());
        return nb::bytes(bytes.data(), bytes.size());
    }
    void restore(const nb::bytes& saved) override {
        if (!loop_->restore(static_cast<const unsigned char*>(saved.data()), saved.size())) {
            throw nb::value_error("state is damaged: it is not as it was saved");
        }
    }
    bool set(const DeviceSetup& other) override {
        if constexpr (of_law) {
            const LawParams& own = loop_->setup().controller;
            return loop_->set(outside_setup(other, own.law, own.units));
        } else {
            return loop_->set(other);
        }
    }

private:
    static constexpr bool of_law = std::is_same_v<typename C::Params, LawParams>;

    // Apart: its alignment is that of wide registers, and Python frees a loop as one of any controller.
    std::unique_ptr<Loop> loop_;
};

std::unique_ptr<AnyLoop> make_loop(const DeviceSetup& s) {
    std::unique_ptr<AnyLoop> made;
    with_controller<double>(s.controller, s.common.observer_bandwidth > 0.0,
                            [&]<class C>() { made = std::make_unique<HeldLoop<C, DeviceSetup>>(s); });
    return made;
}
std::unique_ptr<AnyLoop> make_law_loop(const DeviceSetup& s, Law* law, const Units& units) {
    std::unique_ptr<AnyLoop> made;
    const OutsideSetup setup = outside_setup(s, law, units);
    with_law<NothingReported>(setup, [&]<class C>() { made = std::make_unique<HeldLoop<C, OutsideSetup>>(setup); });
    return made;
}

}  // namespace

void bind_stepper(nb::module_& m) {
    m.attr("Motion") = nb::borrow(reinterpret_cast<PyObject*>(motion_type()));
    nb::class_<GyroscopeHolder>(m, "Gyroscope")
        .def(nb::init<const DeviceSetup&, const Units&>(), nb::arg("setup"), nb::arg("units"))
        .def_prop_ro("motion", &GyroscopeHolder::motion)
        .def("step", &GyroscopeHolder::step, nb::arg("force").none())
        .def_prop_rw("state", &GyroscopeHolder::state, &GyroscopeHolder::restore);
    nb::class_<AnyLoop>(m, "Loop")
        .def(nb::new_(&make_loop), nb::arg("setup"))
        .def("run", &AnyLoop::run, nb::arg("samples"), nb::arg("device"))
        .def("set", &AnyLoop::set, nb::arg("setup"))
        .def_prop_ro("steps", &AnyLoop::step)
        .def_prop_rw("state", &AnyLoop::state, &AnyLoop::restore);
    m.def("law_loop", &make_law_loop, nb::arg("setup"), nb::arg("law"), nb::arg("units"), nb::keep_alive<0, 2>());
}

}  // namespace fracgyro::bindings
