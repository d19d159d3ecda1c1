// What fracgyro.mjs calls: the simulator, and the controller alone. One instance of the module holds one of them, in
// these globals, and JavaScript owns the memory behind them: nothing is allocated here and nothing is imported.
#include "fracgyro/guard.hpp"
#include "fracgyro/kernel_design.hpp"
#include "fracgyro/settings.hpp"
#include "fracgyro/record.hpp"

#include <cstring>
#include <new>

namespace fracgyro {
namespace {

Setup setup;
std::array<double, setting_names.size()> values;  // in the order of setting_names
KernelDesign kernel_design;                       // room to design the modes in
bool single_precision = false;                    // of the controller alone
std::array<double, row_width> row;                // what it found in its last step
std::array<double, 12> estimates;
void* state_at = nullptr;  // its state
std::size_t state_size = 0;
const Status* status_at = nullptr;

// A controller behind its guard.
template <class Controller>
struct Held {
    typename Guard<Controller>::Coefficients coefficients{};
    typename Guard<Controller>::State state{};
};
// One at a time, in room for any: objects of each kind would lie in the module as they begin.
template <Scalar T>
constexpr std::size_t room_for_any = []<class... Entries>(std::tuple<Entries...>*) {
    return std::max(
        {std::max(sizeof(Held<typename Entries::Type>), sizeof(Held<Composite<typename Entries::Type>>))...});
}(static_cast<Controllers<T>*>(nullptr));
alignas(16) std::array<std::byte, std::max(room_for_any<double>, room_for_any<float>)> room;
// Its state as it is saved, aligned as it is held.
constexpr std::size_t saved_at = 16;
alignas(16) std::array<unsigned char, saved_at + room.size()> saved;
bool (*saved_is_sound)() = nullptr;

template <class Controller>
Held<Controller>& held() {
    static_assert(alignof(Held<Controller>) <= 16 && std::is_trivially_destructible_v<Held<Controller>>);
    return *std::launder(reinterpret_cast<Held<Controller>*>(room.data()));
}

// Its own function, as it is the same for every surface.
template <class Adaptation>
[[gnu::noinline]] void tell(const typename Adaptation::State& state, const typename Adaptation::Coefficients& c) {
    const auto e = Adaptation::estimates(state, c);
    const auto quality = Adaptation::quality(state, c);
    const auto number = [](auto a) { return static_cast<double>(a); };
    estimates = {number(e.damping.xx),   number(e.damping.xy),      number(e.damping.yy),
                 number(e.stiffness.xx), number(e.stiffness.xy),    number(e.stiffness.yy),
                 number(e.rate),         number(e.bound[0]),        number(e.bound[1]),
                 number(e.bound[2]),     number(quality.deviation), number(quality.trusted)};
}

template <class Act>
void with_held(Act&& act) {
    if (single_precision) {
        with_controller<float>(setup.kind, setup.controller.adaptation.composite, act);
    } else {
        with_controller<double>(setup.kind, setup.controller.adaptation.composite, act);
    }
}

}  // namespace
}  // namespace fracgyro

using namespace fracgyro;

#define EXPORT extern "C" [[gnu::visibility("default")]]

EXPORT std::size_t setting_count() { return setting_names.size(); }
EXPORT const char* setting_name(std::size_t i) { return setting_names[i].data(); }
EXPORT std::size_t kind_count() { return controller_kinds.size(); }
EXPORT const char* kind_name(std::size_t i) { return controller_kinds[i].data(); }
EXPORT std::size_t channel_count() { return channels.size(); }
EXPORT const char* channel_name(std::size_t i) { return channels[i].name.data(); }
EXPORT int channel_width(std::size_t i) { return channels[i].width; }

// To be filled in before `setup_done`.
EXPORT double* setting_values() { return values.data(); }
// Designs the modes of a controller with memory. Returns whether there are such.
EXPORT bool setup_done(std::size_t kind, bool with_memory, double duration, double tolerance) {
    setup.kind = controller_kinds[kind];
    take_settings(setup, values.data());
    Modes& modes = setup.controller.surface.modes;
    if (!with_memory) {
        modes = {};
        return true;
    }
    modes = designed_modes(kernel_design, modes.order, setup.controller.step, duration, tolerance);
    return modes.count > 0 || modes.order == 0.0 || modes.order == 1.0;
}

// A run into `rows`, with room for steps / every + 1 of them. Returns the number of samples before divergence.
EXPORT int simulate(int every, double* rows) { return static_cast<int>(record<double>(setup, every, rows)); }

EXPORT void controller_start(bool single) {
    single_precision = single;
    with_held([]<class C>() {
        auto* made = new (room.data()) Held<C>{.coefficients = Guard<C>::prepare(setup.controller)};
        state_at = &made->state;
        state_size = sizeof made->state;
        saved_is_sound = [] {
            const auto* state = reinterpret_cast<const typename Guard<C>::State*>(saved.data() + saved_at);
            return Guard<C>::sound(*std::launder(state), held<C>().coefficients);
        };
        status_at = &made->state.status;
    });
}
// Of what the controller is made from.
EXPORT std::uint32_t controller_key() {
    const Modes& modes = setup.controller.surface.modes;
    std::uint32_t sum = checksum(setup.kind.data(), setup.kind.size());
    sum = checksum(values.data(), sizeof values, sum);
    sum = checksum(modes.rates.data(), modes.count * sizeof modes.rates[0], sum);
    return checksum(modes.weights.data(), modes.count * sizeof modes.weights[0], sum);
}
// One step, from the motion measured now. Returns the row of what was found.
EXPORT const double* controller_step(double x, double y, double vx, double vy) {
    with_held([&]<class C>() {
        using T = typename C::Value;
        const Motion<T> motion{.position = {T(x), T(y)}, .velocity = {T(vx), T(vy)}};
        const auto signals = Guard<C>::step(held<C>().state, held<C>().coefficients, motion);
        write_row<T>({.step = 0, .motion = motion, .signals = signals, .disturbance = {}}, row.data());
    });
    return row.data();
}
// As they stand after the last step.
EXPORT const double* controller_estimates() {
    with_held([]<class C>() {
        tell<typename C::AdaptationType>(held<C>().state.controller.adaptation,
                                         held<C>().coefficients.controller.adaptation);
    });
    return estimates.data();
}
// What was thought of the last sample.
EXPORT int controller_status() { return static_cast<int>(*status_at); }
// The saved state, a checksum and the state: where it is, and how long; written by controller_save, and to be filled in
// before controller_restore, which returns whether it is as it was saved.
EXPORT unsigned char* controller_saved() { return saved.data() + saved_at - sizeof(std::uint32_t); }
EXPORT std::size_t controller_saved_size() { return sizeof(std::uint32_t) + state_size; }
EXPORT void controller_save() {
    std::memcpy(saved.data() + saved_at, state_at, state_size);
    const std::uint32_t sum = checksum(saved.data() + saved_at, state_size);
    std::memcpy(controller_saved(), &sum, sizeof sum);
}
EXPORT bool controller_restore() {
    std::uint32_t sum = 0;
    std::memcpy(&sum, controller_saved(), sizeof sum);
    const bool good = sum == checksum(saved.data() + saved_at, state_size) && saved_is_sound();
    if (good) {
        std::memcpy(state_at, saved.data() + saved_at, state_size);
    }
    return good;
}
