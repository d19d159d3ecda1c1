#include "arrays.hpp"
#include "bindings.hpp"
#include "controllers.hpp"
#include "numbers.hpp"
#include "run_setup.hpp"

#include "fracgyro/sim/running_loop.hpp"

#include <nanobind/stl/vector.h>

namespace fracgyro::bindings {

namespace {

// The measured motion in Python: (time, position, velocity).
PyTypeObject* motion_type() {
    static PyStructSequence_Field fields[] = {{"time", "of the sample"},
                                              {"position", "as measured, (x, y)"},
                                              {"velocity", "as measured, (x, y); NaN without a velocity sensor"},
                                              {nullptr, nullptr}};
    static PyStructSequence_Desc about{"fracgyro.Motion",
                                       "The motion that is measured at a sample, in the units of the run.\n\n"
                                       ">>> fg.Plant(fg.Scenario.paper()).motion.time\n0.0",
                                       fields, 3};
    static PyTypeObject* const type = PyStructSequence_NewType(&about);
    return type;
}

// The gyroscope or another plant, and its device, one sample at a time.
class GyroscopeHolder {
public:
    GyroscopeHolder(const RunSetup& s, const Units& units)
        : owner_(s.owner),
          coefficients_(DevicePlant::prepare(s)),
          draw_(s),
          now_{.state = DevicePlant::start(s)},
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
    // None: the force is not two plain finite numbers, and nothing changes.
    nb::object step(nb::handle force) {
        Vec2<double> asked;
        if (!take(force.ptr(), asked)) {
            return nb::none();
        }
        if (!bounded(now_.state.motion)) {
            throw nb::value_error("the motion has diverged: the plant cannot continue");
        }
        DevicePlant::act(now_.state, coefficients_, {asked.x() / units_.force, asked.y() / units_.force}, now_.n);
        DevicePlant::step(now_.state, coefficients_, now_.n);
        if (owner_ != nullptr) {
            owner_->check();
        }
        ++now_.n;
        sense();
        return motion();
    }

    // The force to which drivers rounded the last one, None without converters.
    nb::object rounded() const {
        const Vec2<double>* const code = DevicePlant::code(now_.state, coefficients_);
        return code == nullptr ? nb::none() : nb::steal(new_pair(units_.force * *code));
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
        DevicePlant::State state{};
        std::int64_t n = 0;  // the sample
    };

    double time() const { return static_cast<double>(now_.n) * step_ * units_.time; }
    void sense() { DevicePlant::sense(now_.state, coefficients_, draw_(now_.n)); }

    std::shared_ptr<AnyPlant> owner_;
    DevicePlant::Coefficients coefficients_;
    DeviceGyroscope::Draw draw_;
    Now now_;
    Units units_;
    double step_;
    bool senses_velocity_;
};

// A closed loop run in parts, with its controller or a user's.
class LoopHolder {
public:
    explicit LoopHolder(const RunSetup& s) : owner_(s.owner), own_(make_double(s)), loop_(new RunningLoop(s, *own_)) {}
    LoopHolder(const RunSetup& s, UserController* user, const Units& units) : owner_(s.owner), user_(user) {
        user->begin(units, s.common);
        own_ = filtered_user(*user, s.common);
        loop_ = std::make_unique<RunningLoop>(s, own_ != nullptr ? *own_ : *user, false);
    }

    // Rows of the next samples, fewer if the motion diverges.
    nb::object run(std::int64_t samples, std::size_t device) {
        Rows rows;
        std::size_t width = 0, count = 0;
        loop_->run(samples, [&](const auto& at) {
            write_any_row(at, loop_->controller(), device, [&](std::size_t of_row) {
                width = of_row;
                if (count == 0) {
                    rows.resize(width * static_cast<std::size_t>(samples));
                }
                return rows.data() + width * count++;
            });
        });
        if (user_ != nullptr) {
            user_->check();
        }
        if (owner_ != nullptr) {
            owner_->check();
        }
        rows.resize(width * count);
        return nb::cast(owned_rows<2>(std::move(rows), {count, width}));
    }
    std::int64_t step() const { return loop_->step(); }
    nb::bytes state() const {
        std::vector<unsigned char> bytes(loop_->saved_size());
        loop_->save(bytes.data());
        return nb::bytes(bytes.data(), bytes.size());
    }
    void restore(const nb::bytes& saved) {
        if (!loop_->restore(static_cast<const unsigned char*>(saved.data()), saved.size())) {
            throw nb::value_error("state is damaged: it is not as it was saved");
        }
    }
    // Sets other numbers from the next sample on. True if possible: the controller is the same, with the same memory.
    bool set(const RunSetup& other) {
        const bool can = loop_->set(other);
        if (can) {
            owner_ = other.owner;
        }
        return can;
    }

private:
    std::shared_ptr<AnyPlant> owner_;
    std::unique_ptr<AnyController<double>> own_;
    UserController* user_ = nullptr;
    std::unique_ptr<RunningLoop> loop_;
};

}  // namespace

void bind_stepper(nb::module_& m) {
    m.attr("Motion") = nb::borrow(reinterpret_cast<PyObject*>(motion_type()));
    nb::class_<GyroscopeHolder>(m, "Gyroscope")
        .def(nb::init<const RunSetup&, const Units&>(), nb::arg("setup"), nb::arg("units"))
        .def_prop_ro("motion", &GyroscopeHolder::motion)
        .def("step", &GyroscopeHolder::step, nb::arg("force").none())
        .def_prop_ro("rounded", &GyroscopeHolder::rounded)
        .def_prop_rw("state", &GyroscopeHolder::state, &GyroscopeHolder::restore);
    nb::class_<LoopHolder>(m, "Loop")
        .def(nb::init<const RunSetup&>(), nb::arg("setup"))
        .def(nb::init<const RunSetup&, UserController*, const Units&>(), nb::arg("setup"), nb::arg("user"),
             nb::arg("units"), nb::keep_alive<1, 3>())
        .def("run", &LoopHolder::run, nb::arg("samples"), nb::arg("device"))
        .def("set", &LoopHolder::set, nb::arg("setup"))
        .def_prop_ro("steps", &LoopHolder::step)
        .def_prop_rw("state", &LoopHolder::state, &LoopHolder::restore);
}

}  // namespace fracgyro::bindings
