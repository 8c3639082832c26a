/* A mesh drawn with a z-buffer, four samples to a pixel, for contact sheets
 * and comparisons of exported meshes. */
#include "lib/base/preview.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

enum { SS = 2 };              /* samples per pixel along each axis */

struct canvas {
    size_t w, h;
    float *depth, *rgb;
};

/* Turn, centre and project: x, y in samples, z towards the viewer. */
static void preview_mesh_project(float *out, const struct preview_mesh *m,
                                 const struct preview_view *v,
                                 const struct canvas *c)
{
    float a = v->yaw * (float)M_PI / 180, b = v->pitch * (float)M_PI / 180;
    float scale = (float)c->h / v->height, far = 6 * v->height;

    for (size_t i = 0; i < m->nv; i++) {
        float x = m->verts[i * 3] - v->centre[0];
        float y = m->verts[i * 3 + 1] - v->centre[1];
        float z = m->verts[i * 3 + 2] - v->centre[2];
        float x1 = cosf(a) * x + sinf(a) * z, z1 = cosf(a) * z - sinf(a) * x;
        float y1 = cosf(b) * y - sinf(b) * z1, z2 = sinf(b) * y + cosf(b) * z1;
        float k = far / (far - z2);

        out[i * 3] = (float)c->w / 2 + x1 * k * scale;
        out[i * 3 + 1] = (float)c->h / 2 - y1 * k * scale;
        out[i * 3 + 2] = z2 * scale;
    }
}

/* Area-weighted vertex normals in view space (x right, y up, z to viewer). */
static void preview_mesh_normals(float *n, const float *p,
                                 const struct preview_mesh *m)
{
    memset(n, 0, m->nv * 3 * sizeof *n);
    for (size_t i = 0; i < m->nf; i++) {
        const int32_t *f = m->faces + i * 3;
        const float *a = p + f[0] * 3, *b = p + f[1] * 3, *c = p + f[2] * 3;
        float u[3] = { b[0] - a[0], a[1] - b[1], b[2] - a[2] };
        float v[3] = { c[0] - a[0], a[1] - c[1], c[2] - a[2] };
        float g[3] = { u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                       u[0] * v[1] - u[1] * v[0] };

        for (int k = 0; k < 3; k++)
            for (int d = 0; d < 3; d++)
                n[f[k] * 3 + d] += g[d];
    }
}

/* Key, fill and rim light with a little gloss; out is linear RGB. */
static void preview_sample_shade(float *out, float nx, float ny, float nz,
                                 const float *albedo)
{
    static const float clay[3] = { 0.62f, 0.53f, 0.46f };
    const float *base = albedo ? albedo : clay;
    float l = sqrtf(nx * nx + ny * ny + nz * nz) + 1e-9f;

    nx /= l, ny /= l, nz /= l;
    if (nz < 0)
        nz = -nz;
    float key = -0.50f * nx + 0.55f * ny + 0.67f * nz;
    float fill = 0.75f * nx + 0.05f * ny + 0.65f * nz;
    float rim = 0.5f + 0.5f * ny;
    key = key > 0 ? key : 0;
    fill = fill > 0 ? fill : 0;
    float half = -0.28f * nx + 0.30f * ny + 0.91f * nz;
    float spec = half > 0 ? 0.10f * powf(half, 24) : 0;
    float e = 0.78f * key + 0.22f * fill + 0.16f * rim;
    for (int d = 0; d < 3; d++)
        out[d] = base[d] * e + spec;
}

/* Twice the signed area of (a, b, (x,y)). */
static float preview_triangle_edge(const float *a, const float *b, float x,
                                   float y)
{
    return (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
}

/* Sample `at` inside triangle f by its weights w: normal and albedo, shaded. */
static void preview_triangle_shade(struct canvas *c, size_t at,
                                   const float w[3], const float *n,
                                   const int32_t *f,
                                   const struct preview_mesh *m)
{
    float nn[3] = { 0 }, al[3] = { 0 };

    for (int k = 0; k < 3; k++)
        for (int d = 0; d < 3; d++) {
            nn[d] += w[k] * n[f[k] * 3 + d];
            if (m->color)
                al[d] += w[k] * m->color[f[k] * 3 + d];
        }
    preview_sample_shade(c->rgb + at * 3, nn[0], nn[1], nn[2],
                         m->color ? al : NULL);
}

/* Every sample of a triangle that nothing hides, and the edges if asked for. */
static void preview_triangle_draw(struct canvas *c, const float *p,
                                  const float *n, const int32_t *f,
                                  const struct preview_mesh *m, bool wire)
{
    const float *q[3] = { p + f[0] * 3, p + f[1] * 3, p + f[2] * 3 };
    float area = preview_triangle_edge(q[0], q[1], q[2][0], q[2][1]);

    if (fabsf(area) < 1e-6f)
        return;
    float lo[2] = { 1e9f, 1e9f }, hi[2] = { -1e9f, -1e9f };
    for (int k = 0; k < 3; k++)
        for (int d = 0; d < 2; d++) {
            lo[d] = fminf(lo[d], q[k][d]);
            hi[d] = fmaxf(hi[d], q[k][d]);
        }
    int xa = (int)fmaxf(0, floorf(lo[0])), ya = (int)fmaxf(0, floorf(lo[1]));
    int xb = (int)fminf((float)c->w - 1, ceilf(hi[0]));
    int yb = (int)fminf((float)c->h - 1, ceilf(hi[1]));
    float len[3];
    for (int k = 0; k < 3; k++)
        len[k] = hypotf(q[(k + 1) % 3][0] - q[(k + 2) % 3][0],
                        q[(k + 1) % 3][1] - q[(k + 2) % 3][1]);
    for (int y = ya; y <= yb; y++)
        for (int x = xa; x <= xb; x++) {
            float sx = (float)x + 0.5f, sy = (float)y + 0.5f, w[3];

            w[0] = preview_triangle_edge(q[1], q[2], sx, sy) / area;
            w[1] = preview_triangle_edge(q[2], q[0], sx, sy) / area;
            w[2] = 1 - w[0] - w[1];
            if (w[0] < 0 || w[1] < 0 || w[2] < 0)
                continue;
            float z = w[0] * q[0][2] + w[1] * q[1][2] + w[2] * q[2][2];
            size_t at = (size_t)y * c->w + (size_t)x;
            if (z <= c->depth[at])
                continue;
            c->depth[at] = z;
            preview_triangle_shade(c, at, w, n, f, m);
            for (int k = 0; wire && k < 3; k++)
                if (w[k] * fabsf(area) < 0.9f * len[k])
                    for (int d = 0; d < 3; d++)
                        c->rgb[at * 3 + (size_t)d] *= 0.45f;
        }
}

/* Linear 0 to 1 as a byte of sRGB. */
static uint8_t preview_to_srgb(float v)
{
    v = v < 0 ? 0 : v > 1 ? 1 : v;
    v = v <= 0.0031308f ? 12.92f * v : 1.055f * powf(v, 1 / 2.4f) - 0.055f;
    return (uint8_t)(v * 255 + 0.5f);
}

/* Means of the samples, encoded. */
static void preview_resolve(uint8_t *rgb, size_t stride, size_t x0, size_t y0,
                            const struct canvas *c)
{
    for (size_t y = 0; y < c->h / SS; y++)
        for (size_t x = 0; x < c->w / SS; x++)
            for (size_t d = 0; d < 3; d++) {
                float s = 0;

                for (size_t k = 0; k < SS * SS; k++)
                    s += c->rgb[((y * SS + k / SS) * c->w + x * SS + k % SS) *
                                3 + d];
                rgb[((y0 + y) * stride + x0 + x) * 3 + d] =
                    preview_to_srgb(s / (SS * SS));
            }
}

int preview_draw(uint8_t *rgb, size_t stride, size_t x0, size_t y0, size_t w,
                 size_t h, const struct preview_mesh *mesh,
                 const struct preview_view *view, struct error *err)
{
    struct canvas c = { .w = w * SS, .h = h * SS };
    size_t n = c.w * c.h;
    float *p = malloc(mesh->nv * 3 * sizeof *p);
    float *nrm = malloc(mesh->nv * 3 * sizeof *nrm);
    int rc = -1;

    c.depth = malloc(n * sizeof *c.depth);
    c.rgb = malloc(n * 3 * sizeof *c.rgb);
    if (!p || !nrm || !c.depth || !c.rgb) {
        error_set(err, EX_OSERR, "out of memory for a preview of %zux%zu",
                  w, h);
        goto out;
    }
    for (size_t i = 0; i < n; i++) {
        float g = 0.05f + 0.05f * (float)(i / c.w) / (float)c.h;

        c.depth[i] = -1e30f;
        c.rgb[i * 3] = c.rgb[i * 3 + 1] = g;
        c.rgb[i * 3 + 2] = g * 1.1f;
    }
    preview_mesh_project(p, mesh, view, &c);
    preview_mesh_normals(nrm, p, mesh);
    for (size_t i = 0; i < mesh->nf; i++)
        preview_triangle_draw(&c, p, nrm, mesh->faces + i * 3, mesh,
                              view->wire);
    preview_resolve(rgb, stride, x0, y0, &c);
    rc = 0;
out:
    free(p);
    free(nrm);
    free(c.depth);
    free(c.rgb);
    return rc;
}
