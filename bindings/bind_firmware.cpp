#include "alone.hpp"
#include "bindings.hpp"
#include "fields.hpp"

#include "fracgyro/controllers.hpp"
#include "fracgyro/guard.hpp"

#include <nanobind/stl/string.h>

namespace fracgyro::bindings {

namespace {

// A controller with room for so many modes.
template <std::size_t Capacity>
struct Sized {
    template <Scalar T>
    using SurfaceType = Surface<T, FractionalTerm<T, Capacity>, true>;
    template <Scalar T>
    using ControllerType = SlidingModeController<T, SurfaceType>;
};

template <class Controller>
std::size_t guarded_size(bool observing) {
    return observing ? sizeof(typename Guard<Observing<Controller>>::State) : sizeof(typename Guard<Controller>::State);
}

// Of the state here; processors with shorter integers need no more. 0 for a capacity that is none.
template <Scalar T>
std::size_t state_size(std::size_t capacity, bool composite, bool observing) {
    const auto size = [&]<std::size_t Capacity>() {
        using Controller = typename Sized<Capacity>::template ControllerType<T>;
        return composite ? guarded_size<Composite<Controller>>(observing) : guarded_size<Controller>(observing);
    };
    return [&]<std::size_t... I>(std::index_sequence<I...>) {
        return ((2 * (I + 1) == capacity ? size.template operator()<2 * (I + 1)>() : 0) + ...);
    }(std::make_index_sequence<Modes::capacity / 2>());
}

template <Scalar T>
nb::object coefficients(const std::string& kind, const ControllerParams& p) {
    nb::object nested;
    with_controller<T>(kind, p, [&]<class Controller>() { nested = nested_fields(Guard<Controller>::prepare(p)); });
    return nested;
}

}  // namespace

void bind_firmware(nb::module_& m) {
    m.def(
        "coefficients",
        [](const std::string& kind, const ControllerParams& p, bool single) {
            return single ? coefficients<Alone<float>>(kind, p) : coefficients<Alone<double>>(kind, p);
        },
        nb::arg("kind"), nb::arg("params"), nb::arg("single"),
        "The coefficients, nested as the structs are: a tuple for each struct, a list for each array.");
    m.def(
        "state_size",
        [](std::size_t capacity, bool composite, bool observing, bool single) {
            return single ? state_size<Alone<float>>(capacity, composite, observing)
                          : state_size<Alone<double>>(capacity, composite, observing);
        },
        nb::arg("capacity"), nb::arg("composite"), nb::arg("observing"), nb::arg("single"));
}

}  // namespace fracgyro::bindings
