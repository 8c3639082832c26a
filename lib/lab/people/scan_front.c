/* What stands between a person and the camera: a hand, a microphone, a cup.
 * Modelled about the head's middle along the camera's axes (x right, y down, z
 * away), in head units. */
#include <math.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/lab/people/scan_figure.h"
#include "lib/base/vec3.h"

/* ---- the hand ----------------------------------------------------------- */

/* base.obj: the joint at the left wrist; decimetres. */
enum { WRIST = 14030, WRIST_N = 8 };
#define UNITS 0.5f              /* head units in a decimetre */

/* Principal axes of the hand, columns across, along the fingers, out of the
 * palm: along is known, across is where it spreads most. */
static void front_hand_axes(float m[9], const float *v, const int32_t *part,
                            size_t n, const float wrist[3],
                            const float along[3])
{
    float across[3] = {0.7f, 0.3f, -0.6f}, out[3];

    for (int round = 0; round < 20; round++) {
        float sum[3] = {0, 0, 0};
        mad3(across, across, along, -dot3(across, along));
        unit3(across);
        for (size_t i = 0; i < n; i++) {
            float d[3];
            sub3(d, v + 3 * part[i], wrist);
            if (dot3(d, along) < 0)
                continue;
            mad3(d, d, along, -dot3(d, along));
            mad3(sum, sum, d, dot3(d, across));
        }
        copy3(across, sum);
    }
    mad3(across, across, along, -dot3(across, along));
    unit3(across);
    cross3(out, across, along);
    for (int k = 0; k < 3; k++) {
        m[k] = across[k];
        m[3 + k] = along[k];
        m[6 + k] = out[k];
    }
}

/* From the wrist, the mean of its joint, to the farthest finger tip. */
static void front_hand_along(float along[3], float wrist[3],
                             const struct body *b)
{
    const float *v = b->mesh.v;
    float far = 0;

    memset(wrist, 0, 3 * sizeof *wrist);
    for (int i = WRIST; i < WRIST + WRIST_N; i++)
        mad3(wrist, wrist, v + 3 * i, 1.0f / WRIST_N);
    for (size_t i = 0; i < b->nbody; i++) {
        float d[3] = {v[3 * i] - wrist[0], v[3 * i + 1] - wrist[1],
                      v[3 * i + 2] - wrist[2]};
        if (v[3 * i] > 3.5f && v[3 * i + 1] < wrist[1] && length3(d) > far
            && length3(d) < 2.4f) {
            far = length3(d);
            copy3(along, d);
        }
    }
    unit3(along);
}

/* The vertices within a tube about the hand and forearm: their list, its
 * length, and in (nbody) 1 for each. */
static size_t front_hand_part(int32_t *part, uint8_t *in, const struct body *b,
                              const float wrist[3], const float along[3])
{
    const float *v = b->mesh.v;
    size_t n = 0;

    for (size_t i = 0; i < b->nbody; i++) {
        float d[3];
        sub3(d, v + 3 * i, wrist);
        float l = dot3(d, along);
        in[i] = v[3 * i] > 2.2f && l > -2.3f
                && length3(d) * length3(d) - l * l < 1.3f;
        if (in[i])
            part[n++] = (int32_t)i;
    }
    return n;
}

/* The body's left hand and forearm, in the hand's own axes, the wrist at the
 * origin. */
int hand_make(struct piece *p, const struct body *b, struct arena *memory,
              struct error *err)
{
    const float *v = b->mesh.v;
    float wrist[3], along[3], m[9];
    struct arena room = {0};
    int32_t *part = arena_take(&room, b->nbody, sizeof *part);
    int32_t *faces = arena_take(&room, 3 * b->mesh.nf, sizeof *faces);
    float *place = arena_take(&room, 3 * b->nbody, sizeof *place);
    uint8_t *in = arena_take(&room, b->nbody, 1);
    size_t nf = 0;
    int rc = -1;

    if (arena_check(&room, "a hand", err))
        goto out;
    front_hand_along(along, wrist, b);
    front_hand_axes(m, v, part, front_hand_part(part, in, b, wrist, along),
                    wrist, along);
    for (size_t i = 0; i < b->nbody; i++) {
        float d[3];
        sub3(d, v + 3 * i, wrist);
        rot3(place + 3 * i, m, d);
        for (size_t k = 0; k < 3; k++)
            place[3 * i + k] *= UNITS;
    }
    for (size_t i = 0; i < b->mesh.nf; i++) {
        const int32_t *f = b->mesh.f + 3 * i;
        if (in[f[0]] && in[f[1]] && in[f[2]])
            memcpy(faces + 3 * nf++, f, 3 * sizeof *f);
    }
    rc = piece_make(p, b, place, b->nbody, faces, nf, -9, memory, err);
out:
    arena_release(&room);
    return rc;
}

/* A hand at the chin, a cheek or the mouth, at a random angle: its fingers
 * seldom reach the eyes. */
static int front_add_hand(struct figure *f, struct random *r, struct error *err)
{
    const struct piece *q = &f->assets->hand;
    struct figure_part *p = figure_grow(f, q->nc, q->nf, STUFF_HAND,
                                        RIDE_FREE, LABEL_OCCLUDER, err);
    const double (*h)[2] = f->assets->traits.hand;
    float a[9], b[9], m[9], t[9];
    float side = random_uniform(r) < 0.5 ? 1 : -1;

    if (!p)
        return -1;
    /* fingers up and to the middle, palm to the face, tilted a little */
    axis33(a, 2, side * trait_range(r, h[0]));
    axis33(b, 1, trait_range(r, h[1]));
    mat3_mul(t, a, b);
    axis33(b, 0, trait_range(r, h[2]));
    mat3_mul(m, t, b);
    float at[3] = {side * trait_range(r, h[3]), trait_range(r, h[4]),
                   -0.75f - trait_range(r, h[5])};
    for (size_t i = 0; i < q->nc; i++) {
        const float *v = q->place + 3 * i;
        float d[3] = {side * v[0], -v[1], v[2]};
        rot3(f->place + 3 * (p->c0 + i), m, d);
        mad3(f->place + 3 * (p->c0 + i), f->place + 3 * (p->c0 + i), at, 1);
    }
    for (size_t i = 0; i < 3 * q->nf; i++)
        f->faces[3 * p->f0 + i] = q->faces[i] + (int32_t)p->c0;
    return 0;
}

/* ---- bodies of revolution ----------------------------------------------- */

#define SIDES 16

/* A body of revolution: n rings of radius r at heights h along an axis. */
static int front_add_revolved(struct figure *f, const float *h, const float *r,
                            int n, const float at[3], const float turn[9],
                            const float color[3], struct error *err)
{
    struct figure_part *p = figure_grow(f, (size_t)(n * SIDES),
                                        (size_t)((n - 1) * SIDES * 2),
                                        STUFF_METAL, RIDE_FREE,
                                        LABEL_OCCLUDER, err);

    if (!p)
        return -1;
    copy3(p->tint, color);
    size_t i = p->f0;
    for (int k = 0; k < n; k++)
        for (int s = 0; s < SIDES; s++) {
            float w = 2 * PI_F * (float)s / SIDES;
            float d[3] = {r[k] * cosf(w), h[k], r[k] * sinf(w)};
            float *o = f->place + 3 * (p->c0 + (size_t)(k * SIDES + s));
            rot3(o, turn, d);
            mad3(o, o, at, 1);
        }
    for (int k = 0; k + 1 < n; k++)
        for (int s = 0; s < SIDES; s++, i += 2) {
            int32_t a = (int32_t)p->c0 + k * SIDES, b = a + SIDES;
            int32_t q = (s + 1) % SIDES;
            int32_t quad[6] = {a + s, a + q, b + s, b + s, a + q, b + q};
            memcpy(f->faces + 3 * i, quad, sizeof quad);
        }
    return 0;
}

/* A microphone or a cup, turned about its axis. */
static int front_add_thing(struct figure *f, struct random *r,
                           struct error *err)
{
    static const float mic_h[] = {-.13f, -.12f, -.09f, -.04f, .01f, .06f,
                                  .10f, .13f, .16f, 1.6f};
    static const float mic_r[] = {0, .05f, .09f, .115f, .12f, .115f, .095f,
                                  .07f, .065f, .05f};
    static const float cup_h[] = {-.2f, -.2f, -.19f, .1f, .22f, .22f};
    static const float cup_r[] = {0, .19f, .2f, .185f, .16f, 0};
    float a[9], b[9], turn[9], color[3];
    float side = random_uniform(r) < 0.5 ? 1 : -1;
    bool mic = f->look.front == FRONT_MICROPHONE;
    const double (*h)[2] = f->assets->traits.held;

    axis33(a, 2, -side * trait_range(r, h[mic ? 0 : 1]));
    axis33(b, 0, trait_range(r, h[2]));
    mat3_mul(turn, a, b);
    float at[3] = {side * trait_range(r, h[3]), trait_range(r, h[4]),
                   -0.75f - trait_range(r, h[5])};
    for (int k = 0; k < 3; k++)
        color[k] = mic ? 0.04f : f->look.cap_color[k];
    return mic ? front_add_revolved(f, mic_h, mic_r, 10, at, turn, color, err)
               : front_add_revolved(f, cup_h, cup_r, 6, at, turn, color, err);
}

int figure_add_front(struct figure *f, struct error *err)
{
    struct random r;

    random_init(&r, f->look.key, "front");
    switch (f->look.front) {
    case FRONT_NONE: return 0;
    case FRONT_HAND:
        if (f->assets->hand.nc)
            return front_add_hand(f, &r, err);
        /* fall through */
    default: return front_add_thing(f, &r, err);
    }
}
