#include "any_numbers.hpp"
#include "bindings.hpp"
#include "run_setup.hpp"

#include "fracgyro/sim/user_plant.hpp"

#include <nanobind/stl/array.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/vector.h>

#include <optional>

namespace fracgyro::bindings {

namespace {

// A tuple of floats.
nb::object new_tuple(std::span<const double> numbers) {
    nb::object made = nb::steal(PyTuple_New(static_cast<Py_ssize_t>(numbers.size())));
    for (std::size_t i = 0; made.is_valid() && i < numbers.size(); ++i) {
        PyObject* const number = PyFloat_FromDouble(numbers[i]);
        if (number == nullptr) {
            nb::raise_python_error();
        }
        PyTuple_SET_ITEM(made.ptr(), static_cast<Py_ssize_t>(i), number);
    }
    if (!made.is_valid()) {
        nb::raise_python_error();
    }
    return made;
}

// A Python callable as a plant. Its caller holds the GIL.
class PythonPlant final : public UserPlant {
public:
    // `motion`: None if the states are x, y, vx, vy. `initial`: empty if the run begins with its own motion.
    PythonPlant(nb::object derivative, nb::object motion, std::size_t states, const std::vector<double>& initial,
                bool takes_rate)
        : call_(std::move(derivative)),
          motion_(std::move(motion)),
          count_(states),
          given_(!initial.empty()),
          takes_rate_(takes_rate) {
        std::copy_n(initial.begin(), std::min(initial.size(), first_.size()), first_.begin());
        // A bound method is called faster than an object.
        if ((Py_TYPE(call_.ptr())->tp_flags & Py_TPFLAGS_HAVE_VECTORCALL) == 0) {
            call_ = call_.attr("__call__");
        }
    }

    std::size_t count() const override { return count_; }
    bool runs_on_any_thread() const override { return false; }
    void begin(const Units& units, const Setup& setup) override {
        UserPlant::begin(units, setup);
        if (!given_) {
            const Vec2<double> q = units.length * setup.plant.initial_position;
            const Vec2<double> v = units.velocity * setup.plant.initial_velocity;
            first_ = {q.x(), q.y(), v.x(), v.y()};
        }
    }
    PlantState start() override { return first_; }
    // The time at which it raised; None if it did not.
    std::optional<double> failed_at() const { return failed_ ? std::optional(time_) : std::nullopt; }

protected:
    PlantState derivative(const PlantInput& in, const PlantState& state) override {
        time_ = in.time;
        const nb::object time = nb::float_(in.time), rate = takes_rate_ ? nb::object(nb::float_(in.rate)) : nb::none();
        const nb::object now = new_tuple({state.data(), count_});
        if (!force_.is_valid() || !(in.force == of_force_)) {
            force_ = nb::steal(new_pair(in.force));
            of_force_ = in.force;
        }
        const std::array<PyObject*, 4> given{time.ptr(), now.ptr(), force_.ptr(), rate.ptr()};
        const nb::object returned =
            nb::steal(PyObject_Vectorcall(call_.ptr(), given.data(), takes_rate_ ? 4 : 3, nullptr));
        PlantState rates{};
        take(returned, {rates.data(), count_}, "the plant returned");
        return rates;
    }
    Motion<double> own_motion(const PlantState& state) override {
        std::array<double, 4> moving{state[0], state[1], state[2], state[3]};
        if (!motion_.is_none()) {
            const nb::object now = new_tuple({state.data(), count_});
            const nb::object returned = nb::steal(PyObject_CallOneArg(motion_.ptr(), now.ptr()));
            take(returned, moving, "motion(state) of the plant returned");
            const auto finite = [](double number) { return std::isfinite(number); };
            if (std::ranges::all_of(state, finite) && !std::ranges::all_of(moving, finite)) {
                raise_refusal("motion(state) of the plant returned", returned, time_, "4 finite numbers, x, y, vx, vy");
            }
        }
        return {.position = {moving[0], moving[1]}, .velocity = {moving[2], moving[3]}};
    }

private:
    void take(const nb::object& returned, std::span<double> to, const char* what) {
        if (!returned.is_valid()) {
            failed_ = true;
            nb::raise_python_error();
        }
        if (!take_any(returned.ptr(), to)) {
            raise_refusal(what, returned, time_, (std::to_string(to.size()) + " finite numbers").c_str());
        }
    }

    nb::object call_, motion_, force_;
    Vec2<double> of_force_{};
    PlantState first_{};
    std::size_t count_;
    bool given_, takes_rate_, failed_ = false;
    double time_ = 0.0;
};

}  // namespace

void bind_user_plant(nb::module_& m) {
    nb::list kinds, meanings, takes_rate;
    for_each_plant([&]<class Entry>(std::size_t) {
        kinds.append(nb::str(Entry::kind.data(), Entry::kind.size()));
        meanings.append(nb::str(Entry::meaning.data(), Entry::meaning.size()));
        takes_rate.append(has_own_fields<typename Entry::Type::Params> ? TakesRate<typename Entry::Type> : true);
    });
    m.attr("plant_kinds") = kinds;
    m.attr("plant_meanings") = meanings;
    m.attr("plant_takes_rate") = takes_rate;
    nb::class_<UserPlant>(m, "UserPlant");
    nb::class_<PythonPlant, UserPlant>(m, "PythonPlant")
        .def(nb::init<nb::object, nb::object, std::size_t, const std::vector<double>&, bool>(), nb::arg("derivative"),
             nb::arg("motion").none(), nb::arg("states"), nb::arg("initial"), nb::arg("takes_rate"))
        .def_prop_ro("failed_at", [](const PythonPlant& of) -> nb::object {
            const auto time = of.failed_at();
            return time ? nb::object(nb::float_(*time)) : nb::none();
        });
    nb::class_<NativePlant, UserPlant>(m, "NativePlant")
        .def(
            "__init__",
            [](NativePlant* made, std::uintptr_t address, bool steps, const std::vector<double>& parameters,
               std::size_t states, const NativePlant::Places& places, const std::vector<double>& initial) {
                using Computes = NativePlant::Computes;
                new (made)
                    NativePlant(reinterpret_cast<PlantFunction>(address), steps ? Computes::step : Computes::derivative,
                                parameters, states, places, initial);
            },
            nb::arg("address"), nb::arg("steps"), nb::arg("parameters"), nb::arg("states"), nb::arg("places"),
            nb::arg("initial"));
}

}  // namespace fracgyro::bindings
