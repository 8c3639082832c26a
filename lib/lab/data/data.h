/* People with known truth, for training and evaluation: read from streams
 * (SHAP, then MOTN and IMAG for each frame), a pool of them to draw batches
 * from, crops and labels of their frames. */
#ifndef SPID_LAB_DATA_DATA_H
#define SPID_LAB_DATA_DATA_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/base/random.h"
#include "lib/lab/data/box.h"
#include "lib/base/crop.h"
#include "lib/head/lbs.h"
#include "lib/head/motion.h"
#include "lib/head/person.h"

#define DATA_SHAPE 300
#define DATA_EXP 100

/* A frame: its picture (or the part of it around the face) and its truth.
 * Positions are pixels of the whole picture, which has `size` pixels a side;
 * rgba covers x0 .. x0+width, y0 .. y0+height of it. */
struct data_frame {
    struct motion motion;   /* the true one; data_truth sets its pose.exp */
    float lmk[68][2];       /* true landmarks, pixels */
    struct square crop;     /* the face crop they ask for, pixels */
    size_t size, x0, y0, width, height;
    double turn;            /* radians about the picture's middle, clockwise,
                             * by which rgba is to be turned; see data_turn */
    uint8_t *rgba;          /* (height,width,4): colours and the mask */
    uint8_t *alone;         /* (height,width,3) the person over black without
                             * noise, if whole pictures are kept and the
                             * stream has it; else NULL */
    uint8_t *hidden;        /* (height,width) 1 where something is in front of
                             * the person, likewise; else NULL */
};

struct data_person {
    int id;                 /* as the stream says, or its index */
    float shape[DATA_SHAPE];
    size_t count, room;
    struct data_frame *frame;
};

/* Free what it holds; zeroed then. */
void data_person_release(struct data_person *p);

/* ---- reading ----------------------------------------------------------- */

struct data_reader;

/* People of the files in order, over and over; a "-" is read once, a folder
 * means its *.spid, looked up anew in every pass.  margin: 0 keeps whole
 * pictures, all of one size, -1 whole pictures of any size, 1.4 the square of
 * 1.4 face crops around the face.  The names
 * are borrowed.  NULL when there is no file. */
struct data_reader *data_open(const char *const *names, size_t count,
                              double margin, struct error *err);
/* NULL is allowed. */
void data_close(struct data_reader *r);
/* From here on, fn says what shape every person read has; an error of its is
 * data_next's. */
typedef int data_shape_fn(void *ctx, struct data_person *p,
                          struct error *err);
/* fn and ctx are borrowed until data_close. */
void data_reshape(struct data_reader *r, data_shape_fn *fn, void *ctx);

/* The next person with at least one frame into *p (empty before).  -1 when
 * the data end, a truth record is missing, or whole pictures (margin 0)
 * differ in size; the message names file and frame. */
int data_next(struct data_reader *r, struct data_person *p,
              struct error *err);
/* One pass only: data_next returns 1, *p empty, after the last person. */
void data_once(struct data_reader *r);

/* ---- the pool ---------------------------------------------------------- */

/* The `size` people read last.  Which people are in it depends only on how
 * many have been read, so that a run can resume by reading them again. */
struct data_pool {
    struct data_reader *reader;
    size_t size;
    uint64_t read;              /* people read so far */
    struct data_person *person; /* person k lies in slot k % size */
};

/* Fill the pool so that `read` people (at least size) have passed. */
int data_pool_init(struct data_pool *pool, struct data_reader *reader,
                   size_t size, uint64_t read, struct error *err);
/* Free what it holds. */
void data_pool_release(struct data_pool *pool);
/* Read on until `read` people have passed. */
int data_pool_advance(struct data_pool *pool, uint64_t read,
                      struct error *err);

/* A frame of a person of the pool, and whose it is. */
const struct data_frame *data_pool_draw(const struct data_pool *pool,
                                        const struct data_person **who,
                                        struct random *r);

/* ---- sampling ---------------------------------------------------------- */

/* Random numbers for one item of one step: the same whoever draws it. */
void data_random(struct random *r, uint64_t seed, uint64_t step,
                 uint64_t item);

/* How much the pictures are changed before the encoders see them; 0 nothing,
 * 1 the usual. */
struct data_augment {
    float jitter;       /* of the crop's place and size */
    float colour;       /* gain, gamma, saturation, noise, blur */
    float background;   /* share of pictures with another background */
    float roll;         /* spread of turns in the picture's plane, degrees */
};

/* f as a camera turned by `angle` (radians, clockwise) about its axis would
 * have it: truth, landmarks and crop; the pixels stay f's and are turned when
 * they are sampled.  Exact, for the axis goes through the picture's middle. */
void data_turn(struct data_frame *out, const struct data_frame *f,
               double angle);

/* rgb (n,n,3) in [0,1] = the square q of the frame (black outside), changed
 * by r and how.  how NULL: as it is, over its own background. */
int data_sample(float *rgb, size_t n, const struct data_frame *f,
                struct square q, const struct data_augment *how,
                struct random *r, struct error *err);

/* rgba (n,n,4) = the square with its mask, as they are; zeros outside. */
int data_sample_plain(float *rgba, size_t n, const struct data_frame *f,
                      struct square q, struct error *err);

/* The colours alone; frame is a const struct data_frame, rgb (224,224,3): a
 * tta_crop_fn (lib/track/tta.h). */
int data_crop(void *frame, float *rgb, struct square q, struct error *err);

/* A face crop like f's that a tracker might have found. */
struct square data_jitter(const struct data_frame *f, float jitter,
                          struct random *r);

/* The true translation relative to crop q: what the network should say. */
void data_net_translation(double tnet[3], const struct data_frame *f,
                          struct square q);

/* Whole picture as (n,n,3) in [0,1] over black, by its mask or as the stream
 * has it, and the mask (n,n) unless NULL; the frame must hold its whole
 * picture, whose side is a multiple of n (box means) or equal to it. */
int data_portrait(float *rgb, float *mask, size_t n,
                  const struct data_frame *f, struct error *err);

/* The frame (whole, S = f->size pixels) as a source photograph: rgb (S,S,3),
 * matte (S,S) and back (S,S,3), what lies behind the person, as spid-shape
 * finds them in a photograph.  Where the stream has the person alone, back is
 * what makes the picture of both; else the picture itself, so that its colours
 * are the person's.  EX_DATAERR when the frame is not whole or not of `size`
 * pixels, EX_OSERR.  p has no other parts and is to be released. */
int data_source(struct person *p, const struct data_frame *f, size_t size,
                struct error *err);

/* What hides the person says nothing about them: there, and two pixels about,
 * target (n,n,channels) becomes what was drawn, so that no loss and no figure
 * counts it.  Whether there is anything. */
bool data_mask_occluded(float *target, const float *drawn, size_t channels,
                        size_t n, const struct data_frame *f);

/* ---- truth -------------------------------------------------------------- */

/* The true motion (exp points into f) and camera of a frame. */
void data_truth(struct head_motion *m, float cam[12],
                const struct data_frame *f);
/* f's face crop in a picture of `image` pixels a side. */
struct box data_face(const struct data_frame *f, size_t image);
/* What shows between f's lips; empty where they are closed. */
struct box data_mouth(const struct data_frame *f, size_t image);

#endif
