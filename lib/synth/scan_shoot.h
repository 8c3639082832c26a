/* Frames of a person of the scans with their truth in the head's terms. */
#ifndef SPID_SYNTH_SCAN_SHOOT_H
#define SPID_SYNTH_SCAN_SHOOT_H

#include "lib/head/lbs.h"
#include "lib/synth/motion.h"
#include "lib/synth/scan_film.h"

/* A person ready to be taken, with the background behind them. */
struct scan_cast {
    struct figure figure;
    struct identity id;
    struct follow follow;
    float beta[PERSONA_SHAPE_MAX];
    float *wall;                /* (3,size,size) */
    int size;
};

struct scan_crew {              /* one worker's */
    struct scan_stage stage;
    struct scan_film film;
    float *verts, *bend;        /* (V,3) */
};

int scan_crew_init(struct scan_crew *c, const struct head *h, int size,
                   struct error *err);
void scan_crew_release(struct scan_crew *c);

int scan_cast_init(struct scan_cast *c, const struct scan_assets *a,
                   const struct head *h, uint64_t seed, uint64_t index,
                   float effects, int size, struct error *err);
void scan_cast_release(struct scan_cast *c);

/* The cast at `time` seconds: the print, the true motion, the 68 landmarks in
 * pixels and the driven vertices (crew->verts). */
int scan_shoot(const struct scan_print *out, struct synth_motion *m,
               float lmk[68][2], struct scan_crew *crew,
               const struct scan_cast *c, uint64_t frame, double time,
               struct error *err);

#endif
