/* Counter-based random numbers: a value depends on its key and index only,
 * never on what was drawn before, so any thread count gives the same bytes. */
#ifndef SPID_BASE_RANDOM_H
#define SPID_BASE_RANDOM_H

#include <stdbool.h>
#include <stdint.h>

/* SplitMix64's finaliser applied to x + the golden gamma. */
uint64_t random_mix(uint64_t x);

/* FNV-1a of a NUL-terminated string: a key from a name. */
uint64_t random_name(const char *name);

/* A stream of numbers: element i of the sequence named by key. */
struct random {
    uint64_t key;
    uint64_t next; /* index of the next value */
};

/* Sequence for seed and name; sub-sequences by random_init(r, key, name). */
void random_init(struct random *r, uint64_t seed, const char *name);

/* All 64 bits; every other draw is made of this one. */
uint64_t random_u64(struct random *r);
double random_uniform(struct random *r);                 /* [0,1) */
double random_range(struct random *r, double lo, double hi);
/* The same as random_range, rounded to float. */
float random_float(struct random *r, double lo, double hi);
double random_normal(struct random *r);                  /* N(0,1) */
uint32_t random_below(struct random *r, uint32_t n);     /* 0..n-1, n > 0 */
bool random_chance(struct random *r, double p);          /* true with p */

#endif
