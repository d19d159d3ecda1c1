/* The controller for C, C99 and later. Everything is nondimensional; fracgyro_coefficients.h defines the units.
 *
 *     fracgyro_state state;
 *     fracgyro_init(&state);
 *     every FRACGYRO_STEP_SECONDS:  status = fracgyro_step(&state, &motion, &force);
 *
 * No function allocates, blocks, recurses or fails, and each returns in bounded time. A state belongs to one caller at
 * a time; any number of states may be in use. */
#ifndef FRACGYRO_H
#define FRACGYRO_H

#include "fracgyro_coefficients.h" /* fracgyro_number, fracgyro_report; the state's size; units; the scenario */

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum {
    FRACGYRO_OK = 0,
    FRACGYRO_SATURATED = 1,    /* the force is at its limit; the estimates are frozen, so that they do not wind up */
    FRACGYRO_NOT_FINITE = 2,   /* NaN or infinity was measured: the last force is held, the estimates are frozen */
    FRACGYRO_OUT_OF_RANGE = 3, /* the sample is outside the range of a gyroscope's motion: as FRACGYRO_NOT_FINITE */
    FRACGYRO_RESTARTED = 4,    /* the force was not finite, or at its limit too long: the next sample starts again */
    FRACGYRO_REFUSED = 5,      /* nothing was restored: saved by another controller, or damaged since */
    FRACGYRO_IMPLAUSIBLE = 6,  /* the plant cannot have moved so far in one step: as FRACGYRO_NOT_FINITE */
    FRACGYRO_LOST = 7          /* no sample is accepted: feedforward only, until enough samples agree */
} fracgyro_status;

typedef struct {
    fracgyro_number x, y;
} fracgyro_vector;

typedef struct {
    fracgyro_vector position, velocity;
} fracgyro_motion;

typedef struct {
    unsigned char bytes[FRACGYRO_STATE_SIZE];
} __attribute__((aligned(FRACGYRO_STATE_ALIGNMENT))) fracgyro_state;

/* A state with its checksum, for flash memory or transfer between equal processors. */
typedef struct {
    uint32_t key, checksum;
    fracgyro_state state;
} fracgyro_saved;

/* Resets the state to t = 0. */
void fracgyro_init(fracgyro_state* state);

/* The force to hold until the next step, from the motion measured now. `force` is always set and within the limit. */
fracgyro_status fracgyro_step(fracgyro_state* state, const fracgyro_motion* motion, fracgyro_vector* force);

/* The force that acts where a converter rounds that of fracgyro_step: call it after each step, for controllers that
 * filter the motion. Others ignore it. */
void fracgyro_acted(fracgyro_state* state, const fracgyro_vector* force);

#if FRACGYRO_WORDS
/* Words of converters on x and y: two's complement, right-aligned. */
typedef struct {
    int32_t x, y;
} fracgyro_words;

/* fracgyro_step and fracgyro_acted between converters: from the words of the ADC to those of the DAC, whose scales are
 * in fracgyro_coefficients.h. `velocity` may be a null pointer if FRACGYRO_VELOCITY_SENSED is 0. */
fracgyro_status fracgyro_step_words(fracgyro_state* state, const fracgyro_words* position,
                                    const fracgyro_words* velocity, fracgyro_words* drive);
#endif

/* The controller's report before the next step. Does nothing for a controller without a report. */
void fracgyro_read_report(const fracgyro_state* state, fracgyro_report* report);

/* A restored state continues as the saved one would have, bit for bit. */
void fracgyro_save(const fracgyro_state* state, fracgyro_saved* saved);
fracgyro_status fracgyro_restore(fracgyro_state* state, const fracgyro_saved* saved);

#ifdef __cplusplus
}
#endif

#endif
