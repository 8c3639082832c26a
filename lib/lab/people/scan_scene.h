/* Frames of a person of the scans with their truth in the head's terms. */
#ifndef SPID_LAB_PEOPLE_SCAN_SCENE_H
#define SPID_LAB_PEOPLE_SCAN_SCENE_H

#include "lib/head/lbs.h"
#include "lib/head/motion.h"
#include "lib/lab/people/scan_film.h"

#define SCENE_SHAPES 512        /* of any head; those past the scans are 0 */

/* A person ready to be rendered, with the background behind them. */
struct scan_scene {
    struct arena memory;
    struct figure figure;
    struct identity id;
    struct follow follow;
    float beta[SCENE_SHAPES];
    float *wall;                /* (3,size,size) */
    int size;
};

struct scan_worker {              /* one worker's */
    struct arena memory;
    struct scan_stage stage;
    struct scan_film film;
    float *verts, *bend;        /* (V,3) */
    double *exact;              /* (V,3) verts in double */
};

/* One thread's memory for people of head h (borrowed) at size x size. */
int scan_worker_init(struct scan_worker *c, const struct head *h, int size,
                   struct error *err);
/* Free what it holds; zeroed then. */
void scan_worker_release(struct scan_worker *c);

/* Person `index` of the seed: looks, clothes and light from a (borrowed), in
 * pictures of size x size; effects from 0, a perfect camera, to 1. */
int scan_scene_init(struct scan_scene *c, const struct scan_assets *a,
                   const struct head *h, uint64_t seed, uint64_t index,
                   float effects, int size, struct error *err);
/* Free what it holds; zeroed then. */
void scan_scene_release(struct scan_scene *c);

/* The scene at `time` seconds, the head as it turns or (not NULL) at `turn`:
 * the print, the true motion, the head's 68
 * landmarks and the labels' LANDMARK_FACE on the scans' own skin in pixels,
 * and the driven vertices (worker->verts). */
int scan_scene_render(const struct scan_print *out, struct motion *m,
               float lmk[68][2], float (*points)[2],
               struct scan_worker *worker,
               const struct scan_scene *c, uint64_t frame, double time,
               const struct synth_turn *turn, struct error *err);

#endif
