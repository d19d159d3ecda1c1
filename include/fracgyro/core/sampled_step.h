/* One sample of a sum of first-order recursions, which is one step of a fractional operator or a fractional PID.
   C99 and C++, for any type fracgyro_number: sampled.hpp includes it, and `fracgyro export operator` copies it. */

typedef struct {
    fracgyro_number decay; /* change of the memory per sample, relative to itself, below 0; 1 + decay may round to 1 */
    fracgyro_number weight;
} fracgyro_term;

typedef struct {
    int of_values, of_changes; /* terms driven by the last sample, then terms driven by the change to this one */
    fracgyro_number now, past, change, past_change; /* weights of this sample, the last, the change, the last change */
    fracgyro_number trace; /* below the rounding of any relevant sample; keeps the memory from becoming subnormal */
} fracgyro_gains;

typedef struct {
    fracgyro_number sample, change;
} fracgyro_past;

/* Adds the terms' outputs to `sum`, then `input` to their memory. */
static inline fracgyro_number fracgyro_run_terms(const fracgyro_term* term, fracgyro_number* memory, int count,
                                                 fracgyro_number input, fracgyro_number sum) {
    for (int j = 0; j < count; ++j) {
        const fracgyro_number held = memory[j];
        sum = sum + term[j].weight * held;
        memory[j] = held + (term[j].decay * held + input);
    }
    return sum;
}

static inline fracgyro_number fracgyro_step_sample(const fracgyro_gains* gains, const fracgyro_term* term,
                                                   fracgyro_number* memory, fracgyro_past* past,
                                                   fracgyro_number sample) {
    const int values = gains->of_values;
    const fracgyro_number change = sample - past->sample;
    fracgyro_number sum = (gains->now * sample + gains->past * past->sample) +
                          (gains->change * change + gains->past_change * past->change);
    sum = fracgyro_run_terms(term, memory, values, past->sample + gains->trace, sum);
    sum = fracgyro_run_terms(term + values, memory + values, gains->of_changes, change + gains->trace, sum);
    past->sample = sample;
    past->change = change;
    return sum;
}
