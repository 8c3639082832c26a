/* Records of the stream as the structures the head and the avatar work on. */
#ifndef SPID_AVATAR_RECORDS_H
#define SPID_AVATAR_RECORDS_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/head/head.h"
#include "lib/head/lbs.h"
#include "lib/stream/stream.h"

/* A MOTN record: Theta_d of one frame.  pose.exp points at exp. */
struct motion {
    struct head_motion pose;
    float exp[HEAD_MAX_EXP];        /* psi */
    float R[9], t[3];               /* Eq. T_d: the camera */
    float crop[3];                  /* face crop, portrait-window pixels */
};

/* Fill m from a MOTN record of a head with nexp expression directions.  -1 and
 * *err naming the array when one is missing, of another size or not finite. */
int motion_read(struct motion *m, const struct record *rec, size_t nexp,
                struct error *err);
/* Write m as a MOTN record, others (may be NULL) appended. */
int motion_write(struct stream_writer *w, uint64_t frame, double time,
                 const struct motion *m, size_t nexp,
                 const struct array *others, int nothers, struct error *err);
/* cam (3,4) = [R|t]. */
void motion_camera(float cam[12], const struct motion *m);

/* Write a MESH record: verts (V,3), cam, the inner lips' centroid and
 * opening; faces when with_faces is set (the first one of a stream); others
 * appended. */
int mesh_write(struct stream_writer *w, uint64_t frame, double time,
               const struct head *h, const float *verts, const float cam[12],
               int with_faces, const struct array *others, int nothers,
               struct error *err);

/* What an identity file says (spid-shape writes it, spid-branches --bake adds
 * the Gaussians): owned copies, absent parts are NULL or 0. */
struct person {
    float *shape;               /* (nshape) beta */
    size_t nshape;
    uint8_t *rgb, *matte;       /* (size,size,3), (size,size) */
    size_t size;
    float crop[3];              /* of the source picture in its file */
    struct motion source;       /* the source's own motion */
    int has_source;
    char head[17], model[17];   /* hashes of CONF: "head_hash",
                                 * "model_hash"; "" when it has none */
};

/* Take what one record holds; 1: it was part of an identity, 0: another
 * record, -1: damaged.  nexp as in motion_read. */
int person_take(struct person *p, const struct record *rec, size_t nexp,
                struct error *err);
/* Read an identity file up to its END.  Fails when it has no SHAP. */
int person_load(struct person *p, const char *path, size_t nexp,
                struct error *err);
void person_release(struct person *p);

/* Fold the person's beta into h; fails when the identity was made for another
 * head (its CONF names it). */
int person_fold(struct identity *id, const struct head *h,
                const struct person *p, struct error *err);

#endif
