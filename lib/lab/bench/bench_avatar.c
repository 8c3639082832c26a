/* The head mesh and the Gaussians' update, on a synthetic person with true
 * parameters. */
#include "lib/lab/bench/bench_avatar.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/framesink.h"
#include "lib/base/file.h"
#include "lib/lab/people/synth.h"

/* A person's clip: pictures, true motion, the shape folded. */
static int bench_make_clip(struct bench_person *p, struct error *err)
{
    const struct synth_options opt = {.seed = 11, .people = 1,
                                      .frames = PERSON_FRAMES,
                                      .size = PERSON_SIZE,
                                      .fps = PERSON_FPS};
    const size_t pixels = PERSON_SIZE * PERSON_SIZE;
    struct synth_frame f;
    struct synth *synth = synth_open(&p->head, &opt, err);

    p->rgb = arena_take(&p->memory, PERSON_FRAMES, 3 * pixels);
    p->mask = arena_take(&p->memory, pixels, 1);
    p->beta = arena_take(&p->memory, p->head.nshape, sizeof *p->beta);
    p->verts = arena_take(&p->memory, 3 * p->head.V, sizeof *p->verts);
    if (!synth || arena_check(&p->memory, "a clip", err))
        goto fail;
    for (size_t i = 0; i < PERSON_FRAMES; i++) {
        struct motion *m = &p->motion[i];

        if (synth_next(synth, &f, err) != 1)
            goto fail;
        memcpy(p->rgb + i * 3 * pixels, f.rgb, 3 * pixels);
        *m = *f.motion;
        m->pose.exp = m->exp;
        if (i)
            continue;
        memcpy(p->mask, f.mask, pixels);
        for (size_t k = 0; k < f.nbeta; k++)
            p->beta[k] = f.beta[k];
        if (head_fold(&p->id, &p->head, f.beta, f.nbeta, err))
            goto fail;
    }
    synth_close(synth);
    return 0;
fail:
    synth_close(synth);
    return -1;
}

int bench_person_open(struct bench_person *p, struct bench *b,
                      struct error *err)
{
    memset(p, 0, sizeof *p);
    p->b = b;
    if (!b->model || !b->head)
        return error_set(err, EX_NOINPUT, "no model.safetensors or no "
                         "head.safetensors (expected -m MODEL)");
    return model_open(&p->model, b->model, err) ||
           head_load(&p->head, b->head, err) || bench_make_clip(p, err) ||
           densify_init(&p->dense, p->head.f, p->head.F, p->head.V, err)
               ? -1 : 0;
}

void bench_person_close(struct bench_person *p)
{
    baked_release(&p->baked);
    texture_release(&p->texture);
    baker_release(&p->baker);
    model_close(&p->model);
    densify_release(&p->dense);
    identity_release(&p->id);
    head_release(&p->head);
    baked_move_release(&p->move);
    arena_release(&p->memory);
}

/* ---- files ------------------------------------------------------------- */

int bench_folder(char *dir, struct error *err)
{
    file_temporary(dir, "spid-bench-XXXXXX");
    if (mkdtemp(dir))
        return 0;
    error_set(err, EX_CANTCREAT, "%s: cannot be made", dir);
    dir[0] = 0;
    return -1;
}

int bench_person_write(const struct bench_person *p, const char *path,
                       size_t frames, struct error *err)
{
    const size_t values = (size_t)PERSON_SIZE * PERSON_SIZE * 3;
    struct framesink *out =
        framesink_open(&(struct framesink_options){.path = path}, err);

    for (size_t i = 0; out && i < frames; i++) {
        const struct framesink_frame f = {
            .width = PERSON_SIZE, .height = PERSON_SIZE, .channels = 3,
            .rgb = p->rgb + i % PERSON_FRAMES * values, .frame = i,
            .time = (double)i / PERSON_FPS
        };

        if (framesink_write(out, &f, err)) {
            framesink_abandon(out);
            return -1;
        }
    }
    return out ? framesink_finish(out, err) : -1;
}

/* ---- flame ------------------------------------------------------------- */

/* Pose the next frame's mesh. */
static int bench_call_pose(void *context, struct error *err)
{
    struct bench_person *p = context;

    (void)err;
    head_pose(p->verts, &p->id, &p->motion[p->at++ % PERSON_FRAMES].pose);
    return 0;
}

/* worst: at least the clip's meshes' difference from those in double, head units. */
static int bench_pose_error(double *worst, struct bench_person *p,
                            struct error *err)
{
    const size_t n = 3 * p->head.V;
    double exp[HEAD_MAX_EXP], *truth = malloc(n * sizeof *truth);

    if (!truth)
        return error_set(err, EX_OSERR, "no memory for a mesh");
    for (size_t i = 0; i < PERSON_FRAMES; i++) {
        const struct head_motion *m = &p->motion[i].pose;
        struct head_motion_d d = head_motion_widen(exp, m, p->head.nexp);

        d.beta = p->beta;
        head_pose(p->verts, &p->id, m);
        head_pose_d(truth, NULL, &p->head, &d);
        for (size_t k = 0; k < n; k++)
            *worst = fmax(*worst, fabs(p->verts[k] - truth[k]));
    }
    free(truth);
    return 0;
}

int bench_flame(struct bench *b, struct error *err)
{
    double worst = 0;
    struct bench_person p;
    struct bench_times t;
    char config[96];
    int rc = bench_person_open(&p, b, err);

    if (rc == 0) {
        /* every direction active, as a network's output has it */
        for (size_t i = 0; i < PERSON_FRAMES; i++)
            for (size_t k = 0; k < p.head.nexp; k++)
                if (p.motion[i].exp[k] == 0)
                    p.motion[i].exp[k] = 1e-3f;
        snprintf(config, sizeof config, "V=%zu, %zu expressions, jaw, eyes, "
                 "lids", p.head.V, p.head.nexp);
        rc = bench_time(&t, b->seconds / 4, 300, bench_call_pose, &p, err) ||
             bench_pose_error(&worst, &p, err) ? -1 : 0;
        if (rc == 0)
            bench_add(b, "flame", config, "default", 1, &t, worst, NAN);
    }
    bench_person_close(&p);
    return rc;
}

/* ---- branches ---------------------------------------------------------- */

#define PAPER_MOUTH 32

/* What the rows are of; a model without a file has the paper's networks. */
static void bench_branches_config(char *config, size_t size,
                                  const struct bench_person *p)
{
    const size_t K = p->model.config.mouth;

    snprintf(config, size, "%sN=%zu, plane 296, mouth %zu",
             p->model.st ? "" : "ViT-B/14 at 518, untrained, ", p->baked.N,
             K < PAPER_MOUTH ? PAPER_MOUTH : K);
}

int bench_person_avatar(struct bench_person *p, enum nn_type type,
                        struct error *err)
{
    struct model larger = p->model;     /* the same file, another grid where
                                         * that is smaller than the paper's */

    larger.config.plane = larger.config.backbone.size = 296;
    if (larger.config.mouth < PAPER_MOUTH)
        larger.config.mouth = PAPER_MOUTH;
    larger.config.size = PERSON_SIZE;
    return baker_open(&p->baker, &larger, &p->head,
                      &(struct baker_options){.type = type}, err);
}

int bench_person_bake(void *person, struct error *err)
{
    struct bench_person *p = person;
    float cam[12];

    (void)err;
    head_pose(p->verts, &p->id, &p->motion[0].pose);
    motion_camera(cam, &p->motion[0]);
    avatar_bake(&p->baker.avatar, &(struct avatar_source){
        .rgb = p->rgb, .matte = p->mask, .verts = p->verts, .cam = cam
    });
    return 0;
}

/* Move the Gaussians to the next frame. */
static int bench_call_drive(void *context, struct error *err)
{
    struct bench_person *p = context;
    struct head_mouth mouth;
    float cam[12];

    (void)err;
    motion_camera(cam, &p->motion[p->at++ % PERSON_FRAMES]);
    head_mouth(&mouth, &p->head, p->verts);
    baked_drive(&p->move, &p->baked, &p->dense, p->verts, mouth.centre,
                mouth.chin, mouth.gap, cam);
    return 0;
}

/* Largest difference of baked_drive's centres from the same sums in double:
 * a vertex, or half of two, bent about the neck. */
static double bench_drive_error(struct bench_person *p)
{
    const struct baked *b = &p->baked;
    double worst = 0;

    for (size_t i = 0; i < b->dynamic; i++) {
        size_t k = (size_t)b->vertex[i], V = p->dense.V;
        const int32_t *e = p->dense.edge + 2 * (k < V ? 0 : k - V);
        const float *v = p->verts + 3 * (k < V ? k : (size_t)e[0]);
        const float *w = k < V ? v : p->verts + 3 * (size_t)e[1];
        double x[3];

        for (int c = 0; c < 3; c++)
            x[c] = 0.5 * ((double)v[c] + (double)w[c]);
        for (int c = 0; c < 3; c++) {
            const float *m = p->move.frame.mesh + 4 * c;
            double to = (double)m[0] * x[0] + (double)m[1] * x[1] +
                        (double)m[2] * x[2] + (double)m[3];
            double want = x[c] + (double)b->neck[i] * (to - x[c]);

            worst = fmax(worst, fabs((double)p->move.mean[3 * i + (size_t)c] -
                                     want));
        }
    }
    return worst;
}

/* Phase A in one precision; truth: what its colours are held against, filled
 * by the first. */
static int bench_baking(struct bench_person *p, enum nn_type type,
                        double **truth, struct error *err)
{
    double max = NAN, psnr = NAN;
    struct bench_times t;
    char config[96], knob[64];

    baker_release(&p->baker);
    baked_release(&p->baked);
    if (bench_person_avatar(p, type, err) ||
        bench_time(&t, p->b->seconds / 6, 3, bench_person_bake, p, err) ||
        baked_from_avatar(&p->baked, &p->baker.avatar, false, err))
        return -1;
    size_t n = p->baked.N * p->baked.C;
    if (*truth) {
        bench_compare(&max, &psnr, p->baked.color, *truth, n);
    } else {
        *truth = malloc(n * sizeof **truth);
        if (!*truth)
            return error_set(err, EX_OSERR, "no memory for the colours");
        for (size_t i = 0; i < n; i++)
            (*truth)[i] = p->baked.color[i];
    }
    bench_branches_config(config, sizeof config, p);
    snprintf(knob, sizeof knob, "bake (Phase A), %s", nn_type_name(type));
    bench_add(p->b, "branches", config, knob, p->b->threads, &t, max, psnr);
    return 0;
}

/* The row of the update. */
static int bench_driving(struct bench_person *p, struct error *err)
{
    struct bench_times t;
    char config[96];

    if (baked_move_init(&p->move, &p->baked, err) ||
        bench_time(&t, p->b->seconds / 8, 300, bench_call_drive, p, err))
        return -1;
    bench_branches_config(config, sizeof config, p);
    bench_add(p->b, "branches", config, "update (a frame)", 1, &t,
              bench_drive_error(p), NAN);
    return 0;
}

/* Phase A in the paper's configuration, in every precision. */
static int bench_baking_paper(struct bench_person *p, struct error *err)
{
    double *truth = NULL;
    int rc;

    model_close(&p->model);
    avatar_config_paper(&p->model.config);
    rc = bench_baking(p, NN_F32, &truth, err) ||
                 bench_baking(p, NN_FAST, &truth, err) ||
                 bench_baking(p, NN_BF16, &truth, err)
             ? -1
             : 0;
    free(truth);
    return rc;
}

int bench_branches(struct bench *b, struct error *err)
{
    struct bench_person p;
    double *truth = NULL;
    const int rc = bench_person_open(&p, b, err) ||
                   bench_baking(&p, NN_F32, &truth, err) ||
                   bench_baking(&p, NN_FAST, &truth, err) ||
                   bench_driving(&p, err) || bench_baking_paper(&p, err)
                       ? -1 : 0;

    if (rc == 0)
        bench_note(b, "branches: the error of a bake is of its colours "
                   "against f32, of an update of its centres against double "
                   "(head units)");
    free(truth);
    bench_person_close(&p);
    return rc;
}
