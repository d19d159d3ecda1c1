/* Counts the instructions of a step, under QEMU with -icount shift=0, where the 25 MHz SysTick moves once in 40 of
   them. They are instructions, not cycles, which QEMU does not know. Prints mean and most. */
#include "fracgyro.h"

#include <stdint.h>
#include <stdio.h>

#ifndef FRACGYRO_COUNTED_STEPS
#define FRACGYRO_COUNTED_STEPS 64
#endif
#define SYSTICK ((volatile uint32_t*)0xE000E010)
/* One repeat for each instruction of a tick, so that counts are exact to the instruction. */
enum { per_tick = 40, repeats = 40, period = FRACGYRO_COUNTED_STEPS, settled = 9600 };

static fracgyro_state state, before;
static fracgyro_vector force;

static uint32_t ticks(void) { return 0xFFFFFFU - SYSTICK[2]; }

/* The nominal springs, moved by the controller's force: x and y, then their rates. */
static const fracgyro_number springs[3] = FRACGYRO_NOMINAL_STIFFNESS;
static fracgyro_motion moved(fracgyro_motion m) {
    const fracgyro_number h = (fracgyro_number)(FRACGYRO_STEP_SECONDS * FRACGYRO_VELOCITY_UNIT / FRACGYRO_LENGTH_UNIT);
    const fracgyro_vector q = m.position, v = m.velocity;
    m.velocity.x += h * (force.x - springs[0] * (q.x + h / 2 * v.x) - springs[1] * (q.y + h / 2 * v.y));
    m.velocity.y += h * (force.y - springs[1] * (q.x + h / 2 * v.x) - springs[2] * (q.y + h / 2 * v.y));
    m.position.x += h / 2 * (v.x + m.velocity.x);
    m.position.y += h / 2 * (v.y + m.velocity.y);
    return m;
}

/* Instructions of one step from the present state, which does not change. */
static uint32_t of_one_step(const fracgyro_motion* motion, int count) {
    before = state;
    const uint32_t start = ticks();
    for (int i = 0; i < repeats; ++i) {
        state = before;
        for (int k = 0; k < count; ++k) {
            fracgyro_step(&state, motion, &force);
        }
    }
    const uint32_t spent = (ticks() - start) & 0xFFFFFFU; /* the counter has 24 bits */
    state = before;
    return spent * per_tick / repeats;
}
static uint32_t most, total;
static void count(const fracgyro_motion* motion) {
    const fracgyro_vector held = force;
    const uint32_t spent = of_one_step(motion, 1) - of_one_step(motion, 0);
    most = spent > most ? spent : most;
    total += spent;
    force = held;
}

int main(void) {
    SYSTICK[1] = 0xFFFFFF;
    SYSTICK[2] = 0;
    SYSTICK[0] = 5;
    fracgyro_init(&state);
    /* Counts the first steps of a period, 64 unless the header has another, and those of one after the start-up; in 64
       two steps evaluate the reference again. Prints the mean of the later group, and
       the maximum of all steps, including those after faults. */
    fracgyro_motion motion = {{(fracgyro_number)0.5, (fracgyro_number)0.5}, {0, 0}};
    for (uint32_t n = 0; n < settled + period; ++n) {
        total = n < settled ? 0 : total;
        if (n < period || n >= settled) {
            count(&motion);
        }
        fracgyro_step(&state, &motion, &force);
        motion = moved(motion);
    }
    const uint32_t mean = total / period;
    const fracgyro_motion wild = {{(fracgyro_number)1e4, 0}, {0, 0}}, lost = {{0, 0}, {0, (fracgyro_number)1e30}};
    count(&wild);
    for (int n = 0; n < period; ++n) { /* until the controller restarts, and beyond */
        count(&lost);
        fracgyro_step(&state, &lost, &force);
    }
    printf("%lu %lu\n", (unsigned long)mean, (unsigned long)most);
    return 0;
}
