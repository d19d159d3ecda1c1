/* What a control loop looks like. Put your sensors and actuators in place of the two functions. */
#include "fracgyro.h"

#include <math.h>
#include <stdio.h>

/* A mass at rest one unit off centre, and a sensor that once loses contact. */
static void read_motion(int tick, fracgyro_motion* motion) {
    const fracgyro_motion rest = {{1, 0}, {0, 0}};
    *motion = rest;
    if (tick == 2) {
        motion->position.x = NAN;
    }
}

static void apply_force(int tick, fracgyro_status status, fracgyro_vector force) {
    printf("tick %d: status %d, force %.6f %.6f\n", tick, (int)status, (double)force.x, (double)force.y);
}

int main(void) {
    fracgyro_state state;
    fracgyro_init(&state);

    /* In a timer interrupt, every FRACGYRO_STEP_SECONDS. */
    for (int tick = 0; tick < 5; ++tick) {
        fracgyro_motion motion;
        fracgyro_vector force;
        read_motion(tick, &motion);
        const fracgyro_status status = fracgyro_step(&state, &motion, &force);
        apply_force(tick, status, force);
    }

    fracgyro_report report; /* fracgyro_coefficients.h names its members */
    fracgyro_read_report(&state, &report);
    printf("%d numbers reported\n", FRACGYRO_REPORTED);

    fracgyro_saved saved; /* to flash, say */
    fracgyro_save(&state, &saved);
    return fracgyro_restore(&state, &saved) == FRACGYRO_OK ? 0 : 1;
}
