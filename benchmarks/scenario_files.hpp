// The files that faults.py and off_model.py leave for their programs: "numbers" and "sensing" (in the order of
// settings.hpp), "poles" and "weights" of the exponentials.
#pragma once

#include "fracgyro/sim/settings.hpp"

#include <algorithm>
#include <cstdio>
#include <vector>

inline std::vector<double> read(const char* name) {
    std::vector<double> numbers;
    if (std::FILE* const file = std::fopen(name, "rb")) {
        for (double number; std::fread(&number, sizeof number, 1, file) == 1;) {
            numbers.push_back(number);
        }
        std::fclose(file);
    }
    return numbers;
}

// False if there are not as many numbers as its kind of controller has.
template <class Setup>
bool take_files(Setup& setup) {
    const auto numbers = read("numbers"), sensing = read("sensing"), poles = read("poles"), weights = read("weights");
    fracgyro::SensingNumbers around{};
    if (numbers.size() != fracgyro::setting_count(setup) || sensing.size() != around.size()) {
        return false;
    }
    fracgyro::take_settings(setup, numbers.data());
    std::copy(sensing.begin(), sensing.end(), around.begin());
    fracgyro::take_sensing(setup.common, around);
    if (fracgyro::ExponentialSum* const kernel = fracgyro::kernel_of(setup.controller); kernel != nullptr) {
        std::copy(poles.begin(), poles.end(), kernel->poles.begin());
        std::copy(weights.begin(), weights.end(), kernel->weights.begin());
    }
    return true;
}
