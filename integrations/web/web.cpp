// What fracgyro.mjs calls: the closed loop, and the controller by itself. One instance of the module holds one of them,
// in these globals and in pages behind them that go when it does. Nothing is imported.
#define _LIBCPP_VERBOSE_ABORT(...) __builtin_trap()  // of a vector that would be too long
#include "fracgyro/control/guard.hpp"
#include "fracgyro/core/kernel_design.hpp"
#include "fracgyro/sim/device_settings.hpp"
#include "fracgyro/sim/running_loop.hpp"
#include "fracgyro/sim/settings.hpp"

#include <bit>
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

template <class Report>
[[gnu::noinline]] void keep_report(const Report& found) {
    double* next = report.data();
    for_each_number<Reported::between_steps>(found, [&](auto number) { *next++ = static_cast<double>(number); });
}

// What can be done with a controller of one type: a table for each, which is less than code that chooses each time.
struct ControllerOfType {
    void (*start)();
    void (*step)(const Motion<double>&);
    void (*report)();
    bool (*saved_is_sound)();
    std::size_t state_size;
};
const ControllerOfType* controller = nullptr;  // the controller by itself
void* state_at = nullptr;
const Status* status_at = nullptr;
std::array<double, 2> force;  // of its last step

template <class C>
Held<C>& held() {
    static_assert(alignof(Held<C>) <= 16 && std::is_trivially_destructible_v<Held<C>>);
    return *std::launder(reinterpret_cast<Held<C>*>(room.data()));
}
template <class C>
void start_held() {
    auto* const made = new (room.data()) Held<C>{.coefficients = prepare<Guard<C>>(setup.controller, setup.common)};
    state_at = &made->state;
    status_at = &made->state.status;
}
template <class C>
void step_held(const Motion<double>& measured) {
    using T = typename C::Value;
    const auto rounded = [](const Vec2<double>& a) { return Vec2<T>{T(a.x()), T(a.y())}; };
    auto& [coefficients, state] = held<C>();
    Guard<C>::step(state, coefficients, {rounded(measured.position), rounded(measured.velocity)});
    force = {static_cast<double>(state.force.x()), static_cast<double>(state.force.y())};
}
template <class C>
void report_held() {
    keep_report(Guard<C>::report(held<C>().state, held<C>().coefficients));
}
template <class C>
bool saved_is_sound() {
    const auto* const state = reinterpret_cast<const typename Guard<C>::State*>(saved.data() + saved_at);
    return Guard<C>::sound(*std::launder(state), held<C>().coefficients);
}
template <class C>
constexpr ControllerOfType controller_of{.start = &start_held<C>,
                                         .step = &step_held<C>,
                                         .report = &report_held<C>,
                                         .saved_is_sound = &saved_is_sound<C>,
                                         .state_size = sizeof(typename Guard<C>::State)};

// The same of closed loops.
struct LoopOfType {
    void (*start)();
    std::int64_t (*step)();
    int (*run)(int samples, std::int64_t every, double* rows, bool device);
    bool (*set)(const DeviceSetup&);
    void (*kick)(const Vec2<double>&);
    void (*save)(unsigned char*);
    bool (*restore)(const unsigned char*);
    std::size_t saved_size;
};
const LoopOfType* loop = nullptr;
void* loop_at = nullptr;
unsigned char* loop_saved_at = nullptr;

template <class C>
RunningLoop<C, DeviceSetup>& running() {
    static_assert(alignof(RunningLoop<C, DeviceSetup>) <= 16);
    return *static_cast<RunningLoop<C, DeviceSetup>*>(loop_at);
}

// Rows at the samples that `every` divides. Returns how many samples there were.
template <class C>
int run_into(int samples, std::int64_t every, double* rows, bool device) {
    using Report = typename C::Report;
    const std::int64_t first = running<C>().step();
    running<C>().run(samples, [&](const DeviceSnapshot<Report>& at) { write_each(at, every, rows, device); });
    return static_cast<int>(running<C>().step() - first);
}
template <class C>
constexpr LoopOfType loop_of{
    .start = [] { loop_at = new RunningLoop<C, DeviceSetup>(setup); },
    .step = [] { return running<C>().step(); },
    .run = &run_into<C>,
    .set = [](const DeviceSetup& other) { return running<C>().set(other); },
    .kick = [](const Vec2<double>& velocity) { running<C>().kick(velocity); },
    .save = [](unsigned char* bytes) { running<C>().save(bytes); },
    .restore = [](const unsigned char* bytes) { return running<C>().restore(bytes, loop->saved_size); },
    .saved_size = RunningLoop<C, DeviceSetup>::saved_size};

constexpr std::size_t page = 65536;

// Pages of memory; nullptr: there are none left.
void* pages(std::size_t bytes) {
    const std::size_t before = __builtin_wasm_memory_grow(0, (bytes + page - 1) / page);
    return before == ~std::size_t{0} ? nullptr : reinterpret_cast<void*>(before * page);
}

// Blocks of a power of two with their place among the powers in front. One that is deleted serves again: pages are not
// given back, and a loop that is tuned makes its setup again each time.
struct alignas(16) Block {
    std::size_t place = 0;
    Block* next = nullptr;  // while it is free
};
constexpr std::size_t smallest = 5;
std::array<Block*, 32> free_blocks{};
std::byte* rest = nullptr;  // of the pages that small blocks are cut from
std::size_t rest_size = 0;

Block* new_block(std::size_t place) {
    const std::size_t size = std::size_t{1} << place;
    if (rest_size < size) {
        rest_size = std::max(size, page);
        rest = static_cast<std::byte*>(pages(rest_size));
        if (rest == nullptr) {
            __builtin_trap();
        }
    }
    auto* const block = new (rest) Block{.place = place};
    rest += size;
    rest_size -= size;
    return block;
}

}  // namespace
}  // namespace fracgyro

using namespace fracgyro;

void* operator new(std::size_t bytes) {
    const auto bits = static_cast<std::size_t>(std::bit_width(bytes + sizeof(Block) - 1));
    const std::size_t place = std::max(bits, smallest);
    Block* block = free_blocks[place];
    if (block == nullptr) {
        block = new_block(place);
    } else {
        free_blocks[place] = block->next;
    }
    return block + 1;
}
void operator delete(void* at) noexcept {
    if (at != nullptr) {
        Block* const block = static_cast<Block*>(at) - 1;
        block->next = std::exchange(free_blocks[block->place], block);
    }
}
void operator delete(void* at, std::size_t) noexcept { operator delete(at); }

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

// The loop at t = 0.
EXPORT void loop_start() {
    with_controller<double>(setup.controller, setup.common.observer_bandwidth > 0.0,
                            []<class C>() { loop = &loop_of<C>; });
    loop->start();
    loop_saved_at = static_cast<unsigned char*>(operator new(loop->saved_size));
}
// The coming sample.
EXPORT double loop_step() { return static_cast<double>(loop->step()); }
// The coming samples into `rows`, with room for those that `every` divides, with the channels of the device or without.
// Returns how many samples there were: fewer where the motion diverges. The loop is that of any device: of two the
// module would be larger.
EXPORT int loop_run(int samples, double every, double* rows, bool device) {
    return loop->run(samples, static_cast<std::int64_t>(every), rows, device);
}
// Goes on with the numbers that `setting_values` now has. Returns whether a loop that runs can.
EXPORT bool loop_set() {
    ExponentialSum* const kernel = kernel_of(setup.controller);
    const ExponentialSum designed = kernel != nullptr ? *kernel : ExponentialSum{};
    take_settings(setup, values.data());
    if (kernel != nullptr) {
        *kernel = designed;
    }
    return loop->set(setup);
}
EXPORT void loop_kick(double vx, double vy) { loop->kick({vx, vy}); }
// The saved state, as that of the controller below.
EXPORT unsigned char* loop_saved() { return loop_saved_at; }
EXPORT std::size_t loop_saved_size() { return loop->saved_size; }
EXPORT void loop_save() { loop->save(loop_saved_at); }
EXPORT bool loop_restore() { return loop->restore(loop_saved_at); }

EXPORT void controller_start(bool single) {
    const bool observed = setup.common.observer_bandwidth > 0.0;
    if (single) {
        with_controller<float>(setup.controller, observed, []<class C>() { controller = &controller_of<C>; });
    } else {
        with_controller<double>(setup.controller, observed, []<class C>() { controller = &controller_of<C>; });
    }
    controller->start();
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
    controller->step({.position = {x, y}, .velocity = {vx, vy}});
    return force.data();
}
// What it reports, as it stands after the last step.
EXPORT const double* controller_report() {
    controller->report();
    return report.data();
}
// What was thought of the last sample.
EXPORT int controller_status() { return static_cast<int>(*status_at); }
// The saved state, a checksum and the state: where it is, and how long; written by controller_save, and to be filled in
// before controller_restore, which returns whether it is as it was saved.
EXPORT unsigned char* controller_saved() { return saved.data() + saved_at - sizeof(std::uint32_t); }
EXPORT std::size_t controller_saved_size() { return sizeof(std::uint32_t) + controller->state_size; }
EXPORT void controller_save() {
    std::memcpy(saved.data() + saved_at, state_at, controller->state_size);
    const std::uint32_t sum = checksum(saved.data() + saved_at, controller->state_size);
    std::memcpy(controller_saved(), &sum, sizeof sum);
}
EXPORT bool controller_restore() {
    std::uint32_t sum = 0;
    std::memcpy(&sum, controller_saved(), sizeof sum);
    const bool good = sum == checksum(saved.data() + saved_at, controller->state_size) && controller->saved_is_sound();
    if (good) {
        std::memcpy(state_at, saved.data() + saved_at, controller->state_size);
    }
    return good;
}
