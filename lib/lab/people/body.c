/* Shoulders and clothes: rings from inside the neck out to the shoulders and
 * down, cloth wherever the neckline says so, and a collar. */
#include "lib/lab/people/actor.h"

#include <math.h>

#include "lib/lab/people/noise.h"
#include "lib/lab/people/vec.h"

#define AROUND 72
#define RINGS 34
#define PI 3.14159265f

/* The bare body at ring t (0 inside the neck, 1 shoulder, 2 below the window)
 * and angle phi (0 at the front, growing to the left). */
static void body_torso(const struct actor *a, float p[3], float t, float phi)
{
    const float *b = a->neck_base;
    float wide = 0.98f * a->look.shoulder, u = clampf(t, 0, 1);
    float neck_x = a->neck_radius[0] * 0.86f;
    float neck_z = a->neck_radius[1] * 0.84f;
    float flare = u * (0.55f + 0.45f * u);
    float rx = lerpf(neck_x, wide, flare);
    float rz = lerpf(neck_z, 0.46f * a->look.build, ramp(0, 0.8f, u));
    float s = sinf(phi), c = cosf(phi);
    float e = lerpf(1, 0.8f, u);

    p[0] = b[0] + rx * copysignf(powf(fabsf(s), e), s);
    p[2] = b[2] - 0.04f * u + rz * copysignf(powf(fabsf(c), e), c);
    /* the trapezius runs down to the shoulder; chest and back drop sooner */
    float side = fabsf(s);
    float fall = 0.36f * powf(u, 0.85f) + (1 - side) * 0.20f * u;
    float back = 0.5f - 0.5f * c;
    p[1] = b[1] + 0.06f + 0.12f * fmaxf(back, side * 0.9f) - fall;
    if (t > 1)
        p[1] -= (t - 1) * 1.6f;
    if (c > 0)                       /* chest */
        p[2] += 0.10f * a->look.build * ramp(0.2f, 1.2f, t) * c;
}

/* Where the cloth begins, as t, at angle phi. */
static float body_neckline(enum collar collar, float phi)
{
    float front = 0.5f + 0.5f * cosf(phi);
    float tight = expf(-phi * phi * 5);

    switch (collar) {
    case COLLAR_VEE: return 0.20f + 0.05f * front + 0.38f * tight;
    case COLLAR_SHIRT: return 0.10f + 0.16f * tight;
    case COLLAR_HOOD: return 0.12f + 0.14f * tight;
    case COLLAR_TURTLE: return 0.02f;
    case COLLAR_WIDE: return 0.42f + 0.14f * front;
    default: return 0.15f + 0.10f * front;
    }
}

/* Height of the cloth over the body at distance d (in t) past its edge. */
static float body_thickness(const struct persona *p, float d, float phi)
{
    float base = 0.020f, edge = ramp(0, 0.02f, d);
    float back = 0.5f - 0.5f * cosf(phi);

    switch (p->collar) {
    case COLLAR_HOOD:
        return edge * (0.035f + (0.09f + 0.10f * back)
                       * expf(-sqrtf(fabsf(d - 0.13f) * 40) * 0.8f));
    case COLLAR_TURTLE:
        return edge * (0.022f + 0.02f * ramp(0.12f, 0.05f, d));
    case COLLAR_SHIRT:
        return edge * (base + 0.045f * ramp(0.22f, 0.16f, d));
    default:
        return edge * (base + 0.012f * ramp(0.06f, 0.035f, d));
    }
}

/* Rings lie closer together at the neck than down the chest. */
static float body_ring_t(int r)
{
    float x = (float)r / (RINGS - 1);

    return x < 0.8f ? 1.15f * powf(x / 0.8f, 1.25f)
                    : 1.15f + (x - 0.8f) / 0.2f * 0.85f;
}

/* A point of the clothed torso: thickness and folds along its normal, the
 * collar, and what is painted on it. */
static void body_vertex(struct actor *a, size_t i, float t, float phi)
{
    float *p = a->neutral + 3 * i, e[3], f[3], n[3], q[3];
    const float *shift = a->look.cloth.shift;

    body_torso(a, p, t, phi);
    body_torso(a, e, t + 0.02f, phi);
    body_torso(a, f, t, phi + 0.05f);
    sub3(e, e, p);
    sub3(f, f, p);
    cross3(n, e, f);
    unit3(n);
    if (n[1] < 0 && t < 1)
        for (int k = 0; k < 3; k++)
            n[k] = -n[k];
    float d = t - body_neckline(a->look.collar, phi);
    float up = body_thickness(&a->look, d, phi);
    if (d > 0) {                     /* folds */
        for (int k = 0; k < 3; k++)
            q[k] = p[k] * 4 + shift[k];
        up += (noise_sum(q[0], q[1] * 0.6f, q[2], 3) * 0.020f + 0.004f)
              * ramp(0.02f, 0.3f, d);
    }
    mad3(p, p, n, up);
    if (a->look.collar == COLLAR_TURTLE && t < 0.16f) {
        float x = 1 - t / 0.16f;     /* a tube up the neck */
        float wide = 1.15f + 0.12f * (1 - x);
        p[0] = a->neck_base[0] + sinf(phi) * a->neck_radius[0] * wide;
        p[2] = a->neck_base[2] + cosf(phi) * a->neck_radius[1] * wide;
        p[1] += 0.13f * x;
    }
    copy3(a->paint[i].c, p);
    a->anchor[i] = ANCHOR_BODY;
    struct paint *k = &a->paint[i];
    k->k[PAINT_RED] = 0.1f;
    k->k[PAINT_SHUT] = 0.25f * ramp(0.25f, 0, t);
    /* the seam of the collar */
    k->k[PAINT_DARK] = ramp(0.015f, 0.005f, fabsf(d - 0.055f)) * 0.35f;
    if (a->look.collar == COLLAR_SHIRT && d > 0)
        k->k[PAINT_DARK] += 0.4f * ramp(0.03f, 0.01f, fabsf(phi))
                            * ramp(0.2f, 0.25f, d);
}

int body_build(struct actor *a, struct error *err)
{
    size_t v0, f0;

    if (actor_grow(a, RINGS * AROUND, 2 * (RINGS - 1) * AROUND, &v0, &f0, err))
        return -1;
    for (int r = 0; r < RINGS; r++)
        for (int c = 0; c < AROUND; c++)
            body_vertex(a, v0 + (size_t)(r * AROUND + c), body_ring_t(r),
                        2 * PI * (float)c / AROUND - PI);
    size_t f = f0;
    for (int r = 0; r + 1 < RINGS; r++)
        for (int c = 0; c < AROUND; c++) {
            int d = (c + 1) % AROUND;
            int32_t p = (int32_t)v0 + r * AROUND, q = p + AROUND;
            int32_t quad[6] = { p + c, q + c, p + d, p + d, q + c, q + d };
            for (int k = 0; k < 6; k++)
                a->faces[3 * f + (size_t)k] = quad[k];
            float phi = 2 * PI * ((float)c + 0.5f) / AROUND - PI;
            float t = 0.5f * (body_ring_t(r) + body_ring_t(r + 1));
            int cloth = t > body_neckline(a->look.collar, phi);
            for (int k = 0; k < 2; k++, f++) {
                a->material[f] = cloth ? MATERIAL_CLOTH : MATERIAL_SKIN;
                a->label[f] = cloth ? LABEL_CLOTH : LABEL_NECK;
            }
        }
    return 0;
}
