/* SpiD for other programs, in five calls: open a person, drive, draw, close.
 * spid(3) is its page; examples/embed.c a program.
 *
 * Only these names are a promise: what else the library holds may change.  One
 * struct spid is not for two threads at once; a process may have several, all
 * with the number of threads that the first one was opened with. */
#ifndef SPID_API_SPID_H
#define SPID_API_SPID_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define SPID_EXPRESSIONS 100

/* How a head is held and what its face does (spid-stream(5), MOTN). */
struct spid_motion {
    float rotation[9];          /* [R|t]: from the head's frame to the camera */
    float translation[3];
    float expression[SPID_EXPRESSIONS];
    float jaw[3];               /* axis times angle */
    float lids[2];              /* left, right; 0 open to 1 closed */
    float eyes[6];              /* left, right; axis times angle */
};

struct spid_options {
    const char *model;          /* model.safetensors, its head beside it; NULL:
                                 * $SPID_MODEL, else where it is installed */
    bool star;                  /* SpiD*: faster, without the refiner */
    bool relative;              /* frames are followed from the first one with
                                 * a face on: the person does what the driver
                                 * has done since, from its own rest */
    int threads;                /* 0: all processors that are allowed */
};

struct spid;

/* The person in a picture, an identity or a baked avatar; opt NULL: all
 * zeros.  NULL and a line in error (of `size` bytes) when that fails. */
struct spid *spid_open(const char *source, const struct spid_options *opt,
                       char *error, size_t size);
/* Free everything; NULL is allowed. */
void spid_close(struct spid *s);
/* What the last call that gave -1 has to say. */
const char *spid_error(const struct spid *s);

/* Pixels of a side of what is drawn. */
size_t spid_size(const struct spid *s);
/* The motion now: at first the source's own. */
void spid_motion(struct spid_motion *m, const struct spid *s);

/* Drive it by a motion.  0; -1 when a number is not finite. */
int spid_drive(struct spid *s, const struct spid_motion *m);
/* Drive it by the newest frame of a video: rgb (height,width,3), sRGB, rows
 * after each other, at `time` seconds.  1; 0 when no face is seen, the last
 * motion stays then; -1. */
int spid_follow(struct spid *s, const uint8_t *rgb, size_t width,
                size_t height, double time);

/* Draw it: rgba (size,size,4), straight alpha.  0 or -1. */
int spid_draw(struct spid *s, uint8_t *rgba);

#ifdef __cplusplus
}
#endif

#endif
