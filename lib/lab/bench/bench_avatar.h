/* The synthetic person that the stages flame, branches and pipeline share. */
#ifndef SPID_LAB_BENCH_BENCH_AVATAR_H
#define SPID_LAB_BENCH_BENCH_AVATAR_H

#include <stddef.h>
#include <stdint.h>

#include "lib/avatar/baked.h"
#include "lib/base/arena.h"
#include "lib/base/densify.h"
#include "lib/avatar/baker.h"
#include "lib/lab/bench/bench.h"
#include "lib/head/lbs.h"
#include "lib/head/motion.h"
#include "lib/photo/texture.h"

#define PERSON_SIZE 512
#define PERSON_FRAMES 10    /* of the clip in memory, shown again and again */
#define PERSON_FPS (25.0 / 3)

struct bench_person {
    struct bench *b;
    struct head head;
    struct identity id;
    struct arena memory;
    double *beta;           /* (nshape) folded into it */
    struct motion motion[PERSON_FRAMES];    /* true */
    uint8_t *rgb;           /* (PERSON_FRAMES,PERSON_SIZE,PERSON_SIZE,3) */
    uint8_t *mask;          /* (PERSON_SIZE,PERSON_SIZE) of the first */
    size_t at;              /* next frame */
    struct model model;
    struct baker baker;
    struct densify dense;
    struct baked baked;
    struct texture texture;     /* the first frame's */
    float *verts;
    struct baked_move move;
};

/* The clip and the head, no avatar yet.  EX_NOINPUT without a model. */
int bench_person_open(struct bench_person *p, struct bench *b,
                      struct error *err);
/* Free what it holds. */
void bench_person_close(struct bench_person *p);

/* dir [FILE_TEMPORARY] = a new folder for temporary files, "" when there is
 * none; whoever asks removes it.  EX_CANTCREAT. */
int bench_folder(char *dir, struct error *err);
/* The clip, again and again until there are so many frames, as a picture or
 * video of that name. */
int bench_person_write(const struct bench_person *p, const char *path,
                       size_t frames, struct error *err);

/* The model's weights, on the paper's grid: 296 and 32. */
int bench_person_avatar(struct bench_person *p, enum nn_type type,
                        struct error *err);
/* Phase A with them, from the clip's first frame (for bench_time). */
int bench_person_bake(void *person, struct error *err);

#endif
