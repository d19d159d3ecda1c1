/* Counts the instructions of a step, under QEMU with -icount shift=0, where the 25 MHz SysTick moves once in 40 of them. They
 * are instructions, not cycles, which QEMU does not know. Prints mean and most. */
#include "fracgyro.h"

#include <stdint.h>
#include <stdio.h>

#define SYSTICK ((volatile uint32_t*)0xE000E010)
/* As many repeats as instructions per tick: exact to the instruction. */
enum { per_tick = 40, repeats = 40, period = 64, settled = 150 * period };

static fracgyro_state state, before;
static fracgyro_vector force;

static uint32_t ticks(void) { return 0xFFFFFFU - SYSTICK[2]; }

/* Somewhere near the reference, different at every sample; every 64 of them alike. */
static fracgyro_motion motion_at(uint32_t n) {
    const uint32_t a = (n % 64 + 1) * 2654435761U;
    const fracgyro_number x = (fracgyro_number)(int32_t)a / 2147483648U, y = (fracgyro_number)(int32_t)(a << 8) / 2147483648U;
    const fracgyro_motion motion = {{x, y}, {y, x}};
    return motion;
}

/* Of one step from the present state, which is left as it was. */
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

int main(void) {
    SYSTICK[1] = 0xFFFFFF;
    SYSTICK[2] = 0;
    SYSTICK[0] = 5;
    fracgyro_init(&state);
    /* Of the first 64 steps, and of 64 once what only the start needs is past, two in each evaluating the reference anew: the
     * mean of the later, and the most of any, those of a fault included. */
    uint32_t most = 0, total = 0;
    for (uint32_t n = 0; n < settled + period; ++n) {
        const fracgyro_motion motion = motion_at(n);
        if (n < period || n >= settled) {
            const uint32_t spent = of_one_step(&motion, 1) - of_one_step(&motion, 0);
            most = spent > most ? spent : most;
            total += n < settled ? 0 : spent;
        }
        fracgyro_step(&state, &motion, &force);
    }
    const fracgyro_motion lost = {{0, 0}, {0, (fracgyro_number)1e30}};
    const uint32_t spent = of_one_step(&lost, 1) - of_one_step(&lost, 0);
    most = spent > most ? spent : most;
    printf("%lu %lu\n", (unsigned long)(total / period), (unsigned long)most);
    return 0;
}
