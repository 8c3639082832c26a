/* Meshes and strands grow as the parts of a person add theirs. */
#include "lib/lab/people/actor.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/lab/people/vec.h"

static int actor_reserve(void *block, size_t count, size_t size)
{
    void **p = block, *n = realloc(*p, (count ? count : 1) * size);
    if (!n)
        return -1;
    *p = n;
    return 0;
}

int actor_grow(struct actor *a, size_t nv, size_t nf, size_t *v0, size_t *f0,
               struct error *err)
{
    size_t v = a->nv + nv, f = a->nf + nf;

    if (actor_reserve(&a->neutral, 3 * v, sizeof *a->neutral)
        || actor_reserve(&a->paint, v, sizeof *a->paint)
        || actor_reserve(&a->anchor, v, sizeof *a->anchor)
        || actor_reserve(&a->faces, 3 * f, sizeof *a->faces)
        || actor_reserve(&a->material, f, sizeof *a->material)
        || actor_reserve(&a->label, f, sizeof *a->label))
        return error_set(err, EX_OSERR, "out of memory for %zu vertices", v);
    memset(a->paint + a->nv, 0, nv * sizeof *a->paint);
    memset(a->anchor + a->nv, 0, nv);
    *v0 = a->nv;
    *f0 = a->nf;
    a->nv = v;
    a->nf = f;
    return 0;
}

struct strand_point *actor_strand(struct actor *a, enum strand_kind kind,
                                  int n, float half, float tip)
{
    if (a->nstrand == a->strand_room) {
        size_t room = a->strand_room ? 2 * a->strand_room : 4096;
        if (actor_reserve(&a->strand, room, sizeof *a->strand))
            return NULL;
        a->strand_room = room;
    }
    if (a->npoint + (size_t)n > a->point_room) {
        size_t room = a->point_room ? 2 * a->point_room : 65536;
        if (actor_reserve(&a->point, room, sizeof *a->point))
            return NULL;
        a->point_room = room;
    }
    a->strand[a->nstrand++] = (struct strand){
        .first = (uint32_t)a->npoint, .points = (uint16_t)n,
        .kind = (uint8_t)kind, .face = -1, .half = half, .tip = tip
    };
    a->npoint += (size_t)n;
    return a->point + a->npoint - n;
}

/* Centre and half axes of the scalp: the hair's ellipsoid. */
static void actor_measure_skull(struct actor *a)
{
    float lo[3] = { 9, 9, 9 }, hi[3] = { -9, -9, -9 };
    float brow = 0.5f * (a->lmk[19][1] + a->lmk[24][1]);

    for (size_t i = 0; i < a->head->V; i++) {
        const float *p = a->neutral + 3 * i;
        if (p[1] < brow || (a->head->region
                            && a->head->region[i] == REGION_EAR))
            continue;
        for (int k = 0; k < 3; k++) {
            lo[k] = p[k] < lo[k] ? p[k] : lo[k];
            hi[k] = p[k] > hi[k] ? p[k] : hi[k];
        }
    }
    for (int k = 0; k < 3; k++) {
        a->skull[k] = 0.5f * (lo[k] + hi[k]);
        a->skull_radius[k] = 0.5f * (hi[k] - lo[k]);
    }
    /* the widest place lies about brow height: the cap is most of a sphere */
    float height = hi[1] - brow;
    a->skull[1] = brow + 0.10f * height;
    a->skull_radius[1] = hi[1] - a->skull[1];
}

/* Radius of the left eyeball, and the neck just above the rim of the model. */
static void actor_measure_eye_and_neck(struct actor *a)
{
    const struct head *h = a->head;
    float r2 = 0, lowest = 9, lo[3] = { 9, 9, 9 }, hi[3] = { -9, -9, -9 };
    size_t n = 0;

    for (size_t i = 0; i < h->V; i++) {
        if (a->neutral[3 * i + 1] < lowest)
            lowest = a->neutral[3 * i + 1];
        if (h->weights[5 * i + JOINT_EYE_LEFT] < 0.99f)
            continue;
        float d[3];
        sub3(d, a->neutral + 3 * i, a->eye[0]);
        r2 += length3(d);
        n++;
    }
    a->eye_radius = n ? r2 / (float)n : 0.06f;
    for (size_t i = 0; i < h->V; i++)
        for (int k = 0; k < 3; k++) {
            float v = a->neutral[3 * i + (size_t)k];
            float y = a->neutral[3 * i + 1] - lowest;
            if (y < 0.08f || y > 0.24f)
                continue;
            lo[k] = v < lo[k] ? v : lo[k];
            hi[k] = v > hi[k] ? v : hi[k];
        }
    for (int k = 0; k < 3; k++)
        a->neck_base[k] = 0.5f * (lo[k] + hi[k]);
    a->neck_base[1] = lowest;
    a->neck_radius[0] = 0.5f * (hi[0] - lo[0]);
    a->neck_radius[1] = 0.5f * (hi[2] - lo[2]);
}

/* Places of the neutral head that other parts are built on: landmarks, lips,
 * eyes, skull. */
static void actor_measure(struct actor *a)
{
    const struct head *h = a->head;

    head_landmarks(&a->lmk[0][0], h, a->neutral);
    head_lip_centroid(a->mouth, h, a->neutral);
    for (int k = 0; k < 3; k++) {
        a->eye[0][k] = (float)a->id.joints[3 * JOINT_EYE_LEFT + k];
        a->eye[1][k] = (float)a->id.joints[3 * JOINT_EYE_RIGHT + k];
    }
    actor_measure_eye_and_neck(a);
    actor_measure_skull(a);
    /* brows are flatter than the model's bone, to each person's taste */
    float flat = 0.45f * (1 - 0.6f * a->look.brow_arch);
    for (int i = 17; i < 27; i++) {
        float peak = a->lmk[i < 22 ? 19 : 24][1];
        a->lmk[i][1] += flat * (peak - a->lmk[i][1]) - 0.026f;
    }
}

/* The head model's own faces and how much of its neck follows the body. */
static int actor_take_head(struct actor *a, struct error *err)
{
    const struct head *h = a->head;
    struct head_motion rest = { 0 };
    size_t v0, f0;

    if (actor_grow(a, h->V, h->F, &v0, &f0, err))
        return -1;
    a->neck = calloc(h->V, sizeof *a->neck);
    if (!a->neck)
        return error_set(err, EX_OSERR, "out of memory");
    head_pose(a->neutral, &a->id, &rest);
    memcpy(a->faces, h->f, 3 * h->F * sizeof *a->faces);
    actor_measure(a);
    float chin = a->lmk[8][1], base = a->neck_base[1];
    for (size_t i = 0; i < h->V; i++) {
        const float *p = a->neutral + 3 * i;
        /* behind, the neck starts higher than under the chin */
        float top = chin - 0.06f + 0.25f * ramp(a->lmk[8][2], a->neck_base[2],
                                                p[2]);
        a->neck[i] = ramp(fminf(top, chin + 0.1f), base + 0.02f, p[1]);
        if (h->region && h->region[i] != REGION_NECK
            && h->region[i] != REGION_SKIN)
            a->neck[i] = 0;
    }
    return 0;
}

int actor_init(struct actor *a, const struct head *head,
               const struct persona *p, struct error *err)
{
    *a = (struct actor){ .look = *p, .head = head };
    if (!head->has_landmarks)
        return error_set(err, EX_DATAERR,
                         "the head has no landmarks (expected 68)");
    if (head_fold(&a->id, head, p->beta, p->nbeta, err)
        || actor_take_head(a, err))
        goto out;
    paint_head(a);
    if (mouth_build(a, err) || body_build(a, err) || hair_grow(a, err)
        || face_hair_grow(a, err) || glasses_build(a, err))
        goto out;
    memcpy(a->look.eye.centre, a->eye, sizeof a->eye);
    a->look.eye.radius = a->eye_radius;
    return 0;
out:
    actor_release(a);
    return -1;
}

void actor_release(struct actor *a)
{
    identity_release(&a->id);
    free(a->neutral);
    free(a->paint);
    free(a->faces);
    free(a->material);
    free(a->label);
    free(a->anchor);
    free(a->neck);
    free(a->strand);
    free(a->point);
    *a = (struct actor){ 0 };
}
