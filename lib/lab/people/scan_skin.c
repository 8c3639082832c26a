/* Skin statistics: every photograph is unwrapped through a fitted face, the
 * studio's light is divided out, and what remains is split into slow colour
 * (principal components) and fine grain. */
#include "lib/lab/people/scan_skin.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/image.h"
#include "lib/base/parallel.h"
#include "lib/base/sort.h"
#include "lib/lab/head/surface.h"
#include "lib/lab/people/landmark_sets.h"
#include "lib/lab/people/scan_piece.h"
#include "lib/lab/people/scan_register.h"
#include "lib/lab/people/scan_skin_fit.h"
#include "lib/lab/people/tri.h"
#include "lib/base/vec3.h"

#define N SKIN_SIZE
#define M SKIN_SLOW

/* ---- the texture square ------------------------------------------------- */

/* Which triangle of the skin each texel lies on. */
static int skin_chart_init(struct skin_chart *c, const struct scan_face *f,
                           struct arena *room, struct error *err)
{
    struct raster_vertex *at = arena_take(room, f->nc, sizeof *at);

    c->face = arena_take(room, N * N, sizeof *c->face);
    c->b = arena_take(room, 2 * N * N, sizeof *c->b);
    if (arena_check(room, "skin", err))
        return -1;
    for (size_t i = 0; i < f->nc; i++)
        at[i] = (struct raster_vertex){f->uv[2 * i] * N,
                                       (1 - f->uv[2 * i + 1]) * N, 1};
    for (int i = 0; i < N * N; i++)
        c->face[i] = -1;
    for (size_t i = 0; i < f->nf; i++) {
        const int32_t *v = f->faces + 3 * i;
        struct tri t;
        int x0, x1;
        if (f->part[i] != PART_SKIN
            || !tri_setup(&t, &at[v[0]], &at[v[1]], &at[v[2]], N, N))
            continue;
        for (int y = t.y0; y <= t.y1; y++) {
            if (!tri_row(&t, y, N, &x0, &x1))
                continue;
            for (int x = x0; x <= x1; x++) {
                float dx = (float)x + 0.5f - t.ox, dy = (float)y + 0.5f
                           - t.oy;
                c->face[y * N + x] = (int32_t)i;
                c->b[2 * (y * N + x)] = t.w[0] * dx + t.w[1] * dy;
                c->b[2 * (y * N + x) + 1] = t.w[2] * dx + t.w[3] * dy;
            }
        }
    }
    return 0;
}

/* The texel of a vertex of the scans. */
static void skin_texel_of(float o[2], const struct scan_face *f, int32_t vertex)
{
    o[0] = o[1] = 0;
    for (size_t i = 0; i < f->nc; i++)
        if (f->source[i] == vertex) {
            o[0] = f->uv[2 * i] * N;
            o[1] = (1 - f->uv[2 * i + 1]) * N;
            return;
        }
}

/* Fill a polygon of landmarks in mask with 255; grow: texels further out. */
static void skin_fill_polygon(uint8_t *mask, const struct scan_face *f,
                              const struct register_map *m, const int *lmk,
                              int n, float grow)
{
    float p[40][2], mid[2] = {0, 0};

    for (int i = 0; i < n; i++) {
        skin_texel_of(p[i], f, m->vertex[lmk[i]]);
        mid[0] += p[i][0] / (float)n;
        mid[1] += p[i][1] / (float)n;
    }
    for (int y = 0; y < N; y++)
        for (int x = 0; x < N; x++) {
            bool in = false;
            float px = (float)x + 0.5f, py = (float)y + 0.5f, near = 1e9f;
            if (fabsf(px - mid[0]) > 110 || fabsf(py - mid[1]) > 110)
                continue;
            for (int i = 0, j = n - 1; i < n; j = i++) {
                if ((p[i][1] > py) != (p[j][1] > py)
                    && px < (p[j][0] - p[i][0]) * (py - p[i][1])
                            / (p[j][1] - p[i][1]) + p[i][0])
                    in = !in;
                float ex = p[j][0] - p[i][0], ey = p[j][1] - p[i][1];
                float t = clampf(((px - p[i][0]) * ex + (py - p[i][1]) * ey)
                                 / (ex * ex + ey * ey + 1e-6f), 0, 1);
                near = minf(near, hypotf(px - p[i][0] - t * ex,
                                          py - p[i][1] - t * ey));
            }
            float v = in ? 1 : grow > 0 ? clampf(1.5f - near / grow, 0, 1)
                                        : clampf(1 - near / 3, 0, 1);
            uint8_t b = (uint8_t)(255 * v);
            mask[y * N + x] = b > mask[y * N + x] ? b : mask[y * N + x];
        }
}

/* Where a beard grows: cheeks under a line from the mouth to the ears, chin and
 * upper lip, but no lips. */
static void skin_make_beard(struct skin_model *s, const struct scan_face *f,
                            const struct register_map *m)
{
    float nose[2], chin[2], ear[2], mouth[2];

    skin_texel_of(nose, f, m->vertex[2]);
    skin_texel_of(chin, f, m->vertex[152]);
    skin_texel_of(ear, f, m->vertex[234]);
    skin_texel_of(mouth, f, m->vertex[13]);
    for (int y = 0; y < N; y++)
        for (int x = 0; x < N; x++) {
            float side = fabsf((float)x - 0.5f * N)
                         / fabsf(ear[0] - 0.5f * N);
            /* the cheek's edge climbs from the mouth to the ears */
            float top = lerpf(mouth[1] + 14, ear[1] - 6, ramp(0.3f, 1, side));
            float low = chin[1] + 42 - 30 * side;
            float v = ramp(top - 10, top + 14, (float)y)
                      * ramp(low + 16, low - 10, (float)y)
                      * ramp(1.04f, 0.93f, side);
            /* the upper lip's, under the nose */
            float m2 = ramp(nose[1] + 2, nose[1] + 9, (float)y)
                       * ramp(mouth[1] + 25, mouth[1], (float)y)
                       * ramp(0.36f, 0.22f, side);
            v = maxf(v, m2) * (1 - s->lip[y * N + x] / 255.0f);
            s->beard[y * N + x] = (uint8_t)(255 * v);
        }
}

/* Shares of brows, lids, lips and beard on the chart, from the landmarks that
 * outline them. */
static int skin_make_masks(struct skin_model *s, const struct scan_face *f,
                           const struct register_map *m, struct arena *memory,
                           struct error *err)
{
    static const int brow[2][10] = {
        {70, 63, 105, 66, 107, 55, 65, 52, 53, 46},
        {300, 293, 334, 296, 336, 285, 295, 282, 283, 276}};
    uint8_t **const mask[] = {&s->brow, &s->lip, &s->beard, &s->eye, &s->mouth};

    for (size_t i = 0; i < sizeof mask / sizeof *mask; i++)
        *mask[i] = arena_take(memory, N * N, 1);
    if (arena_check(memory, "skin", err))
        return -1;
    for (int i = 0; i < 2; i++) {
        skin_fill_polygon(s->brow, f, m, brow[i], 10, 9);
        skin_fill_polygon(s->eye, f, m, landmark_lid[i], LANDMARK_LID, 5);
    }
    skin_fill_polygon(s->lip, f, m, landmark_lip, LANDMARK_LIP / 2, 0);
    skin_fill_polygon(s->mouth, f, m, landmark_lip + LANDMARK_LIP / 2,
                      LANDMARK_LIP / 2, 0);
    skin_make_beard(s, f, m);
    return 0;
}

/* ---- one photograph ----------------------------------------------------- */

/* Colours of a photograph on the texture square, log linear; weight 0 where
 * the skin faces away or something else covers it. */
static void skin_unwrap(struct skin_sample *o, const struct image *im,
                        const struct scan_face *f, const struct skin_chart *c,
                        const struct registration *r, const float *shape,
                        const float *normal, const float *table)
{
    for (int i = 0; i < N * N; i++) {
        float p[3] = {0, 0, 0}, n[3] = {0, 0, 0}, px[3], q[3];
        o->weight[i] = 0;
        memset(o->log + 3 * i, 0, 3 * sizeof *o->log);
        if (c->face[i] < 0)
            continue;
        const int32_t *v = f->raw + 3 * c->face[i];
        float w[3] = {0, c->b[2 * i], c->b[2 * i + 1]};
        w[0] = 1 - w[1] - w[2];
        for (int k = 0; k < 3; k++) {
            mad3(p, p, shape + 3 * v[k], w[k]);
            mad3(n, n, normal + 3 * v[k], w[k]);
        }
        unit3(n);
        rot3(q, r->rot, n);
        register_project(px, r, p);
        float x = px[0] - 0.5f, y = px[1] - 0.5f;
        int x0 = (int)x, y0 = (int)y;
        if (q[2] < 0.12f || x < 0 || y < 0 || x0 >= (int)im->width - 1
            || y0 >= (int)im->height - 1)
            continue;
        float fx = x - (float)x0, fy = y - (float)y0;
        const uint8_t *a = im->rgb + 3 * ((size_t)y0 * im->width
                                          + (size_t)x0);
        const uint8_t *b = a + 3 * im->width;
        for (int k = 0; k < 3; k++) {
            float l = lerpf(lerpf(table[a[k]], table[a[k + 3]], fx),
                            lerpf(table[b[k]], table[b[k + 3]], fx), fy);
            o->log[3 * i + k] = logf(maxf(l, 0.002f));
        }
        copy3(o->normal + 3 * i, q);
        o->weight[i] = ramp(0.12f, 0.5f, q[2]);
    }
}

/* Texels that are no skin lose their weight: hair, which is far darker than
 * the person's skin or of another colour.  Returns the person's mean log
 * colour in `mean`; v (N,N) is scratch. */
static void skin_drop_hair(struct skin_sample *o, const struct skin_model *s,
                           float *v, float mean[3])
{
    for (int k = 0; k < 3; k++) {
        size_t n = 0;
        /* cheeks, nose and forehead's middle */
        for (int y = N * 28 / 100; y < N * 60 / 100; y += 2)
            for (int x = N * 28 / 100; x < N * 72 / 100; x += 2)
                if (o->weight[y * N + x] > 0.5f && !s->brow[y * N + x]
                    && !s->lip[y * N + x])
                    v[n++] = o->log[3 * (y * N + x) + k];
        sort_floats(v, n);
        mean[k] = n ? v[n / 2] : -1;
    }
    for (int i = 0; i < N * N; i++) {
        float d = 0, *l = o->log + 3 * i;
        for (int k = 0; k < 3; k++)
            d += (l[k] - mean[k]) / 3;
        float warm = (l[0] - l[2]) - (mean[0] - mean[2]);
        bool lip = s->lip[i] > 0, low = i / N > N * 55 / 100;
        if ((d < (low ? -1.5f : -0.95f) || d > 0.9f) && !lip)
            o->weight[i] = 0;
        if (fabsf(warm) > 0.75f && !lip && i / N < N * 35 / 100)
            o->weight[i] = 0;
        if (s->brow[i] || s->eye[i] > 60)
            o->weight[i] = 0;
    }
}

int skin_sample_take(struct skin_sample *o, const struct skin_model *s,
                     const struct skin_chart *c, const struct scan_face *f,
                     const struct register_map *m, const char *path,
                     const float *point, struct error *err)
{
    const size_t one = 3 * (size_t)FACE_VERTICES;
    struct image im;
    struct registration r;
    float *shape = malloc((2 * one + N * N) * sizeof *shape);
    float table[256];
    int rc = -1;

    for (int i = 0; i < 256; i++)
        table[i] = srgb_decode((float)i);
    if (!shape)
        return error_set(err, EX_OSERR, "out of memory for skin");
    if (image_read(&im, path, err))
        goto out;
    if (im.damaged) {
        error_set(err, EX_DATAERR, "%s: cut (expected a whole JPEG)", path);
    } else if (register_fit(&r, m, f, point)) {
        error_set(err, EX_OSERR, "out of memory for skin");
    } else {
        float *normal = shape + one;

        register_shape(shape, f, &r);
        surface_normals(normal, shape, FACE_VERTICES, f->raw, f->nf);
        skin_unwrap(o, &im, f, c, &r, shape, normal, table);
        skin_drop_hair(o, s, normal + one, o->mean);
        rc = 0;
    }
    image_release(&im);
out:
    free(shape);
    return rc;
}

/* ---- all of them -------------------------------------------------------- */

/* Names and points of the neutral London photographs. */
static int skin_list_photographs(struct skin_list *l, const char *dir,
                                 struct arena *room, struct error *err)
{
    char path[4096];

    snprintf(path, sizeof path, "%s/labels/photos.safetensors", dir);
    if (label_rows_read(&l->all, path, err))
        return -1;
    l->row = arena_take(room, l->all.n, sizeof *l->row);
    if (arena_check(room, "skin", err))
        return -1;
    for (size_t i = 0; i < l->all.n; i++)
        if (strstr(l->all.name[i], "london/") &&
            strstr(l->all.name[i], "_neutral"))
            l->row[l->n++] = i;
    return l->n >= 4 ? 0 : error_set(err, EX_DATAERR, "%s: %zu neutral "
                                     "photographs (expected at least 4)",
                                     path, l->n);
}

struct skin_take {
    struct skin_fit *t;
    const struct skin_model *s;
    const struct scan_face *f;
    const struct register_map *m;
    const struct skin_list *l;
    const char *dir;
};

/* Photograph i of the list. */
static int skin_take(void *ctx, size_t i, struct error *err)
{
    const struct skin_take *c = ctx;
    const struct skin_list *l = c->l;
    char path[4096], name[512];
    const char *base = strrchr(l->all.name[l->row[i]], '/');

    snprintf(name, sizeof name, "%.*s", (int)strcspn(base, "#"), base);
    snprintf(path, sizeof path, "%s/photos/london%s", c->dir, name);
    return skin_fit_add(c->t, i, c->s, c->f, c->m, path,
                        l->all.landmark[l->row[i]][0], err);
}

int skin_model_fit(struct skin_model *s, const struct scan_face *f,
                   const char *dir, struct arena *memory, struct error *err)
{
    struct arena room = {0};
    struct register_map m;
    struct skin_list l = {0};
    struct skin_fit t = {0};

    *s = (struct skin_model){0};
    int rc = register_map_load(&m, f, dir, &room, err) ||
             skin_list_photographs(&l, dir, &room, err) ||
             skin_make_masks(s, f, &m, memory, err) ||
             skin_chart_init(&t.chart, f, &room, err);
    t.grain = arena_take(memory, l.n, N * N);
    rc = rc || arena_check(memory, "skin", err) ||
         skin_fit_init(&t, l.n, &room, err) ||
         parallel_try(l.n, skin_take,
                      &(struct skin_take){&t, s, f, &m, &l, dir}, err) ||
         skin_fit_finish(s, &t, memory, err);
    label_rows_release(&l.all);
    arena_release(&room);
    return rc ? -1 : 0;
}
