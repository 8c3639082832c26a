/* The Gaussians a stream describes at this moment: the last GAUS record with
 * the GMOV records after it applied. */
#ifndef SPID_SPLAT_SCENE_H
#define SPID_SPLAT_SCENE_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/base/relative_pose.h"
#include "lib/splat/types.h"
#include "lib/stream/stream.h"

enum scene_change {
    SCENE_NONE,         /* the record was neither GAUS nor GMOV */
    SCENE_LOADED,       /* GAUS: everything is new */
    SCENE_MOVED         /* GMOV: the camera, and the ranges below */
};

struct scene {
    struct gaussians g; /* current values; arrays owned by the scene */
    float cam[12];      /* [R|t] of the last record that had one */
    int has_cam;
    size_t first, count;        /* centres set by the last GMOV */
    size_t mouth, mouth_count;  /* the mouth branch's range, fixed by GAUS */
    int mouth_moved;    /* the last GMOV carried a shift or the chin's */
    float source[9];    /* R of the camera that the head was baked from */
    float light[3];     /* on it */
    float lamp[LAMP_SIZE];  /* that it is shown in */
    int has_source;
    size_t blended, blended_count;  /* static Gaussians that the neck blend
                                     * moves lie in this range, by GAUS */
    int neck_moved;     /* the last GMOV carried the shoulders' motion */
    float pivot[3];     /* of the neck blend; with blended ones */
    float view[12];     /* the source's camera, which saw g.uv; when it has
                         * them */

    float *mean;        /* (N,3) g's, owned */
    float *neck;        /* (N) neck blend weights, 0 but in the static
                         * branch (GAUS "bend"), or NULL; part of mean's
                         * memory */
    void *block;        /* the last GAUS, owned, in which the other arrays lie: */
    const float *loaded;        /* (N,3) its centres */
    const float *jaw;   /* (mouth_count,3) how the mouth goes with the chin, or
                         * NULL */
    const uint8_t *grain;       /* (grain_size,grain_size), or NULL: none */
    size_t grain_size;
};

/* A zeroed struct scene is empty and valid. */
void scene_release(struct scene *s);

/* Apply a record.  Returns which change it was, or -1 and *err naming record,
 * array and index: a GMOV before any GAUS, lengths that differ, numbers that
 * are not finite, a mouth branch that is not one range. */
int scene_apply(struct scene *s, const struct record *rec,
                struct error *err);

/* Hand the change to a renderer: splat_load after SCENE_LOADED, splat_update
 * after SCENE_MOVED. */
int scene_to_splat(struct splat *out, const struct scene *s,
                   enum scene_change change, struct error *err);

#endif
