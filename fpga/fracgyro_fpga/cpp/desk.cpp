// The expected answers of exported hardware with a fixed point: the same core, computing with Fixed on this computer.
//
//     desk NUMBERS OBSERVER POLES WEIGHTS      the numbers that chosen.hpp describes
//
//    Files are those of testbench.cpp: a row of "answer" for each of "motion".
#include "fixed.hpp"

#include "chosen.hpp"
#include "fracgyro/sim/aggregate.hpp"

#include <cstdio>

namespace fracgyro {

// The tracer refuses whatever calls it.
inline HardwareFixed power(HardwareFixed /*base*/, HardwareFixed /*exponent*/) { std::abort(); }
inline HardwareFixed exponential(HardwareFixed /*a*/) { std::abort(); }
inline HardwareFixed logarithm(HardwareFixed /*a*/) { std::abort(); }

}  // namespace fracgyro

int main(int count, char** words) {
    using namespace fracgyro;
    using Controller = ChosenController<HardwareFixed>;
    std::FILE* const in = std::fopen("motion", "rb");
    std::FILE* const out = std::fopen("answer", "wb");
    if (count != 5 || in == nullptr || out == nullptr) {
        return 1;
    }
    const auto coefficients = chosen_coefficients<Controller>(words);
    Controller::State state{};
    std::vector<std::int64_t> row;
    const auto put = [&](HardwareFixed number) { row.push_back(number.places); };
    for (std::array<std::int64_t, 4> m{}; std::fread(m.data(), sizeof m, 1, in) == 1;) {
        const auto report = Controller::report(state, coefficients);
        Controller::step(state, coefficients,
                         {.position = {HardwareFixed::of(m[0]), HardwareFixed::of(m[1])},
                          .velocity = {HardwareFixed::of(m[2]), HardwareFixed::of(m[3])}});
        row.clear();
        put(HardwareFixed(static_cast<int>(state.status)));
        put(state.force.x());
        put(state.force.y());
        for_each_number<Reported::between_steps>(report, put);
        if (std::fwrite(row.data(), sizeof row[0], row.size(), out) != row.size()) {
            return 1;
        }
    }
    return std::fclose(out) == 0 ? 0 : 1;
}
