/* The source picture as Phase A sees it: floats over black for the backbone,
 * and with its matte, the person's colours running on beyond the matte's edge
 * so that no background is sampled there. */
#ifndef SPID_AVATAR_SOURCE_PICTURE_H
#define SPID_AVATAR_SOURCE_PICTURE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"

struct source_picture {
    size_t size;            /* S: side, pixels */
    float *rgb;             /* (S,S,3) in [0,1], times the matte */
    float *rgba;            /* (S,S,4) colours as they are, padded at the
                             * edge; matte */
    uint8_t *padded;        /* (S,S) step in which a pixel got its colour: 1
                             * its own, 0 none */
    uint8_t *across;        /* (S,S) of a pixel and two to either side, whether
                             * all are the person's */
    const uint8_t *certain;     /* (S,S) 0 beyond the photograph, or NULL: all is
                                 * in it; the caller's */
    uint32_t *list;         /* (2,S,S) pixels whose turn it is */
    float *block;           /* what the arrays are part of */
};

/* Memory for pictures of size x size. */
int source_picture_init(struct source_picture *p, size_t size,
                        struct error *err);
/* Free what it holds; zeroed then. */
void source_picture_release(struct source_picture *p);

/* Take rgb (S,S,3), matte (S,S; NULL: all is the person) and how certain that is
 * (S,S; 0 beyond the photograph; NULL: all is in it), which must stay until the
 * bake's end; pad: run the colours on over the edge. */
void source_picture_set(struct source_picture *p, const uint8_t *rgb,
                        const uint8_t *matte, const uint8_t *certain, bool pad);

/* Whether the photograph shows what lies at a place in [-1,1]; else the picture
 * has a guess there. */
bool source_picture_contains(const struct source_picture *p, const float place[2]);

/* out (N,4): colour and matte at places (N,2) in [-1,1]. */
void source_picture_sample(float *out, const struct source_picture *p,
                           const float *place, size_t N);
/* dplace (N,2) += gradient of dout (N,4). */
void source_picture_sample_backward(float *dplace, const float *dout,
                                    const struct source_picture *p,
                                    const float *place, size_t N);

#endif
