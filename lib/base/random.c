/* Random numbers by counting (SplitMix64 of key and index), and the usual
 * distributions of them. */
#include "lib/base/random.h"

#include <math.h>

uint64_t random_mix(uint64_t x)
{
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

uint64_t random_name(const char *name)
{
    uint64_t h = 0xcbf29ce484222325u;

    for (; *name; name++)
        h = (h ^ (unsigned char)*name) * 0x100000001b3u;
    return h;
}

void random_init(struct random *r, uint64_t seed, const char *name)
{
    r->key = random_mix(random_mix(seed) ^ random_name(name));
    r->next = 0;
}

uint64_t random_u64(struct random *r)
{
    /* Two rounds: keys and indices are both small numbers in practice. */
    return random_mix(r->key ^ random_mix(r->next++));
}

double random_uniform(struct random *r)
{
    return (double)(random_u64(r) >> 11) * 0x1p-53;
}

double random_range(struct random *r, double lo, double hi)
{
    return lo + (hi - lo) * random_uniform(r);
}

float random_float(struct random *r, double lo, double hi)
{
    return (float)random_range(r, lo, hi);
}

/* Box-Muller; both draws are spent, so value i always costs two indices. */
double random_normal(struct random *r)
{
    double u = 1.0 - random_uniform(r); /* (0,1] */
    double v = random_uniform(r);

    return sqrt(-2 * log(u)) * cos(2 * M_PI * v);
}

uint32_t random_below(struct random *r, uint32_t n)
{
    /* The high half of a 32x64 product: bias below n / 2^64. */
    return (uint32_t)(((unsigned __int128)random_u64(r) * n) >> 64);
}

bool random_chance(struct random *r, double p)
{
    return random_uniform(r) < p;
}
