/* Training steps: the motion encoder's, the narrow refiner's, and the whole
 * system's at 256x256, two people a step, with its parts; in bfloat16 what
 * spid-train computes so. */
#include "lib/lab/bench/bench.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/net/config.h"
#include "lib/base/parallel.h"
#include "lib/base/cpu.h"
#include "lib/net/motion_encoder.h"
#include "lib/lab/people/synth.h"
#include "lib/lab/train/adam.h"
#include "lib/lab/train/motion_loss.h"
#include "lib/lab/data/data.h"
#include "lib/lab/train/avatar_system.h"

#define IMAGE 256
#define PEOPLE 2
#define FRAMES 2            /* the source and a target */
#define ALONE 8             /* batch of the encoder by itself */
#define CROP ((size_t)MOTION_ENCODER_SIZE * MOTION_ENCODER_SIZE * 3)

enum part { CROPS, ENCODER, BAKE, DRAW, LOSSES, DRAW_BACK, BAKE_BACK,
            ENCODER_BACK, UPDATE, PARTS };
static const char *const part_name[PARTS] = {
    "crops", "encoder", "bake", "mesh, draw, refine", "losses",
    "draw and refine backward", "bake backward", "encoder backward", "Adam"};

struct course {
    struct bench *b;
    struct head head;
    struct data_person who[PEOPLE];
    struct identity id[PEOPLE];
    struct params ps;
    struct avatar_system tr;
    struct motion_encoder net;
    struct motion_loss loss;
    struct adam adam;
    struct train_config config;     /* the losses' weights */
    float *rgb, *out, *dout;        /* (ALONE,...) */
    double spent[PARTS];
    size_t steps;
};

/* ---- people ------------------------------------------------------------- */

/* A synthetic frame as training data. */
static int bench_train_frame(struct data_frame *f, const struct synth_frame *s,
                             size_t size, struct error *err)
{
    const struct synth_motion *m = s->motion;

    *f = (struct data_frame){.size = size, .width = size, .height = size};
    f->rgba = malloc(4 * size * size);
    if (!f->rgba)
        return error_set(err, EX_OSERR, "no memory for a picture");
    for (size_t i = 0; i < size * size; i++) {
        memcpy(f->rgba + 4 * i, s->rgb + 3 * i, 3);
        f->rgba[4 * i + 3] = s->mask[i];
    }
    memcpy(f->motion.rot, m->rot, sizeof f->motion.rot);
    memcpy(f->motion.trans, m->trans, sizeof f->motion.trans);
    memcpy(f->motion.exp, m->exp, sizeof f->motion.exp);
    memcpy(f->motion.jaw, m->jaw, sizeof f->motion.jaw);
    memcpy(f->motion.lid, m->lid, sizeof f->motion.lid);
    memcpy(f->motion.eye, m->eye, sizeof f->motion.eye);
    memcpy(f->lmk, s->lmk, sizeof f->lmk);
    f->crop = (struct square){s->crop[0], s->crop[1], s->crop[2]};
    return 0;
}

/* Two people of two frames, their shapes folded. */
static int bench_train_people(struct course *c, size_t size, struct error *err)
{
    const struct synth_options opt = {
        .seed = 9, .people = PEOPLE, .frames = FRAMES, .size = (int)size,
        .fps = 1, .effects = 1};
    struct synth *s = synth_open(&c->head, &opt, err);
    struct synth_frame f;
    int rc = s ? 1 : -1;

    for (size_t i = 0; rc > 0 && i < PEOPLE * FRAMES; i++) {
        struct data_person *p = &c->who[i / FRAMES];

        if (!p->frame)
            p->frame = calloc(FRAMES, sizeof *p->frame);
        if (!p->frame)
            rc = error_set(err, EX_OSERR, "no memory for people");
        else if ((rc = synth_next(s, &f, err)) > 0 &&
                 bench_train_frame(&p->frame[p->count++], &f, size, err))
            rc = -1;
        if (rc > 0 && p->count == 1)
            rc = head_fold(&c->id[i / FRAMES], &c->head, f.beta, f.nbeta, err)
                     ? -1 : 1;
    }
    synth_close(s);
    return rc < 0 ? -1 : 0;
}

/* ---- one step ----------------------------------------------------------- */

/* Now; the time since *t goes to a part. */
static void bench_train_lap(struct course *c, enum part p, double *t)
{
    double now = cpu_seconds();

    c->spent[p] += now - *t;
    *t = now;
}

/* A person of the batch: source frame 0, target frame 1. */
static int bench_train_person(struct course *c, size_t k, double *t,
                              struct error *err)
{
    struct avatar_system *tr = &c->tr;
    const struct data_frame *f = &c->who[k].frame[1];
    struct motion_state s = {.verts = tr->verts};
    double terms[TERM_COUNT] = {0}, picture[PICTURE_COUNT] = {0};

    if (avatar_system_bake(tr, &c->who[k].frame[0], &c->id[k], NULL, NULL, err))
        return -1;
    bench_train_lap(c, BAKE, t);
    c->loss.id = &c->id[k];
    motion_loss(c->dout + k * MOTION_OUT, terms, &s, c->out + k * MOTION_OUT,
                f, f->crop, &c->config.geometry, 1.0 / PEOPLE, &c->loss);
    bench_train_lap(c, LOSSES, t);
    if (avatar_system_draw(tr, s.verts, s.cam, err))
        return -1;
    bench_train_lap(c, DRAW, t);
    if (avatar_system_losses(tr, picture, f, &c->config, 1.0 / PEOPLE, err))
        return -1;
    bench_train_lap(c, LOSSES, t);
    if (avatar_system_draw_backward(tr, err))
        return -1;
    motion_decode_backward(c->dout + k * MOTION_OUT, tr->dverts, tr->dcam, &s,
                           c->out + k * MOTION_OUT, f, f->crop, &c->id[k]);
    bench_train_lap(c, DRAW_BACK, t);
    avatar_system_bake_backward(tr);
    bench_train_lap(c, BAKE_BACK, t);
    return 0;
}

/* One step of the whole system. */
static int bench_call_system(void *context, struct error *err)
{
    struct course *c = context;
    double t = cpu_seconds();

    memset(c->ps.g, 0, c->ps.total * sizeof *c->ps.g);
    memset(c->dout, 0, PEOPLE * MOTION_OUT * sizeof *c->dout);
    for (size_t k = 0; k < PEOPLE; k++)
        if (data_sample(c->rgb + k * CROP, MOTION_ENCODER_SIZE,
                        &c->who[k].frame[1], c->who[k].frame[1].crop, NULL,
                        NULL, err))
            return -1;
    bench_train_lap(c, CROPS, &t);
    motion_encoder_forward(c->out, c->rgb, &c->net);
    bench_train_lap(c, ENCODER, &t);
    for (size_t k = 0; k < PEOPLE; k++)
        if (bench_train_person(c, k, &t, err))
            return -1;
    motion_encoder_backward(NULL, c->dout, &c->net);
    bench_train_lap(c, ENCODER_BACK, &t);
    adam_update(&c->adam, &c->ps, 0, adam_norm(&c->ps));
    motion_encoder_update(&c->net);
    avatar_system_update(&c->tr);
    bench_train_lap(c, UPDATE, &t);
    c->steps++;
    return 0;
}

/* ---- the parts by themselves -------------------------------------------- */

/* One step of the encoder alone. */
static int bench_call_encoder(void *context, struct error *err)
{
    struct course *c = context;

    (void)err;
    memset(c->ps.g, 0, c->ps.total * sizeof *c->ps.g);
    motion_encoder_forward(c->out, c->rgb, &c->net);
    motion_encoder_backward(NULL, c->dout, &c->net);
    adam_update(&c->adam, &c->ps, 0, adam_norm(&c->ps));
    motion_encoder_update(&c->net);
    return 0;
}

/* The refiner forward and back. */
static int bench_call_refiner(void *context, struct error *err)
{
    struct course *c = context;

    (void)err;
    refiner_forward(c->tr.rgb, c->tr.feat, &c->tr.refiner);
    refiner_backward(&(struct refiner_gradients){.feat = c->tr.dfeat},
                     c->tr.drgb, c->tr.dfield, &c->tr.refiner);
    return 0;
}

/* The encoder's row. */
static int bench_encoder(struct course *c, struct error *err)
{
    struct nn_options opt = {NN_TRAIN, NN_F32};
    struct bench_times t;
    int rc = -1;

    params_init(&c->ps);
    if (!motion_encoder_init(&c->net, &c->ps, "motion.",
                             "mobilenetv3_small_100", err) &&
        !params_allocate(&c->ps, err) &&
        !params_allocate_gradients(&c->ps, err) &&
        !adam_init(&c->adam, &c->ps, 0, 0, err)) {
        params_randomise(&c->ps, 1);
        motion_encoder_init_weights(&c->net);
        rc = motion_encoder_plan(&c->net, ALONE, opt, err);
    }
    for (size_t i = 0; i < ALONE * CROP; i++)
        c->rgb[i] = 0.5f + 0.4f * sinf(0.01f * (float)i);
    for (size_t i = 0; i < ALONE * MOTION_OUT; i++)
        c->dout[i] = 0.01f;
    if (rc == 0)
        rc = bench_time(&t, c->b->seconds / 8, 5, bench_call_encoder, c, err);
    if (rc == 0) {
        bench_add(c->b, "train", "motion encoder, batch 8, f32", "step",
                  c->b->threads, &t, NAN, NAN);
        bench_note(c->b, "train: motion encoder %.0f pictures a second",
                   ALONE / t.median * 1e3);
    }
    motion_encoder_release(&c->net);
    adam_release(&c->adam);
    params_release(&c->ps);
    return rc;
}

/* People, networks and optimiser. */
static int bench_train_open(struct course *c, struct error *err)
{
    static const char losses[] = "{\"stage\":\"all\",\"batch\":2,\"micro\":1}";
    struct nn_options train = {NN_TRAIN, NN_BF16}, fixed = {NN_FROZEN, NN_BF16};
    struct avatar_config model;

    avatar_config_shipped(&model);
    params_init(&c->ps);
    if (train_config_parse(&c->config, losses, "bench", err) ||
        bench_train_people(c, model.size, err) ||
        avatar_system_init(&c->tr, &c->ps, &model, &c->head, err) ||
        motion_encoder_init(&c->net, &c->ps, "motion.", model.motion_net,
                            err) ||
        params_allocate(&c->ps, err) ||
        params_allocate_gradients(&c->ps, err) ||
        adam_init(&c->adam, &c->ps, 1, 0, err))
        return -1;
    params_randomise(&c->ps, 1);
    motion_encoder_init_weights(&c->net);
    return avatar_system_plan(&c->tr, IMAGE, 1, 0, train, err) ||
                   motion_encoder_plan(&c->net, PEOPLE, fixed, err) ||
                   motion_loss_init(&c->loss, &c->head, err)
               ? -1
               : 0;
}

/* The system's row, and where its time goes. */
static int bench_system(struct course *c, struct error *err)
{
    struct bench_times t;
    char config[96];

    if (bench_train_open(c, err) ||
        bench_time(&t, c->b->seconds / 2, 3, bench_call_system, c, err))
        return -1;
    snprintf(config, sizeof config, "system, 256x256, batch 2, bf16, N=%zu",
             c->tr.avatar.set.n);
    bench_add(c->b, "train", config, "step", c->b->threads, &t, NAN, NAN);
    bench_note(c->b, "train: whole system %.2f pictures a second; mean of "
               "%zu steps:", PEOPLE / t.median * 1e3, c->steps);
    for (int p = 0; p < PARTS; p++)
        bench_note(c->b, "  %-26s %8.1f ms", part_name[p],
                   1e3 * c->spent[p] / (double)c->steps);
    if (bench_time(&t, c->b->seconds / 8, 5, bench_call_refiner, c, err))
        return -1;
    bench_add(c->b, "train", "narrow refiner, 256x256, bf16",
              "forward + backward", c->b->threads, &t, NAN, NAN);
    return 0;
}

/* All of it. */
static void bench_train_close(struct course *c)
{
    for (size_t k = 0; k < PEOPLE; k++) {
        data_person_release(&c->who[k]);
        identity_release(&c->id[k]);
    }
    avatar_system_release(&c->tr);
    motion_encoder_release(&c->net);
    motion_loss_release(&c->loss);
    adam_release(&c->adam);
    train_config_release(&c->config);
    params_release(&c->ps);
    head_release(&c->head);
    free(c->rgb);
    free(c);
}

int bench_train(struct bench *b, struct error *err)
{
    struct course *c = calloc(1, sizeof *c);
    size_t each = CROP + 2 * MOTION_OUT;
    int rc = -1;

    if (!b->head) {
        free(c);
        return error_set(err, EX_NOINPUT, "no head model (expected --head)");
    }
    if (!c || !(c->rgb = malloc(ALONE * each * sizeof *c->rgb))) {
        free(c);
        return error_set(err, EX_OSERR, "no memory for training");
    }
    c->b = b;
    c->out = c->rgb + ALONE * CROP;
    c->dout = c->out + ALONE * MOTION_OUT;
    parallel_set_width(b->threads);
    if (!head_load(&c->head, b->head, err) && !bench_encoder(c, err) &&
        !bench_system(c, err))
        rc = 0;
    bench_train_close(c);
    return rc;
}
