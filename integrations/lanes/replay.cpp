// Answers every motion in the file "motion" (x, y and their rates) with a row in the file "answer": the force, and what
// the controller reported with it. The controller is that of studies, in the lanes of the widest register of this
// processor.
//
//     replay KIND float|double      the kind by its place in the registry; also reads "numbers", in the order of
//                                   settings.hpp, "poles" and "weights" of exponentials, and "observer", the bandwidth
//                                   of the observer of velocity, 0: the velocity is measured
//
// The motions go through each lane in turn, with runs of half their size in the others. The answer is that of the
// first lane or, where another lane's is not the same, that one's.
#include "fracgyro/sim/lanes.hpp"
#include "fracgyro/sim/recorder.hpp"
#include "fracgyro/sim/settings.hpp"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

namespace fracgyro {
namespace {

#if defined(__AVX512F__)
constexpr std::size_t register_bytes = 64;
#elif defined(__AVX2__)
constexpr std::size_t register_bytes = 32;
#else
constexpr std::size_t register_bytes = 16;
#endif

template <class Row>
std::vector<Row> read(const char* name) {
    std::vector<Row> rows;
    if (std::FILE* const file = std::fopen(name, "rb")) {
        for (Row row; std::fread(&row, sizeof row, 1, file) == 1;) {
            rows.push_back(row);
        }
        std::fclose(file);
    }
    return rows;
}

template <class Row>
bool write(const char* name, const std::vector<Row>& rows) {
    std::FILE* const file = std::fopen(name, "wb");
    if (file == nullptr) {
        return false;
    }
    const bool whole = std::fwrite(rows.data(), sizeof(Row), rows.size(), file) == rows.size();
    return std::fclose(file) == 0 && whole;
}

Setup stored_setup(std::size_t kind) {
    Setup setup = setup_from(kind, read<double>("numbers"), read<double>("observer").front(), read<double>("poles"),
                             read<double>("weights"));
    setup.lists = Shared<ReferenceLists>(lists_from(read<double>("terms"), read<double>("rows")));
    prepare_reference(setup);
    return setup;
}

// One row after another.
template <class Controller, class Number>
std::vector<Number> answers(const typename Controller::Coefficients& c, std::size_t lane,
                            const std::vector<std::array<Number, 4>>& motions) {
    using T = typename Controller::Value;
    typename Controller::State state{};
    std::vector<Number> rows;
    for (const auto& [x, y, v, w] : motions) {
        const auto in_lane = [lane](Number a) {
            T lanes(0.5 * static_cast<double>(a));
            lanes.lane[lane] = a;
            return lanes;
        };
        const Motion<T> motion{.position = {in_lane(x), in_lane(y)}, .velocity = {in_lane(v), in_lane(w)}};
        const auto signals = Controller::step(state, c, motion);
        const auto put = [&](const T& number) { rows.push_back(number.lane[lane]); };
        put(signals.force.x());
        put(signals.force.y());
        for_each_number<Reported::between_steps>(signals.report, put);
    }
    return rows;
}

template <class Number>
bool replay(const Setup& setup) {
    using T = Lanes<Number, register_bytes / sizeof(Number)>;
    const auto motions = read<std::array<Number, 4>>("motion");
    bool written = false;
    with_controller<T>(setup.controller, setup.common.observer_bandwidth > 0.0, [&]<class Controller>() {
        const auto coefficients = prepare<Controller>(setup.controller, setup.common);
        const auto first = answers<Controller>(coefficients, 0, motions);
        auto odd = first;
        for (std::size_t lane = 1;
             lane < T::count && std::memcmp(odd.data(), first.data(), first.size() * sizeof first[0]) == 0; ++lane) {
            odd = answers<Controller>(coefficients, lane, motions);
        }
        written = write("answer", odd);
    });
    return written;
}

}  // namespace
}  // namespace fracgyro

int main(int count, char** words) {
    if (count != 3) {
        return 1;
    }
    const fracgyro::Setup setup = fracgyro::stored_setup(std::strtoul(words[1], nullptr, 10));
    return (std::strcmp(words[2], "float") == 0 ? fracgyro::replay<float>(setup) : fracgyro::replay<double>(setup)) ? 0
                                                                                                                    : 1;
}
