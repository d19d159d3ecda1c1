/* Write the outputs of an exported operator for the samples in the file "samples" to the file "answer". */
#include "operator.h"

#include <stdio.h>

int main(void) {
    static operator_state state;
    NUMBER sample;
    FILE* in = fopen("samples", "rb");
    FILE* out = fopen("answer", "wb");
    if (!in || !out) {
        return 1;
    }
    operator_reset(&state);
    while (fread(&sample, sizeof sample, 1, in) == 1) {
        const NUMBER found = operator_step(&state, sample);
        if (fwrite(&found, sizeof found, 1, out) != 1) {
            return 1;
        }
    }
    return fclose(out) == 0 ? 0 : 1;
}
