// The controllers by name. A new one is its own file plus one line here.
#pragma once

#include "fracgyro/composite.hpp"
#include "fracgyro/controller.hpp"
#include "fracgyro/observer.hpp"

#include <algorithm>
#include <string_view>
#include <tuple>

namespace fracgyro {

template <std::size_t Size>
struct Name {
    char text[Size]{};
    consteval Name(const char (&characters)[Size]) { std::copy_n(characters, Size, text); }
    constexpr std::string_view view() const { return {text, Size - 1}; }
};

template <Name name, class Controller>
struct Listed {
    static constexpr std::string_view kind = name.view();
    using Type = Controller;
};

template <Scalar T>
using Controllers =
    std::tuple<Listed<"fractional_fast_terminal", SlidingModeController<T, FractionalFastTerminalSurface>>,
               Listed<"fractional", SlidingModeController<T, FractionalSurface>>,
               Listed<"fast_terminal", SlidingModeController<T, FastTerminalSurface>>,
               Listed<"linear", SlidingModeController<T, LinearSurface>>>;

// The same controller with composite adaptation.
template <class Controller>
using Composite = typename Controller::template Adapted<CompositeAdaptation>;

// Calls visit.template operator()<Controller>() for the controller of that kind. Returns whether there is one.
template <Scalar T, class Visit>
bool with_controller(std::string_view kind, bool composite, Visit&& visit) {
    const auto visit_one = [&]<class Controller>() {
        if (composite) {
            visit.template operator()<Composite<Controller>>();
        } else {
            visit.template operator()<Controller>();
        }
        return true;
    };
    const auto try_all = [&]<class... Entries>(std::tuple<Entries...>*) {
        return ((Entries::kind == kind && visit_one.template operator()<typename Entries::Type>()) || ...);
    };
    return try_all(static_cast<Controllers<T>*>(nullptr));
}

// The same, behind an observer where the parameters have one.
template <Scalar T, class Visit>
bool with_controller(std::string_view kind, const ControllerParams& p, Visit&& visit) {
    return with_controller<T>(kind, p.adaptation.composite, [&]<class Controller>() {
        if (p.observer_bandwidth > 0.0) {
            visit.template operator()<Observing<Controller>>();
        } else {
            visit.template operator()<Controller>();
        }
    });
}

// Their kinds, in the order of the list.
inline constexpr auto controller_kinds = []<class... Entries>(std::tuple<Entries...>*) {
    return std::array<std::string_view, sizeof...(Entries)>{Entries::kind...};
}(static_cast<Controllers<double>*>(nullptr));

}  // namespace fracgyro
