/* Light from a panorama: its slow part as harmonics, its strongest places as
 * lamps with shadows, and mirrored pictures of it for three roughnesses.
 *
 * World: y up; the panorama's middle column lies at -z.  A camera sees the
 * world turned by `turn` about y: camera (x, y, z) = x right, y down,
 * z forward. */
#ifndef SPID_LAB_PEOPLE_SCAN_LIGHT_H
#define SPID_LAB_PEOPLE_SCAN_LIGHT_H

#include "lib/base/arena.h"
#include "lib/base/harmonics.h"

#define LIGHT_LAMPS 3
#define LIGHT_LEVELS 4

struct lamp {
    float dir[3];               /* unit, towards it */
    float rgb[3];               /* irradiance of a surface facing it */
    float size;                 /* radians, half its width */
};

/* A panorama made ready: level 0 sharp, then blurred as ever rougher
 * surfaces mirror it. */
struct light_map {
    int w[LIGHT_LEVELS], h[LIGHT_LEVELS];
    float *level[LIGHT_LEVELS]; /* (h,w,3), mean luminance 1 */
    int nlamp;
    struct lamp lamp[LIGHT_LAMPS];      /* world frame, turn 0 */
    float *calm;                /* (h[2],w[2],3) level without the lamps */
};

/* What falls on one person, camera frame. */
struct light {
    const struct light_map *map;
    float turn, gain[3];        /* exposure and colour */
    struct harmonic2 sky[3];    /* radiance per channel, lamps left out */
    int nlamp;
    struct lamp lamp[LIGHT_LAMPS];
};

/* Prepare a panorama rgb (h,w,3), linear, first row the zenith; w = 2 h. */
int light_map_make(struct light_map *m, const float *rgb, int w, int h,
                   struct arena *memory, struct error *err);
/* Read and prepare one: see panorama_read for what is refused. */
int light_map_load(struct light_map *m, const char *path, struct arena *memory,
                   struct error *err);

/* m (borrowed) turned by `turn` radians about the vertical, times gain (3). */
void light_init(struct light *l, const struct light_map *m, float turn,
                const float gain[3]);

/* Radiance from direction d (camera frame, any length), level 0 to
 * LIGHT_LEVELS - 1, between two of them by fractions. */
void light_mirror(float rgb[3], const struct light *l, const float d[3],
                  float level);

/* l (3), camera frame, at most 1 long: what faces the camera and has normal n
 * has nearest to 1 + l.n times its mean luminance, shadows left out. */
void light_slope(float slope[3], const struct light *l);
/* h turned: o(d) = h(r^T d), r row-major. */
void harmonic2_turn(struct harmonic2 *o, const struct harmonic2 *h,
                    const float r[9]);

/* How much of the sphere a point sees, weighted by the cosine: moments of
 * visible cosine over pi (1, d, dd^T - I/3). */
float harmonic2_moments(const struct harmonic2 *h, const float m[10]);

#endif
