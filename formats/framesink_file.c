/* A frame into a picture's file, a video, the terminal or a video device. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

#include "formats/image.h"
#include "formats/framesink_impl.h"
#include "formats/mark.h"
#include "formats/pattern.h"
#include "formats/png.h"
#include "formats/pnm.h"
#include "formats/terminal.h"
#include "lib/base/file.h"

/* "dir/out.mp4" is written as "dir/out.part.mp4": the writer goes by the
 * extension, which --format may say. */
static char *framesink_video_part(const struct framesink_options *o)
{
    const char *path = o->path, *dot = strrchr(path, '.');
    const char *slash = strrchr(path, '/'), *end;
    const bool named = dot && (!slash || dot > slash);
    char *part = NULL;

    end = o->format == FRAMESINK_GIF    ? ".gif"
          : o->format == FRAMESINK_WEBP ? ".webp"
          : o->format == FRAMESINK_APNG ? ".apng"
          : named                       ? dot : ".mp4";
    if (asprintf(&part, "%.*s.part%s",
                 named ? (int)(dot - path) : (int)strlen(path), path, end) < 0)
        return NULL;
    return part;
}

/* Header first, then the frame's planes. */
static int framesink_write_y4m(struct framesink *s)
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

int framesink_write_video(struct framesink *s, double time, struct error *err)
{
    if (s->count == 0) {
        FILE *fp;

        s->part = framesink_video_part(&s->opt);
        if (!s->part)
            return error_set(err, EX_OSERR, "out of memory");
        fp = fopen(s->part, "wb");     /* the writer would not say why not */
        if (!fp)
            return error_set(err, EX_CANTCREAT, "%s: cannot create: %s",
                             s->path, strerror(errno));
        fclose(fp);
        s->video = video_create(s->part, &(struct video_options){
            .width = s->width, .height = s->height, .alpha = s->opt.alpha,
            .rate = (double)s->opt.rate_num / s->opt.rate_den,
            .sound = framesink_lost_sound(s) ? NULL : s->sound,
            .start = s->start, .comment = mark_text()}, err);
        if (!s->video) {
            unlink(s->part);
            return -1;
        }
    }
    return video_write(s->video, s->pixel, time, err);
}

/* pixel (N,all): colour, alpha and depth of f beside each other. */
static void framesink_interleave(float *pixel, const struct framesink_frame *f,
                                 size_t C)
{
    const size_t N = f->width * f->height;

    for (size_t i = 0; i < N; i++) {
        for (size_t k = 0; k < C; k++)
            *pixel++ = f->color ? f->color[i * C + k]
                                : (float)f->rgb[3 * i + k] / 255;
        if (f->alpha)
            *pixel++ = f->alpha[i];
        if (f->depth)
            *pixel++ = f->depth[i];
    }
}

/* Write all to a part beside the file, which it becomes when it is whole. */
static int framesink_write_channels(struct framesink *s, const char *path,
                                    const struct framesink_frame *f,
                                    struct error *err)
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
    framesink_interleave(s->plane, f, C);
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

int framesink_write_exr(struct framesink *s, const struct framesink_frame *f,
                        struct error *err)
{
    char *name = pattern_name(s->path, f->frame);
    int rc = name ? framesink_write_channels(s, name, f, err)
                  : error_set(err, EX_OSERR, "out of memory");

    free(name);
    return rc;
}

int framesink_write_picture(struct framesink *s,
                            const struct framesink_frame *f, struct error *err)
{
    const int C = s->opt.alpha ? 4 : 3;
    struct outfile one = {0}, *o = &s->out;
    const bool own = o->file != stdout && s->opt.format != FRAMESINK_Y4M
                    && pattern_count(s->path) == 1;
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
        rc = framesink_write_y4m(s);
    if (rc != 0 && (s->opt.format != FRAMESINK_PNG || ferror(o->file)))
        outfile_error(o, err);
    else if (rc == 0 && (fflush(o->file) || ferror(o->file)))
        rc = outfile_error(o, err);     /* now: someone may be watching */
    if (own && rc == 0)
        return outfile_close(&one, err);
    if (own)
        outfile_abandon(&one);
    return rc;
}

int framesink_write_terminal(struct framesink *s, struct error *err)
{
    int columns, lines;

    terminal_size(stdout, &columns, &lines);
    if (terminal_draw(stdout, s->pixel, s->width, s->height, columns, lines))
        return error_set(err, EX_IOERR, "<stdout>: cannot write: %s",
                         strerror(errno));
    return 0;
}

int framesink_write_device(struct framesink *s, struct error *err)
{
    if (!s->device)
        s->device = v4l2_open(s->path, s->width, s->height, err);
    return s->device ? v4l2_write(s->device, s->pixel, err) : -1;
}
