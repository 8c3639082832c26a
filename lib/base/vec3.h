/* Small helpers: numbers, three floats, row-major matrices beside those of
 * lib/base/rotation.h. */
#ifndef SPID_BASE_VEC3_H
#define SPID_BASE_VEC3_H

#include <math.h>
#include <stddef.h>

#include "lib/base/rotation.h"

#define PI_F ((float)M_PI)
#define DEGREE_F (PI_F / 180)

/* Of 1: what a photograph shows darker than that is its noise, and tells nothing of
 * light.  Before logarithms it is added, or the least.  Half and twice: tests/bench/README.md,
 * "The constants of hidden hair". */
#define SRGB_DARK 0.02f

/* As fmaxf and fminf, which are calls; b where a is not a number. */
static inline float maxf(float a, float b)
{
    return a > b ? a : b;
}
static inline float minf(float a, float b)
{
    return a < b ? a : b;
}
/* As (int)ceilf and (int)floorf, for what an int holds. */
static inline int ceil_int(float x)
{
    int i = (int)x;

    return i + (x > (float)i);
}
static inline int floor_int(float x)
{
    int i = (int)x;

    return i - (x < (float)i);
}
static inline float clampf(float x, float lo, float hi)
{
    return x < lo ? lo : x > hi ? hi : x;
}
static inline float lerpf(float a, float b, float t)
{
    return a + (b - a) * t;
}
/* A byte's worth of sRGB, 0 to 255, to linear light. */
static inline float srgb_decode(float c)
{
    float v = c / 255;

    return v <= 0.04045f ? v / 12.92f : powf((v + 0.055f) / 1.055f, 2.4f);
}
/* 0 at a, 1 at b, smooth between; a may lie above b. */
static inline float ramp(float a, float b, float x)
{
    float t = clampf((x - a) / (b - a), 0, 1);
    return t * t * (3 - 2 * t);
}
static inline float dot3(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
/* Of n numbers. */
static inline double dot_many(const double *a, const double *b, size_t n)
{
    double sum = 0;

    for (size_t i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}
static inline void sub3(float o[3], const float a[3], const float b[3])
{
    for (int i = 0; i < 3; i++)
        o[i] = a[i] - b[i];
}
/* o = a + b s */
static inline void mad3(float o[3], const float a[3], const float b[3],
                        float s)
{
    for (int i = 0; i < 3; i++)
        o[i] = a[i] + b[i] * s;
}
static inline void lerp3(float o[3], const float a[3], const float b[3],
                         float t)
{
    for (int i = 0; i < 3; i++)
        o[i] = lerpf(a[i], b[i], t);
}
static inline void copy3(float o[3], const float a[3])
{
    o[0] = a[0];
    o[1] = a[1];
    o[2] = a[2];
}
static inline void cross3(float o[3], const float a[3], const float b[3])
{
    float x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2];
    float z = a[0] * b[1] - a[1] * b[0];
    o[0] = x;
    o[1] = y;
    o[2] = z;
}
static inline float length3(const float a[3])
{
    return sqrtf(dot3(a, a));
}
/* Unit vector; a zero vector becomes (0,0,1). */
static inline void unit3(float a[3])
{
    float l = length3(a);
    if (l < 1e-12f) {
        a[0] = a[1] = 0;
        a[2] = 1;
        return;
    }
    for (int i = 0; i < 3; i++)
        a[i] /= l;
}
/* o = R a, R row-major 3x3; o may not alias a */
static inline void rot3(float o[3], const float r[9], const float a[3])
{
    for (int i = 0; i < 3; i++)
        o[i] = r[3 * i] * a[0] + r[3 * i + 1] * a[1] + r[3 * i + 2] * a[2];
}
/* o with these columns */
static inline void columns33(float o[9], const float a[3], const float b[3],
                             const float c[3])
{
    for (int k = 0; k < 3; k++) {
        o[3 * k] = a[k];
        o[3 * k + 1] = b[k];
        o[3 * k + 2] = c[k];
    }
}
/* Rotation by angle (radians) about one axis: 0 x, 1 y, 2 z. */
static inline void axis33(float o[9], int axis, float angle)
{
    float c = cosf(angle), s = sinf(angle);
    int a = (axis + 1) % 3, b = (axis + 2) % 3;
    for (int i = 0; i < 9; i++)
        o[i] = 0;
    o[4 * axis] = 1;
    o[4 * a] = o[4 * b] = c;
    o[3 * a + b] = -s;
    o[3 * b + a] = s;
}
/* Rodrigues: rotation by an axis-angle vector. */
static inline void rodrigues33(float o[9], const float w[3])
{
    float a = length3(w), c = cosf(a), k[3] = { w[0], w[1], w[2] };
    float s = a < 1e-6f ? 1 : sinf(a) / a;
    float d = a < 1e-3f ? 0.5f : (1 - c) / (a * a);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            o[3 * i + j] = d * k[i] * k[j] + (i == j ? c : 0);
    o[1] -= s * k[2];
    o[2] += s * k[1];
    o[3] += s * k[2];
    o[5] -= s * k[0];
    o[6] -= s * k[1];
    o[7] += s * k[0];
}

#endif
