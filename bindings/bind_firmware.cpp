#include "bindings.hpp"
#include "fields.hpp"

#include "fracgyro/controllers.hpp"
#include "fracgyro/guard.hpp"

#include <nanobind/stl/string.h>

namespace fracgyro::bindings {

namespace {

// A controller with room for so many modes.
template <std::size_t Capacity, bool with_terminal>
struct Sized {
    template <Scalar T>
    using SurfaceType = Surface<T, FractionalTerm<T, Capacity>, with_terminal>;
    template <Scalar T>
    using GuardType = Guard<SlidingModeController<T, SurfaceType>>;
};

// (size, alignment) of the state here; processors with shorter integers need no more.
template <Scalar T>
nb::tuple state_size(std::size_t capacity) {
    nb::object found = nb::none();
    [&]<std::size_t... I>(std::index_sequence<I...>) {
        const auto look = [&]<std::size_t Capacity>() {
            if (Capacity == capacity) {
                using State = typename Sized<Capacity, true>::template GuardType<T>::State;
                found = nb::make_tuple(sizeof(State), alignof(State));
            }
        };
        (look.template operator()<4 * (I + 1)>(), ...);
    }(std::make_index_sequence<Modes::capacity / 4>());
    return nb::cast<nb::tuple>(found);
}

template <Scalar T>
nb::object coefficients(const std::string& kind, const ControllerParams& p) {
    nb::object nested;
    with_controller<T>(kind, [&]<class Controller>() { nested = nested_fields(Controller::prepare(p)); });
    return nested;
}

}  // namespace

void bind_firmware(nb::module_& m) {
    m.def(
        "coefficients",
        [](const std::string& kind, const ControllerParams& p, bool single) {
            return single ? coefficients<float>(kind, p) : coefficients<double>(kind, p);
        },
        nb::arg("kind"), nb::arg("params"), nb::arg("single"),
        "The coefficients, nested as the structs are: a tuple for each struct, a list for each array.");
    m.def(
        "state_size",
        [](std::size_t capacity, bool single) {
            return single ? state_size<float>(capacity) : state_size<double>(capacity);
        },
        nb::arg("capacity"), nb::arg("single"));
}

}  // namespace fracgyro::bindings
