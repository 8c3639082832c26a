/* A mesh of MakeHuman's and its picture read, laid on the neutral face and
 * bound to it. */
#include "lib/lab/people/scan_piece.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sysexits.h>

#include "formats/image.h"
#include "lib/base/vec3.h"

void bitmap_sample(float rgba[4], const struct bitmap *t, float u, float v)
{
    if (!t->rgba) {
        rgba[0] = rgba[1] = rgba[2] = rgba[3] = 1;
        return;
    }
    float x = clampf(u, 0, 1) * (float)t->w - 0.5f;
    float y = (1 - clampf(v, 0, 1)) * (float)t->h - 0.5f;
    x = clampf(x, 0, (float)(t->w - 1) - 0.001f);
    y = clampf(y, 0, (float)(t->h - 1) - 0.001f);
    int x0 = (int)x, y0 = (int)y;
    float fx = x - (float)x0, fy = y - (float)y0;
    const uint8_t *a = t->rgba + 4 * (y0 * t->w + x0), *c = a + 4 * t->w;
    float w[4] = {(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy};
    for (int k = 0; k < 4; k++)
        rgba[k] = (w[0] * a[k] + w[1] * a[4 + k] + w[2] * c[k]
                   + w[3] * c[4 + k]) * (1 / 255.0f);
}

/* Corners by the vertex that they stand for. */
struct corners {
    int32_t *first;     /* (nv) of a vertex, or -1 */
    int32_t *next;      /* (corners) of the same vertex */
    int32_t *texel;     /* (corners) texture place's index */
};

/* The corner of vertex v at texture place t, made where there is none. */
static int32_t piece_corner(struct piece *p, struct corners *k, int32_t v,
                            int32_t t, const float *place, const float *vt)
{
    int32_t c = k->first[v];

    while (c >= 0 && k->texel[c] != t)
        c = k->next[c];
    if (c >= 0)
        return c;
    c = (int32_t)p->nc++;
    k->texel[c] = t;
    k->next[c] = k->first[v];
    k->first[v] = c;
    p->origin[c] = v;
    copy3(p->place + 3 * c, place + 3 * v);
    p->uv[2 * c] = vt ? vt[2 * t] : 0;
    p->uv[2 * c + 1] = vt ? vt[2 * t + 1] : 0;
    return c;
}

/* Corners of faces above a height, split where texture places part. */
static int piece_cut(struct piece *p, const float *place, size_t nv,
                     const int32_t *f, const float *vt, const int32_t *ft,
                     size_t nf, float above, struct arena *memory,
                     struct error *err)
{
    struct arena room = {0};
    struct corners c = {
        .first = arena_take(&room, nv, sizeof *c.first),
        .next = arena_take(&room, 3 * nf, sizeof *c.next),
        .texel = arena_take(&room, 3 * nf, sizeof *c.texel)
    };

    p->place = arena_take(memory, 9 * nf, sizeof *p->place);
    p->uv = arena_take(memory, 6 * nf, sizeof *p->uv);
    p->faces = arena_take(memory, 3 * nf, sizeof *p->faces);
    p->origin = arena_take(memory, 3 * nf, sizeof *p->origin);
    if (arena_check(&room, "a piece", err) ||
        arena_check(memory, "a piece", err)) {
        arena_release(&room);
        return -1;
    }
    for (size_t i = 0; i < nv; i++)
        c.first[i] = -1;
    for (size_t i = 0; i < nf; i++) {
        const int32_t *v = f + 3 * i;
        float top = minf(place[3 * v[0] + 1],
                          minf(place[3 * v[1] + 1], place[3 * v[2] + 1]));
        if (top < above)
            continue;
        for (size_t k = 0; k < 3; k++)
            p->faces[3 * p->nf + k] =
                piece_corner(p, &c, v[k], vt ? ft[3 * i + k] : 0, place, vt);
        p->nf++;
    }
    arena_release(&room);
    return 0;
}

static int piece_bind_corners(struct piece *p, const struct body *b,
                              struct arena *memory, struct error *err)
{
    p->bind = arena_take(memory, 4 * p->nc, sizeof *p->bind);
    p->weight = arena_take(memory, 4 * p->nc, sizeof *p->weight);
    if (arena_check(memory, "a piece", err))
        return -1;
    for (size_t i = 0; i < p->nc; i++)
        near_bind(p->bind + 4 * i, p->weight + 4 * i, &b->near,
                  p->place + 3 * i);
    return 0;
}

/* Mean of the picture by alpha, linear light. */
static void piece_measure_picture(struct piece *p)
{
    double sum[4] = {0, 0, 0, 1e-9};
    const struct bitmap *t = &p->picture;

    for (int i = 0; i < t->w * t->h; i++) {
        const uint8_t *c = t->rgba + 4 * i;
        for (int k = 0; k < 3; k++)
            sum[k] += pow(c[k] / 255.0, 2.2) * c[3];
        sum[3] += c[3];
    }
    for (int k = 0; k < 3; k++)
        p->mean[k] = t->rgba ? (float)(sum[k] / sum[3]) : 1;
}

int bitmap_load(struct bitmap *t, const char *path, struct arena *memory,
                struct error *err)
{
    struct image im;

    if (image_read(&im, path, err))
        return -1;
    *t = (struct bitmap){
        .w = (int)im.width, .h = (int)im.height,
        .rgba = arena_take(memory, 4 * im.width, im.height)
    };
    for (size_t i = 0; t->rgba && i < im.width * im.height; i++) {
        memcpy(t->rgba + 4 * i, im.rgb + 3 * i, 3);
        t->rgba[4 * i + 3] = im.alpha ? im.alpha[i] : 255;
    }
    image_release(&im);
    if (t->w < 2 || t->h < 2)
        return error_set(err, EX_DATAERR, "%s: %d x %d pixels (expected a "
                         "picture)", path, t->w, t->h);
    return arena_check(memory, path, err);
}

int piece_load(struct piece *p, const struct body *b, const char *dir,
               const char *name, const char *picture, float above,
               struct arena *memory, struct error *err)
{
    char mesh[4096], bind[4096], path[4096];
    struct arena room = {0};
    struct wavefront w = {0};
    struct mhclo m;

    *p = (struct piece){.hidden = arena_take(memory, b->mesh.nv, 1)};
    snprintf(p->name, sizeof p->name, "%s", name);
    snprintf(mesh, sizeof mesh, "%s/%s.obj", dir, name);
    snprintf(bind, sizeof bind, "%s/%s.mhclo", dir, name);
    snprintf(path, sizeof path, "%s/%s", dir, picture ? picture : "");
    int rc = wavefront_read(&w, mesh, NULL, &room, err) ||
             mhclo_read(&m, bind, b->mesh.nv, w.nv, &room, err) ||
             (picture && bitmap_load(&p->picture, path, memory, err)) ||
             arena_check(memory, name, err);
    float *place = arena_take(&room, 3 * w.nv, sizeof *place);
    rc = rc || arena_check(&room, name, err);
    if (rc == 0) {
        mhclo_place(place, &m, b->place);
        memcpy(p->hidden, m.hidden, b->mesh.nv);
        piece_measure_picture(p);
        rc = piece_cut(p, place, w.nv, w.f, w.vt, w.ft, w.nf, above, memory,
                       err) ||
             piece_bind_corners(p, b, memory, err);
    }
    arena_release(&room);
    return rc ? -1 : 0;
}

int piece_make(struct piece *p, const struct body *b, const float *place,
               size_t nv, const int32_t *faces, size_t nf, float above,
               struct arena *memory, struct error *err)
{
    *p = (struct piece){0};
    piece_measure_picture(p);
    return piece_cut(p, place, nv, faces, NULL, NULL, nf, above, memory, err) ||
           piece_bind_corners(p, b, memory, err) ? -1 : 0;
}
