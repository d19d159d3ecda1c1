#include "arrays.hpp"
#include "bindings.hpp"

#include "fracgyro/sim/aggregate.hpp"
#include "fracgyro/sim/any_controller.hpp"
#include "fracgyro/sim/unpacked.hpp"
#include "fracgyro/hardware/guard.hpp"
#include "fracgyro/hardware/pickoffs.hpp"
#include "fracgyro/sim/loop.hpp"

#include <nanobind/stl/string.h>

namespace fracgyro::bindings {

namespace {

// Numbers of a struct, in the order of its members, nested like its braces; with `law` instead of those of an
// erased controller.
template <class Value>
nb::object nested(const Value& value, const nb::object& law = {}) {
    if constexpr (std::is_arithmetic_v<Value>) {
        return nb::cast(value);
    } else if constexpr (std::is_pointer_v<Value>) {  // the reference, which the exported file names
        return nb::object(nb::str(value == nullptr ? "" : "&course"));
    } else if constexpr (requires { value.controller->needs_velocity(); }) {
        return law;
    } else if constexpr (requires { Value::is_unpacked; }) {
        return nb::cast(value.value);
    } else if constexpr (requires { value.begin(); }) {
        nb::list all;
        for (const auto& each : value) {
            all.append(nested(each, law));
        }
        return all;
    } else if constexpr (!std::is_class_v<Value>) {  // a pack
        nb::list entries;
        for (std::size_t k = 0; k < sizeof(Value) / sizeof(value[0]); ++k) {
            entries.append(nb::cast(value[k]));
        }
        return nb::tuple(entries);
    } else {
        return with_members(
            value, [&](const auto&... members) { return nb::object(nb::make_tuple(nested(members, law)...)); });
    }
}

// Size of the guarded state on this machine; processors with shorter integers need no more. 0 for an unknown capacity.
template <Scalar T>
std::size_t state_size(const Setup& s, std::size_t capacity) {
    std::size_t found = 0;
    const auto take = [&]<class Sized>() {
        for_device<Sized>(s.common, [&]<class Seen>() { found = sizeof(typename Guard<Seen>::State); });
        return found;
    };
    if (capacity == 0 || capacity % 2 != 0 || capacity > ExponentialSum::capacity) {
        return 0;
    }
    with_controller<T>(s.controller, [&]<class C>() {
        if constexpr (requires { typename C::template Sized<2>; }) {
            // Each pair of exponentials adds the same number of bytes: two sizes compile faster than all.
            const std::size_t one = take.template operator()<typename SizedController<C, 2>::Type>(),
                              two = take.template operator()<typename SizedController<C, 4>::Type>();
            found = one + (capacity / 2 - 1) * (two - one);
        } else {
            take.template operator()<C>();
        }
    });
    return found;
}

// The numbers of the parts around a controller do not depend on which it is: compiled for each controller instead of
// for an erased one, they take 100 s and 3 GB.
template <Scalar T, bool velocity>
nb::object with_parts(const nb::object& law, const Common& common) {
    nb::object found;
    for_device<Erased<T, velocity>>(common,
                                    [&]<class Seen>() { found = nested(Guard<Seen>::prepare({}, common), law); });
    return found;
}

template <Scalar T>
nb::object coefficients(const Setup& s) {
    nb::object found;
    with_controller<T>(s.controller, [&]<class C>() {
        const auto of = [&]<class Law>(const Common& common) {
            found = with_parts<T, measures_velocity<Law>>(nested(prepare<Law>(s.controller, s.common)), common);
        };
        if constexpr (takes_filter<C>) {
            of.template operator()<C>(s.common);
        } else {
            Common unfiltered = s.common;
            unfiltered.filter = {};
            if (s.common.observer_bandwidth > 0.0) {
                of.template operator()<typename FromPositions<C>::Type>(unfiltered);
            } else {
                of.template operator()<C>(unfiltered);
            }
        }
    });
    return found;
}

}  // namespace

void bind_firmware(nb::module_& m) {
    m.def(
        "coefficients",
        [](const Setup& s, bool single) {
            return single ? coefficients<Unpacked<float>>(s) : coefficients<Unpacked<double>>(s);
        },
        nb::arg("setup"), nb::arg("single"),
        "The coefficients, nested as the structs are: a tuple for each struct, a list for each array.");
    m.def(
        "state_size",
        [](const Setup& s, std::size_t capacity, bool single) {
            return single ? state_size<Unpacked<float>>(s, capacity) : state_size<Unpacked<double>>(s, capacity);
        },
        nb::arg("setup"), nb::arg("capacity"), nb::arg("single"));
    m.def(
        "chosen_type",
        [](const Setup& s) {
            std::size_t chosen = 0;
            with_params(s.controller, [&](const auto& p, auto family) { chosen = family.chosen(p); });
            return nb::make_tuple(s.controller.index(), chosen);
        },
        nb::arg("setup"), "The line of the registry, and which of its types; as RegisteredController takes them.");
}

}  // namespace fracgyro::bindings
