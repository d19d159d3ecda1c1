// Functions that fracgyro.mjs calls: the closed loop, and a controller by itself. An instance of the module holds one
// of them, in these globals and in the module's memory, which is freed with the instance. The module imports only the
// caller's law. FRACGYRO_SINGLE: a module of controllers in single precision, without a loop.
#define _LIBCPP_VERBOSE_ABORT(...) __builtin_trap()  // called for a vector that would be too long
#include "fracgyro/core/kernel_design.hpp"
#include "fracgyro/sim/guarded_controller.hpp"
#include "fracgyro/sim/running_loop.hpp"
#include "fracgyro/sim/settings.hpp"
#include "fracgyro/sim/user_law.hpp"

#include <bit>
#include <memory>
#include <new>
#include <vector>

#ifndef FRACGYRO_SINGLE
// From a sample, `in`, which is a UserInput, the force on x and y and the reports, to `out`. Throws instead of
// returning a force that is not finite; then this instance can no longer be used.
extern "C" [[clang::import_module("caller"), clang::import_name("law")]] void callers_law(const double* in,
                                                                                          double* out);
#endif

namespace fracgyro {
namespace {

#ifdef FRACGYRO_SINGLE
using Number = float;
#else
using Number = double;

// A function of the caller's as the controller of a loop.
class CallersLaw final : public UserLaw {
public:
    CallersLaw(std::size_t reports, std::ptrdiff_t rate_place)
        : out_(2 + reports, CommonReport::nan), rate_place_(rate_place) {}

    Vec2<double> force(const UserInput& in) override {
        callers_law(&in.time, out_.data());
        return {out_[0], out_[1]};
    }
    std::span<const double> report() override { return std::span<const double>(out_).subspan(2); }
    std::ptrdiff_t rate_place() const override { return rate_place_; }
    bool estimates_rate() const override { return rate_place_ >= 0; }
    void refused(double, const Vec2<double>&) const override { __builtin_trap(); }

private:
    std::vector<double> out_;
    std::ptrdiff_t rate_place_;
};
#endif

// Maximum number of settings over all kinds.
constexpr std::size_t most_settings = []<std::size_t... I>(std::index_sequence<I...>) {
    const auto count = [](const Setup& of_kind) {
        std::size_t found = 0;
        for_each_setting(of_kind, [&](std::string_view, const auto&, std::string_view, const auto&) { ++found; });
        return found;
    };
    return std::max({count({.controller = ControllerParams(std::in_place_index<I>)})...});
}(std::make_index_sequence<controller_kinds.size()>{});

[[clang::no_destroy]] constinit PlantSetup setup;
std::array<double, most_settings> values;  // those of the kind, in the order of settings.hpp
KernelDesign kernel_design;                // room to design the exponentials in

[[clang::no_destroy]] constinit std::unique_ptr<GuardedController> controller;  // without a loop
std::array<double, 2> force;                                                    // output of its last step
[[clang::no_destroy]] constinit std::vector<double> report;
#ifndef FRACGYRO_SINGLE
[[clang::no_destroy]] constinit std::unique_ptr<AnyController<double>> loop_controller;
[[clang::no_destroy]] constinit std::unique_ptr<RunningLoop> loop;
#endif
[[clang::no_destroy]] constinit std::vector<unsigned char> saved;  // the state of either

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
std::byte* rest = nullptr;  // unused part of the page from which small blocks are cut
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

// Memory for `count` numbers; nullptr if there is too little.
EXPORT double* room_for(std::size_t count) { return static_cast<double*>(pages(count * sizeof(double))); }

// To be filled in before `setup_done`.
EXPORT double* setting_values() { return values.data(); }
// The kind is a place in the registry; `sensing`: parts around a controller, as sensing_of in
// settings.hpp lists them; `device`: the numbers of a dynamic rate and a real device, or nullptr. Designs the
// exponentials of a controller with memory. Returns whether there are such.
EXPORT bool setup_done(std::size_t kind, const double* sensing, double duration, double tolerance,
                       const double* device) {
    setup.controller = params_of_kind(kind);
    take_settings(setup, values.data());
    SensingNumbers numbers{};
    std::copy_n(sensing, numbers.size(), numbers.begin());
    take_sensing(setup.common, numbers);
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
// The terms of a sum of sines and the rows of a table, as lists_from takes them; before `setup_done`.
EXPORT void reference_lists(std::size_t terms, const double* term, std::size_t rows, const double* row) {
    setup.lists = Shared<ReferenceLists>(lists_from({term, terms}, {row, rows}));
}
// Returns true if the controller takes a filter of the measured motions, or there is none.
EXPORT bool filter_fits() {
    bool fits = !setup.common.filter.on();
    with_controller<Number>(setup.controller, [&]<class C>() { fits = fits || takes_filter<C>; });
    return fits;
}
// Which of the kind's types it is: what it reports depends on that.
EXPORT std::size_t chosen_type() {
    std::size_t chosen = 0;
    with_params(setup.controller, [&](const auto& params, auto family) { chosen = family.chosen(params); });
    return chosen;
}

// The points of the rate and of the temperature: how many, and their times, in steps, followed by their values. The
// rates about x and y as take_transverse in settings.hpp reads them.
EXPORT void device_points(std::size_t rates, const double* rate, std::size_t temperatures, const double* temperature,
                          std::size_t across, const double* transverse) {
    const auto profile = [](std::size_t count, const double* from) {
        return Profile{{from, from + count}, {from + count, from + 2 * count}};
    };
    setup.rate.table = profile(rates, rate);
    setup.device.temperature = profile(temperatures, temperature);
    take_transverse(setup.rate, {transverse, across});
}

#ifndef FRACGYRO_SINGLE
// A device in volts, as take_volts in settings.hpp reads it.
EXPORT void device_in_volts(std::size_t count, const double* numbers) { take_volts(setup, {numbers, count}); }
#endif

// The terms of the disturbance, as take_terms in settings.hpp reads them.
EXPORT void disturbance_terms(std::size_t count, const double* numbers) {
    take_terms(setup.disturbance, {numbers, count});
}

#ifndef FRACGYRO_SINGLE
// The loop at t = 0.
EXPORT void loop_start() {
    loop.reset();
    loop_controller = make_controller<double>(setup.controller, setup.common);
    loop = std::make_unique<RunningLoop>(setup, *loop_controller);
    saved.resize(loop->saved_size());
}
// The loop at t = 0 with the caller's law. reports: count of its reported numbers; rate_place: index of the angular
// rate among them, or -1.
EXPORT void loop_start_law(std::size_t reports, std::ptrdiff_t rate_place) {
    loop.reset();
    auto law = std::make_unique<CallersLaw>(reports, rate_place);
    law->begin({}, setup.common);
    loop_controller = std::move(law);
    loop = std::make_unique<RunningLoop>(setup, *loop_controller, false);
}
// The coming sample.
EXPORT double loop_step() { return static_cast<double>(loop->step()); }
// The coming samples into `rows`, with room for those that `every` divides, and how many columns of the device.
// Returns how many samples there were: fewer where the motion diverges. The loop is that of any device: of two the
// module would be larger.
EXPORT int loop_run(int samples, double every, double* rows, std::size_t device) {
    const std::int64_t first = loop->step();
    loop->run(samples, [&](const auto& at) {
        if (at.step % static_cast<std::int64_t>(every) == 0) {
            write_any_row(at, *loop_controller, device,
                          [&](std::size_t width) { return std::exchange(rows, rows + width); });
        }
    });
    return static_cast<int>(loop->step() - first);
}
// Continues with the numbers that `setting_values` now has. Returns false if a running loop cannot.
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
EXPORT unsigned char* loop_saved() { return saved.data(); }
EXPORT std::size_t loop_saved_size() { return saved.size(); }
EXPORT void loop_save() { loop->save(saved.data()); }
EXPORT bool loop_restore() { return loop->restore(saved.data(), saved.size()); }
#endif

EXPORT void controller_start() {
    controller = make_guarded(make_controller<Number>(setup.controller, setup.common), setup.common);
    saved.resize(controller->saved_size());
}
// Key of the settings from which the controller was made.
EXPORT std::uint32_t controller_key() {
    const std::size_t kind = setup.controller.index();
    std::uint32_t sum = checksum(&kind, sizeof kind);
    const SensingNumbers sensing = sensing_of(setup.common);
    sum = checksum(sensing.data(), sizeof sensing, sum);
    sum = checksum(values.data(), sizeof values, sum);
    if (const ExponentialSum* const kernel = kernel_of(setup.controller)) {
        sum = checksum(kernel->poles.data(), kernel->count * sizeof kernel->poles[0], sum);
        sum = checksum(kernel->weights.data(), kernel->count * sizeof kernel->weights[0], sum);
    }
    return sum;
}
// One step, from the motion measured now; without a sensor of velocity that is not looked at. Returns the force.
EXPORT const double* controller_step(double x, double y, double vx, double vy) {
    const Vec2<double> found = controller->step({.position = {x, y}, .velocity = {vx, vy}});
    force = {found.x(), found.y()};
    return force.data();
}
// The report after the last step.
EXPORT const double* controller_report() {
    report = controller->report();
    return report.data();
}
// The guard's verdict on the last sample.
EXPORT int controller_status() { return static_cast<int>(controller->status()); }
// The saved state, a checksum and the state: where it is, and how long; written by controller_save, and to be filled in
// before controller_restore, which returns whether it is as it was saved.
EXPORT unsigned char* controller_saved() { return saved.data(); }
EXPORT std::size_t controller_saved_size() { return saved.size(); }
EXPORT void controller_save() { controller->save(saved.data()); }
EXPORT bool controller_restore() { return controller->restore(saved.data(), saved.size()); }
