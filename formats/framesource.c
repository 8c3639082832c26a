/* Frames in: folders, lists, pictures, videos, cameras and piped streams, one
 * after the other as one clip. */
#include "formats/framesource.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>
#include <unistd.h>

#include "formats/door.h"
#include "formats/inputs.h"
#include "formats/livelink.h"
#include "formats/png.h"
#include "formats/pnm.h"
#include "formats/video.h"
#include "formats/y4m.h"

enum kind { KIND_NONE, KIND_IMAGE, KIND_VIDEO, KIND_Y4M, KIND_PNM, KIND_PNG };

struct framesource {
    struct framesource_options opt;
    struct names in;
    size_t next;                   /* the one to open */
    enum kind kind;                /* of the open one */
    FILE *fp;
    struct video_reader *video;
    struct y4m y4m;
    const char *name;
    uint64_t frames;               /* delivered */
    size_t here;                   /* of the open input */
    double start, last, end;       /* time of the open input's first frame, of
                                    * the last one delivered, of its end */
    bool sounds;                   /* the one input has sound */
    int num, den;                  /* rate */
    uint8_t *rgb, *planes;
    size_t rgb_room, planes_room;
    size_t damaged;                /* pictures */
    struct door door;              /* of Y4M whose pixels are not square */
    struct image square;
};

struct framesource *framesource_open(const char *const *paths, size_t count,
                                     const struct framesource_options *opt,
                                     struct error *err)
{
    struct framesource *s = calloc(1, sizeof *s);

    if (!s)
        return error_null(err, EX_OSERR, "out of memory");
    if (opt)
        s->opt = *opt;
    if (s->opt.max_pixels == 0)
        s->opt.max_pixels = IMAGE_MAX_PIXELS;
    s->name = "<no input>";
    for (size_t i = 0; i < count; i++)
        if (inputs_add(&s->in, paths[i], err) != 0) {
            framesource_close(s);
            return NULL;
        }
    if (s->in.count == 0) {
        error_set(err, EX_DATAERR, "no input frames");
        framesource_close(s);
        return NULL;
    }
    return s;
}

/* ---- opening one input ------------------------------------------------ */

/* Rate as a fraction: 30000/1001 and its kind, else thousandths. */
static void framesource_set_rate(struct framesource *s, double rate)
{
    double whole = round(rate), ntsc = whole * 1000 / 1001;

    if (s->frames > 0 || !(rate > 0))
        return;
    if (fabs(rate - whole) < 1e-3) {
        s->num = (int)whole;
        s->den = 1;
    } else if (fabs(rate - ntsc) < 1e-3) {
        s->num = (int)whole * 1000;
        s->den = 1001;
    } else {
        s->num = (int)lrint(rate * 1000);
        s->den = 1000;
    }
}

/* What a file carries, by its first bytes. */
static enum kind framesource_kind_of(const unsigned char *b, size_t n)
{
    if (n >= 6 && memcmp(b, "GIF8", 4) == 0)
        return KIND_VIDEO;
    if (video_is_webp(b, n))
        return KIND_VIDEO;
    if (n >= 12 && memcmp(b + 4, "ftypavis", 8) == 0)   /* AVIF that moves */
        return KIND_VIDEO;
    if (n >= 9 && memcmp(b, "YUV4MPEG2", 9) == 0)
        return KIND_Y4M;
    if (n >= 2 && b[0] == 'P' && b[1] >= '5' && b[1] <= '7')
        return KIND_PNM;
    if (n >= 4 && memcmp(b, "\x89PNG", 4) == 0)
        return KIND_PNG;
    return KIND_NONE;
}

/* The header line; frames follow. */
static int framesource_open_y4m(struct framesource *s, struct error *err)
{
    char line[512];
    size_t bytes;

    if (!fgets(line, sizeof line, s->fp))
        return error_set(err, EX_DATAERR, "%s: no Y4M header", s->name);
    line[strcspn(line, "\n")] = 0;
    if (y4m_parse(&s->y4m, line, err) != 0)
        return error_prefix(err, "%s", s->name);
    s->y4m.bt601 = s->opt.bt601;
    if (s->y4m.width * s->y4m.height > s->opt.max_pixels)
        return error_set(err, EX_DATAERR, "%s: frames of %zu x %zu pixels "
                         "(at most %zu pixels)", s->name, s->y4m.width,
                         s->y4m.height, s->opt.max_pixels);
    if (s->frames == 0) {
        s->num = s->y4m.rate_num;
        s->den = s->y4m.rate_den;
    }
    bytes = y4m_frame_bytes(&s->y4m);
    if (bytes > s->planes_room) {
        free(s->planes);
        s->planes = malloc(bytes);
        s->planes_room = s->planes ? bytes : 0;
    }
    bytes = 3 * s->y4m.width * s->y4m.height;
    if (bytes > s->rgb_room) {
        free(s->rgb);
        s->rgb = malloc(bytes);
        s->rgb_room = s->rgb ? bytes : 0;
    }
    if (!s->planes || !s->rgb)
        return error_set(err, EX_OSERR, "%s: out of memory", s->name);
    return 0;
}

/* One of the piped formats, by its first byte, which cannot be read twice. */
static int framesource_open_pipe(struct framesource *s, FILE *fp,
                                 const char *name, struct error *err)
{
    int c = getc(fp);

    s->name = name;
    s->fp = fp;
    if (c == EOF)
        return error_set(err, EX_DATAERR, "%s: empty (expected Y4M, PAM, "
                         "PPM or PNG frames)", name);
    ungetc(c, fp);
    s->kind = c == 'Y' ? KIND_Y4M : c == 'P' ? KIND_PNM
              : c == 0x89 ? KIND_PNG : KIND_NONE;
    if (s->kind == KIND_NONE)
        return error_set(err, EX_DATAERR, "%s: not Y4M, PAM, PPM or PNG"
                         " frames (decode other formats with ffmpeg, or name "
                         "the file)", name);
    return s->kind == KIND_Y4M ? framesource_open_y4m(s, err) : 0;
}

/* A picture, or else a video. */
static int framesource_open_file(struct framesource *s, const char *path,
                                 struct error *err)
{
    unsigned char b[32];
    struct stat st;
    size_t n;
    FILE *fp = fopen(path, "rb");

    if (!fp)
        return error_set(err, EX_NOINPUT, "%s: cannot open: %s", path,
                         strerror(errno));
    if (fstat(fileno(fp), &st) == 0 && S_ISFIFO(st.st_mode))
        return framesource_open_pipe(s, fp, path, err);
    if (livelink_probe(path)) {
        fclose(fp);
        return error_set(err, EX_DATAERR, "%s: a take of Live Link Face, not "
                         "pictures (expected as the driver of spid-animate, "
                         "or for spid-pack --arkit)", path);
    }
    n = fread(b, 1, sizeof b, fp);
    rewind(fp);
    if (n == 0) {
        fclose(fp);
        return error_set(err, EX_DATAERR, "%s: empty file (expected frames)",
                         path);
    }
    s->kind = framesource_kind_of(b, n);
    if (s->kind == KIND_Y4M || s->kind == KIND_PNM) {
        s->fp = fp;
        return s->kind == KIND_Y4M ? framesource_open_y4m(s, err) : 0;
    }
    if (s->kind == KIND_PNG && png_is_animated(fp))
        s->kind = KIND_VIDEO;
    fclose(fp);
    if (s->kind == KIND_PNG ||
        (s->kind == KIND_NONE && inputs_is_picture(path))) {
        s->kind = KIND_IMAGE;
        return 0;
    }
    s->kind = KIND_VIDEO;
    s->video = video_open(path, s->opt.bt601, err);
    if (!s->video)
        return -1;
    framesource_set_rate(s, s->video->rate);
    return 0;
}

/* What is piped in, or by "<" any file. */
static int framesource_open_stdin(struct framesource *s, struct error *err)
{
    struct stat st;

    if (fstat(STDIN_FILENO, &st) == 0 && S_ISREG(st.st_mode)) {
        const int c = ungetc(getc(stdin), stdin);

        if (c != EOF && !memchr("YP\x89", c, 3))
            return framesource_open_file(s, "/dev/stdin", err);
    }
    if (isatty(STDIN_FILENO))
        return error_set(err, EX_USAGE, "<stdin>: a terminal (expected Y4M, "
                         "PAM, PPM or PNG frames through a pipe)");
    return framesource_open_pipe(s, stdin, "<stdin>", err);
}

/* The next input of the list. */
static int framesource_open_next(struct framesource *s, struct error *err)
{
    const char *path = s->in.name[s->next++];

    s->name = path;
    s->here = 0;
    s->kind = KIND_NONE;
    if (strcmp(path, "-") == 0)
        return framesource_open_stdin(s, err);
    if (!video_is_live(path))
        return framesource_open_file(s, path, err);
    s->kind = KIND_VIDEO;
    s->video = video_open(path, s->opt.bt601, err);
    if (s->video)
        framesource_set_rate(s, s->video->rate);
    return s->video ? 0 : -1;
}

/* Before the next one. */
static void framesource_close_input(struct framesource *s)
{
    if (s->fp && s->fp != stdin)
        fclose(s->fp);
    s->fp = NULL;
    video_close(s->video);
    s->video = NULL;
    s->kind = KIND_NONE;
}

/* ---- reading ---------------------------------------------------------- */

int frame_copy(struct image *im, const struct frame *f, struct error *err)
{
    const size_t n = 3 * f->width * f->height;

    *im = (struct image){.width = f->width, .height = f->height,
                         .rgb = malloc(n)};
    if (!im->rgb)
        return error_set(err, EX_OSERR, "no memory for a frame");
    memcpy(im->rgb, f->rgb, n);
    return 0;
}


/* The same frame with square pixels: 1, or -1. */
static int framesource_make_square(struct framesource *s, struct frame *f,
                                   struct error *err)
{
    const struct y4m *y = &s->y4m;
    const struct door_tag tag = {
        .aspect = y->aspect_den ? (double)y->aspect_num / y->aspect_den : 1,
        .pixels = {.channels = 3, .bits = 8}
    };

    if (door_picture(&s->door, &s->square, y->width, y->height, &tag, s->rgb,
                     3 * y->width, s->name, err))
        return -1;
    f->rgb = s->square.rgb;
    f->width = s->square.width;
    f->height = s->square.height;
    return 1;
}

/* One frame, converted to RGB; short ones are an error. */
static int framesource_read_y4m(struct framesource *s, struct frame *f,
                                struct error *err)
{
    size_t bytes = y4m_frame_bytes(&s->y4m), got;
    char line[512];

    if (!fgets(line, sizeof line, s->fp)) {
        if (s->here == 0)
            return error_set(err, EX_DATAERR, "%s: Y4M without frames",
                             s->name);
        return 0;
    }
    if (strncmp(line, "FRAME", 5) != 0)
        return error_set(err, EX_DATAERR, "%s: frame %zu: no FRAME line",
                         s->name, s->here);
    got = fread(s->planes, 1, bytes, s->fp);
    if (got != bytes)
        return error_set(err, EX_DATAERR, "%s: frame %zu: cut short after "
                         "%zu of %zu bytes", s->name, s->here, got, bytes);
    y4m_to_rgb(s->rgb, s->planes, &s->y4m);
    f->rgb = s->rgb;
    f->width = s->y4m.width;
    f->height = s->y4m.height;
    return s->y4m.aspect_num == s->y4m.aspect_den
         ? 1 : framesource_make_square(s, f, err);
}

/* One picture of a sequence. */
static int framesource_read_pnm(struct framesource *s, struct frame *f,
                                struct error *err)
{
    int rc = pnm_read(s->fp, &s->rgb, &s->rgb_room, &f->width, &f->height,
                      s->opt.max_pixels, err);

    if (rc < 0)
        return error_prefix(err, "%s: frame %zu", s->name, s->here);
    f->rgb = s->rgb;
    return rc;
}

/* A picture becomes the frame, and is s's. */
static void framesource_take(struct framesource *s, struct frame *f,
                             const struct image *im)
{
    free(im->alpha);
    free(s->rgb);
    s->rgb = im->rgb;
    s->rgb_room = 3 * im->width * im->height;
    f->rgb = im->rgb;
    f->width = im->width;
    f->height = im->height;
}

/* One picture of a sequence. */
static int framesource_read_png(struct framesource *s, struct frame *f,
                                struct error *err)
{
    struct image im;
    int c = getc(s->fp);

    if (c == EOF)
        return 0;
    ungetc(c, s->fp);
    if (png_read_next(&im, s->fp, s->opt.max_pixels, err) != 0)
        return error_prefix(err, "%s: frame %zu", s->name, s->here);
    framesource_take(s, f, &im);
    return 1;
}

/* The one picture of a file. */
static int framesource_read_image(struct framesource *s, struct frame *f,
                                  struct error *err)
{
    struct image im;

    if (s->here > 0)
        return 0;
    if (image_read(&im, s->name, err) != 0)
        return -1;
    s->damaged += im.damaged;
    framesource_take(s, f, &im);
    return 1;
}

/* The next decoded frame. */
static int framesource_read_video(struct framesource *s, struct frame *f,
                                  struct error *err)
{
    int rc = video_read(s->video, &f->rgb, &f->width, &f->height, &f->time,
                        err);

    if (rc == 1 && f->width * f->height > s->opt.max_pixels)
        return error_set(err, EX_DATAERR, "%s: frames of %zu x %zu pixels "
                         "(at most %zu pixels)", s->name, f->width,
                         f->height, s->opt.max_pixels);
    return rc;
}

/* By the open input's kind. */
static int framesource_read_any(struct framesource *s, struct frame *f,
                                struct error *err)
{
    switch (s->kind) {
    case KIND_IMAGE: return framesource_read_image(s, f, err);
    case KIND_VIDEO: return framesource_read_video(s, f, err);
    case KIND_Y4M: return framesource_read_y4m(s, f, err);
    case KIND_PNM: return framesource_read_pnm(s, f, err);
    case KIND_PNG: return framesource_read_png(s, f, err);
    default: return 0;
    }
}

/* Times: the video's own, shifted to follow the inputs before; otherwise by
 * the rate. */
static void framesource_stamp(struct framesource *s, struct frame *f)
{
    double step;

    if (s->num <= 0) {
        framesource_set_rate(s, s->opt.rate > 0 ? s->opt.rate : 25);
        if (s->num <= 0) {
            s->num = 25;
            s->den = 1;
        }
    }
    step = (double)s->den / s->num;
    if (s->kind != KIND_VIDEO)
        f->time = s->frames ? s->last + step : 0;
    else if (s->here == 0)
        s->start = f->time - (s->frames ? s->last + step : 0);
    if (s->kind == KIND_VIDEO) {
        f->time -= s->start;
        s->sounds = s->video->sounds;
    }
    /* multiples of the frame time, not sums of rounding errors */
    if (s->kind != KIND_VIDEO && s->next == 1)
        f->time = (double)s->frames * s->den / s->num;
    f->index = s->frames++;
    s->last = f->time;
    s->end = s->kind == KIND_VIDEO ? s->video->end - s->start
                                   : f->time + step;
    s->here++;
}

int framesource_read(struct framesource *s, struct frame *f,
                     struct error *err)
{
    for (;;) {
        int rc;

        if (s->kind == KIND_NONE) {
            if (s->next == s->in.count)
                return 0;
            if (framesource_open_next(s, err) != 0)
                return -1;
        }
        memset(f, 0, sizeof *f);
        rc = framesource_read_any(s, f, err);
        if (rc > 0)
            framesource_stamp(s, f);
        if (rc != 0)
            return rc;
        if (s->kind == KIND_VIDEO)
            s->end = s->video->end - s->start;
        framesource_close_input(s);
    }
}

void framesource_rate(const struct framesource *s, int *num, int *den)
{
    *num = s->num > 0 ? s->num : 25;
    *den = s->num > 0 ? s->den : 1;
}

double framesource_end(const struct framesource *s)
{
    return s->end;
}

const char *framesource_sound(const struct framesource *s, double *start)
{
    if (s->in.count != 1 || !s->sounds || video_is_live(s->in.name[0]))
        return NULL;
    *start = s->start;
    return s->in.name[0];
}

bool framesource_reads(const struct framesource *s, const char *name)
{
    return inputs_have(&s->in, name);
}

bool framesource_recorded(const struct framesource *s)
{
    struct stat st;
    bool all = true;

    for (size_t i = 0; i < s->in.count; i++)
        all = all && strcmp(s->in.name[i], "-") != 0 &&
              stat(s->in.name[i], &st) == 0 && S_ISREG(st.st_mode);
    return all;
}

size_t framesource_total(const struct framesource *s)
{
    if (s->kind == KIND_VIDEO && s->in.count == 1)
        return s->video->frames;
    return s->kind == KIND_IMAGE ? s->in.count : 0;
}

size_t framesource_damaged(const struct framesource *s)
{
    return s->damaged;
}

const char *framesource_name(const struct framesource *s)
{
    return s->name;
}

void framesource_close(struct framesource *s)
{
    if (!s)
        return;
    framesource_close_input(s);
    names_release(&s->in);
    free(s->rgb);
    free(s->planes);
    door_release(&s->door);
    image_release(&s->square);
    free(s);
}
