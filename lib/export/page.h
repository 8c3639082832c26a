/* The driven avatar as a page for a browser: everything that the player in
 * lib/export/web needs to pose the head, move the Gaussians and look up the
 * photograph by itself, gathered record by record and packed small.
 *
 * Numbers travel in 16 bits between the ends of their range: centres to 20
 * micrometres, colours, opacities and places to a part in 65,000.  The motion
 * stays in float. */
#ifndef SPID_EXPORT_PAGE_H
#define SPID_EXPORT_PAGE_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/avatar/baked.h"
#include "lib/base/error.h"
#include "lib/head/lbs.h"
#include "lib/head/motion.h"
#include "lib/head/person.h"

/* More than that no browser plays. */
#define PAGE_MAX_GAUSSIANS 1000000
#define PAGE_MAX_FRAMES 65536
#define PAGE_MAX_PIXELS 2048   /* of a side of the photograph */

/* One frame's numbers before its expression: R (3,3), t (3), jaw (3), lids
 * (2), eyes (6). */
#define PAGE_POSE 23

struct page {
    struct baked baked;
    bool has_avatar, moved;     /* GAUS was there; GMOV or MESH was */
    size_t nexp, frames, room;
    float *motion;              /* (frames, PAGE_POSE + nexp) */
    double *time;               /* (frames) seconds */
    const char *live_model, *live_head; /* borrowed: the files that a page
                                         * which finds motions itself holds;
                                         * NULL: it is to have no camera */
};

/* m in PAGE_POSE + nexp numbers. */
void page_row(float *to, const struct motion *m, size_t nexp);
/* And back; what they do not say is 0. */
void page_motion(struct motion *m, const float *row, size_t nexp);

/* nexp: expression directions of the head.  A zeroed page may be released. */
void page_init(struct page *p, size_t nexp);
/* Free what it holds; zeroed then. */
void page_release(struct page *p);

/* Take a GAUS, MOTN, GMOV or MESH record, the avatar or one frame of the
 * drive; others are ignored.  -1 and *err: damaged, or more than a page can
 * hold, or times that do not increase. */
int page_record(struct page *p, const struct record *rec, struct error *err);
/* The GAUS record of an avatar's file. */
int page_load_avatar(struct page *p, const char *path, struct error *err);

/* Write the page from the player's template (formats/pagefile.h); without one
 * (NULL) its arrays alone, as safetensors, and *bytes stays.
 *   id      the identity folded into its head
 *   person  its photograph and own motion, where it has them
 * *bytes: how large the page became.  -1 and *err also when there was no
 * avatar, or a drive without motion, or the avatar is another head's. */
int page_write(const struct page *p, const char *path,
               const char *template_path, const struct identity *id,
               const struct person *person, size_t *bytes,
               struct error *err);

#endif
