/* Inside the frame sink: what framesink.c, which chooses and keeps the order,
 * and the writers of records and files share. */
#ifndef SPID_FORMATS_FRAMESINK_IMPL_H
#define SPID_FORMATS_FRAMESINK_IMPL_H

#include <stddef.h>
#include <stdint.h>

#include "formats/framesink.h"
#include "formats/httpsink.h"
#include "formats/outfile.h"
#include "formats/v4l2.h"
#include "formats/video.h"
#include "formats/y4m.h"
#include "lib/base/covered.h"

#define MAX_CHANNELS 32

struct framesink {
    struct framesink_options opt;
    char *path;
    char *part;                    /* of a video */
    size_t count;                  /* frames written */
    size_t width, height;          /* of the first */
    struct background fitted;      /* opt.background at that size */
    struct outfile out;            /* Y4M, PAM, PNG to one file or stdout */
    struct stream_writer *stream;
    struct video_writer *video;
    char *sound;                   /* the clip it is of */
    double start, end;             /* of the sound, of the last frame */
    struct v4l2_sink *device;
    struct httpsink *http;
    struct y4m y4m;
    uint8_t *pixel;                /* composed frame */
    uint8_t *planes;               /* Y4M */
    float *plane;                  /* EXR */
    uint16_t *half;                /* FEAT in f16 */
    size_t half_count;
    struct covered covered;        /* FEAT's pixels */
    float *photo;                  /* those of the photograph, packed */
    size_t photo_count;
};

/* Whether the file is one of formats/video.h. */
static inline bool framesink_is_video(const struct framesink_options *o)
{
    return o->format == FRAMESINK_VIDEO || o->format == FRAMESINK_GIF ||
           o->format == FRAMESINK_WEBP || o->format == FRAMESINK_APNG;
}

/* ---- records (framesink_record.c) --------------------------------------- */

/* The composed frame as an IMAG record. */
int framesink_write_imag(struct framesink *s, const struct framesink_frame *f,
                         struct error *err);
/* A FEAT record; with `covered` only the pixels that alpha covers. */
int framesink_write_feat(struct framesink *s, const struct framesink_frame *f,
                         struct error *err);

/* ---- files (framesink_file.c) ------------------------------------------- */

/* The composed frame as PNG, PAM or a part of a Y4M: into the one file or
 * standard output, or by a pattern into a file of its own. */
int framesink_write_picture(struct framesink *s,
                            const struct framesink_frame *f,
                            struct error *err);
/* The composed frame into a video, which is opened at the first one, when the
 * size is known. */
int framesink_write_video(struct framesink *s, double time,
                          struct error *err);
/* f's floats as a file of its own: channels R G B, then f.03 to f.31, A and
 * Z. */
int framesink_write_exr(struct framesink *s, const struct framesink_frame *f,
                        struct error *err);
/* The composed frame on the terminal, as large as it is now. */
int framesink_write_terminal(struct framesink *s, struct error *err);
/* The composed frame to a video device. */
int framesink_write_device(struct framesink *s, struct error *err);

#endif
