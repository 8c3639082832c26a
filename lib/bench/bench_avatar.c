/* The head mesh, the Gaussians' update and the whole driving pipeline, on a
 * synthetic person: true parameters for the mesh, frames in memory for the
 * pipeline.  The pipeline draws the paper's number of Gaussians, whatever grid
 * the model was trained on: convolutions do not know their picture's size. */
#include "lib/bench/bench.h"

#include <math.h>
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

#include "lib/animate/animate.h"
#include "lib/avatar/baked.h"
#include "lib/avatar/model.h"
#include "lib/base/cpu.h"
#include "lib/geom/camera.h"
#include "lib/synth/synth.h"
#include "lib/track/encoders.h"

#define SIZE 512
#define FRAMES 30           /* of the clip in memory, shown again and again */
#define PART 60             /* frames of one timed run */

struct stage {
    struct bench *b;
    struct head head;
    struct identity id;
    struct motion motion[FRAMES];
    uint8_t *rgb;           /* (FRAMES,SIZE,SIZE,3) */
    uint8_t *mask;          /* (SIZE,SIZE) of the first */
    float crop[3];
    size_t at, left;        /* next frame, frames left of a run */
    struct avatar_model avatar;
    struct densify dense;
    struct baked baked;
    float *verts;
    struct baked_move move;
};

/* A person's clip: pictures, true motion, the shape folded. */
static int make_clip(struct stage *s, struct error *err)
{
    const struct synth_options opt = {.seed = 11, .people = 1,
                                      .frames = FRAMES, .size = SIZE,
                                      .fps = 25, .threads = s->b->threads};
    const size_t pixels = SIZE * SIZE;
    struct synth_frame f;
    struct synth *synth = synth_open(&s->head, &opt, err);

    s->rgb = malloc(FRAMES * 3 * pixels);
    s->mask = malloc(pixels);
    if (!synth || !s->rgb || !s->mask)
        goto fail;
    for (size_t i = 0; i < FRAMES; i++) {
        struct motion *m = &s->motion[i];

        if (synth_next(synth, &f, err) != 1)
            goto fail;
        memcpy(s->rgb + i * 3 * pixels, f.rgb, 3 * pixels);
        memcpy(m->R, f.motion->rot, sizeof m->R);
        memcpy(m->t, f.motion->trans, sizeof m->t);
        memcpy(m->exp, f.motion->exp, s->head.nexp * sizeof *m->exp);
        memcpy(m->pose.jaw, f.motion->jaw, sizeof m->pose.jaw);
        memcpy(m->pose.lid, f.motion->lid, sizeof m->pose.lid);
        memcpy(m->pose.eye, f.motion->eye, sizeof m->pose.eye);
        m->pose.exp = m->exp;
        if (i)
            continue;
        memcpy(s->mask, f.mask, pixels);
        memcpy(s->crop, f.crop, sizeof s->crop);
        if (head_fold(&s->id, &s->head, f.beta, f.nbeta, err))
            goto fail;
    }
    synth_close(synth);
    return 0;
fail:
    synth_close(synth);
    return err->code ? -1 : error_set(err, EX_OSERR, "no memory for a clip");
}

static int open_stage(struct stage *s, struct bench *b, struct error *err)
{
    memset(s, 0, sizeof *s);
    s->b = b;
    if (!b->model || !b->head)
        return error_set(err, EX_NOINPUT, "no model.safetensors or no "
                         "head.safetensors (expected -m MODEL)");
    if (head_load(&s->head, b->head, err) ||
        make_clip(s, err) ||
        densify_init(&s->dense, s->head.f, s->head.F, s->head.V, err))
        return -1;
    s->verts = malloc(3 * s->head.V * sizeof *s->verts);
    return s->verts ? 0 : error_set(err, EX_OSERR, "no memory");
}

static void close_stage(struct stage *s)
{
    baked_release(&s->baked);
    avatar_model_release(&s->avatar);
    densify_release(&s->dense);
    identity_release(&s->id);
    head_release(&s->head);
    free(s->rgb);
    free(s->mask);
    free(s->verts);
    baked_move_release(&s->move);
}

/* ---- flame ------------------------------------------------------------- */

static int call_pose(void *context, struct error *err)
{
    struct stage *s = context;

    (void)err;
    head_pose(s->verts, &s->id, &s->motion[s->at++ % FRAMES].pose);
    return 0;
}

/* Largest difference from the double reference, over some frames. */
static double pose_error(struct stage *s)
{
    size_t n = 3 * s->head.V;
    double *ref = malloc(n * sizeof *ref), worst = 0;
    double *beta = calloc(s->head.nshape, sizeof *beta);
    double exp[HEAD_MAX_EXP];
    struct identity mean;
    struct error err;

    for (size_t i = 0; ref && beta && i < FRAMES &&
         head_fold(&mean, &s->head, NULL, 0, &err) == 0; i += 10) {
        const struct head_motion *m = &s->motion[i].pose;
        struct head_motion_d d = {.beta = beta, .exp = exp,
                                  .lid = {m->lid[0], m->lid[1]}};

        for (size_t k = 0; k < s->head.nexp; k++)
            exp[k] = m->exp[k];
        for (int k = 0; k < 3; k++) {
            d.pose[6 + k] = m->jaw[k];
            d.pose[9 + k] = m->eye[k];
            d.pose[12 + k] = m->eye[3 + k];
        }
        head_pose(s->verts, &mean, m);
        head_pose_d(ref, NULL, &s->head, &d);
        for (size_t k = 0; k < n; k++)
            worst = fmax(worst, fabs(s->verts[k] - ref[k]));
        identity_release(&mean);
    }
    free(ref);
    free(beta);
    return worst;
}

int bench_flame(struct bench *b, struct error *err)
{
    struct stage *s = calloc(1, sizeof *s);
    struct bench_times t;
    char config[96];
    int rc = s ? open_stage(s, b, err) : error_set(err, EX_OSERR, "no memory");

    if (rc == 0) {
        /* every direction active, as a network's output has it */
        for (size_t i = 0; i < FRAMES; i++)
            for (size_t k = 0; k < s->head.nexp; k++)
                if (s->motion[i].exp[k] == 0)
                    s->motion[i].exp[k] = 1e-3f;
        double worst = pose_error(s);
        snprintf(config, sizeof config, "V=%zu, %zu expressions, jaw, eyes, "
                 "lids", s->head.V, s->head.nexp);
        rc = bench_time(&t, b->seconds / 4, 300, call_pose, s, err);
        if (rc == 0) {
            bench_add(b, "flame", config, "default", 1, &t, worst, NAN);
            bench_note(b, "flame: %.3f micrometres from the double "
                       "reference", worst / s->head.scale * 1e6);
        }
    }
    if (s)
        close_stage(s);
    free(s);
    return rc;
}

/* ---- branches ---------------------------------------------------------- */

/* Weights of the model on the paper's grid: 296 and 32. */
static int open_avatar(struct stage *s, struct error *err)
{
    struct safetensors *st = st_open(s->b->model, err);
    struct avatar_model *m = &s->avatar;
    int rc = -1;

    if (!st)
        return -1;
    params_init(&m->ps);
    if (model_config(&m->config, st, err) == 0) {
        m->config.plane = m->config.backbone.size = 296;
        m->config.mouth = 32;
        m->config.size = SIZE;
        rc = avatar_init(&m->avatar, &m->ps, &m->config, &s->head, err) ||
             params_allocate(&m->ps, err) ||
             params_load(&m->ps, st, "", err) ||
             avatar_plan(&m->avatar, (struct nn_options){NN_INFER, NN_FAST},
                         err) ? -1 : 0;
    }
    st_close(st);
    return rc;
}

static int call_bake(void *context, struct error *err)
{
    struct stage *s = context;
    float cam[12];

    (void)err;
    head_pose(s->verts, &s->id, &s->motion[0].pose);
    motion_camera(cam, &s->motion[0]);
    avatar_bake(&s->avatar.avatar, &(struct avatar_source){
        .rgb = s->rgb, .matte = s->mask, .verts = s->verts, .cam = cam
    });
    return 0;
}

static int call_drive(void *context, struct error *err)
{
    struct stage *s = context;
    struct head_mouth mouth;
    float cam[12];

    (void)err;
    motion_camera(cam, &s->motion[s->at++ % FRAMES]);
    head_mouth(&mouth, &s->head, s->verts);
    baked_drive(&s->move, &s->baked, &s->dense, s->verts, mouth.centre,
                mouth.gap, BAKED_CLOSED, cam);
    return 0;
}

static int bench_baking(struct stage *s, struct error *err)
{
    struct bench_times t;
    char config[96];

    if (open_avatar(s, err) ||
        bench_time(&t, s->b->seconds / 4, 3, call_bake, s, err) ||
        baked_from_avatar(&s->baked, &s->avatar.avatar, err) ||
        baked_move_init(&s->move, &s->baked, err))
        return -1;
    snprintf(config, sizeof config, "N=%zu, plane 296, mouth 32",
             s->baked.N);
    bench_add(s->b, "branches", config, "bake (Phase A)", s->b->threads, &t,
              NAN, NAN);
    if (bench_time(&t, s->b->seconds / 8, 300, call_drive, s, err))
        return -1;
    bench_add(s->b, "branches", config, "update (a frame)", 1, &t, 0, NAN);
    return 0;
}

int bench_branches(struct bench *b, struct error *err)
{
    struct stage *s = calloc(1, sizeof *s);
    int rc = s ? open_stage(s, b, err) : error_set(err, EX_OSERR, "no memory");

    if (rc == 0)
        rc = bench_baking(s, err);
    if (s)
        close_stage(s);
    free(s);
    return rc;
}

/* ---- pipeline ---------------------------------------------------------- */

/* A decoded frame from memory, as the driver reads it. */
static int read_memory(void *context, struct frame *f, struct error *err)
{
    struct stage *s = context;

    (void)err;
    if (s->left == 0)
        return 0;
    s->left--;
    *f = (struct frame){.width = SIZE, .height = SIZE, .index = s->at,
                        .rgb = s->rgb + s->at % FRAMES * 3 * SIZE * SIZE,
                        .time = (double)s->at / 25};
    s->at++;
    return 1;
}

enum { STAGES = 8 };
static const char *const stage_name[STAGES] = {
    "crop", "motion", "flame", "branches", "splat", "refine", "decode",
    "encode"
};

/* One renderer set-up: SpiD* or SpiD, with what it draws. */
struct pipe {
    struct stage *s;
    struct encoders nets;
    struct identity mean;
    struct track track;
    struct animate animate;
    struct framesink *sink;
    char dir[32], clip[48], made[48];   /* of a video row; "" otherwise */
    double sum[STAGES];
    size_t frames;
};

static void add_times(void *ctx, const struct animate_frame *f)
{
    struct pipe *p = ctx;
    const double t[STAGES] = {f->t.crop, f->t.network + f->t.heads,
                              f->t.flame, f->t.branches, f->t.splat,
                              f->t.refine, f->t.decode, f->t.encode};

    for (int i = 0; i < STAGES; i++)
        p->sum[i] += 1e3 * t[i];
    p->frames++;
}

/* PART frames through the whole pipeline. */
static int call_pipe(void *context, struct error *err)
{
    struct pipe *p = context;
    struct driver d;

    p->s->left = PART;
    driver_init(&d, &p->track, read_memory, p->s);
    int rc = driver_start(&d, NULL, NULL, err) ||
             animate_run(&p->animate, &d, NULL, p->sink, add_times, p, err)
             ? -1 : 0;
    driver_release(&d);
    return rc;
}

/* The same from a video file to a video file. */
static int call_video(void *context, struct error *err)
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
    rc = driver_start(&d, NULL, NULL, err) ||
         animate_run(&p->animate, &d, NULL, out, add_times, p, err) ? -1 : 0;
    driver_release(&d);
    if (rc == 0)
        rc = framesink_finish(out, err);
    else
        framesink_abandon(out);
out:
    framesource_close(in);
    return rc;
}

/* PART frames as a video in a directory of our own. */
static int make_video(struct pipe *p, struct error *err)
{
    snprintf(p->dir, sizeof p->dir, "/tmp/spid-bench-XXXXXX");
    if (!mkdtemp(p->dir)) {
        p->dir[0] = 0;
        return error_set(err, EX_CANTCREAT, "/tmp: no room for a video");
    }
    snprintf(p->clip, sizeof p->clip, "%s/clip.mp4", p->dir);
    snprintf(p->made, sizeof p->made, "%s/made.mp4", p->dir);
    const struct framesink_options to = {.path = p->clip,
                                         .format = FRAMESINK_VIDEO};
    struct framesink *out = framesink_open(&to, err);

    for (size_t i = 0; out && i < PART; i++) {
        const struct framesink_frame f = {
            .width = SIZE, .height = SIZE, .channels = 3, .frame = i,
            .rgb = p->s->rgb + i % FRAMES * 3 * SIZE * SIZE,
            .time = (double)i / 25
        };

        if (framesink_write(out, &f, err)) {
            framesink_abandon(out);
            return -1;
        }
    }
    return out ? framesink_finish(out, err) : -1;
}

/* What a row of the pipeline draws, and between what. */
struct variant {
    bool star, half, video;
    const char *knob;
    bool report;                /* into the JSON's "fps" and "ms" */
};

static int open_pipe(struct pipe *p, struct stage *s, const struct variant *v,
                     struct error *err)
{
    const double half_size = SIZE / 2.0;
    const struct track_options track = {
        .size = SIZE, .has_crop = true, .has_window = true,
        .crop = {(double)s->crop[0], (double)s->crop[1], (double)s->crop[2]},
        .window = {half_size, half_size, SIZE}
    };
    const struct animate_options opt = {
        .size = SIZE, .model = s->b->model, .star = v->star, .half = v->half,
        .workers = s->b->threads, .closed = BAKED_CLOSED,
        .precision = NN_FAST
    };
    const struct framesink_options sink = {.path = "/dev/null",
                                           .format = FRAMESINK_PAM};

    memset(p, 0, sizeof *p);
    p->s = s;
    p->sink = framesink_open(&sink, err);
    if (!p->sink || encoders_open(&p->nets, s->b->model, false, NN_FAST, err) ||
        head_fold(&p->mean, &s->head, NULL, 0, err) ||
        track_init(&p->track, &p->mean, &p->nets.motion, &track, err) ||
        (v->video && make_video(p, err)))
        return -1;
    return animate_init(&p->animate, &opt, &s->id, &s->baked, &s->dense, err);
}

static void close_pipe(struct pipe *p)
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

/* The numbers of a row that programs look for. */
static void report(struct bench *b, const struct pipe *p,
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
                         p->sum[i] / (double)p->frames);
    }
}

static int bench_variant(struct stage *s, const struct variant *v,
                         struct error *err)
{
    struct pipe *p = calloc(1, sizeof *p);
    struct bench_times t;
    char config[96];
    int rc = p ? open_pipe(p, s, v, err)
               : error_set(err, EX_OSERR, "no memory");

    if (rc == 0)
        rc = bench_time(&t, s->b->seconds / 4, 300 / PART,
                        v->video ? call_video : call_pipe, p, err);
    if (rc == 0) {
        t.min /= PART;
        t.median /= PART;
        t.p95 /= PART;
        snprintf(config, sizeof config, "%s 512x512 N=%zu C=%d",
                 v->star ? "SpiD*" : "SpiD", s->baked.N,
                 v->star ? 3 : (int)s->baked.C);
        bench_add(s->b, "pipeline", config, v->knob, s->b->threads, &t, NAN,
                  NAN);
        if (v->report)
            report(s->b, p, v, t.median);
    }
    if (p)
        close_pipe(p);
    free(p);
    return rc;
}

int bench_pipeline(struct bench *b, struct error *err)
{
    static const struct variant variants[] = {
        {true, false, false, "frame to RGB", true},
        {false, false, false, "frame to RGB", true},
        {false, true, false, "frame to RGB, f16 features", false},
        {true, false, true, "video to video (mp4)", true},
        {false, false, true, "video to video (mp4)", true}
    };
    static const struct variant clear = {true, false, false,
                                         "without the clear ones", false};
    struct stage *s = calloc(1, sizeof *s);
    int rc = s ? open_stage(s, b, err) : error_set(err, EX_OSERR, "no memory");

    if (rc == 0)
        rc = open_avatar(s, err) || call_bake(s, err) ||
             baked_from_avatar(&s->baked, &s->avatar.avatar, err) ? -1 : 0;
    for (size_t i = 0; i < sizeof variants / sizeof *variants && rc == 0; i++)
        rc = bench_variant(s, &variants[i], err);
    if (rc == 0) {
        size_t all = s->baked.N;

        baked_drop_clear(&s->baked);
        bench_note(b, "pipeline: %zu of %zu Gaussians have an opacity over "
                   "1/255", s->baked.N, all);
        rc = bench_variant(s, &clear, err);
    }
    if (s)
        close_stage(s);
    free(s);
    return rc;
}
