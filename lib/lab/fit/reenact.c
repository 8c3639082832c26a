/* Phase B of fitted people in one process: what they act is what a stream of
 * motions did, drawn as spid animate draws it. */
#include "lib/lab/fit/reenact.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/list.h"
#include "lib/base/rotation.h"
#include "lib/head/arkit.h"

/* How far the avatar is taken from its photograph: what it shows beyond is
 * less and less a picture of a person. */
#define REENACT_TURN_MIN 0.2        /* shares of the turn of who acts, */
#define REENACT_TURN_MAX 0.5
#define REENACT_OWN_MIN 0.3         /* and at least so much of one's own */
#define REENACT_ROLL 0.15           /* spread, radians */
#define REENACT_SHIFT 0.06          /* spread, head units */
#define REENACT_DISTANCE 0.06       /* spread of its logarithm */
#define REENACT_WHOLE 0.7           /* share of faces taken as they are */
#define REENACT_UNEVEN 0.6          /* share of faces with another's side, */
#define REENACT_UNEVEN_MIN 0.4      /* and how much of it, at least */
#define REENACT_WINK 0.4            /* share of those that take its lid, too */
#define REENACT_ASIDE 0.3           /* share of mouths drawn to a side, */
#define REENACT_ASIDE_MIN 0.15      /* and how far, at least */

static const float reenact_front[9] = {1, 0, 0, 0, -1, 0, 0, 0, -1};

/* ---- opening ------------------------------------------------------------ */

/* One more motion to act. */
static int reenact_add(const struct record *rec, void *reenact,
                       struct error *err)
{
    struct reenact *r = reenact;
    struct motion *m;

    if (!record_is(rec, RECORD_MOTN))
        return 0;
    m = list_add(&r->act, &r->acts, &r->room, sizeof *m, err);
    return m ? motion_read(m, rec, r->models.head.nexp, err) : -1;
}

/* All motions of a stream. */
static int reenact_read(struct reenact *r, const char *path,
                        struct error *err)
{
    if (stream_load(path, reenact_add, r, err))
        return -1;
    return r->acts ? 0 : error_set(err, EX_DATAERR, "%s: no motions (expected "
                                   "MOTN records)", path);
}

int reenact_open(struct reenact *r, const char *model, const char *head,
                 const char *motions, size_t size, uint64_t seed,
                 struct error *err)
{
    *r = (struct reenact){.size = size};
    random_init(&r->random, seed, "reenact");
    r->rgb = malloc(3 * size * size);
    if (!r->rgb)
        return error_set(err, EX_OSERR, "no memory for a picture");
    if (prepare_open(&r->models, model, head, err) == 0 &&
        reenact_read(r, motions, err) == 0)
        return 0;
    reenact_release(r);
    return -1;
}

void reenact_release(struct reenact *r)
{
    pipeline_release(&r->pipeline);
    prepared_release(&r->person);
    prepare_release(&r->models);
    free(r->act);
    free(r->rgb);
    memset(r, 0, sizeof *r);
}

/* ---- a person ----------------------------------------------------------- */

/* The portrait as a person's picture, at least as large as the model's. */
static int reenact_picture(struct reenact *r, const struct portrait *portrait,
                           struct error *err)
{
    const struct person own = {
        .size = portrait->size, .rgb = portrait->rgb,
        .matte = portrait->mask, .back = portrait->back
    };
    size_t min = r->models.model.config.size;

    return person_resize(&r->person.person, &own,
                         own.size < min ? min : own.size, err);
}

int reenact_person(struct reenact *r, const struct portrait *portrait,
                   const float *beta, size_t n, const struct motion *m,
                   struct error *err)
{
    struct person *p = &r->person.person;
    const struct pipeline_options opt = {
        .size = r->size, .picture = r->size, .model = &r->models.model,
        .rules = SPLAT_GSPLAT, .precision = NN_FAST
    };

    pipeline_release(&r->pipeline);
    prepared_release(&r->person);
    r->back = portrait->back;
    if (reenact_picture(r, portrait, err))
        return -1;
    p->crop[0] = p->crop[1] = 0.5f * (float)r->size;
    p->crop[2] = (float)r->size;
    p->source = *m;
    p->has_source = true;
    p->nshape = n;
    p->shape = malloc(n * sizeof *beta);
    if (!p->shape)
        return error_set(err, EX_OSERR, "no memory for a person");
    memcpy(p->shape, beta, n * sizeof *beta);
    if (prepare_person(&r->person, &r->models, err))
        return -1;
    const struct pipeline_avatar avatar = prepared_avatar(&r->person,
                                                          &r->models);

    return pipeline_init(&r->pipeline, &opt, &avatar, err);
}

/* ---- a picture ---------------------------------------------------------- */

/* R = exp(share log(R)) */
static void reenact_part(float R[9], double share)
{
    float turn[3];

    rotation_log(turn, R);
    for (int i = 0; i < 3; i++)
        turn[i] *= (float)share;
    rotation_exp(R, turn);
}

/* The camera: part of what one turned from the front at the photograph, part
 * of what another's head does, and a roll. */
static void reenact_camera(struct motion *m, const struct motion *own,
                           const struct motion *act, struct random *random)
{
    const float roll[3] = {
        0, 0, (float)(REENACT_ROLL * random_normal(random))
    };
    float mine[9], theirs[9], rolled[9], both[9];

    mat3_mul(mine, own->R, reenact_front);      /* the front is symmetric */
    mat3_mul(theirs, act->R, reenact_front);
    reenact_part(theirs, random_range(random, REENACT_TURN_MIN,
                                      REENACT_TURN_MAX));
    reenact_part(mine, random_range(random, REENACT_OWN_MIN, 1));
    rotation_exp(rolled, roll);
    mat3_mul(both, rolled, theirs);
    mat3_mul(theirs, mine, both);
    mat3_mul(m->R, theirs, reenact_front);
    for (int i = 0; i < 2; i++)
        m->t[i] = own->t[i] + (float)(REENACT_SHIFT * random_normal(random));
    m->t[2] = own->t[2] * (float)exp(REENACT_DISTANCE *
                                     random_normal(random));
}

/* Make a face uneven: part of one side becomes another face's, and the mouth
 * is drawn to a side.  People who were asked to smile do it evenly, and an
 * encoder that has seen only these takes every smirk for a small smile. */
static void reenact_uneven(struct motion *m, const struct motion *other,
                           struct random *random)
{
    const int side = random_chance(random, 0.5);

    if (random_chance(random, REENACT_UNEVEN)) {
        float share = random_float(random, REENACT_UNEVEN_MIN, 1);

        for (int k = 0; k < ARKIT_COUNT; k++)
            if (arkit_is_left(k))
                m->exp[k + side] += share * (other->exp[k + side] -
                                             m->exp[k + side]);
        if (random_chance(random, REENACT_WINK))
            m->pose.lid[side] = other->pose.lid[side];
    }
    if (random_chance(random, REENACT_ASIDE)) {
        bool left = random_chance(random, 0.5);
        float far = random_float(random, REENACT_ASIDE_MIN, 1);

        m->exp[ARKIT_MOUTH_LEFT] = left ? far : 0;
        m->exp[ARKIT_MOUTH_RIGHT] = left ? 0 : far;
    }
}

/* One of the motions. */
static const struct motion *reenact_any(struct reenact *r)
{
    return &r->act[random_below(&r->random, (uint32_t)r->acts)];
}

/* A face from one motion, in whole or in part, and a turn from another, for
 * the person of the photograph. */
static void reenact_motion(struct motion *m, struct reenact *r)
{
    struct random *random = &r->random;
    const struct motion *own = &r->person.person.source;
    const struct motion *turn = reenact_any(r), *face = reenact_any(r);
    const struct motion *other = reenact_any(r);
    float share = random_chance(random, REENACT_WHOLE)
                      ? 1 : (float)random_uniform(random);

    *m = *face;
    m->pose.exp = m->exp;
    reenact_uneven(m, other, random);
    memcpy(m->crop, own->crop, sizeof m->crop);
    for (size_t k = 0; k < r->models.head.nexp; k++)
        m->exp[k] += (1 - share) * (own->exp[k] - m->exp[k]);
    for (int i = 0; i < 3; i++)
        m->pose.jaw[i] += (1 - share) *
                          (own->pose.jaw[i] - face->pose.jaw[i]);
    reenact_camera(m, own, turn, random);
}

int reenact_draw(struct reenact *r, struct motion *m, struct error *err)
{
    struct background back = {.rgb = r->back, .width = r->size,
                              .height = r->size};
    struct pipeline_picture p;

    reenact_motion(m, r);
    if (pipeline_draw(&r->pipeline, m, err))
        return -1;
    p = pipeline_picture(&r->pipeline);
    const struct framesink_frame f = {
        .width = r->size, .height = r->size, .channels = 3,
        .color = p.color, .alpha = p.alpha
    };

    framesink_compose(r->rgb, &f, &back);
    return 0;
}
