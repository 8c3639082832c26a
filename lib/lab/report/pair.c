/* Two clips, frame by frame, into the halves of one video. */
#include "lib/lab/report/pair.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

#include "formats/framesource.h"
#include "formats/video.h"
#include "lib/base/file.h"

#define PAIR_MAX ((size_t)256 << 20)            /* bytes of the file */

void pair_release(struct pair *p)
{
    free(p->mp4);
    memset(p, 0, sizeof *p);
}

/* The largest square in the middle of a frame. */
static struct square pair_middle(const struct frame *f)
{
    double w = (double)f->width, h = (double)f->height;

    return (struct square){w / 2, h / 2, w < h ? w : h};
}

/* One frame as half of the picture (S, 2 S, 3). */
static int pair_put(uint8_t *both, uint8_t *half, size_t S, size_t side,
                    const struct frame *f, const struct square *window,
                    struct error *err)
{
    const struct square q = window ? *window : pair_middle(f);

    if (crop_resize_u8(half, S, f->rgb, f->width, f->height, 3 * f->width, 3,
                       q))
        return error_set(err, EX_OSERR, "out of memory for a frame");
    for (size_t y = 0; y < S; y++)
        memcpy(both + (2 * y + side) * 3 * S, half + y * 3 * S, 3 * S);
    return 0;
}

/* What is open while a pair is made. */
struct pairing {
    struct framesource *driver, *result;
    struct video_writer *video;
    uint8_t *both, *half;
    char path[FILE_TEMPORARY];  /* of the file while it is written */
};

/* The file that the video's writer takes its kind from. */
static int pair_name(struct pairing *g, struct error *err)
{
    file_temporary(g->path, "spid-report-XXXXXX.mp4");
    int fd = mkstemps(g->path, 4);

    if (fd < 0) {
        error_set(err, EX_CANTCREAT, "%s: %s", g->path, strerror(errno));
        g->path[0] = '\0';
        return -1;
    }
    close(fd);
    return 0;
}

/* Memory and video for halves of the result's height. */
static int pair_begin(struct pair *p, struct pairing *g,
                      const struct frame *result, struct error *err)
{
    int num, den;

    p->size = result->height < 1024 ? result->height & ~(size_t)1 : 1024;
    framesource_rate(g->result, &num, &den);
    p->rate = (double)num / den;
    g->both = malloc(6 * p->size * p->size + 1);
    g->half = malloc(3 * p->size * p->size + 1);
    if (!g->both || !g->half)
        return error_set(err, EX_OSERR, "out of memory for a frame");
    if (pair_name(g, err))
        return -1;
    g->video = video_create(g->path, &(struct video_options){
        .width = 2 * p->size, .height = p->size, .rate = p->rate}, err);
    return g->video ? 0 : -1;
}

/* Frames of both, until one ends.  1: one more; 0: the end; -1: damaged. */
static int pair_step(struct pair *p, struct pairing *g,
                     const struct square *window, struct error *err)
{
    struct frame a, b;
    int rc = framesource_read(g->driver, &a, err);

    if (rc <= 0 || (rc = framesource_read(g->result, &b, err)) <= 0)
        return rc;
    if (!g->video && pair_begin(p, g, &b, err))
        return -1;
    if (pair_put(g->both, g->half, p->size, 0, &a, window, err) ||
        pair_put(g->both, g->half, p->size, 1, &b, NULL, err) ||
        video_write(g->video, g->both, a.time, err))
        return -1;
    p->frames++;
    return 1;
}

int pair_make(struct pair *p, const char *driver, const char *result,
              const struct square *window, struct error *err)
{
    const struct framesource_options opt = {0};
    struct pairing g = {
        .driver = framesource_open(&driver, 1, &opt, err),
        .result = framesource_open(&result, 1, &opt, err)};
    int rc = g.driver && g.result ? 1 : -1;

    memset(p, 0, sizeof *p);
    while (rc > 0 && p->frames < PAIR_FRAMES)
        rc = pair_step(p, &g, window, err);
    if (rc >= 0 && !p->frames)
        rc = error_set(err, EX_DATAERR, "%s: no frames", result);
    if (rc >= 0) {
        rc = video_finish(g.video, 0, err);
        g.video = NULL;
        if (rc == 0)
            p->mp4 = (uint8_t *)file_read(&p->bytes, g.path, PAIR_MAX, err);
        rc = p->mp4 ? 0 : -1;
    }
    if (g.video)
        video_finish(g.video, 0, NULL);
    if (g.path[0])
        unlink(g.path);
    framesource_close(g.driver);
    framesource_close(g.result);
    free(g.both);
    free(g.half);
    return rc;
}
