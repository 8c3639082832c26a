/* The whole driving pipeline on a synthetic person, its frames in memory or in
 * a video.  It draws at least the paper's number of Gaussians, whatever grid
 * the model was trained on: convolutions do not know their picture's size.  Every row's
 * pictures are held against those of the slowest way: float everywhere, no
 * cut-offs, every Gaussian. */
#include "lib/lab/bench/bench.h"
#include "lib/splat/splat.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

#include "formats/framesource.h"
#include "lib/animate/animate.h"
#include "lib/avatar/prune.h"
#include "lib/base/cpu.h"
#include "lib/base/file.h"
#include "lib/lab/bench/bench_avatar.h"
#include "lib/track/encoders.h"

#define ROWS 20             /* about as many share the stage's seconds; the
                             * person and the errors take most of them */
#define FRAMES_MAX 1024    /* frames of a row's timed runs */
#define FRAME_VALUES ((size_t)PERSON_SIZE * PERSON_SIZE * 3)

struct pipe_rows {
    struct bench_person person;
    size_t all;                 /* Gaussians before any was left out */
    float *truth[2];            /* of SpiD, SpiD*: (PERSON_FRAMES,PERSON_SIZE,
                                 * PERSON_SIZE,3), 0..1 */
};

/* A decoded frame from memory, as the driver reads it. */
static int pipeline_read_memory(void *context, struct frame *f,
                                struct error *err)
{
    struct pipe_rows *l = context;
    struct bench_person *s = &l->person;

    (void)err;
    if (s->at == PERSON_FRAMES)
        return 0;
    *f = (struct frame){.width = PERSON_SIZE, .height = PERSON_SIZE,
                        .rgb = s->rgb + s->at * FRAME_VALUES,
                        .index = s->at, .time = (double)s->at / PERSON_FPS};
    s->at++;
    return 1;
}

enum { STAGES = 8 };
static const char *const stage_name[STAGES] = {
    "crop", "motion", "flame", "branches", "splat", "refine", "decode",
    "encode"
};

/* What a row of the pipeline draws, how, and between what. */
struct variant {
    const char *knob;
    bool star, video;
    bool exact;                 /* the truth: no cut-offs */
    bool f32, roi;              /* features in float */
    bool no_tta;                /* the encoder on one crop */
    bool no_align;              /* poses as it says them */
    bool no_photo;              /* baked colours alone */
    enum nn_type type;          /* of the networks */
    bool report;                /* into the JSON's "fps" and "ms" */
};

enum pictures { PICTURES_PASS, PICTURES_KEEP, PICTURES_COMPARE };

/* One renderer set-up: SpiD* or SpiD, with what it draws. */
struct pipe {
    struct pipe_rows *l;
    struct encoders nets;
    struct identity mean;
    struct track track;
    struct animate animate;
    struct framesink *sink;
    char dir[FILE_TEMPORARY];           /* of a video row; "" otherwise */
    char clip[FILE_TEMPORARY + 16], made[FILE_TEMPORARY + 16];
    double done[PERSON_FRAMES]; /* when each frame of this run was, seconds */
    size_t frames;              /* of timed runs: how many, ... */
    double stage[STAGES][FRAMES_MAX]; /* ... and milliseconds of each frame */
    double ms[FRAMES_MAX];
    size_t intervals;
    enum pictures pictures;
    float *truth;
    double worst, squares;      /* of the pictures compared */
    size_t values;
};

/* A finished picture, as floats or as bytes, becomes the truth or is held
 * against it. */
static void pipeline_take_picture(struct pipe *p, uint64_t index,
                                  const float *color, const uint8_t *rgb)
{
    if (p->pictures == PICTURES_PASS)
        return;
    float *want = p->truth + index * FRAME_VALUES;

    for (size_t k = 0; k < FRAME_VALUES; k++) {
        float x = color ? fminf(fmaxf(color[k], 0), 1) : (float)rgb[k] / 255;
        double d = fabs((double)x - (double)want[k]);

        if (p->pictures == PICTURES_KEEP) {
            want[k] = x;
            continue;
        }
        p->worst = fmax(p->worst, d);
        p->squares += d * d;
    }
    p->values += FRAME_VALUES;
}

/* A finished frame's times and picture. */
static void pipeline_frame_done(void *ctx, const struct animate_frame *f)
{
    struct pipe *p = ctx;
    const double t[STAGES] = {f->t.crop, f->t.network + f->t.heads,
                              f->t.draw.flame, f->t.draw.branches, f->t.draw.splat,
                              f->t.draw.refine, f->t.decode, f->t.encode};

    p->done[f->index] = cpu_seconds();
    for (int i = 0; i < STAGES && p->pictures == PICTURES_PASS; i++)
        p->stage[i][p->frames] = 1e3 * t[i];
    p->frames += p->pictures == PICTURES_PASS;
    if (p->clip[0] == 0)
        pipeline_take_picture(p, f->index, f->color, NULL);
}

/* One run through the whole pipeline. */
static int pipeline_call(void *context, struct error *err)
{
    struct pipe *p = context;
    struct driver d;

    p->l->person.at = 0;
    driver_init(&d, &p->track, pipeline_read_memory, p->l);
    int rc = driver_start(&d, "frames", NULL, NULL, err) ||
                     animate_run(&p->animate, &d, NULL, p->sink,
                                 pipeline_frame_done, p, err)
                 ? -1
                 : 0;
    driver_release(&d);
    return rc;
}

/* The same from a video file to a video file. */
static int pipeline_call_video(void *context, struct error *err)
{
    struct pipe *p = context;
    const char *const clip = p->clip;
    const struct framesink_options to = {.path = p->made,
                                         .format = FRAMESINK_VIDEO};
    struct framesource *in = framesource_open(&clip, 1, NULL, err);
    struct framesink *out = in ? framesink_open(&to, err) : NULL;
    struct driver d;
    int rc = -1;

    if (!out)
        goto out;
    driver_init(&d, &p->track, driver_read_source, in);
    rc = driver_start(&d, clip, NULL, NULL, err) ||
                 animate_run(&p->animate, &d, NULL, out, pipeline_frame_done, p,
                             err)
             ? -1
             : 0;
    driver_release(&d);
    if (rc == 0)
        rc = framesink_finish(out, err);
    else
        framesink_abandon(out);
out:
    framesource_close(in);
    return rc;
}

/* The clip as a video in a directory of our own. */
static int pipeline_make_video(struct pipe *p, struct error *err)
{
    if (bench_folder(p->dir, err))
        return -1;
    snprintf(p->clip, sizeof p->clip, "%s/clip.mp4", p->dir);
    snprintf(p->made, sizeof p->made, "%s/made.mp4", p->dir);
    return bench_person_write(&p->l->person, p->clip, PERSON_FRAMES, err);
}

/* A tracker that has seen no frame. */
static int pipeline_start_track(struct pipe *p, const struct variant *v,
                                struct error *err)
{
    const double middle = PERSON_SIZE / 2.0;
    const float *crop = p->l->person.motion[0].crop;
    const struct track_options track = {
        .size = PERSON_SIZE, .has_crop = true, .has_window = true,
        .crop = {(double)crop[0], (double)crop[1], (double)crop[2]},
        .window = {middle, middle, PERSON_SIZE}, .no_tta = v->no_tta,
        .no_align = v->no_align
    };

    track_release(&p->track);
    return track_init(&p->track, &p->mean, &p->nets.motion, &track, err);
}

/* Encoder, tracker and workers as a variant wants them. */
static int pipeline_open(struct pipe *p, struct pipe_rows *l,
                         const struct variant *v, struct error *err)
{
    struct bench_person *s = &l->person;
    const enum nn_type motion = v->type == NN_INT8 ? NN_FAST : v->type;
    const struct animate_options opt = {
        .pipeline = {
            .size = PERSON_SIZE, .model = &s->model, .star = v->star,
            .f32 = v->f32 || v->exact, .exact = v->exact, .roi = v->roi,
            .precision = v->type
        },
        .workers = s->b->threads
    };
    const struct pipeline_avatar avatar = {
        &s->id, &s->baked, &s->dense, v->no_photo ? NULL : &s->texture
    };
    const struct framesink_options sink = {.path = "/dev/null",
                                           .format = FRAMESINK_PAM};

    memset(p, 0, sizeof *p);
    p->l = l;
    p->truth = l->truth[v->star];
    p->sink = framesink_open(&sink, err);
    return !p->sink ||
                   encoders_open(&p->nets, &s->model, false, motion, err) ||
                   head_fold(&p->mean, &s->head, NULL, 0, err) ||
                   pipeline_start_track(p, v, err) ||
                   (v->video && pipeline_make_video(p, err)) ||
                   animate_init(&p->animate, &opt, &avatar, err)
               ? -1 : 0;
}

/* And the video's files. */
static void pipeline_close(struct pipe *p)
{
    animate_release(&p->animate);
    track_release(&p->track);
    identity_release(&p->mean);
    encoders_release(&p->nets);
    framesink_abandon(p->sink);
    if (p->dir[0]) {
        unlink(p->clip);
        unlink(p->made);
        rmdir(p->dir);
    }
}

/* The pictures of the video that was made last. */
static int pipeline_read_video(struct pipe *p, struct error *err)
{
    const char *const made = p->made;
    struct framesource *in = framesource_open(&made, 1, NULL, err);
    struct frame f;
    int rc = in ? 1 : -1;

    while (rc > 0 && (rc = framesource_read(in, &f, err)) > 0)
        pipeline_take_picture(p, f.index, NULL, f.rgb);
    framesource_close(in);
    return rc;
}

/* One run from the clip's start. */
static int pipeline_run(struct pipe *p, const struct variant *v,
                        struct error *err)
{
    return pipeline_start_track(p, v, err) ||
                   (v->video ? pipeline_call_video(p, err)
                             : pipeline_call(p, err))
               ? -1
               : 0;
}

/* The first run is for the pictures, and warms what the timed ones use. */
static int pipeline_compare(struct pipe *p, const struct variant *v,
                            double *max_abs, double *psnr_db, struct error *err)
{
    p->pictures = v->exact ? PICTURES_KEEP : PICTURES_COMPARE;
    if (pipeline_run(p, v, err) || (v->video && pipeline_read_video(p, err)))
        return -1;
    p->pictures = PICTURES_PASS;
    *max_abs = *psnr_db = NAN;
    if (v->exact)
        return 0;
    *max_abs = p->worst;
    *psnr_db = -10 * log10(fmax(p->squares / (double)p->values, 1e-300));
    return 0;
}

/* Timed runs for about as many seconds: of the time between finished frames,
 * as many of which are under way as there are threads. */
static int pipeline_time(struct pipe *p, const struct variant *v,
                         double seconds, struct error *err)
{
    const double begun = cpu_seconds();
    const size_t abreast = (size_t)p->animate.opt.workers;

    do {
        if (pipeline_run(p, v, err))
            return -1;
        for (size_t i = abreast; i < PERSON_FRAMES; i++)
            p->ms[p->intervals++] = 1e3 * (p->done[i] - p->done[i - abreast]) /
                                    (double)abreast;
    } while (p->frames + PERSON_FRAMES <= FRAMES_MAX &&
             cpu_seconds() - begun < seconds);
    return 0;
}

/* The numbers of a row that programs look for. */
static void pipeline_report(struct bench *b, struct pipe *p,
                            const struct variant *v, double median)
{
    char key[24];

    snprintf(key, sizeof key, "spid%s%s", v->star ? "_star" : "",
             v->video ? "_video" : "");
    bench_number(b, "fps", key, 1e3 / median);
    for (int i = 0; i < STAGES; i++) {
        bool own = v->video ? v->star && i > 5
                            : i < 6 && (v->star ? i != 5 : i > 3);

        if (own)
            bench_number(b, "ms", !v->star && i == 4 ? "splat_features"
                                                     : stage_name[i],
                         bench_quantiles(p->stage[i], p->frames).median);
    }
}

/* A row: its error, then its times. */
static int pipeline_variant(struct pipe_rows *l, const struct variant *v,
                            struct error *err)
{
    struct bench *b = l->person.b;
    struct pipe *p = calloc(1, sizeof *p);
    double max, psnr;
    char config[96];
    int rc = p ? pipeline_open(p, l, v, err)
               : error_set(err, EX_OSERR, "no memory");

    if (rc == 0)
        rc = pipeline_compare(p, v, &max, &psnr, err) ||
                     pipeline_time(p, v, b->seconds / (4 * ROWS), err)
                 ? -1
                 : 0;
    if (rc == 0) {
        const struct bench_times t = bench_quantiles(p->ms, p->intervals);

        if (v->report)
            pipeline_report(b, p, v, t.median);
        snprintf(config, sizeof config, "%s%s 512x512 N=%zu C=%d",
                 v->star ? "SpiD*" : "SpiD", v->video ? " mp4 to mp4" : "",
                 l->all, v->star ? 3 : (int)l->person.baked.C);
        bench_add(b, "pipeline", config, v->knob, b->threads, &t, max, psnr);
    }
    if (p)
        pipeline_close(p);
    free(p);
    return rc;
}

/* Fewer and fewer Gaussians. */
static int pipeline_reduced(struct pipe_rows *l, struct error *err)
{
    static const double eps[] = {0.1, 1, 10};
    struct bench_person *s = &l->person;
    struct prune_report r;
    char knob[64];
    struct variant v = {.knob = knob, .star = true, .type = NN_FAST};

    for (size_t i = 0; i < sizeof eps / sizeof *eps; i++) {
        if (prune_views(&s->baked, &r, &s->dense, &s->id, PERSON_SIZE, eps[i],
                        err))
            return -1;
        snprintf(knob, sizeof knob, "--prune %g: %zu", eps[i], s->baked.N);
        if (pipeline_variant(l, &v, err))
            return -1;
    }
    return 0;
}

/* The first frame as texture; what the person hides is taken for black. */
static int pipeline_make_texture(struct bench_person *s, struct error *err)
{
    uint8_t *back = calloc(FRAME_VALUES, 1);
    int rc = back ? texture_init(&s->texture, s->rgb, s->mask, back,
                                 PERSON_SIZE, err)
                  : error_set(err, EX_OSERR, "no memory for a picture");

    free(back);
    s->texture.grain = s->baked.grain;
    s->texture.grain_size = s->baked.grain_size;
    return rc;
}

/* Every variant, then fewer Gaussians. */
static int pipeline_all(struct pipe_rows *l, struct error *err)
{
    static const struct variant variants[] = {
        {"f32, no cut-offs", true, .exact = true, .type = NN_F32},
        {"f32, no cut-offs", false, .exact = true, .type = NN_F32},
        {"default", true, .type = NN_FAST, .report = true},
        {"--no-tta", true, .type = NN_FAST, .no_tta = true},
        {"--no-align", true, .type = NN_FAST, .no_align = true},
        {"--no-photo", true, .type = NN_FAST, .no_photo = true},
        {"f32 networks", true, .type = NN_F32},
        {"bf16 networks", true, .type = NN_BF16},
        {"default", false, .type = NN_FAST, .report = true},
        {"--no-photo", false, .type = NN_FAST, .no_photo = true},
        {"f32 networks", false, .type = NN_F32},
        {"bf16 networks", false, .type = NN_BF16},
        {"int8 refiner", false, .type = NN_INT8},
        {"f32 features", false, .type = NN_FAST, .f32 = true},
        {"--roi", false, .type = NN_FAST, .roi = true},
        {"default", true, .video = true, .type = NN_FAST, .report = true},
        {"default", false, .video = true, .type = NN_FAST, .report = true}
    };
    struct bench_person *s = &l->person;

    for (int i = 0; i < 2; i++) {
        l->truth[i] = calloc(PERSON_FRAMES * FRAME_VALUES,
                             sizeof *l->truth[i]);
        if (!l->truth[i])
            return error_set(err, EX_OSERR, "no memory for pictures");
    }
    if (bench_person_avatar(s, NN_FAST, err) || bench_person_bake(s, err) ||
        baker_copy(&s->baked, &s->baker, false, err) ||
        pipeline_make_texture(s, err))
        return -1;
    l->all = s->baked.N;
    for (size_t i = 0; i < sizeof variants / sizeof *variants; i++) {
        if (!variants[i].exact)
            baked_drop_clear(&s->baked);        /* as the programs do */
        if ((variants[i].type != NN_INT8 || nn_type_native(NN_INT8)) &&
            pipeline_variant(l, &variants[i], err))
            return -1;
    }
    return pipeline_reduced(l, err);
}

int bench_pipeline(struct bench *b, struct error *err)
{
    const size_t first = b->rows;
    struct pipe_rows l = {0};
    const int rc = bench_person_open(&l.person, b, err) ||
                   pipeline_all(&l, err) ? -1 : 0;

    if (rc == 0) {
        bench_note(b, "pipeline: errors are of the finished pictures against "
                   "the first row of the same kind: all networks in f32, "
                   "splatting without cut-offs, every Gaussian; of mp4 to mp4 "
                   "they are of the video made, read back");
        bench_pareto(b, first);
    }
    bench_person_close(&l.person);
    free(l.truth[0]);
    free(l.truth[1]);
    return rc;
}
