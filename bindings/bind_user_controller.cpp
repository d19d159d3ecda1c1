#include "any_numbers.hpp"
#include "arrays.hpp"
#include "bindings.hpp"
#include "numbers.hpp"

#include "fracgyro/sim/user_controller.hpp"

#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <optional>

namespace fracgyro::bindings {

namespace {

// Input of a callable: its tuples are made only when they are requested.
struct SampleObject {
    PyObject_HEAD UserInput in;
};

const UserInput& input(PyObject* sample) { return reinterpret_cast<SampleObject*>(sample)->in; }

PyObject* get_time(PyObject* self, void*) { return PyFloat_FromDouble(input(self).time); }
template <Vec2<double> UserInput::* member>
PyObject* get_pair(PyObject* self, void*) {
    return new_pair(input(self).*member);
}
template <Vec2<double> UserInput::* measured, Vec2<double> UserInput::* wanted>
PyObject* get_difference(PyObject* self, void*) {
    return new_pair(input(self).*measured - input(self).*wanted);
}
PyObject* sample_text(PyObject* self) {
    const UserInput& in = input(self);
    std::array<char, 512> text{};
    std::snprintf(text.data(), text.size(),
                  "Sample(time=%.9g, position=(%.9g, %.9g), velocity=(%.9g, %.9g), reference=(%.9g, %.9g), "
                  "reference_velocity=(%.9g, %.9g), reference_acceleration=(%.9g, %.9g))",
                  in.time, in.position.x(), in.position.y(), in.velocity.x(), in.velocity.y(), in.reference.x(),
                  in.reference.y(), in.reference_velocity.x(), in.reference_velocity.y(), in.reference_acceleration.x(),
                  in.reference_acceleration.y());
    return PyUnicode_FromString(text.data());
}
void free_sample(PyObject* self) {
    PyTypeObject* const type = Py_TYPE(self);
    type->tp_free(self);
    Py_DECREF(type);
}

PyTypeObject* sample_type() {
    static PyGetSetDef members[] = {
        {"time", get_time, nullptr, "t", nullptr},
        {"position", get_pair<&UserInput::position>, nullptr, "q as measured, (x, y)", nullptr},
        {"velocity", get_pair<&UserInput::velocity>, nullptr, "v as measured or observed, (x, y)", nullptr},
        {"reference", get_pair<&UserInput::reference>, nullptr, "r, (x, y)", nullptr},
        {"reference_velocity", get_pair<&UserInput::reference_velocity>, nullptr, "dr/dt, (x, y)", nullptr},
        {"reference_acceleration", get_pair<&UserInput::reference_acceleration>, nullptr, "d2r/dt2, (x, y)", nullptr},
        {"error", get_difference<&UserInput::position, &UserInput::reference>, nullptr,
         "e = q - r, as measured, (x, y)", nullptr},
        {"error_rate", get_difference<&UserInput::velocity, &UserInput::reference_velocity>, nullptr,
         "v - dr/dt, as measured or observed, (x, y)", nullptr},
        {nullptr, nullptr, nullptr, nullptr, nullptr}};
    static PyType_Slot slots[] = {
        {Py_tp_doc,
         const_cast<char*>("What a controller is given at one sample: floats and pairs of floats, in SI units "
                           "if run.units is SI.\n\n"
                           ">>> times = []\n"
                           ">>> law = lambda sample: times.append(sample.time) or (0.0, 0.0)\n"
                           ">>> scenario = fg.Scenario.paper().replace({\"run.duration\": 0.002})\n"
                           ">>> run = fg.simulate(scenario, controller=law)\n"
                           ">>> times[:2]\n[0.0, 0.001]")},
        {Py_tp_getset, members},
        {Py_tp_repr, reinterpret_cast<void*>(&sample_text)},
        {Py_tp_dealloc, reinterpret_cast<void*>(&free_sample)},
        {0, nullptr}};
    static PyType_Spec spec{"fracgyro.Sample", sizeof(SampleObject), 0,
                            Py_TPFLAGS_DEFAULT | Py_TPFLAGS_DISALLOW_INSTANTIATION, slots};
    static auto* const type = reinterpret_cast<PyTypeObject*>(PyType_FromSpec(&spec));
    return type;
}

bool take_pair(PyObject* from, Vec2<double>& to) {
    std::array<double, 2> both{};
    const bool taken = take_any(from, both);
    to = {both[0], both[1]};
    return taken;
}

// A Python callable as a controller. Its caller holds the GIL.
class PythonController final : public UserController {
public:
    explicit PythonController(nb::object controller)
        : call_(std::move(controller)), report_(nb::getattr(call_, "report", nb::none())) {
        // A bound method is called faster than an object.
        if ((Py_TYPE(call_.ptr())->tp_flags & Py_TPFLAGS_HAVE_VECTORCALL) == 0) {
            call_ = call_.attr("__call__");
        }
    }

    Vec2<double> force(const UserInput& in) override {
        if (!sample_.is_valid() || Py_REFCNT(sample_.ptr()) > 1) {  // the user keeps the last one
            sample_ = nb::steal(PyType_GenericAlloc(sample_type(), 0));
            if (!sample_.is_valid()) {
                nb::raise_python_error();
            }
        }
        reinterpret_cast<SampleObject*>(sample_.ptr())->in = in;
        time_ = in.time;
        const nb::object returned = nb::steal(PyObject_CallOneArg(call_.ptr(), sample_.ptr()));
        Vec2<double> force;
        if (!returned.is_valid()) {
            fail();
        }
        if (!take_pair(returned.ptr(), force)) {
            refuse("the controller returned", returned, "two finite numbers");
        }
        return force;
    }

    std::span<const double> report() override {
        if (report_.is_none()) {
            return numbers_;
        }
        const nb::object found = nb::steal(PyObject_CallNoArgs(report_.ptr()));
        if (!found.is_valid()) {
            fail();
        }
        if (!PyDict_Check(found.ptr())) {
            refuse("report() of the controller returned", found, "a dict of names to numbers or pairs of numbers");
        }
        if (!named_) {
            name(found);
        }
        bool same = static_cast<std::size_t>(PyDict_GET_SIZE(found.ptr())) == names_.size();
        std::size_t at = 0;
        for (const auto& [name, width] : names_) {
            PyObject* const value = PyDict_GetItemWithError(found.ptr(), name.ptr());
            Vec2<double> pair;
            const bool one = value != nullptr && width == 1 && take_number(value, numbers_[at]);
            same = same && (one || (value != nullptr && width == 2 && take_pair(value, pair)));
            if (!same) {
                break;
            }
            if (width == 2) {
                numbers_[at] = pair.x();
                numbers_[at + 1] = pair.y();
            }
            at += width;
        }
        if (!same) {
            refuse("report() of the controller returned", found,
                   "the same names at every sample, of numbers or pairs of numbers as at the first");
        }
        return numbers_;
    }
    std::ptrdiff_t rate_place() const override { return rate_place_; }
    bool estimates_rate() const override { return !report_.is_none(); }
    bool runs_on_any_thread() const override { return false; }

    // The time at which it raised; None if it did not.
    std::optional<double> failed_at() const { return failed_ ? std::optional(time_) : std::nullopt; }
    nb::list names() const {
        nb::list all;
        for (const auto& [name, width] : names_) {
            all.append(nb::make_tuple(name, width));
        }
        return all;
    }

private:
    [[noreturn]] void fail() {
        failed_ = true;
        nb::raise_python_error();
    }
    [[noreturn]] void refuse(const char* what, const nb::object& returned, const char* wanted) {
        raise_refusal(what, returned, time_, wanted);
    }
    void name(const nb::object& found) {
        PyObject *key = nullptr, *value = nullptr;
        Py_ssize_t place = 0;
        while (PyDict_Next(found.ptr(), &place, &key, &value) != 0) {
            double number = 0.0;
            const std::size_t width = take_number(value, number) ? 1 : 2;
            if (!PyUnicode_Check(key)) {
                refuse("report() of the controller returned", found, "a dict of names to numbers or pairs of numbers");
            }
            if (width == 1 && PyUnicode_CompareWithASCIIString(key, "rate_estimate") == 0) {
                rate_place_ = static_cast<std::ptrdiff_t>(numbers_.size());
            }
            names_.emplace_back(nb::borrow(key), width);
            numbers_.resize(numbers_.size() + width);
        }
        named_ = true;
    }

    nb::object call_, report_, sample_;
    std::vector<std::pair<nb::object, std::size_t>> names_;
    std::vector<double> numbers_;
    std::ptrdiff_t rate_place_ = -1;
    double time_ = 0.0;
    bool named_ = false, failed_ = false;
};

}  // namespace

void bind_user_controller(nb::module_& m) {
    m.attr("Sample") = nb::borrow(reinterpret_cast<PyObject*>(sample_type()));
    nb::class_<Units>(m, "Units")
        .def(nb::init<>())
        .def_rw("time", &Units::time)
        .def_rw("length", &Units::length)
        .def_rw("velocity", &Units::velocity)
        .def_rw("acceleration", &Units::acceleration)
        .def_rw("force", &Units::force)
        .def_rw("rate", &Units::rate);
    nb::class_<UserController>(m, "UserController");
    nb::class_<PythonController, UserController>(m, "PythonController")
        .def(nb::init<nb::object>(), nb::arg("controller"))
        .def_prop_ro("failed_at",
                     [](const PythonController& of) -> nb::object {
                         const auto time = of.failed_at();
                         return time ? nb::object(nb::float_(*time)) : nb::none();
                     })
        .def_prop_ro("names", &PythonController::names);
    nb::class_<NativeController, UserController>(m, "NativeController")
        .def(
            "__init__",
            [](NativeController* made, std::uintptr_t address, std::size_t state_size,
               const std::vector<double>& parameters, std::size_t reports, std::ptrdiff_t rate_place) {
                new (made) NativeController(reinterpret_cast<UserFunction>(address), state_size, parameters, reports,
                                            rate_place);
            },
            nb::arg("address"), nb::arg("state_size"), nb::arg("parameters"), nb::arg("reports"), nb::arg("rate_place"))
        .def_prop_rw(
            "state",
            [](NativeController& of) {
                const auto state = of.memory();
                return std::vector<double>(state.begin(), state.end());
            },
            [](NativeController& of, const std::vector<double>& state) {
                if (state.size() != of.memory().size()) {
                    throw nb::value_error("state is damaged: it is not as it was saved");
                }
                std::ranges::copy(state, of.memory().begin());
            });
}

}  // namespace fracgyro::bindings
