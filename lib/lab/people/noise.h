/* Smooth noise.  In space: one shared lattice of four random bytes a cell,
 * repeated every 64 cells, read with smooth trilinear weights.  In time:
 * random numbers by slot of a track, joined by splines. */
#ifndef SPID_LAB_PEOPLE_NOISE_H
#define SPID_LAB_PEOPLE_NOISE_H

#include <stdint.h>

/* Fill the lattice: once, the same in every run, before the first parallel
 * region that reads it. */
void noise_lattice_fill(void);

/* All four channels at p (cells), each in -1..1. */
void noise4(float out[4], const float p[3]);

/* Channel 0 only, octaves halving in size and weight; about -1..1. */
float noise_sum(float x, float y, float z, int octaves);

/* Random number 0..1 of a track in slot i. */
float noise_slot(uint64_t track, int64_t i);
/* In -1..1, with a new value every `period` seconds. */
float noise_time(uint64_t track, double time, double period);

#endif
