/* Example of a control loop, on a simulated gyroscope. Replace read_motion and apply_force by your sensors and
   actuators. */
#include "fracgyro.h"

#include <stdio.h>

/* The gyroscope of the scenario, without noise: from x, y, their rates and the force to the motion one step later. */
static const fracgyro_number gyroscope[4][6] = FRACGYRO_EXAMPLE_GYROSCOPE;
static fracgyro_number motion_now[4] = FRACGYRO_EXAMPLE_START;

static void read_motion(fracgyro_motion* motion) {
    motion->position.x = motion_now[0];
    motion->position.y = motion_now[1];
    motion->velocity.x = motion_now[2];
    motion->velocity.y = motion_now[3];
}

static void apply_force(fracgyro_vector force) {
    const fracgyro_number from[6] = {motion_now[0], motion_now[1], motion_now[2], motion_now[3], force.x, force.y};
    for (int i = 0; i < 4; ++i) {
        motion_now[i] = 0;
        for (int j = 0; j < 6; ++j) {
            motion_now[i] += gyroscope[i][j] * from[j];
        }
    }
}

int main(void) {
    static fracgyro_state state;
    fracgyro_init(&state);

    printf("status 0: computed, 1: the force is at its limit; README.md has the others\n");
    /* In a timer interrupt, every FRACGYRO_STEP_SECONDS. */
    for (int tick = 0; tick <= 1000; ++tick) {
        fracgyro_motion motion;
        fracgyro_vector force;
        read_motion(&motion);
        const fracgyro_status status = fracgyro_step(&state, &motion, &force);
        apply_force(force);
        if (tick % 100 == 0) {
            printf("tick %d: status %d, position %.6f %.6f, force %.6f %.6f\n", tick, (int)status,
                   (double)motion.position.x, (double)motion.position.y, (double)force.x, (double)force.y);
        }
    }

    /* The controller's report. Your own code reads the members: report.rate_estimate, for example. */
    fracgyro_report report;
    fracgyro_read_report(&state, &report);
    static const char* const names[] = FRACGYRO_EXAMPLE_NAMES;
    for (int i = 0; i < FRACGYRO_REPORTED; ++i) {
        printf("%s: %g\n", names[i], (double)((const fracgyro_number*)&report)[i]);
    }

    fracgyro_saved saved; /* to flash, say */
    fracgyro_save(&state, &saved);
    return fracgyro_restore(&state, &saved) == FRACGYRO_OK ? 0 : 1;
}
