/* Names for the arrays of a controller in C (C99), which fracgyro.native.Law runs:

       void law(const double* in, double* state, const double* parameters, double* out);

   A pair has x first: in[FRACGYRO_POSITION] is x and in[FRACGYRO_POSITION + 1] is y. Units are SI if run.units is SI,
   otherwise nondimensional. */
#ifndef FRACGYRO_LAW_H
#define FRACGYRO_LAW_H

/* Places in `in`. */
enum {
    FRACGYRO_TIME = 0,
    FRACGYRO_POSITION = 1,
    FRACGYRO_VELOCITY = 3,
    FRACGYRO_REFERENCE = 5,
    FRACGYRO_REFERENCE_VELOCITY = 7,
    FRACGYRO_REFERENCE_ACCELERATION = 9,
    FRACGYRO_INPUTS = 11 /* the number of doubles in `in` */
};

/* Places in `out`. */
enum {
    FRACGYRO_FORCE = 0,
    FRACGYRO_REPORTS = 2 /* the first of the reports, one double each */
};

#endif
