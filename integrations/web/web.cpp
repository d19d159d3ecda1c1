// What fracgyro.mjs calls: the simulator, and the controller by itself. One instance of the module holds one of them,
// in these globals and in pages behind them that go when it does. Nothing is imported.
#define _LIBCPP_VERBOSE_ABORT(...) __builtin_trap()  // of a vector that would be too long
#include "fracgyro/control/guard.hpp"
#include "fracgyro/core/kernel_design.hpp"
#include "fracgyro/sim/device_settings.hpp"
#include "fracgyro/sim/settings.hpp"

#include <cstring>
#include <new>

namespace fracgyro {
namespace {

// As many as any kind has.
constexpr std::size_t most_settings = []<std::size_t... I>(std::index_sequence<I...>) {
    const auto count = [](const Setup& of_kind) {
        std::size_t found = 0;
        for_each_setting(of_kind, [&](std::string_view, const auto&, std::string_view, const auto&) { ++found; });
        return found;
    };
    return std::max({count({.controller = ControllerParams(std::in_place_index<I>)})...});
}(std::make_index_sequence<controller_kinds.size()>{});

[[clang::no_destroy]] constinit DeviceSetup setup;
std::array<double, most_settings> values;  // those of the kind, in the order of settings.hpp
KernelDesign kernel_design;                // room to design the exponentials in
bool single_precision = false;             // of the controller by itself
std::array<double, 2> force;               // that of its last step
void* state_at = nullptr;                  // its state
std::size_t state_size = 0;
const Status* status_at = nullptr;

// A controller behind its guard.
template <class Controller>
struct Held {
    typename Guard<Controller>::Coefficients coefficients{};
    typename Guard<Controller>::State state{};
};
// The most that measure(list of a line's types) gives for any line of the registry.
template <Scalar T>
constexpr std::size_t most_of(auto measure) {
    return [&]<class... Entries>(std::tuple<Entries...>*) {
        return std::max({measure(typename Entries::Type::template Types<T>{})...});
    }(static_cast<Registry*>(nullptr));
}
// One at a time, in room for any: objects of each kind would lie in the module as they begin.
template <Scalar T>
constexpr std::size_t room_for_any = most_of<T>([]<class... Types>(List<Types...>) {
    return std::max({sizeof(Held<Types>)..., sizeof(Held<typename FromPositions<Types>::Type>)...});
});
alignas(16) std::array<std::byte, std::max(room_for_any<double>, room_for_any<float>)> room;
std::array<double, most_of<double>([]<class... Types>(List<Types...>) {
               return std::max({width_of<typename Types::Report>()...});
           })>
    report;
// Its state as it is saved, aligned as it is held.
constexpr std::size_t saved_at = 16;
alignas(16) std::array<unsigned char, saved_at + room.size()> saved;
bool (*saved_is_sound)() = nullptr;

template <class Controller>
Held<Controller>& held() {
    static_assert(alignof(Held<Controller>) <= 16 && std::is_trivially_destructible_v<Held<Controller>>);
    return *std::launder(reinterpret_cast<Held<Controller>*>(room.data()));
}

template <class Act>
void with_held(Act&& act) {
    const bool observed = setup.common.observer_bandwidth > 0.0;
    if (single_precision) {
        with_controller<float>(setup.controller, observed, act);
    } else {
        with_controller<double>(setup.controller, observed, act);
    }
}

template <class Report>
[[gnu::noinline]] void keep_report(const Report& found) {
    double* next = report.data();
    for_each_number<Reported::between_steps>(found, [&](auto number) { *next++ = static_cast<double>(number); });
}

// Pages of memory; nullptr: there are none left.
void* pages(std::size_t bytes) {
    constexpr std::size_t page = 65536;
    const std::size_t before = __builtin_wasm_memory_grow(0, (bytes + page - 1) / page);
    return before == ~std::size_t{0} ? nullptr : reinterpret_cast<void*>(before * page);
}

}  // namespace
}  // namespace fracgyro

using namespace fracgyro;

// For the points of rates and temperatures.
void* operator new(std::size_t bytes) {
    void* const found = pages(bytes);
    if (found == nullptr) {
        __builtin_trap();
    }
    return found;
}
void operator delete(void*) noexcept {}
void operator delete(void*, std::size_t) noexcept {}

#define EXPORT extern "C" [[gnu::visibility("default")]]

// Room for so many numbers; nullptr: there is none left.
EXPORT double* room_for(std::size_t count) { return static_cast<double*>(pages(count * sizeof(double))); }

// To be filled in before `setup_done`.
EXPORT double* setting_values() { return values.data(); }
// The kind is a place in the registry; the bandwidth, that of the observer of velocity, 0: the velocity is measured.
// `device`: the numbers of a rate that moves and a device that is not ideal (device_settings.hpp), or nullptr. Designs
// the exponentials of a controller with memory. Returns whether there are such.
EXPORT bool setup_done(std::size_t kind, double observer_bandwidth, double duration, double tolerance,
                       const double* device) {
    setup.controller = params_of_kind(kind);
    take_settings(setup, values.data());
    setup.common.observer_bandwidth = observer_bandwidth;
    if (device != nullptr) {
        take_device_settings(setup, device);
    }
    ExponentialSum* const kernel = kernel_of(setup.controller);
    if (kernel == nullptr || !has_memory(setup.controller)) {
        return true;
    }
    *kernel = designed_kernel(kernel_design, kernel->order, setup.common.step, duration, tolerance);
    return kernel->count > 0 || kernel->order == 0.0 || kernel->order == 1.0;
}
// Which of the kind's types it is: what it reports depends on that.
EXPORT std::size_t chosen_type() {
    std::size_t chosen = 0;
    with_params(setup.controller, [&](const auto& params, auto family) { chosen = family.chosen(params); });
    return chosen;
}

// A run into `rows`, with room for steps / every + 1 of them, with the channels of the device or without. Returns the
// number of samples before divergence. The loop is that of any device: of two the module would be larger.
EXPORT int simulate(int every, double* rows, bool device) {
    return static_cast<int>(record_device(setup, every, rows, device));
}

EXPORT void controller_start(bool single) {
    single_precision = single;
    with_held([]<class C>() {
        auto* made = new (room.data()) Held<C>{.coefficients = prepare<Guard<C>>(setup.controller, setup.common)};
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
    const std::size_t kind = setup.controller.index();
    std::uint32_t sum = checksum(&kind, sizeof kind);
    sum = checksum(&setup.common.observer_bandwidth, sizeof(double), sum);
    sum = checksum(values.data(), sizeof values, sum);
    if (const ExponentialSum* const kernel = kernel_of(setup.controller)) {
        sum = checksum(kernel->poles.data(), kernel->count * sizeof kernel->poles[0], sum);
        sum = checksum(kernel->weights.data(), kernel->count * sizeof kernel->weights[0], sum);
    }
    return sum;
}
// One step, from the motion measured now; without a sensor of velocity that is not looked at. Returns the force.
EXPORT const double* controller_step(double x, double y, double vx, double vy) {
    with_held([&]<class C>() {
        using T = typename C::Value;
        const Motion<T> motion{.position = {T(x), T(y)}, .velocity = {T(vx), T(vy)}};
        const Vec2<T> found = Guard<C>::step(held<C>().state, held<C>().coefficients, motion).force;
        force = {static_cast<double>(found.x()), static_cast<double>(found.y())};
    });
    return force.data();
}
// What it reports, as it stands after the last step.
EXPORT const double* controller_report() {
    with_held([]<class C>() { keep_report(Guard<C>::report(held<C>().state, held<C>().coefficients)); });
    return report.data();
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
