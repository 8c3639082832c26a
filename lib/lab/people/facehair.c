/* Brows, lashes and beards ride on the skin; frames of glasses sit on the
 * nose.  All are strands. */
#include "lib/lab/people/actor.h"

#include <math.h>
#include <sysexits.h>

#include "lib/base/random.h"
#include "lib/lab/people/vec.h"

static int facehair_no_memory(struct error *err)
{
    return error_set(err, EX_OSERR, "out of memory for strands");
}

/* A strand on face f at (s, t) leaning along dir, bent towards the skin. */
static int facehair_plant(struct actor *a, enum strand_kind kind, size_t f,
                          float s, float t, const float dir[3], float length,
                          float half, float random, float lift)
{
    const int32_t *v = a->head->f + 3 * f;
    float e[3], g[3], n[3], p[3], d[3];
    int points = 4;
    struct strand_point *q = actor_strand(a, kind, points, half, 0.35f);

    if (!q)
        return -1;
    struct strand *st = &a->strand[a->nstrand - 1];
    st->face = (int32_t)f;
    st->random = random;
    sub3(e, a->neutral + 3 * v[1], a->neutral + 3 * v[0]);
    sub3(g, a->neutral + 3 * v[2], a->neutral + 3 * v[0]);
    cross3(n, e, g);
    unit3(n);
    mad3(p, a->neutral + 3 * v[0], e, s);
    mad3(p, p, g, t);
    copy3(d, dir);
    mad3(d, d, n, -dot3(d, n));
    unit3(d);
    for (int i = 0; i < points; i++) {
        float x = (float)i / (float)(points - 1);
        mad3(q[i].p, p, d, length * x);
        mad3(q[i].p, q[i].p, n, 0.0015f + lift * x * (1 - 0.6f * x));
        q[i].p[1] -= 0.15f * length * x * x;
        copy3(q[i].n, n);
        q[i].open = 0.6f + 0.4f * x;
    }
    return 0;
}

/* Density of brow hair at p of one brow (landmarks first..first+4), and the
 * way it points: outwards along the brow, up at its inner end. */
static float facehair_brow_at(const struct actor *a, const float p[3],
                              int first, float dir[3])
{
    float best = 9, place = 0;

    for (int i = 0; i < 4; i++) {
        const float *q = a->lmk[first + i], *r = a->lmk[first + i + 1];
        float e[2] = { r[0] - q[0], r[1] - q[1] };
        float x = p[0] - q[0], y = p[1] - q[1];
        float t = clampf((x * e[0] + y * e[1])
                         / (e[0] * e[0] + e[1] * e[1] + 1e-9f), 0, 1);
        float l = hypotf(x - e[0] * t, y - e[1] * t);
        if (l < best) {
            best = l;
            place = ((float)i + t) / 4;
            dir[0] = e[0];
            dir[1] = e[1];
            dir[2] = r[2] - q[2];
        }
    }
    unit3(dir);
    /* landmarks 17..21 and 22..26 both run towards the subject's left */
    float inner = first == 22 ? 1 - place : place;
    if (first != 22)
        for (int k = 0; k < 3; k++)
            dir[k] = -dir[k];
    dir[1] += lerpf(0.05f, 0.6f, inner * inner);
    float wide = 0.027f * a->look.brow_weight * lerpf(0.55f, 1, inner);
    return ramp(wide, wide * 0.4f, best);
}

/* Short strands where brows are painted, as many as the paint is dense. */
static int facehair_grow_brows(struct actor *a, struct random *r)
{
    const struct head *h = a->head;

    for (size_t f = 0; f < h->F; f++) {
        const int32_t *v = h->f + 3 * f;
        const float *o = a->neutral + 3 * v[0];
        float e[3], g[3], n[3], dir[3];
        if (a->paint[v[0]].k[PAINT_BROW] + a->paint[v[1]].k[PAINT_BROW]
            + a->paint[v[2]].k[PAINT_BROW] <= 0)
            continue;
        sub3(e, a->neutral + 3 * v[1], o);
        sub3(g, a->neutral + 3 * v[2], o);
        cross3(n, e, g);
        float count = length3(n) * 0.5f * 34000 * a->look.brow_weight;
        int whole = (int)(count + random_uniform(r));
        for (int i = 0; i < whole; i++) {
            float s = (float)random_uniform(r), t = (float)random_uniform(r);
            float p[3];
            if (s + t > 1) {
                s = 1 - s;
                t = 1 - t;
            }
            mad3(p, o, e, s);
            mad3(p, p, g, t);
            float d = facehair_brow_at(a, p, p[0] > 0 ? 22 : 17, dir);
            if (random_uniform(r) > d)
                continue;
            for (int k = 0; k < 3; k++)
                dir[k] += (float)random_range(r, -0.3, 0.3);
            float curl = (float)random_range(r, -1, 1);
            float length = (float)random_range(r, 0.025, 0.045);
            if (facehair_plant(a, STRAND_BROW, f, s, t, dir, length, 0.0017f,
                               curl, 0.007f))
                return -1;
        }
    }
    return 0;
}

/* Strands on faces of the beard's region, as dense as its paint says. */
static int facehair_grow_beard(struct actor *a, struct random *r)
{
    const struct head *h = a->head;
    float l = a->look.beard_length;

    if (l <= 0)
        return 0;
    for (size_t f = 0; f < h->F; f++) {
        const int32_t *v = h->f + 3 * f;
        const float *o = a->neutral + 3 * v[0];
        float d = 0, e[3], g[3], n[3];
        for (int k = 0; k < 3; k++)
            d += a->paint[v[k]].k[PAINT_BEARD] / 3;
        float upper = o[1] > a->mouth[1] && fabsf(o[0]) < 0.2f;
        d *= upper > 0 ? a->look.moustache : a->look.beard;
        if (d <= 0.05f)
            continue;
        sub3(e, a->neutral + 3 * v[1], o);
        sub3(g, a->neutral + 3 * v[2], o);
        cross3(n, e, g);
        int whole = (int)(length3(n) * 0.5f * 17000 * d + random_uniform(r));
        for (int i = 0; i < whole; i++) {
            float s = (float)random_uniform(r), t = (float)random_uniform(r);
            if (s + t > 1) {
                s = 1 - s;
                t = 1 - t;
            }
            float dir[3] = { (float)random_range(r, -.4, .4)
                             + (upper > 0 ? copysignf(0.8f, o[0]) : 0), -1,
                             (float)random_range(r, -.2, .3) };
            float curl = (float)random_range(r, -1, 1);
            float length = l * (float)random_range(r, 0.6, 1.3);
            if (facehair_plant(a, STRAND_BEARD, f, s, t, dir, length, 0.0017f,
                               curl, l * 0.6f))
                return -1;
        }
    }
    return 0;
}

/* A lash starts on the lid's edge: between two neighbouring landmarks of the
 * eye, on the nearer one's face. */
static int facehair_grow_lashes(struct actor *a, struct random *r)
{
    static const int upper[2][4] = { { 36, 37, 38, 39 }, { 42, 43, 44, 45 } };

    for (int eye = 0; eye < 2; eye++)
        for (int i = 0; i < 90; i++) {
            float x = (float)random_range(r, 0, 2.999), t, p[3], d[3];
            int k = (int)x;
            t = x - (float)k;
            struct strand_point *q = actor_strand(
                a, STRAND_LASH, 4, 0.0011f * a->look.lash, 0.3f);
            if (!q)
                return -1;
            struct strand *s = &a->strand[a->nstrand - 1];
            /* -2 - (first landmark): placed by the stage every frame */
            s->face = -2 - upper[eye][k];
            s->random = t;
            lerp3(p, a->lmk[upper[eye][k]], a->lmk[upper[eye][k] + 1], t);
            sub3(d, p, a->eye[eye == 0 ? 1 : 0]);
            float side = d[0], l = (float)random_range(r, 0.018, 0.030);
            for (int j = 0; j < 4; j++) {
                float u = (float)j / 3;
                /* relative to the lid's edge */
                q[j].p[0] = l * u * clampf(side * 6, -0.5f, 0.5f);
                q[j].p[1] = l * (u * u * 0.75f - 0.1f * u);
                q[j].p[2] = l * u * 0.8f;
                copy3(q[j].n, d);
                unit3(q[j].n);
                q[j].open = 0.6f;
            }
        }
    return 0;
}

int face_hair_grow(struct actor *a, struct error *err)
{
    struct random r;

    random_init(&r, a->look.key, "face hair");
    if (facehair_grow_brows(a, &r) || facehair_grow_lashes(a, &r) ||
        facehair_grow_beard(a, &r))
        return facehair_no_memory(err);
    return 0;
}

/* One tube of the frame through n points. */
static int facehair_tube(struct actor *a, const float (*p)[3], int n,
                         float half)
{
    struct strand_point *q = actor_strand(a, STRAND_FRAME, n, half, 1);

    if (!q)
        return -1;
    for (int i = 0; i < n; i++) {
        copy3(q[i].p, p[i]);
        q[i].n[0] = q[i].n[1] = 0;
        q[i].n[2] = 1;
        q[i].open = 1;
    }
    return 0;
}

/* The bridge over the nose, from -half to half, a tube of radius `radius`. */
static int glasses_add_bridge(struct actor *a, float half, float z,
                              float radius)
{
    float p[7][3];

    for (int i = 0; i < 7; i++) {
        float x = (float)i / 3 - 1;
        p[i][0] = x * half;
        p[i][1] = a->eye[0][1] + 0.03f - 0.02f * x * x;
        p[i][2] = z + 0.02f * (1 - x * x);
    }
    return facehair_tube(a, (const float (*)[3])p, 7, radius);
}

int glasses_build(struct actor *a, struct error *err)
{
    enum { AROUND = 33 };
    float p[AROUND][3], half = a->look.frame_width * 0.5f;

    if (a->look.glasses == GLASSES_NONE)
        return 0;
    float z = fmaxf(a->lmk[27][2] + 0.03f,
                    fmaxf(a->eye[0][2], a->eye[1][2]) + a->eye_radius + 0.07f);
    float apart = 0.5f * (a->eye[0][0] - a->eye[1][0]);
    const bool round = a->look.glasses == GLASSES_ROUND;
    float rx = apart * 0.80f, ry = rx * (round ? 0.95f : 0.70f);
    float e = round ? 1.0f : 0.6f;
    for (int s = 0; s < 2; s++) {
        float side = s ? -1 : 1;
        const float *c = a->eye[s];
        for (int i = 0; i < AROUND; i++) {
            float phi = 6.2831853f * (float)i / (AROUND - 1);
            float x = cosf(phi), y = sinf(phi);
            p[i][0] = c[0] + side * 0.02f
                      + rx * copysignf(powf(fabsf(x), e), x);
            p[i][1] = c[1] - 0.02f + ry * copysignf(powf(fabsf(y), e), y);
            float out = fabsf(p[i][0]) - apart;
            p[i][2] = z - 0.25f * fmaxf(out, 0) * fmaxf(out, 0) * 4;
        }
        if (facehair_tube(a, (const float (*)[3])p, AROUND, half))
            return facehair_no_memory(err);
        const float *ear = a->lmk[s ? 0 : 16];
        float temple[4][3] = {
            { c[0] + side * (0.02f + rx), c[1] + 0.02f, z - 0.03f },
            { ear[0] * 0.97f, c[1] + 0.04f, z - 0.12f },
            { ear[0] * 1.04f, c[1] + 0.03f, ear[2] },
            { ear[0] * 1.04f, c[1] - 0.02f, ear[2] - 0.2f } };
        if (facehair_tube(a, (const float (*)[3])temple, 4, half))
            return facehair_no_memory(err);
    }
    return glasses_add_bridge(a, apart - rx + 0.02f, z, half)
               ? facehair_no_memory(err)
               : 0;
}
