/* Answers every motion in the file "motion" (x, y and their rates as fracgyro_number, one sample after another) with a
   row in the file "answer": status, force x, y, and what the controller reported before it. For comparing processors
   bit by bit. */
#include "fracgyro.h"

#include <stdio.h>

typedef struct {
    fracgyro_number status;
    fracgyro_vector force;
    fracgyro_report report;
} answer;

int main(void) {
    static fracgyro_state state;
    static fracgyro_motion motions[64];
    static answer answers[64];
    FILE* in = fopen("motion", "rb");
    FILE* out = fopen("answer", "wb");
    if (!in || !out) {
        return 1;
    }
    fracgyro_init(&state);
    size_t count;
    while ((count = fread(motions, sizeof motions[0], 64, in)) > 0) {
        for (size_t i = 0; i < count; ++i) {
            fracgyro_read_report(&state, &answers[i].report);
            answers[i].status = (fracgyro_number)fracgyro_step(&state, &motions[i], &answers[i].force);
        }
        if (fwrite(answers, sizeof answers[0], count, out) != count) {
            return 1;
        }
    }
    return fclose(out) == 0 ? 0 : 1;
}
