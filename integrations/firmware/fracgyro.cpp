// The C interface. The control law itself is in include/fracgyro/controllers.
#include "fracgyro.h"

#include <cstring>
#include <new>
#include <type_traits>

namespace {

using fracgyro_exported::coefficients;
using fracgyro_exported::Controller;
using Number = Controller::Value;
using Guard = fracgyro::Guard<Controller>;
using State = Guard::State;

static_assert(sizeof(State) <= FRACGYRO_STATE_SIZE && alignof(State) <= FRACGYRO_STATE_ALIGNMENT);
static_assert(std::is_trivially_copyable_v<State> && std::is_same_v<Number, fracgyro_number>);
static_assert(fracgyro::width_of<Guard::Report, fracgyro::Reported::between_steps>() == FRACGYRO_REPORTED);
static_assert(FRACGYRO_REPORTED == 0 || sizeof(fracgyro_report) == FRACGYRO_REPORTED * sizeof(fracgyro_number));
static_assert(static_cast<int>(fracgyro::Status::ok) == FRACGYRO_OK);
static_assert(static_cast<int>(fracgyro::Status::saturated) == FRACGYRO_SATURATED);
static_assert(static_cast<int>(fracgyro::Status::not_finite) == FRACGYRO_NOT_FINITE);
static_assert(static_cast<int>(fracgyro::Status::out_of_range) == FRACGYRO_OUT_OF_RANGE);
static_assert(static_cast<int>(fracgyro::Status::restarted) == FRACGYRO_RESTARTED);
static_assert(static_cast<int>(fracgyro::Status::implausible) == FRACGYRO_IMPLAUSIBLE);
static_assert(static_cast<int>(fracgyro::Status::lost) == FRACGYRO_LOST);

State& in(fracgyro_state* state) { return *std::launder(reinterpret_cast<State*>(state->bytes)); }
const State& in(const fracgyro_state* state) { return *std::launder(reinterpret_cast<const State*>(state->bytes)); }

std::uint32_t checksum(const fracgyro_state& state) { return fracgyro::checksum(state.bytes, sizeof state.bytes); }

}  // namespace

void fracgyro_init(fracgyro_state* state) {
    std::memset(state, 0, sizeof *state);
    new (state->bytes) State{};
}

// Flattened, the coefficients meet the law as constants: branches that they decide vanish, and one stack frame serves
// all.
[[gnu::flatten]] fracgyro_status fracgyro_step(fracgyro_state* state, const fracgyro_motion* motion,
                                               fracgyro_vector* force) {
    State& s = in(state);
    Guard::step(
        s, coefficients,
        {.position = {motion->position.x, motion->position.y}, .velocity = {motion->velocity.x, motion->velocity.y}});
    force->x = s.force.x();
    force->y = s.force.y();
    return static_cast<fracgyro_status>(s.status);
}

[[gnu::flatten]] void fracgyro_acted(fracgyro_state* state, const fracgyro_vector* force) {
    Guard::acted(in(state), coefficients, {force->x, force->y});
}

#if FRACGYRO_WORDS
fracgyro_status fracgyro_step_words(fracgyro_state* state, const fracgyro_words* position,
                                    const fracgyro_words* velocity, fracgyro_words* drive) {
    using Converters = fracgyro::Converters<Number>;
    constexpr const Converters::Coefficients& c = fracgyro_exported::converters;
    const auto q = Converters::motion(c.position, {position->x, position->y});
    fracgyro_motion motion = {{q.x(), q.y()}, {0, 0}};
    if (FRACGYRO_VELOCITY_SENSED) {
        const auto v = Converters::motion(c.velocity, {velocity->x, velocity->y});
        motion.velocity = {v.x(), v.y()};
    }
    fracgyro_vector force;
    const fracgyro_status status = fracgyro_step(state, &motion, &force);
    const auto driven = Converters::drive(c, {force.x, force.y}, q);
    const auto words = driven.words();
    *drive = {words.x, words.y};
    if (FRACGYRO_ROUNDED_FORCE_KNOWN) {
        const fracgyro_vector acting = {driven.force.x(), driven.force.y()};
        fracgyro_acted(state, &acting);
    }
    return status;
}
#endif

[[gnu::flatten]] void fracgyro_read_report(const fracgyro_state* state, fracgyro_report* report) {
    auto* number = reinterpret_cast<fracgyro_number*>(report);
    fracgyro::for_each_number<fracgyro::Reported::between_steps>(Guard::report(in(state), coefficients),
                                                                 [&](Number found) { *number++ = found; });
}

void fracgyro_save(const fracgyro_state* state, fracgyro_saved* saved) {
    std::memcpy(&saved->state, state, sizeof *state);
    saved->key = FRACGYRO_KEY;
    saved->checksum = checksum(saved->state);
}

fracgyro_status fracgyro_restore(fracgyro_state* state, const fracgyro_saved* saved) {
    if (saved->key != FRACGYRO_KEY || saved->checksum != checksum(saved->state) ||
        !Guard::sound(in(&saved->state), coefficients)) {
        return FRACGYRO_REFUSED;
    }
    std::memcpy(state, &saved->state, sizeof *state);
    return FRACGYRO_OK;
}
