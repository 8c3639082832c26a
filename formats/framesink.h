/* Finished pictures out: one module for spid-splat, spid-refine and spid
 * animate.  Formats: record stream, Y4M, PNG, PAM, EXR, and video files by
 * OpenCV's writer. */
#ifndef SPID_FORMATS_FRAMESINK_H
#define SPID_FORMATS_FRAMESINK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/base/relative_pose.h"
#include "lib/stream/records.h"
#include "lib/stream/stream.h"

enum framesink_format {
    FRAMESINK_AUTO,         /* by the name: .mp4 .mkv .avi .mov .webm video,
                             * .gif .webp .apng animation, .y4m .png .pam .ppm
                             * .exr, /dev/videoN, http://, .spid and names
                             * without an ending stream; others are refused */
    FRAMESINK_STREAM, FRAMESINK_Y4M, FRAMESINK_PNG, FRAMESINK_PAM,
    FRAMESINK_EXR, FRAMESINK_VIDEO,
    FRAMESINK_GIF, FRAMESINK_WEBP, FRAMESINK_APNG,
    FRAMESINK_TERMINAL,     /* drawn on standard output, whatever path says */
    FRAMESINK_DEVICE,       /* formats/v4l2.h */
    FRAMESINK_HTTP          /* formats/httpsink.h */
};

/* What FRAMESINK_STREAM writes. */
enum framesink_record {
    FRAMESINK_IMAG,         /* rgb u8 (straight, and alpha u8 with .alpha) */
    FRAMESINK_FEAT_F16, FRAMESINK_FEAT_F32  /* feat, alpha, depth */
};

#define FRAMESINK_FORMATS "stream, y4m, png, pam, exr, mp4, gif, webp or apng"

/* These names for --format; -1 and *err (EX_USAGE) for any other. */
int framesink_parse_format(const char *value, void *format,
                           struct error *err);

/* What shows where alpha is below 1. */
struct background {
    uint8_t color[3];       /* sRGB; black by default */
    uint8_t *rgb;           /* or a picture [height, width, 3]; NULL: color */
    size_t width, height;
};

/* --background R,G,B (0..255 each), #RRGGBB, black, white, green, grey, or a
 * picture file (resized to the frame, covering it, centre kept).  For the
 * option tables' CLI_CALL: dest is a struct background. */
int background_parse(const char *value, void *dest, struct error *err);
/* Free what it holds; zeroed then. */
void background_release(struct background *bg);
/* out = bg's picture as size by size pixels, or bg's colour; the middle of one
 * that is not square.  The caller releases out. */
int background_fit(struct background *out, const struct background *bg,
                   size_t size, struct error *err);

struct framesink_options {
    const char *path;       /* "-": standard output; for PNG and EXR a
                             * printf pattern such as frame-%05d.png makes a
                             * file per frame, a plain name holds one frame */
    enum framesink_format format;
    enum framesink_record record;
    int rate_num, rate_den; /* frames a second; 0: 25 */
    bool alpha;             /* straight RGBA, no background; Y4M and videos
                             * that video_has_alpha does not know refuse it */
    bool covered;           /* FEAT: only the pixels whose alpha is not 0 */
    bool anyone;            /* HTTP: for other machines, too */
    bool bt601;             /* Y4M matrix, BT.709 otherwise */
    const struct background *background;    /* NULL: black; borrowed */
};

/* One rendered frame.  Colours are as the splatter leaves them: alpha-weighted
 * sums over black, sRGB-encoded, 0..1 (values beyond are clamped). */
struct framesink_frame {
    size_t width, height;
    int channels;           /* 3 to 32 in color */
    const float *color;     /* [height, width, channels], or NULL */
    const uint16_t *half;   /* the same in half precision, if no color:
                             * FRAMESINK_FEAT_F16 only */
    const uint8_t *rgb;     /* [height, width, 3] over black, if neither */
    const float *alpha;     /* [height, width] 0..1; NULL: opaque */
    const float *depth;     /* [height, width] or NULL: FEAT and EXR only */
    const float *photo;     /* [height, width, 5] or NULL, FEAT only: what the
                             * photograph shows (lib/photo) */
    const float *place;     /* [height, width, 3] or NULL, FEAT only: blended
                             * places, and their view: A and b */
    float map[FEAT_MAP];
    const uint8_t *grain;   /* [grain_size, grain_size] FEAT only: GAUS's, or
                             * NULL */
    size_t grain_size;
    const float *gain;      /* FEAT only: how the light changed, or NULL, */
    float tint[3];          /* and by its colour, if it has one */
    bool tinted;
    bool rotated;           /* FEAT only: it says how the head has turned */
    float turn[RELATIVE_POSE_SIZE];
    uint64_t frame;
    double time;
};

struct framesink;

/* Prepare the output.  Nothing is written before the first frame.  NULL and
 * EX_USAGE for a combination that cannot be (EXR to a pipe, alpha in a
 * video), EX_CANTCREAT when the directory cannot be written. */
struct framesink *framesink_open(const struct framesink_options *opt,
                                 struct error *err);

/* The stream writer behind FRAMESINK_STREAM, for records that pass through;
 * NULL for the other formats. */
struct stream_writer *framesink_stream(struct framesink *s);

/* Set the rate before the first frame (from CONF); ignored afterwards and
 * when the options gave one. */
void framesink_set_rate(struct framesink *s, int num, int den);

/* The clip whose sound goes along (NULL: none), and its time of the first frame;
 * before the first frame.  False where the output takes no sound. */
bool framesink_set_sound(struct framesink *s, const char *clip, double start);
/* Whether it does. */
bool framesink_takes_sound(const struct framesink *s);

/* When the last frame ceases to be shown, in the times of the frames; for
 * videos and animations, before the end. */
void framesink_set_end(struct framesink *s, double end);

/* The rate as CONF's "fps" gives it: [numerator, denominator] or a number; and
 * the clip of its "sound". */
void framesink_read_conf(struct framesink *s, const struct record *conf);
/* The clip whose sound should go along, but which is not there; or NULL. */
const char *framesink_lost_sound(const struct framesink *s);

/* Compose and write one frame.  All frames of a Y4M or video must have the
 * size of the first. */
int framesink_write(struct framesink *s, const struct framesink_frame *f,
                    struct error *err);

/* Flush, close, rename to the final name; frees s.  -1 when the last bytes
 * did not arrive. */
int framesink_finish(struct framesink *s, struct error *err);

/* Give up, keeping complete frames: PNG and EXR files stay, a stream, Y4M or
 * PAM as PATH.part, a video as NAME.part.EXT.  Frees s; NULL is allowed. */
void framesink_abandon(struct framesink *s);

/* The frame as 8-bit sRGB over the background into out [height, width, 3]:
 * round(255 clamp(color + (1 - alpha) background)). */
void framesink_compose(uint8_t *out, const struct framesink_frame *f,
                       const struct background *bg);
/* The frame as straight RGBA into out [height, width, 4]:
 * color / alpha, and 0 where alpha is 0. */
void framesink_compose_rgba(uint8_t *out, const struct framesink_frame *f);

#endif
