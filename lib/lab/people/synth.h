/* Synthetic people as a sequence of frames with their truth. */
#ifndef SPID_LAB_PEOPLE_SYNTH_H
#define SPID_LAB_PEOPLE_SYNTH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/head/head.h"
#include "lib/lab/people/scan_scene.h"

#define SYNTH_SIZE_MIN 32
#define SYNTH_SIZE_MAX 2048

struct synth_options {
    uint64_t seed;
    uint64_t first;             /* index of the first person */
    uint64_t people, frames;    /* frames of each person */
    int size;                   /* pixels */
    double fps;                 /* of the people's own time */
    float effects;              /* 0 clean .. 1 everything a camera does */
    const struct synth_turn *turn;      /* (turns) where the head turns to in
                                         * frame k, turn[k % turns]; borrowed */
    size_t turns;               /* 0: as the person moves */
    bool mesh;                  /* also the driven vertices */
    const struct scan_assets *assets;   /* people of the scans, borrowed; NULL:
                                         * plain figures (scan_plain.c) */
    const char *traits;         /* file of theirs; NULL: the built-in */
};

/* One finished frame; everything belongs to the synth and stays until the
 * next call. */
struct synth_frame {
    uint64_t person, frame;     /* frame counts within the person */
    const float *beta;          /* (nbeta) */
    size_t nbeta;
    const struct motion *motion;        /* its light: see light_slope */
    const float *lmk;           /* (68,2) pixels of the picture */
    const float *points;        /* (LANDMARK_FACE,2) where the labels'
                                 * landmarks lie on the scans' skin, pixels;
                                 * NULL without scans */
    const float *verts;         /* (V,3) driven, head frame; NULL: no mesh */
    const uint8_t *rgb;         /* (size,size,3) sRGB */
    const uint8_t *alone;       /* (size,size,3) the person over black, before
                                 * noise and compression */
    const uint8_t *mask;        /* (size,size) coverage by the person */
    const uint8_t *label;       /* (size,size) enum synth_label */
};

struct synth;

/* The synth borrows head.  NULL and *err when memory is short or the head has
 * no landmarks. */
struct synth *synth_open(const struct head *head,
                         const struct synth_options *opt, struct error *err);

/* The next frame: 1, 0 after the last one, -1 and *err.  Frames come in order
 * and are the same for any number of threads. */
int synth_next(struct synth *s, struct synth_frame *frame, struct error *err);

void synth_close(struct synth *s);      /* NULL is allowed */

#endif
