/* Counts the instructions of a step of an exported operator under QEMU with -icount shift=0, where the 25 MHz SysTick
   moves once in 40 of them. Its call counts, the loop around it does not. */
#include "operator.h"

#include <stdint.h>
#include <stdio.h>

#define SYSTICK ((volatile uint32_t*)0xE000E010)
enum { per_tick = 40, steps = 4000 };

static operator_state state;
static volatile NUMBER sample, output;

__attribute__((noinline)) static NUMBER nothing(operator_state* s, NUMBER x) {
    __asm volatile("" ::"r"(s));
    return x;
}

static uint32_t ticks(NUMBER (*step)(operator_state*, NUMBER)) {
    const uint32_t start = SYSTICK[2];
    for (int n = 0; n < steps; ++n) {
        output = step(&state, sample);
    }
    return (start - SYSTICK[2]) & 0xFFFFFFU; /* it counts down, in 24 bits */
}

int main(void) {
    SYSTICK[1] = 0xFFFFFF;
    SYSTICK[2] = 0;
    SYSTICK[0] = 5;
    operator_reset(&state);
    sample = 1;
    const uint32_t spent = ticks(operator_step) - ticks(nothing);
    /* `nothing` consists of one return instruction, which a step also has. */
    printf("%lu\n", (unsigned long)(spent * per_tick / steps + 1));
    return 0;
}
