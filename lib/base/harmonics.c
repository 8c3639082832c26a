/* Projection of a panorama, irradiance, and the slope by least squares. */
#include "lib/base/harmonics.h"

#include "lib/base/vec3.h"

void panorama_direction(float d[3], int x, int y, int w, int h)
{
    float phi = 2 * PI_F * (((float)x + 0.5f) / (float)w - 0.5f);
    float theta = PI_F * ((float)y + 0.5f) / (float)h;

    d[0] = sinf(theta) * sinf(phi);
    d[1] = cosf(theta);
    d[2] = -sinf(theta) * cosf(phi);
}

float panorama_solid_angle(int y, int w, int h)
{
    return 2 * PI_F / (float)w
           * (cosf(PI_F * (float)y / (float)h)
              - cosf(PI_F * (float)(y + 1) / (float)h));
}

void harmonic2_add(struct harmonic2 *h, const float d[3], float v)
{
    const float third = 1 / 3.0f;

    h->a += v / (4 * PI_F);
    for (int k = 0; k < 3; k++) {
        h->b[k] += v * 3 / (4 * PI_F) * d[k];
        h->c[k] += v * 15 / (8 * PI_F) * (d[k] * d[k] - third);
    }
    h->c[3] += v * 15 / (8 * PI_F) * d[0] * d[1];
    h->c[4] += v * 15 / (8 * PI_F) * d[0] * d[2];
    h->c[5] += v * 15 / (8 * PI_F) * d[1] * d[2];
}

float harmonic2_diffuse(const struct harmonic2 *h, const float n[3])
{
    const float *b = h->b, *c = h->c;
    float q = c[0] * n[0] * n[0] + c[1] * n[1] * n[1] + c[2] * n[2] * n[2]
              + 2 * (c[3] * n[0] * n[1] + c[4] * n[0] * n[2]
                     + c[5] * n[1] * n[2]);

    return h->a + 2 / 3.0f * (b[0] * n[0] + b[1] * n[1] + b[2] * n[2])
           + 0.25f * q;
}

/* Over the half of the sphere towards the camera; z weighs against its mean of
 * -1/2 there. */
void light_fit(float slope[3], float (*on)(const void *ctx, const float n[3]),
               const void *ctx)
{
    float mean = 0, n[3], s[3] = {0}, length;
    int rows = 24, columns = 48, count = rows * columns;

    for (int i = 0; i < count; i++) {
        float z = -((float)(i / columns) + 0.5f) / (float)rows;
        float r = sqrtf(1 - z * z);
        float a = 2 * PI_F * (float)(i % columns) / (float)columns;

        n[0] = r * cosf(a);
        n[1] = r * sinf(a);
        n[2] = z;
        float e = on(ctx, n) / (float)count;
        mean += e;
        s[0] += 3 * n[0] * e;
        s[1] += 3 * n[1] * e;
        s[2] += 12 * (n[2] + 0.5f) * e;
    }
    /* the fit is mean + s.(n - (0, 0, -1/2)) */
    mean = fmaxf(mean + 0.5f * s[2], 1e-6f);
    for (int k = 0; k < 3; k++)
        slope[k] = s[k] / mean;
    length = sqrtf(slope[0] * slope[0] + slope[1] * slope[1] +
                   slope[2] * slope[2]);
    for (int k = 0; k < 3 && length > 1; k++)
        slope[k] /= length;
}

/* The luminance of a surface under harmonics ctx. */
static float light_diffuse(const void *ctx, const float n[3])
{
    return fmaxf(harmonic2_diffuse(ctx, n), 0);
}

void light_of_panorama(float slope[3], const float *rgb, int w, int h)
{
    struct harmonic2 sky = {0};

    for (int y = 0; y < h; y++) {
        const float area = panorama_solid_angle(y, w, h);
        struct harmonic2 row = {0};

        for (int x = 0; x < w; x++, rgb += 3) {
            float d[3];

            panorama_direction(d, x, y, w, h);
            d[1] = -d[1];       /* the camera's y is down, its z forward */
            d[2] = -d[2];
            harmonic2_add(&row, d, area * light_luminance(rgb));
        }
        sky.a += row.a;
        for (int k = 0; k < 3; k++)
            sky.b[k] += row.b[k];
        for (int k = 0; k < 6; k++)
            sky.c[k] += row.c[k];
    }
    light_fit(slope, light_diffuse, &sky);
}
