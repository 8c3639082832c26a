/* Wire, landmarks and squares in a picture, and the mesh's silhouette by
 * filling its projected triangles. */
#include "lib/photo/overlay.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "formats/draw.h"
#include "lib/base/camera.h"
#include "lib/base/parallel.h"

int overlay_init(struct overlay *o, const struct identity *id,
                 struct error *err)
{
    const struct head *h = id->head;

    memset(o, 0, sizeof *o);
    o->id = id;
    o->verts = arena_take(&o->memory, 3 * h->V, sizeof *o->verts);
    o->uv = arena_take(&o->memory, 2 * h->V, sizeof *o->uv);
    o->z = arena_take(&o->memory, h->V, sizeof *o->z);
    o->segments = arena_take(&o->memory, 12 * h->F, sizeof *o->segments);
    if (arena_check(&o->memory, "the overlay", err) == 0)
        return 0;
    overlay_release(o);
    return -1;
}

void overlay_release(struct overlay *o)
{
    arena_release(&o->memory);
    free(o->rgb);
    memset(o, 0, sizeof *o);
}

/* Vertices in window pixels. */
static void overlay_project(struct overlay *o, const struct motion *m,
                            double size)
{
    struct head_motion pose = m->pose;
    float cam[12];

    pose.exp = m->exp;
    head_pose(o->verts, o->id, &pose);
    camera_make(cam, m->R, m->t);
    camera_project(o->uv, o->z, cam, (float)size, o->verts, o->id->head->V);
}

/* Twice the signed area of a triangle on screen; negative faces the camera
 * (y points down). */
static float overlay_area(const float *uv, const int32_t *f)
{
    const float *a = uv + 2 * f[0], *b = uv + 2 * f[1], *c = uv + 2 * f[2];

    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

/* From window pixels to picture pixels. */
static void overlay_to_picture(float *xy, size_t n, struct square window,
                               double size)
{
    for (size_t i = 0; i < n; i++) {
        struct square p = {xy[2 * i], xy[2 * i + 1], 0};
        p = square_out_of(p, window, size);
        xy[2 * i] = (float)p.x;
        xy[2 * i + 1] = (float)p.y;
    }
}

/* Edges of the faces that look at the camera, each once. */
static size_t overlay_wire(struct overlay *o)
{
    const struct head *h = o->id->head;
    size_t n = 0;

    for (size_t i = 0; i < h->F; i++) {
        const int32_t *f = h->f + 3 * i;
        if (overlay_area(o->uv, f) >= 0)
            continue;
        for (int k = 0; k < 3; k++) {
            int32_t a = f[k], b = f[(k + 1) % 3];
            if (a > b)
                continue;
            memcpy(o->segments + 4 * n, o->uv + 2 * a, 2 * sizeof(float));
            memcpy(o->segments + 4 * n + 2, o->uv + 2 * b,
                   2 * sizeof(float));
            n++;
        }
    }
    return n;
}

/* Wire of the front, landmarks and face crop. */
static void overlay_draw_head(struct overlay *o, struct canvas *c,
                              const struct motion *m, struct square window,
                              double size)
{
    const struct head *h = o->id->head;
    const double dot = fmax(1.2, window.size / 300);
    float lmk[3 * HEAD_LANDMARKS], uv[2 * HEAD_LANDMARKS], cam[12];
    size_t n;

    overlay_project(o, m, size);
    n = overlay_wire(o);
    overlay_to_picture(o->segments, 2 * n, window, size);
    draw_segments(c, o->segments, n,
                  (struct pen){{90, 220, 255}, 1, 0.35});
    if (!h->has_landmarks)
        return;
    head_landmarks(lmk, h, o->verts);
    camera_make(cam, m->R, m->t);
    camera_project(uv, NULL, cam, (float)size, lmk, HEAD_LANDMARKS);
    overlay_to_picture(uv, HEAD_LANDMARKS, window, size);
    draw_dots(c, uv, HEAD_LANDMARKS, dot, (struct pen){{255, 220, 40}, 1, 1});
}

const uint8_t *overlay_draw(struct overlay *o, const uint8_t *rgb, size_t W,
                            size_t H, const struct motion *m, bool lost,
                            struct square window, double size,
                            const char *text)
{
    const double line = fmax(1, (double)W / 400);
    struct canvas c = {NULL, W, H};

    if (3 * W * H > o->room) {
        free(o->rgb);
        o->rgb = malloc(3 * W * H);
        o->room = o->rgb ? 3 * W * H : 0;
    }
    if (!o->rgb)
        return NULL;
    memcpy(o->rgb, rgb, 3 * W * H);
    c.rgb = o->rgb;
    if (m) {
        struct square q = {m->crop[0], m->crop[1], m->crop[2]};
        struct pen pen = {{60, 230, 60}, line, 1};
        q = square_out_of(q, window, size);
        if (lost) {
            pen.color[0] = 255;
            pen.color[1] = pen.color[2] = 40;
        } else {
            overlay_draw_head(o, &c, m, window, size);
        }
        draw_square(&c, window, (struct pen){{80, 120, 255}, line, 0.8});
        draw_square(&c, q, pen);
    }
    if (text)
        draw_text(&c, text, 8, 8 + fmax(10, (double)H / 34),
                  fmax(10, (double)H / 34),
                  (struct pen){{255, 255, 255}, 1, 1});
    return o->rgb;
}

/* The least of three, where fminf would be called for what may be no number. */
static float overlay_min(float a, float b, float c)
{
    const float min = a < b ? a : b;

    return min < c ? min : c;
}

/* Fill the pixels of a triangle whose centre lies inside, from row `from` up to
 * row `to` of a mask n pixels wide. */
static void overlay_fill(uint8_t *mask, size_t n, size_t from, size_t to,
                         const float *a, const float *b, const float *c)
{
    const float top = overlay_min(a[1], b[1], c[1]);
    const float bottom = -overlay_min(-a[1], -b[1], -c[1]);

    if (top >= (float)to || bottom + 2 <= (float)from)
        return;                 /* most are in another band */
    float x0 = fmaxf(0, floorf(overlay_min(a[0], b[0], c[0])));
    float y0 = fmaxf((float)from, floorf(top));
    float x1 = fminf((float)n, ceilf(-overlay_min(-a[0], -b[0], -c[0])) + 1);
    float y1 = fminf((float)to, ceilf(bottom) + 1);

    for (float y = y0 + 0.5f; y < y1; y++)
        for (float x = x0 + 0.5f; x < x1; x++) {
            uint8_t *pixel = mask + (size_t)y * n + (size_t)x;
            if (*pixel)
                continue;
            float u = (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
            float v = (c[0] - b[0]) * (y - b[1]) - (c[1] - b[1]) * (x - b[0]);
            float w = (a[0] - c[0]) * (y - c[1]) - (a[1] - c[1]) * (x - c[0]);
            if ((u <= 0 && v <= 0 && w <= 0) || (u >= 0 && v >= 0 && w >= 0))
                *pixel = 255;
        }
}

/* Rows of the mask that one thread fills: a dozen of a face's triangles. */
#define BAND 32

/* Band i. */
PARALLEL(overlay_band, i, uint8_t *, mask, size_t, n, const struct head *, h,
         const float *, uv, const float *, z)
{
    const size_t from = i * BAND, to = from + BAND < n ? from + BAND : n;

    memset(mask + from * n, 0, (to - from) * n);
    for (size_t k = 0; k < h->F; k++) {
        const int32_t *f = h->f + 3 * k;
        if (z[f[0]] > CAMERA_NEAR && z[f[1]] > CAMERA_NEAR
            && z[f[2]] > CAMERA_NEAR)
            overlay_fill(mask, n, from, to, uv + 2 * f[0], uv + 2 * f[1],
                         uv + 2 * f[2]);
    }
}

void overlay_fill_mesh(uint8_t *mask, size_t n, const struct head *h,
                       const float *uv, const float *z)
{
    parallel_each(overlay_band, (n + BAND - 1) / BAND, 1, mask, n, h, uv, z);
}

void overlay_silhouette(uint8_t *mask, struct overlay *o,
                        const struct motion *m, size_t n)
{
    overlay_project(o, m, (double)n);
    overlay_fill_mesh(mask, n, o->id->head, o->uv, o->z);
}
