/* Picture metrics of two clips read side by side, one frame of each in memory
 * and the one before it. */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/framesource.h"
#include "lib/lab/eval/compare.h"
#include "lib/lab/eval/image.h"

enum {
    PSNR, SSIM, MSSSIM, L1, FLICKER, LPIPS, ARCFACE, ARCFACE_SRC,
    PSNR_FIRST, PSNR_LATER, BEATS_0, EDGES, MUSIQ, TOPIQ, COUNT
};
static const char *const name[COUNT] = {
    "psnr", "ssim", "msssim", "l1", "flicker", "lpips", "arcface",
    "arcface_src", "psnr_first", "psnr_later", "beats_0_pct", "edge_ratio",
    "musiq", "topiq"};
static const int better[COUNT] = {1, 1, 1, -1, -1, -1, 1, 1, 1, 1, 1, 0,
                                  1, 1};

/* Two clips and the planar pictures of this frame and the last. */
struct frames {
    struct framesource *in[2];      /* truth, result */
    float *now[2], *last[2];        /* (3,H,W) */
    float *first;                   /* the truth's first frame */
    bool unchanged;                 /* a null line is wanted */
    size_t H, W, frames;
    struct lpips *lpips;            /* or NULL */
    struct likeness *likeness;      /* or NULL */
    struct musiq *musiq;            /* or NULL */
    struct topiq *topiq;            /* or NULL */
    int faces;                      /* found in the frames of now: 2 is all */
};

/* Frame f of clip k as planar floats, and its face's embedding. */
static int frames_take(struct frames *p, int k, const struct frame *f,
                       struct error *err)
{
    if (!p->H) {
        p->H = f->height;
        p->W = f->width;
    }
    if (f->height != p->H || f->width != p->W)
        return error_set(err, EX_DATAERR, "%s: frame %zu: %zux%zu pixels "
                         "(expected %zux%zu)", framesource_name(p->in[k]),
                         p->frames, f->width, f->height, p->W, p->H);
    if (!p->now[0]) {
        size_t n = 3 * p->H * p->W;
        p->now[0] = malloc(5 * n * sizeof(float));
        if (!p->now[0])
            return error_set(err, EX_OSERR, "out of memory");
        p->now[1] = p->now[0] + n;
        p->last[0] = p->now[0] + 2 * n;
        p->last[1] = p->now[0] + 3 * n;
        p->first = p->now[0] + 4 * n;
    }
    metric_planar_u8(p->now[k], f->rgb, p->H * p->W);
    if (!p->likeness)
        return 0;
    int found = likeness_embed(p->likeness, k, f->rgb, f->width, f->height,
                               f->time, err);
    p->faces += found > 0;
    return found < 0 ? -1 : 0;
}

/* Next frame of both.  1, 0 at the end of both, -1. */
static int frames_next(struct frames *p, struct error *err)
{
    struct frame f;
    int rc[2];

    p->faces = 0;
    for (int k = 0; k < 2; k++) {
        rc[k] = framesource_read(p->in[k], &f, err);
        if (rc[k] < 0 || (rc[k] && frames_take(p, k, &f, err)))
            return -1;
    }
    if (rc[0] != rc[1])
        return error_set(err, EX_DATAERR, "%s ends after %zu frame%s, the "
                         "other goes on (expected as many frames)",
                         framesource_name(p->in[rc[0] ? 1 : 0]), p->frames,
                         plural(p->frames));
    return rc[0];
}

/* What is measured of picture b (3,H,W) against this frame's truth; NaN where
 * there is none. */
static int frames_measure_picture(double v[COUNT], const struct frames *p,
                                  const float *b, struct error *err)
{
    const float *a = p->now[0];
    size_t n = 3 * p->H * p->W;
    struct metric_ssim s;
    struct metric_msssim m;

    for (int k = 0; k < COUNT; k++)
        v[k] = NAN;
    v[L1] = metric_l1(a, b, n);
    v[PSNR] = metric_psnr(metric_mse(a, b, n));
    if (p->frames)
        v[PSNR_LATER] = v[PSNR];
    if (p->H > 1 && p->W > 1)
        v[EDGES] = metric_edges(b, p->H, p->W) / metric_edges(a, p->H, p->W);
    if (p->H >= 11 && p->W >= 11) {
        if (metric_ssim(&s, NULL, NULL, a, b, 3, p->H, p->W, err))
            return -1;
        v[SSIM] = s.mean;
    }
    if (p->H >= METRIC_MSSSIM_MIN && p->W >= METRIC_MSSSIM_MIN) {
        if (metric_msssim(&m, NULL, a, b, 3, p->H, p->W, err))
            return -1;
        v[MSSSIM] = m.mean;
    }
    if (p->lpips && p->H >= 64 && p->W >= 64 &&
        lpips_distance(&v[LPIPS], p->lpips, a, b, p->H, p->W, err))
        return -1;
    if (p->musiq && musiq_quality(&v[MUSIQ], p->musiq, b, p->H, p->W, err))
        return -1;
    if (p->topiq && p->H >= TOPIQ_MIN && p->W >= TOPIQ_MIN &&
        topiq_quality(&v[TOPIQ], p->topiq, b, p->H, p->W, err))
        return -1;
    return 0;
}

/* Every figure of this pair of frames, and into still[] those of the truth's
 * first frame in the result's place. */
static int frames_measure(double v[COUNT], double still[COUNT],
                          const struct frames *p, struct error *err)
{
    if (frames_measure_picture(v, p, p->now[1], err) ||
        (p->unchanged && p->frames &&
         frames_measure_picture(still, p, p->first, err)))
        return -1;
    if (p->likeness && p->faces == 2) {
        v[ARCFACE] = likeness_pair(p->likeness);
        v[ARCFACE_SRC] = likeness_source(p->likeness);
    }
    if (!p->frames) {
        v[PSNR_FIRST] = v[PSNR];
        return 0;
    }
    v[FLICKER] = metric_flicker(p->last[0], p->now[0], p->last[1], p->now[1],
                                3 * p->H * p->W);
    if (p->unchanged)
        v[BEATS_0] = v[PSNR] > still[PSNR] ? 100 : 0;
    return 0;
}

/* Whether a column belongs in the table at all. */
static bool frames_wanted(const struct frames *p, int k)
{
    switch (k) {
    case FLICKER: return p->frames > 0;
    case LPIPS: return p->lpips != NULL;
    case MUSIQ: return p->musiq != NULL;
    case TOPIQ: return p->topiq != NULL;
    case ARCFACE: return p->likeness != NULL;
    case ARCFACE_SRC: return p->likeness && p->likeness->has_source;
    case PSNR_FIRST: return p->unchanged && p->frames == 0;
    case PSNR_LATER:
    case BEATS_0: return p->unchanged && p->frames > 0;
    case EDGES: return p->unchanged;
    default: return true;
    }
}

void compare_log_names(const struct compare_log *log,
                       const char *const *names, int count)
{
    if (!log || !log->tsv)
        return;
    fputs("pair\tframe", log->tsv);
    for (int k = 0; k < count; k++)
        fprintf(log->tsv, "\t%s", names[k]);
    fputc('\n', log->tsv);
}

void compare_log_frame(const struct compare_log *log, size_t frame,
                       const double *value, int count)
{
    if (!log || !log->tsv)
        return;
    fprintf(log->tsv, "%s\t%zu", log->pair, frame);
    for (int k = 0; k < count; k++)
        fprintf(log->tsv, "\t%.9g", value[k]);
    fputc('\n', log->tsv);
}

/* Figures into the table and the log. */
static void frames_record(struct table *t, size_t row, const double v[COUNT],
                          const struct frames *p,
                          const struct compare_log *log)
{
    for (int k = 0; k < COUNT; k++)
        if (frames_wanted(p, k))
            table_add(t, row, table_column(t, name[k], better[k]), v[k]);
    compare_log_frame(log, p->frames, v, COUNT);
}

/* Figures of the null line: those that a still picture has. */
static void frames_record_still(struct table *t, size_t row,
                                const double v[COUNT], const struct frames *p)
{
    static const int kept[] = {PSNR, SSIM, MSSSIM, L1, LPIPS, PSNR_LATER,
                               EDGES, MUSIQ, TOPIQ};

    for (size_t i = 0; i < sizeof kept / sizeof *kept; i++)
        if (frames_wanted(p, kept[i]))
            table_add(t, row,
                      table_column(t, name[kept[i]], better[kept[i]]),
                      v[kept[i]]);
}

int compare_frames(struct table *t, const struct compare_rows *rows,
                   const struct pair *pair, const struct compare_nets *nets,
                   const struct compare_log *log, struct error *err)
{
    const char *path[2] = {pair->truth, pair->result};
    struct frames p = {.lpips = nets->lpips, .likeness = nets->likeness,
                       .musiq = nets->musiq, .topiq = nets->topiq,
                       .unchanged = rows->unchanged != TABLE_NO_ROW};
    double v[COUNT], still[COUNT];
    size_t bytes;
    int rc = -1;

    if (p.likeness && likeness_start(p.likeness, pair->source, err))
        goto out;
    for (int k = 0; k < 2; k++) {
        p.in[k] = framesource_open(&path[k], 1, NULL, err);
        if (!p.in[k])
            goto out;
    }
    compare_log_names(log, name, COUNT);
    while ((rc = frames_next(&p, err)) > 0) {
        bytes = 3 * p.H * p.W * sizeof(float);
        if (!p.frames)
            memcpy(p.first, p.now[0], bytes);
        if (frames_measure(v, still, &p, err)) {
            rc = -1;
            break;
        }
        frames_record(t, rows->result, v, &p, log);
        if (p.unchanged && p.frames)
            frames_record_still(t, rows->unchanged, still, &p);
        p.frames++;
        memcpy(p.last[0], p.now[0], 2 * bytes);
    }
    if (!rc && !p.frames)
        rc = error_set(err, EX_DATAERR, "%s: no frames", pair->truth);
out:
    free(p.now[0]);
    framesource_close(p.in[0]);
    framesource_close(p.in[1]);
    return rc;
}
