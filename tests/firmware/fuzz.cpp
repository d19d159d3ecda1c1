// For libFuzzer: any bytes are motions, saves and damage, and the C interface must keep its promises through them. The
// firmware is exported with controller.force_limit = 1000, with guard.checked or without, and with any [device].
#include "fracgyro.h"

#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstring>
#include <initializer_list>
#include <type_traits>

namespace {

void must(bool promise) {
    if (!promise) {
        __builtin_trap();
    }
}

struct Answer {
    fracgyro_status status;
    fracgyro_vector force;
    fracgyro_report report;
};

Answer answer(fracgyro_state& state, const fracgyro_motion& motion) {
    Answer a{};
    a.status = fracgyro_step(&state, &motion, &a.force);
    fracgyro_read_report(&state, &a.report);
    return a;
}

// Count of report numbers that are frozen while no sample is accepted: all except those on the quality of the rate.
using Report = fracgyro_exported::Controller::Report;
constexpr bool says_how_well = std::derived_from<Report, fracgyro::CompositeReport<fracgyro_number>>;
using Resting = std::conditional_t<says_how_well, fracgyro::AdaptiveReport<fracgyro_number>, Report>;
constexpr std::size_t resting = fracgyro::width_of<Resting, fracgyro::Reported::between_steps>();

bool same(const void* a, const void* b, std::size_t size) { return std::memcmp(a, b, size) == 0; }

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    fracgyro_state state;
    fracgyro_init(&state);
    Answer last{};
    fracgyro_read_report(&state, &last.report);
    fracgyro_motion motion{};
    for (const std::uint8_t* end = data + size; data < end;) {
        const std::uint8_t what = *data++;
        if (what >= 0x80) {  // saved, another state restored from it answers alike; damaged, it is refused
            fracgyro_saved saved;
            fracgyro_save(&state, &saved);
            fracgyro_state other;
            fracgyro_init(&other);
            must(fracgyro_restore(&other, &saved) == FRACGYRO_OK);
            fracgyro_state twin = state;
            const Answer a = answer(twin, motion), b = answer(other, motion);
            must(a.status == b.status && same(&a.force, &b.force, sizeof a.force));
            saved.state.bytes[what * 17 % sizeof saved.state] ^= 1U << what % 3;
            must(fracgyro_restore(&state, &saved) == FRACGYRO_REFUSED);
            continue;
        }
        // Bits 3 to 6: which of the four numbers are new; bit 0: in multiples of 1/32; bits 1, 2: for how many steps.
        for (fracgyro_number* number :
             {&motion.position.x, &motion.position.y, &motion.velocity.x, &motion.velocity.y}) {
            const int place = static_cast<int>(number - &motion.position.x);
            if ((what >> (3 + place) & 1) == 0) {
                continue;
            }
            if ((what & 1) != 0 && end - data >= 1) {
                *number = static_cast<fracgyro_number>(static_cast<std::int8_t>(*data++)) / 32;
            } else if (end - data >= static_cast<std::ptrdiff_t>(sizeof *number)) {
                std::memcpy(number, data, sizeof *number);
                data += sizeof *number;
            }
        }
        for (int repeat = 0; repeat <= (what & 6) * 8; ++repeat) {
            const Answer now = answer(state, motion);
            must(std::fabs(now.force.x) <= 1000 && std::fabs(now.force.y) <= 1000);  // false for NaN
            fracgyro_number size = std::fabs(motion.position.x) + std::fabs(motion.position.y);
            if (fracgyro::measures_velocity<fracgyro_exported::Controller>) {  // else it is ignored
                size += std::fabs(motion.velocity.x) + std::fabs(motion.velocity.y);
            }
            const bool answered = now.status == FRACGYRO_OK || now.status == FRACGYRO_SATURATED;
            const bool lost = now.status == FRACGYRO_LOST || now.status == FRACGYRO_RESTARTED;
            const bool held = now.status == FRACGYRO_NOT_FINITE || now.status == FRACGYRO_OUT_OF_RANGE ||
                              now.status == FRACGYRO_IMPLAUSIBLE;
            must(answered || lost || held);
            if (!std::isfinite(size)) {
                must(now.status == FRACGYRO_NOT_FINITE || now.status == FRACGYRO_LOST);
            } else if (size < 0.99e6F) {
                must(now.status != FRACGYRO_NOT_FINITE && now.status != FRACGYRO_OUT_OF_RANGE);
            } else if (size > 1.01e6F) {
                must(now.status == FRACGYRO_OUT_OF_RANGE || now.status == FRACGYRO_LOST);
            }
            if (held) {
                must(same(&now.force, &last.force, sizeof now.force));
            }
            if (held || now.status == FRACGYRO_LOST) {  // estimates are frozen
                must(same(&now.report, &last.report, resting * sizeof(fracgyro_number)));
            }
            last = now;
        }
    }
    return 0;
}
