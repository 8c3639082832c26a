/* The records of spid-stream(5) that need no head: each as a struct, read with
 * its arrays checked and written.  What a read leaves lies in the record and
 * lives as long; arrays that are not there are NULL.  Reads return -1 and *err
 * naming the array when one is missing, of another type or shape, or not
 * finite; writes take the arrays that are not NULL. */
#ifndef SPID_STREAM_RECORDS_H
#define SPID_STREAM_RECORDS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/uio.h>

#include "lib/base/error.h"
#include "lib/stream/stream.h"

/* ---- CONF: the first of a stream, a text of JSON ------------------------ */

/* Write CONF with that JSON. */
int conf_text_write(struct stream_writer *w, const char *json,
                    struct error *err);
/* The JSON of a CONF record, *bytes long and not terminated.  NULL when there
 * is none. */
const char *conf_text(size_t *bytes, const struct record *rec);

/* ---- SHAP: the identity beta of one person ------------------------------ */

struct shape {
    const float *beta;          /* (n) standard deviations */
    size_t n;
    const float *offset;        /* (vertices,3) that the person's rest mesh is
                                 * moved by, head units; NULL: none */
    size_t vertices;
    const int32_t *person;      /* (1) number in a data set; NULL: not said */
};

int shape_read(struct shape *s, const struct record *rec, struct error *err);
int shape_write(struct stream_writer *w, uint64_t frame, double time,
                const struct shape *s, struct error *err);

/* ---- IMAG: a picture, and what is known of its pixels ------------------- */

struct imag {
    size_t height, width;   /* pixels */
    const uint8_t *rgb;     /* (height,width,3) sRGB */
    const uint8_t *alpha;   /* (height,width) coverage, of what is drawn */
    const uint8_t *mask;    /* (height,width) true coverage of the person */
    const uint8_t *label;   /* (height,width) region numbers */
    const uint8_t *alone;   /* (height,width,3) the person alone */
};

/* A training picture: square, with a mask. */
int imag_read(struct imag *im, const struct record *rec, struct error *err);
/* Its pixels a side, by its height; 0: it has no picture. */
size_t imag_size(const struct record *rec);
int imag_write(struct stream_writer *w, uint64_t frame, double time,
               const struct imag *im, struct error *err);

/* ---- GAUS: a whole set of Gaussians with what moves them ---------------- */

struct gaus {
    size_t n, channels;
    const float *mean, *scale;          /* (n,3) head units */
    const float *quat;                  /* (n,4) w first */
    const float *opacity;               /* (n) */
    const float *color;                 /* (n,channels), or */
    const uint16_t *color_half;         /* the same in half precision */
    const uint8_t *branch;              /* (n) 0 dynamic, 1 static, 2 mouth */
    const int32_t *vertex;              /* (vertices) densified vertex of */
    size_t vertices;                    /* each dynamic Gaussian */
    const float *lip;                   /* (3) the source's lip centroid */
    const float *jaw;                   /* (jaws,3) how the mouth's move */
    size_t jaws;                        /* with the chin (drive_jaw), and */
    const float *chin;                  /* (3) the source's: both or none */
    const float *bend;                  /* (n) neck blend's weights */
    const float *pivot;                 /* (3) in the neck */
    const float *source;                /* (3,3) R of the source's camera */
    const float *light;                 /* (3) on the source, head frame */
    const float *lamp;                  /* (6) it is shown in, camera frame */
    const float *uv;                    /* (n,2) places in SRCI, 0..1, */
    const float *seen;                  /* (n) how far it shows them, and */
    const float *view;                  /* (3,4) its camera: all or none */
    const float *reach;                 /* (n) up to where it does, and */
    const float *normal;                /* (n,3) of the surface, head frame */
    const float *tilt;                  /* (n,2) how depth rises there */
    const float *around;                /* (n,2) places in, 0..1, and */
    const uint8_t *grain;               /* (grain_size,grain_size) what colours
                                         * are multiplied by, times 128: both or
                                         * none */
    size_t grain_size;
    const float *cam;                   /* (3,4) [R|t] */
};

int gaus_read(struct gaus *g, const struct record *rec, struct error *err);
/* The arrays that are not NULL, into a; returns how many. */
int gaus_arrays(struct array a[STREAM_MAX_ARRAYS], const struct gaus *g);
int gaus_write(struct stream_writer *w, uint64_t frame, double time,
               const struct gaus *g, struct error *err);

/* ---- GMOV: what of a set of Gaussians moved in a frame ------------------ */

/* All may be left out. */
struct gmov {
    const float *cam;       /* (3,4) [R|t] */
    const int32_t *first;   /* (1) number of the first of mean: both or none */
    const float *mean;      /* (count,3) new centres */
    size_t count;
    const float *shift;     /* (3) of the mouth as a whole */
    const float *chin;      /* (3) of the chin, with which the mouth goes */
    const float *body;      /* (3,4) the shoulders' motion */
};

int gmov_read(struct gmov *m, const struct record *rec, struct error *err);
/* The arrays that are not NULL, into a; returns how many.  m must outlive
 * them. */
int gmov_arrays(struct array a[STREAM_MAX_ARRAYS], const struct gmov *m);

/* ---- FEAT: a feature image, with what the photograph shows there -------- */

#define FEAT_PHOTO 5    /* numbers of a pixel of photo, */
#define FEAT_PLACE 4    /* of place, */
#define FEAT_MAP 17     /* of the places' view */
#define FEAT_GAIN 4    /* pixels from one number of gain to the next, */
#define FEAT_TURN 6     /* and of the head's turn */

struct feat {
    size_t height, width, channels;
    const float *f32;       /* (height,width,channels), or packed: only the */
    const uint16_t *f16;    /* pixels (pixels,channels) whose alpha is not 0,
                             * row after row; halves if f32 is NULL */
    bool packed;
    size_t pixels;          /* of packed ones */
    const float *alpha;     /* (height,width) */
    const float *depth;     /* (height,width) camera z; not read */
    const float *photo;     /* (height,width,5), packed (pixels,5): what the
                             * photograph shows (lib/photo) */
    const float *place;     /* (height,width,4) blended places, */
    const float *map;       /* (17) and their view (lib/splat/types.h) */
    const uint8_t *grain;   /* (grain_size,grain_size) GAUS's, which places from
                             * now on may be places of, or NULL: as before */
    size_t grain_size;
    const float *gain;      /* (gain_height,gain_width) gains of the
                             * colours, a quarter of the picture's size
                             * (lib/splat/relight.h) */
    size_t gain_height, gain_width;
    const float *tint;      /* (3) and of red, green and blue everywhere */
    const float *turn;      /* (6) the head's since the source
                             * (lib/base/relative_pose.h) */
};

/* Refused, too: packed features that stand for more than --max-bytes. */
int feat_read(struct feat *f, const struct record *rec, struct error *err);
/* Packed features may lie scattered, in parts (stream_write_parts), their
 * pointer is then only a sign of their type. */
int feat_write(struct stream_writer *w, uint64_t frame, double time,
               const struct feat *f, const struct iovec *part, size_t parts,
               struct error *err);

#endif
