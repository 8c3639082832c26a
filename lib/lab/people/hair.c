/* Scalp hair: strands grown from where the scalp's hair density says so, bent
 * by style, gravity and curl, kept outside the skull. */
#include "lib/lab/people/actor.h"

#include <math.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/random.h"
#include "lib/lab/people/noise.h"
#include "lib/lab/people/vec.h"

/* How a style grows.  Lengths in head units. */
struct cut {
    int count, points;
    float half;                 /* strand half width */
    float top, side;            /* lengths */
    float lift, gravity, comb;  /* along the normal, down, along the flow */
    float wave, thick;          /* noise, thickness of the coat */
};

static const struct cut cuts[HAIR_STYLES] = {
    [HAIR_SHAVED]   = { 0, 2, 0, 0, 0, 0, 0, 0, 0, 0 },
    [HAIR_BUZZ]     = { 9000, 3, .0030f, .035f, .025f, .9f, 0, .5f, .3f, .03f },
    [HAIR_SHORT] = { 8000, 7, .0040f, .17f, .07f,
        .55f, .1f, .9f, .35f, .09f },
    [HAIR_SIDE] = { 8000, 8, .0040f, .30f, .09f,
        .40f, .15f, 1.f, .22f, .10f },
    [HAIR_QUIFF] = { 8000, 8, .0040f, .28f, .08f,
        .75f, .1f, .9f, .25f, .15f },
    [HAIR_MEDIUM] = { 6500, 12, .0055f, .62f, .45f,
        .25f, .5f, .8f, .25f, .12f },
    [HAIR_LONG] = { 6000, 18, .0065f, 1.45f, 1.25f,
        .12f, 1.f, .7f, .10f, .07f },
    [HAIR_WAVY] = { 6000, 20, .0065f, 1.35f, 1.15f,
        .15f, 1.f, .7f, .45f, .10f },
    [HAIR_CURLY] = { 6500, 14, .0055f, .50f, .40f,
        .6f, .45f, .4f, 1.1f, .20f },
    [HAIR_AFRO]     = { 8500, 9, .0055f, .26f, .22f, 1.f, 0, .1f, 1.3f, .22f },
    [HAIR_BUN] = { 6500, 10, .0045f, .70f, .60f,
        .1f, 0, 1.2f, .08f, .05f },
    [HAIR_RECEDING] = { 5500, 6, .0038f, .11f, .07f,
        .45f, .1f, .8f, .3f, .06f },
};

/* Place of p in the skull's ellipsoid: its radius, 1 on the surface. */
static float hair_skull_place(const struct actor *a, float d[3],
                              const float p[3])
{
    for (int k = 0; k < 3; k++)
        d[k] = (p[k] - a->skull[k]) / a->skull_radius[k];
    if (d[1] < 0)
        d[1] *= 0.55f;          /* the neck goes on below */
    return length3(d);
}

/* p goes out of the skull's ellipsoid, and back to it where it stands off too
 * far. */
static void hair_keep_outside(const struct actor *a, float p[3], float room,
                              float slack)
{
    float d[3], r = hair_skull_place(a, d, p), want = 1.0f + room;

    if (r > want + slack && d[1] > -0.35f)
        want = lerpf(r, want + slack, 0.6f);
    else if (r >= want || r < 1e-4f)
        return;
    float s = want / r;
    for (int k = 0; k < 3; k++)
        if (k != 1 || d[1] > 0)
            p[k] = a->skull[k] + (p[k] - a->skull[k]) * s;
}

/* Long hair leaves the face free and lies on the shoulders. */
static void hair_keep_clear(const struct actor *a, float p[3], float depth)
{
    float eyes = a->eye[0][1], wide = fabsf(a->lmk[1][0]) * 0.97f;
    float front = a->lmk[1][2] - 0.05f;

    if (p[1] < eyes + 0.16f && p[2] > front) {
        float need = wide * ramp(eyes + 0.16f, eyes - 0.05f, p[1])
                     + 0.05f * depth;
        if (fabsf(p[0]) < need)
            p[0] = copysignf(need, p[0]);
    }
    float shoulder = a->neck_base[1] - 0.02f - 0.33f * fabsf(p[0]);
    if (p[1] < shoulder) {
        float out = 0.30f + 0.28f * (shoulder - p[1]) + 0.08f * depth;
        float z = p[2] - a->neck_base[2];
        if (z > -0.05f && z < out)
            p[2] = a->neck_base[2] + out;
        else if (z <= -0.05f && z > -out)
            p[2] = a->neck_base[2] - out;
    }
}

/* Which way hair is combed at p. */
static void hair_flow(const struct actor *a, float f[3], const float p[3])
{
    const struct hair_look *h = &a->look.hair;
    float part = h->part, top = ramp(0.1f, 0.8f, (p[1] - a->skull[1])
                                                 / a->skull_radius[1]);
    float x = (p[0] - part) * 8, side = x / sqrtf(1 + x * x);
    float front = p[2] / a->skull_radius[2];

    f[0] = 0;
    f[1] = -0.6f * (1 - top);
    f[2] = 0;
    switch (h->style) {
    case HAIR_SHORT:
        f[0] = 0.35f * (part > 0 ? -1 : 1) * top;
        f[2] = h->fringe ? 0.9f * top : -0.4f * top;
        break;
    case HAIR_SIDE:
        f[0] = side * top;
        f[2] = 0.35f * top;
        break;
    case HAIR_QUIFF:
        f[0] = 0.25f * (part > 0 ? -1 : 1) * top;
        f[2] = -0.9f * top;
        f[1] += 0.5f * top * ramp(0.2f, 0.8f, front);
        break;
    case HAIR_BUN: {
        float bun[3] = { a->skull[0], a->skull[1] + 0.5f * a->skull_radius[1],
                         a->skull[2] - 1.1f * a->skull_radius[2] };
        sub3(f, bun, p);
        unit3(f);
        break;
    }
    case HAIR_MEDIUM: case HAIR_LONG: case HAIR_WAVY: case HAIR_CURLY:
        f[0] = side * ramp(-0.25f, 0.6f, (p[1] - a->skull[1])
                                         / a->skull_radius[1]);
        f[2] = -0.35f * (1 - 0.5f * top) * f[0] * side;
        if (h->fringe && front > 0.45f && fabsf(p[0]) < 0.22f) {
            f[0] *= 0.4f;
            f[2] = 1.0f;
        }
        break;
    default:
        f[2] = -0.3f * top;
    }
}

/* Normals of a strand, mostly away from the skull, and how open to the sky its
 * points lie: the tips and what is far out are. */
static void hair_finish_strand(struct strand_point *q, int n,
                               const struct actor *a, const float normal[3],
                               float depth)
{
    for (int i = 0; i < n; i++) {
        sub3(q[i].n, q[i].p, a->skull);
        if (q[i].n[1] < 0)
            q[i].n[1] *= 0.2f;
        unit3(q[i].n);
        lerp3(q[i].n, q[i].n, normal, 0.25f);
        float t = (float)i / (float)(n - 1);
        q[i].open = lerpf(0.35f, 1, ramp(0, 0.7f, t)) * (0.55f + 0.45f * depth);
    }
}

/* The direction d at share t of a strand's length, from the one before:
 * the cut's lift, comb, waves and weight. */
static void hair_direct(float d[3], const struct actor *a, const float p[3],
                        const float root[3], const float normal[3],
                        const struct cut *cut, float length, float phase,
                        float t)
{
    const struct hair_look *h = &a->look.hair;
    float f[3], w[4], fine[4];
    float s[3] = { root[0] * 9, root[1] * 9 + 5 * length * t, root[2] * 9 };
    float s2[3] = { root[0] * 31, root[1] * 31,
                    root[2] * 31 + 9 * length * t };

    hair_flow(a, f, p);
    noise4(w, s);
    noise4(fine, s2);
    for (int k = 0; k < 3; k++)
        d[k] = 0.55f * d[k] + cut->lift * normal[k] * (1 - t)
               + cut->comb * f[k] + cut->wave * (0.5f * w[k + 1]
                                                 + 0.4f * fine[k + 1]);
    d[1] -= cut->gravity * (0.4f + 1.2f * t);
    if (h->style == HAIR_WAVY || h->style == HAIR_CURLY) {
        float turn = phase + t * length * (10 + 14 * h->curl);
        d[0] += cut->wave * 0.7f * sinf(turn);
        d[2] += cut->wave * 0.7f * cosf(turn);
    }
    unit3(d);
}

/* From the root along the cut's direction, falling, and never into the
 * skull. */
static void hair_grow_strand(struct actor *a, struct strand_point *q, int n,
                             const float root[3], const float normal[3],
                             const struct cut *cut, struct random *r)
{
    const struct hair_look *h = &a->look.hair;
    float top = ramp(0.0f, 0.6f, (root[1] - a->skull[1])
                                 / a->skull_radius[1]);
    float vary = (float)random_range(r, 0.72, 1.08), p[3], d[3];
    float length = lerpf(cut->side, cut->top, top) * h->length * vary;
    float depth = (float)random_uniform(r), room = depth * cut->thick
                  * h->volume * lerpf(0.6f, 1, top);
    int fringe = h->fringe && root[2] > 0.45f * a->skull_radius[2]
                 && fabsf(root[0]) < 0.22f && cut->top > 0.4f;

    if (fringe)
        length = (root[1] - a->lmk[24][1]) * 1.15f + 0.05f;
    float step = length / (float)(n - 1), phase = (float)random_range(r, 0, 6);
    copy3(p, root);
    copy3(d, normal);
    for (int i = 0; i < n; i++) {
        float t = (float)i / (float)(n - 1);
        copy3(q[i].p, p);
        hair_direct(d, a, p, root, normal, cut, length, phase, t);
        mad3(p, p, d, step);
        hair_keep_outside(a, p, room * ramp(0, 0.35f, t + 0.1f),
                          cut->lift * cut->lift * 0.25f + 0.02f);
        if (length > 0.3f && !fringe)
            hair_keep_clear(a, p, depth);
    }
    hair_finish_strand(q, n, a, normal, depth);
}

/* A random point of the scalp, picked by area and density. */
static int hair_pick_root(const struct actor *a, float root[3], float normal[3],
                          struct random *r)
{
    const struct head *h = a->head;

    for (int tries = 0; tries < 64; tries++) {
        size_t f = random_below(r, (uint32_t)h->F);
        const int32_t *v = h->f + 3 * f;
        float d = 0, e[3], g[3];
        for (int k = 0; k < 3; k++)
            d += a->paint[v[k]].k[PAINT_HAIR] / 3;
        sub3(e, a->neutral + 3 * v[1], a->neutral + 3 * v[0]);
        sub3(g, a->neutral + 3 * v[2], a->neutral + 3 * v[0]);
        cross3(normal, e, g);
        float area = length3(normal);
        if (d < 0.12f || random_uniform(r) > (double)(d * area / a->root_area))
            continue;
        float s = (float)random_uniform(r), t = (float)random_uniform(r);
        if (s + t > 1) {
            s = 1 - s;
            t = 1 - t;
        }
        mad3(root, a->neutral + 3 * v[0], e, s);
        mad3(root, root, g, t);
        unit3(normal);
        return 1;
    }
    return 0;
}

/* Faces differ in size: the largest with hair bounds the odds. */
static void hair_measure_roots(struct actor *a)
{
    const struct head *h = a->head;

    a->root_area = 1e-9f;
    for (size_t i = 0; i < h->F; i++) {
        const int32_t *v = h->f + 3 * i;
        float e[3], g[3], n[3];
        if (a->paint[v[0]].k[PAINT_HAIR] < 0.1f)
            continue;
        sub3(e, a->neutral + 3 * v[1], a->neutral + 3 * v[0]);
        sub3(g, a->neutral + 3 * v[2], a->neutral + 3 * v[0]);
        cross3(n, e, g);
        a->root_area = fmaxf(a->root_area, length3(n));
    }
}

/* A knot of hair at the back of the head. */
static int hair_grow_bun(struct actor *a, struct random *r, struct error *err)
{
    float size = 0.17f * a->look.hair.volume;
    float c[3] = { a->skull[0], a->skull[1] + 0.62f * a->skull_radius[1],
                   a->skull[2] - 1.05f * a->skull_radius[2] };

    for (int s = 0; s < 900; s++) {
        int n = 8;
        struct strand_point *q = actor_strand(a, STRAND_HAIR, n, 0.006f, 0.8f);
        if (!q)
            return error_set(err, EX_OSERR, "out of memory for strands");
        float tilt = (float)random_range(r, -0.6, 0.6);
        float from = (float)random_range(r, 0, 6.3), rad, z;
        z = (float)random_range(r, -1, 1);
        rad = sqrtf(fmaxf(1 - z * z, 0));
        a->strand[a->nstrand - 1].random = (float)random_range(r, -1, 1);
        for (int i = 0; i < n; i++) {
            float x = from + 0.16f * (float)i;
            float d[3] = { rad * cosf(x), rad * sinf(x), z + tilt * 0.1f
                           * (float)i };
            unit3(d);
            mad3(q[i].p, c, d, size);
            copy3(q[i].n, d);
            q[i].open = 0.75f;
        }
    }
    return 0;
}

int hair_grow(struct actor *a, struct error *err)
{
    const struct hair_look *h = &a->look.hair;
    const struct cut *cut = &cuts[h->style];
    struct random r;

    random_init(&r, a->look.key, "strands");
    hair_measure_roots(a);
    for (int i = 0; i < cut->count; i++) {
        float root[3], normal[3];
        if (!hair_pick_root(a, root, normal, &r))
            continue;
        struct strand_point *q = actor_strand(a, STRAND_HAIR, cut->points,
                                              cut->half, 0.45f);
        if (!q)
            return error_set(err, EX_OSERR, "out of memory for strands");
        struct strand *s = &a->strand[a->nstrand - 1];
        s->random = (float)random_range(&r, -1, 1);
        s->loose = cut->top > 0.8f;
        hair_grow_strand(a, q, cut->points, root, normal, cut, &r);
    }
    return h->style == HAIR_BUN ? hair_grow_bun(a, &r, err) : 0;
}
