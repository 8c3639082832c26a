/* A photograph whose person is known as an avatar that acts: pictures of real
 * people that look where no photograph shows them, with the true motion.
 * E_m learns turns, lids and gaze from them that the photographs lack. */
#ifndef SPID_LAB_FIT_REENACT_H
#define SPID_LAB_FIT_REENACT_H

#include <stddef.h>
#include <stdint.h>

#include "formats/framesink.h"
#include "lib/animate/pipeline.h"
#include "lib/animate/prepare.h"
#include "lib/base/error.h"
#include "lib/base/random.h"
#include "lib/lab/fit/portrait.h"
#include "lib/head/motion.h"

struct reenact {
    struct prepare models;
    struct motion *act;         /* (acts) what people do */
    size_t acts, room;
    struct random random;
    size_t size;                /* of the pictures */
    struct prepared person;     /* who acts, and who draws him */
    struct pipeline pipeline;
    uint8_t *back;              /* of his portrait, borrowed */
    uint8_t *rgb;               /* (size,size,3) the picture last drawn */
};

/* Models, and the motions of all MOTN records of a stream. */
int reenact_open(struct reenact *r, const char *model, const char *head,
                 const char *motions, size_t size, uint64_t seed,
                 struct error *err);
/* Free what it holds; zeroed then. */
void reenact_release(struct reenact *r);

/* The next person: the portrait that was cut, of shape beta (n), who does m
 * there.  The portrait's background is borrowed until the next. */
int reenact_person(struct reenact *r, const struct portrait *portrait,
                   const float *beta, size_t n, const struct motion *m,
                   struct error *err);

/* A picture of him in r->rgb, and his motion there: somebody's expression,
 * lids and gaze, and part of somebody's turn. */
int reenact_draw(struct reenact *r, struct motion *m, struct error *err);

#endif
