/* Frames out: one writer for streams, videos, Y4M, PNG, PAM and EXR, chosen by
 * --format or the name. */
#include "formats/framesink.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sysexits.h>
#include <unistd.h>

#include "formats/compose.h"
#include "formats/exr.h"
#include "formats/mark.h"
#include "formats/outfile.h"
#include "formats/png.h"
#include "formats/pnm.h"
#include "formats/terminal.h"
#include "formats/v4l2.h"
#include "formats/video.h"
#include "formats/y4m.h"
#include "lib/base/file.h"
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
    struct v4l2_sink *device;
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

/* ---- choosing --------------------------------------------------------- */

int framesink_parse_format(const char *value, void *format,
                           struct error *err)
{
    static const struct {
        const char *name;
        enum framesink_format format;
    } names[] = {
        {"stream", FRAMESINK_STREAM}, {"y4m", FRAMESINK_Y4M},
        {"png", FRAMESINK_PNG}, {"pam", FRAMESINK_PAM},
        {"exr", FRAMESINK_EXR}, {"mp4", FRAMESINK_VIDEO},
    };

    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (strcmp(value, names[i].name) == 0) {
            *(enum framesink_format *)format = names[i].format;
            return 0;
        }
    return error_set(err, EX_USAGE, "unknown format (expected stream, y4m, "
                     "png, pam, exr or mp4)");
}

/* By the ending, FRAMESINK_AUTO when it says nothing. */
static enum framesink_format format_of(const char *path)
{
    static const struct {
        const char *end;
        enum framesink_format format;
    } names[] = {
        {".mp4", FRAMESINK_VIDEO}, {".mkv", FRAMESINK_VIDEO},
        {".avi", FRAMESINK_VIDEO}, {".mov", FRAMESINK_VIDEO},
        {".webm", FRAMESINK_VIDEO}, {".m4v", FRAMESINK_VIDEO},
        {".y4m", FRAMESINK_Y4M}, {".png", FRAMESINK_PNG},
        {".pam", FRAMESINK_PAM}, {".ppm", FRAMESINK_PAM},
        {".exr", FRAMESINK_EXR},
    };
    const char *dot = strrchr(path, '.');

    if (strncmp(path, "/dev/video", 10) == 0)
        return FRAMESINK_DEVICE;
    for (size_t i = 0; dot && i < sizeof names / sizeof *names; i++)
        if (strcasecmp(dot, names[i].end) == 0)
            return names[i].format;
    return FRAMESINK_STREAM;
}

/* A pattern is a name with one %d, %5d or %05d; %% is a percent sign. */
static int is_pattern(const char *path)
{
    int found = 0;

    for (const char *p = path; (p = strchr(p, '%')) != NULL; p++) {
        const char *q = p + 1;

        if (*q == '%') {
            p = q;
            continue;
        }
        q += strspn(q, "0123456789");
        if (*q != 'd' || q - p > 3)
            return -1;
        found++;
    }
    return found;
}

/* The name of frame n; the caller frees. */
static char *pattern_name(const char *path, uint64_t n)
{
    size_t size = strlen(path) + 128, at = 0;
    char *name = malloc(size);

    for (const char *p = path; name && *p; p++) {
        if (p[0] != '%') {
            name[at++] = *p;
        } else if (p[1] == '%') {
            name[at++] = *++p;
        } else {
            int zero = p[1] == '0', width = atoi(p + 1);

            at += (size_t)snprintf(name + at, size - at,
                                   zero ? "%0*llu" : "%*llu", width,
                                   (unsigned long long)n);
            p = strchr(p, 'd');
        }
    }
    if (name)
        name[at] = 0;
    return name;
}

/* What can be refused before the first frame. */
static int check_options(const struct framesink_options *o,
                         struct error *err)
{
    const bool pipe = strcmp(o->path, "-") == 0;
    const int pattern = is_pattern(o->path);

    if (pattern < 0 || pattern > 1)
        return error_set(err, EX_USAGE, "%s: bad pattern (expected one %%d "
                         "such as %%05d; %%%% for a percent sign)", o->path);
    if (pattern == 1 && o->format != FRAMESINK_PNG
        && o->format != FRAMESINK_EXR && o->format != FRAMESINK_PAM)
        return error_set(err, EX_USAGE, "%s: a pattern makes pictures, not a"
                         " stream or video (expected --format png, pam or "
                         "exr)", o->path);
    if (pipe && (o->format == FRAMESINK_EXR || o->format == FRAMESINK_VIDEO))
        return error_set(err, EX_USAGE, "<stdout>: %s cannot be written to a"
                         " pipe (use -o FILE, or --format y4m)",
                         o->format == FRAMESINK_EXR ? "EXR" : "a video file");
    if (o->alpha && (o->format == FRAMESINK_Y4M
                     || o->format == FRAMESINK_VIDEO))
        return error_set(err, EX_USAGE, "%s: no alpha in %s (expected "
                         "--format png, pam or exr)", o->path,
                         o->format == FRAMESINK_Y4M ? "Y4M" : "a video");
    return 0;
}

/* "dir/out.mp4" is written as "dir/out.part.mp4": the writer goes by the
 * extension. */
static char *video_part(const char *path)
{
    const char *dot = strrchr(path, '.'), *slash = strrchr(path, '/');
    size_t n = strlen(path), stem = n;
    char *part = malloc(n + sizeof ".part.mp4");

    if (!part)
        return NULL;
    if (dot && (!slash || dot > slash))
        stem = (size_t)(dot - path);
    memcpy(part, path, stem);
    strcpy(part + stem, ".part");
    strcat(part, stem < n ? path + stem : ".mp4");
    return part;
}

struct framesink *framesink_open(const struct framesink_options *opt,
                                 struct error *err)
{
    struct framesink *s = calloc(1, sizeof *s);

    if (s) {
        s->opt = *opt;
        s->path = strdup(opt->path);
    }
    if (!s || !s->path) {
        free(s);
        error_set(err, EX_OSERR, "out of memory");
        return NULL;
    }
    s->opt.path = s->path;
    if (s->opt.format == FRAMESINK_AUTO)
        s->opt.format = format_of(s->path);
    if (check_options(&s->opt, err) != 0)
        goto failed;
    if (s->opt.format == FRAMESINK_STREAM) {
        s->stream = stream_create(s->path, err);
        if (!s->stream)
            goto failed;
    } else if (strcmp(s->path, "-") == 0
               && s->opt.format != FRAMESINK_TERMINAL
               && outfile_open(&s->out, "-", err) != 0) {
        goto failed;
    }
    return s;
failed:
    framesink_abandon(s);
    return NULL;
}

struct stream_writer *framesink_stream(struct framesink *s)
{
    return s->stream;
}

void framesink_set_rate(struct framesink *s, int num, int den)
{
    if (s->count == 0 && s->opt.rate_num <= 0 && num > 0 && den > 0) {
        s->opt.rate_num = num;
        s->opt.rate_den = den;
    }
}

void framesink_take_conf(struct framesink *s, const struct record *conf)
{
    const struct array *a = record_find(conf, "json");
    cJSON *json = a && a->dtype == DTYPE_U8
        ? cJSON_ParseWithLength(a->data, array_count(a)) : NULL;
    const cJSON *fps = cJSON_GetObjectItem(json, "fps");
    const cJSON *den = cJSON_GetArrayItem(fps, 1);

    if (cJSON_IsNumber(fps))
        framesink_set_rate(s, (int)(fps->valuedouble * 1000 + 0.5), 1000);
    else if (cJSON_IsArray(fps) && den)
        framesink_set_rate(s, cJSON_GetArrayItem(fps, 0)->valueint,
                           den->valueint);
    cJSON_Delete(json);
}

/* ---- writing one frame ------------------------------------------------ */

/* Header first, then the frame's planes. */
static int write_y4m(struct framesink *s)
{
    FILE *fp = s->out.file;
    size_t n;

    if (s->count == 0) {
        char line[128];

        s->y4m = (struct y4m){
            .width = s->width, .height = s->height, .chroma = Y4M_444,
            .rate_num = s->opt.rate_num, .rate_den = s->opt.rate_den,
            .aspect_num = 1, .aspect_den = 1, .bt601 = s->opt.bt601,
        };
        s->planes = malloc(y4m_frame_bytes(&s->y4m));
        if (!s->planes) {
            errno = ENOMEM;
            return -1;
        }
        n = y4m_header(line, sizeof line, &s->y4m);
        if (fwrite(line, 1, n, fp) != n)
            return -1;
    }
    n = y4m_frame_bytes(&s->y4m);
    y4m_from_rgb(s->planes, s->pixel, &s->y4m);
    return fputs("FRAME\n", fp) >= 0 && fwrite(s->planes, 1, n, fp) == n
        ? 0 : -1;
}

/* Opened at the first frame, when the size is known. */
static int write_video(struct framesink *s, struct error *err)
{
    if (s->count == 0) {
        FILE *fp;

        s->part = video_part(s->path);
        if (!s->part)
            return error_set(err, EX_OSERR, "out of memory");
        fp = fopen(s->part, "wb");     /* the writer would not say why not */
        if (!fp)
            return error_set(err, EX_CANTCREAT, "%s: cannot create: %s",
                             s->path, strerror(errno));
        fclose(fp);
        s->video = video_create(s->part, s->width, s->height,
                                (double)s->opt.rate_num / s->opt.rate_den,
                                err);
        if (!s->video) {
            unlink(s->part);
            return -1;
        }
    }
    return video_write(s->video, s->pixel, err);
}

/* Names: R G B, then f.03 to f.31, A and Z. */
static int write_exr(struct framesink *s, const char *path,
                     const struct framesink_frame *f, struct error *err)
{
    char text[MAX_CHANNELS][8];
    static const char *const rgb[3] = {"R", "G", "B"};
    const char *names[MAX_CHANNELS + 2];
    const size_t C = f->color ? (size_t)f->channels : 3;
    const size_t N = f->width * f->height;
    const size_t all = C + (f->alpha != NULL) + (f->depth != NULL);
    char *part;
    int rc;

    for (size_t k = 0; k < C; k++) {
        snprintf(text[k], sizeof text[k], "f.%02zu", k % 100);
        names[k] = k < 3 ? rgb[k] : text[k];
    }
    if (f->alpha)
        names[C] = "A";
    if (f->depth)
        names[C + (f->alpha != NULL)] = "Z";
    free(s->plane);
    s->plane = malloc(N * all * sizeof *s->plane);
    part = malloc(strlen(path) + sizeof ".part");
    if (!s->plane || !part) {
        free(part);
        return error_set(err, EX_OSERR, "out of memory");
    }
    for (size_t i = 0; i < N; i++) {
        float *p = s->plane + i * all;

        for (size_t k = 0; k < C; k++)
            *p++ = f->color ? f->color[i * C + k]
                            : (float)f->rgb[3 * i + k] / 255.0f;
        if (f->alpha)
            *p++ = f->alpha[i];
        if (f->depth)
            *p = f->depth[i];
    }
    strcat(strcpy(part, path), ".part");
    rc = exr_write(part, s->plane, f->width, f->height, (int)all, names, err);
    if (rc == 0 && file_rename(part, path) != 0)
        rc = error_set(err, EX_CANTCREAT, "%s: cannot rename: %s", path,
                       strerror(errno));
    if (rc != 0)
        unlink(part);
    free(part);
    return rc;
}

/* RGBA in place to RGB, and the alphas apart. */
static void split_alpha(uint8_t *pixel, uint8_t *alpha, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        alpha[i] = pixel[4 * i + 3];
        memmove(pixel + 3 * i, pixel + 4 * i, 3);
    }
}

/* An IMAG record. */
static int write_imag(struct framesink *s, const struct framesink_frame *f,
                      struct error *err)
{
    const size_t N = f->width * f->height;
    struct array a[2];
    int n = 1;

    a[0] = array_make("rgb", DTYPE_U8, s->pixel, 3, f->height, f->width, 3,
                      0);
    if (s->opt.alpha) {
        split_alpha(s->pixel, s->pixel + 4 * N, N);
        a[n++] = array_make("alpha", DTYPE_U8, s->pixel + 4 * N, 2,
                            f->height, f->width, 0, 0);
    }
    return stream_write(s->stream, "IMAG", f->frame, f->time, a, n, err);
}

/* The features as halves: as drawn, or rounded here.  NULL: no memory. */
static const uint16_t *half_features(struct framesink *s,
                                     const struct framesink_frame *f, size_t n)
{
    if (!f->color)
        return f->half;
    if (n > s->half_count) {
        free(s->half);
        s->half = malloc(n * sizeof *s->half);
        s->half_count = s->half ? n : 0;
    }
    if (s->half)
        compose_table()->half(s->half, f->color, n);
    return s->half;
}

/* The covered pixels of f's photo, one after the other; NULL without
 * memory. */
static const float *packed_photo(struct framesink *s,
                                 const struct framesink_frame *f)
{
    const size_t N = f->width * f->height;
    float *to;

    if (s->photo_count < FRAMESINK_PHOTO * N) {
        free(s->photo);
        s->photo = malloc(FRAMESINK_PHOTO * N * sizeof *s->photo);
        s->photo_count = s->photo ? FRAMESINK_PHOTO * N : 0;
    }
    to = s->photo;
    for (size_t i = 0; to && i < N; i++)
        if (f->alpha[i] != 0) {
            memcpy(to, f->photo + FRAMESINK_PHOTO * i,
                   FRAMESINK_PHOTO * sizeof *to);
            to += FRAMESINK_PHOTO;
        }
    return s->photo;
}

/* A FEAT record; with `covered` only the pixels that alpha covers. */
static int write_feat(struct framesink *s, const struct framesink_frame *f,
                      struct error *err)
{
    const bool half = s->opt.record == FRAMESINK_FEAT_F16;
    const size_t C = (size_t)f->channels, N = f->width * f->height;
    const bool packed = s->opt.covered && f->alpha;
    const enum dtype type = half ? DTYPE_F16 : DTYPE_F32;
    const void *feat = half ? (const void *)half_features(s, f, N * C)
                            : f->color;
    const struct covered *c = &s->covered;
    const float *photo = f->photo && packed ? packed_photo(s, f) : f->photo;
    struct array a[7];
    int n = 1;

    if (!feat || !photo != !f->photo || (packed && covered_find(&s->covered, feat, f->alpha, N,
                                         C * dtype_size(type))))
        return error_set(err, EX_OSERR, "out of memory");
    a[0] = packed ? array_make("feat", type, NULL, 2, c->pixels, C, 0, 0)
                  : array_make("feat", type, feat, 3, f->height, f->width, C,
                               0);
    if (f->alpha)
        a[n++] = array_make("alpha", DTYPE_F32, f->alpha, 2, f->height,
                            f->width, 0, 0);
    if (f->depth)
        a[n++] = array_make("depth", DTYPE_F32, f->depth, 2, f->height,
                            f->width, 0, 0);
    if (photo)
        a[n++] = packed ? array_make("photo", DTYPE_F32, photo, 2, c->pixels,
                                     FRAMESINK_PHOTO, 0, 0)
                        : array_make("photo", DTYPE_F32, photo, 3, f->height,
                                     f->width, FRAMESINK_PHOTO, 0);
    if (f->place) {
        a[n++] = array_make("place", DTYPE_F32, f->place, 3, f->height,
                            f->width, 3, 0);
        a[n++] = array_make("map", DTYPE_F32, f->map, 1, 6, 0, 0, 0);
    }
    if (f->turned)
        a[n++] = array_make("turn", DTYPE_F32, f->turn, 1,
                            RELATIVE_POSE_SIZE, 0, 0, 0);
    return stream_write_parts(s->stream, "FEAT", f->frame, f->time, a, n,
                              packed ? c->run : NULL, packed ? c->runs : 0,
                              err);
}

/* PNG, PAM or a Y4M frame: into the stream, or a file of its own. */
static int write_picture(struct framesink *s,
                         const struct framesink_frame *f, struct error *err)
{
    const int C = s->opt.alpha ? 4 : 3;
    struct outfile one = {0}, *o = &s->out;
    const bool own = o->file != stdout && s->opt.format != FRAMESINK_Y4M
                    && is_pattern(s->path) == 1;
    int rc;

    if (own) {
        char *name = pattern_name(s->path, f->frame);

        rc = name ? outfile_open(&one, name, err)
                  : error_set(err, EX_OSERR, "out of memory");
        free(name);
        if (rc != 0)
            return -1;
        o = &one;
    } else if (!o->file && outfile_open(o, s->path, err) != 0) {
        return -1;
    }
    errno = 0;
    if (s->opt.format == FRAMESINK_PNG)
        rc = png_write_marked(o->file, s->pixel, f->width, f->height, C, err);
    else if (s->opt.format == FRAMESINK_PAM)
        rc = pnm_write(o->file, s->pixel, f->width, f->height, (size_t)C);
    else
        rc = write_y4m(s);
    if (rc != 0 && s->opt.format != FRAMESINK_PNG)
        outfile_error(o, err);
    else if (rc == 0 && (fflush(o->file) || ferror(o->file)))
        rc = outfile_error(o, err);     /* now: someone may be watching */
    if (own && rc == 0)
        return outfile_close(&one, err);
    if (own)
        outfile_abandon(&one);
    return rc;
}

/* On the terminal, as large as it is now. */
static int write_terminal(struct framesink *s, struct error *err)
{
    int columns, lines;

    terminal_size(stdout, &columns, &lines);
    if (terminal_draw(stdout, s->pixel, s->width, s->height, columns, lines))
        return error_set(err, EX_IOERR, "<stdout>: cannot write: %s",
                         strerror(errno));
    return 0;
}

/* To a video device. */
static int write_device(struct framesink *s, struct error *err)
{
    if (!s->device)
        s->device = v4l2_open(s->path, s->width, s->height, err);
    return s->device ? v4l2_write(s->device, s->pixel, err) : -1;
}

/* The frame in the format that was chosen. */
static int write_any(struct framesink *s, const struct framesink_frame *f,
                     struct error *err)
{
    if (s->opt.format == FRAMESINK_STREAM)
        return s->opt.record == FRAMESINK_IMAG ? write_imag(s, f, err)
                                               : write_feat(s, f, err);
    if (s->opt.format == FRAMESINK_VIDEO)
        return write_video(s, err);
    if (s->opt.format == FRAMESINK_TERMINAL)
        return write_terminal(s, err);
    if (s->opt.format == FRAMESINK_DEVICE)
        return write_device(s, err);
    if (s->opt.format == FRAMESINK_EXR) {
        char *name = pattern_name(s->path, f->frame);
        int rc = name ? write_exr(s, name, f, err)
                      : error_set(err, EX_OSERR, "out of memory");

        free(name);
        return rc;
    }
    return write_picture(s, f, err);
}

/* Only one frame fits in a plain .png or .exr, and only one size in a video. */
static int check_frame(const struct framesink *s,
                       const struct framesink_frame *f, struct error *err)
{
    const enum framesink_format k = s->opt.format;

    if (s->count == 0)
        return 0;
    if ((k == FRAMESINK_EXR || (k == FRAMESINK_PNG && s->out.file != stdout))
        && is_pattern(s->path) == 0)
        return error_set(err, EX_USAGE, "%s: frame %llu: the file holds one "
                         "picture (expected a pattern such as "
                         "frame-%%05d.%s)", s->path,
                         (unsigned long long)f->frame,
                         k == FRAMESINK_EXR ? "exr" : "png");
    if ((k == FRAMESINK_Y4M || k == FRAMESINK_VIDEO || k == FRAMESINK_DEVICE)
        && (f->width != s->width || f->height != s->height))
        return error_set(err, EX_DATAERR, "%s: frame %llu: %zu x %zu pixels "
                         "(expected %zu x %zu, as the frames before)",
                         s->path, (unsigned long long)f->frame, f->width,
                         f->height, s->width, s->height);
    return 0;
}

/* A background picture of another size is brought to the frames' once; frames
 * that are not square have it resized as they are composed. */
static int fit_background(struct framesink *s, const struct framesink_frame *f,
                          struct error *err)
{
    const struct background *bg = s->opt.background;

    if (f->width == s->fitted.width && f->height == s->fitted.height)
        return 0;
    background_release(&s->fitted);
    if (!bg || !bg->rgb || f->width != f->height ||
        (bg->width == f->width && bg->height == f->height))
        return 0;
    return background_fit(&s->fitted, bg, f->width, err);
}

int framesink_write(struct framesink *s, const struct framesink_frame *f,
                    struct error *err)
{
    const enum framesink_format k = s->opt.format;
    const int raw = k == FRAMESINK_EXR || (k == FRAMESINK_STREAM
                    && s->opt.record != FRAMESINK_IMAG);

    if (check_frame(s, f, err) != 0)
        return -1;
    if (s->opt.rate_num <= 0 || s->opt.rate_den <= 0) {
        s->opt.rate_num = 25;
        s->opt.rate_den = 1;
    }
    if (!raw && (s->count == 0 || f->width * f->height
                                  != s->width * s->height)) {
        free(s->pixel);
        s->pixel = malloc(5 * f->width * f->height);
        if (!s->pixel)
            return error_set(err, EX_OSERR, "out of memory for a picture of "
                             "%zu x %zu pixels", f->width, f->height);
    }
    if (!raw && fit_background(s, f, err))
        return -1;
    s->width = f->width;
    s->height = f->height;
    if (!raw && s->opt.alpha)
        framesink_compose_rgba(s->pixel, f);
    else if (!raw)
        framesink_compose(s->pixel, f, s->fitted.rgb ? &s->fitted
                                                     : s->opt.background);
    if (write_any(s, f, err) != 0)
        return -1;
    s->count++;
    return 0;
}

/* ---- ending ----------------------------------------------------------- */

/* Everything but what is still open. */
static void framesink_release(struct framesink *s)
{
    background_release(&s->fitted);
    if (s->opt.format == FRAMESINK_TERMINAL && s->count)
        terminal_end(stdout);
    v4l2_close(s->device);
    free(s->pixel);
    free(s->planes);
    free(s->plane);
    free(s->half);
    covered_release(&s->covered);
    free(s->photo);
    free(s->part);
    free(s->path);
    free(s);
}

int framesink_finish(struct framesink *s, struct error *err)
{
    int rc = 0;

    if (s->stream)
        rc = stream_finish(s->stream, err);
    s->stream = NULL;
    if (s->out.file)
        rc = outfile_close(&s->out, err);
    if (s->video) {
        rc = video_finish(s->video, err);
        s->video = NULL;
        if (rc == 0 && mark_video(s->part, err) < 0)
            rc = -1;
        if (rc == 0 && file_rename(s->part, s->path) != 0)
            rc = error_set(err, EX_CANTCREAT, "%s: cannot rename '%s': %s",
                           s->path, s->part, strerror(errno));
        if (rc != 0)
            unlink(s->part);
    }
    framesink_release(s);
    return rc;
}

void framesink_abandon(struct framesink *s)
{
    if (!s)
        return;
    if (s->stream)
        stream_abandon(s->stream);
    if (s->video) {
        video_finish(s->video, NULL);
        if (s->count == 0)
            unlink(s->part);
    }
    if (s->out.part && s->count > 0) {
        fclose(s->out.file);           /* complete frames: .part stays */
        free(s->out.part);
        free(s->out.path);
        memset(&s->out, 0, sizeof s->out);
    }
    outfile_abandon(&s->out);
    framesink_release(s);
}
