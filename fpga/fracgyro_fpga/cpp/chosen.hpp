// The controller with its guard that a program is compiled for, FRACGYRO_KIND, _CHOSEN, _OBSERVED and _CAPACITY, and
// its numbers, which the program is called with.
//
//     NUMBERS OBSERVER POLES WEIGHTS      the numbers of a run in the order of settings.hpp, the bandwidth of the
//                                         observer and the exponentials, each a list in quotes
#pragma once

#include "fracgyro/hardware/guard.hpp"
#include "fracgyro/sim/settings.hpp"

#include <cstdlib>
#include <vector>

namespace fracgyro {

template <class C, bool observed>
struct SeenBy {
    using Type = C;
};
template <class C>
struct SeenBy<C, true> {
    using Type = typename FromPositions<C>::Type;
};
template <Scalar T>
using ChosenController = Guard<typename SeenBy<
    typename SizedController<RegisteredController<T, FRACGYRO_KIND, FRACGYRO_CHOSEN>, FRACGYRO_CAPACITY>::Type,
    FRACGYRO_OBSERVED>::Type>;

inline std::vector<double> numbers_of(const char* text) {
    std::vector<double> found;
    for (char* end = nullptr;; text = end) {
        const double number = std::strtod(text, &end);
        if (end == text) {
            return found;
        }
        found.push_back(number);
    }
}

// `words`: the arguments of the program, its own name first.
template <class Controller>
typename Controller::Coefficients chosen_coefficients(char** words) {
    const Setup setup = setup_from(FRACGYRO_KIND, numbers_of(words[1]), numbers_of(words[2]).front(),
                                   numbers_of(words[3]), numbers_of(words[4]));
    return prepare<Controller>(setup.controller, setup.common);
}

}  // namespace fracgyro
