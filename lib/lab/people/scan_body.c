/* MakeHuman's body onto the scans' face: a similarity by the eyes, then
 * closest points with smooth displacements, stiff first. */
#include "lib/lab/people/scan_piece.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/vec3.h"
#include "lib/lab/head/surface.h"

/* base.obj: the body, and helpers after it. */
enum { BASE_BODY = 13380, BASE_VERTICES = 19158, BASE_EYE_LEFT = 14598,
       BASE_EYE_RIGHT = 14670, BASE_EYE = 72 };

#define ROUNDS 10

static void body_mean_of(float o[3], const float *p, int first, int n)
{
    o[0] = o[1] = o[2] = 0;
    for (int i = first; i < first + n; i++)
        mad3(o, o, p + 3 * i, 1 / (float)n);
}

/* Eyes onto eyes, upright. */
static void body_lay_on_eyes(float *out, const float *v, size_t n,
                             const struct scan_face *f)
{
    float l[3], r[3], from[3], to[3], d[3], e[3];

    body_mean_of(l, v, BASE_EYE_LEFT, BASE_EYE);
    body_mean_of(r, v, BASE_EYE_RIGHT, BASE_EYE);
    sub3(d, l, r);
    sub3(e, f->eye[0], f->eye[1]);
    lerp3(from, l, r, 0.5f);
    lerp3(to, f->eye[0], f->eye[1], 0.5f);
    float s = length3(e) / length3(d);
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < 3; k++)
            out[3 * i + k] = to[k] + s * (v[3 * i + k] - from[k]);
}

/* d (n,3) becomes the mean over neighbours; where w > 0 it is drawn to its
 * own goal. */
static void body_relax(float *d, float *next, float *count, const float *goal,
                       const float *w, size_t n, const int32_t *f, size_t nf)
{
    memset(next, 0, 3 * n * sizeof *next);
    memset(count, 0, n * sizeof *count);
    for (size_t i = 0; i < nf; i++)
        for (int k = 0; k < 3; k++) {
            int32_t a = f[3 * i + (size_t)k];
            int32_t b = f[3 * i + (size_t)(k + 1) % 3];
            mad3(next + 3 * a, next + 3 * a, d + 3 * b, 1);
            mad3(next + 3 * b, next + 3 * b, d + 3 * a, 1);
            count[a] += 1;
            count[b] += 1;
        }
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < 3; k++) {
            float m = count[i] > 0 ? next[3 * i + k] / count[i] : 0;
            d[3 * i + k] = lerpf(m, goal[3 * i + k], w[i]);
        }
}

struct fit {
    float *normal, *d, *next, *goal, *w, *count;
};

/* The skin's vertices come to lie on the scans, closest first. */
static void body_draw_to_scans(struct body *b, struct fit *t)
{
    size_t n = b->nbody;

    for (int round = 0; round < ROUNDS; round++) {
        float stiff = (float)(ROUNDS - round) / ROUNDS;
        surface_normals(t->normal, b->place, n, b->mesh.f, b->mesh.nf);
        for (size_t i = 0; i < n; i++) {
            int32_t at;
            float *p = b->place + 3 * i;
            t->w[i] = 0;
            memset(t->goal + 3 * i, 0, 3 * sizeof *t->goal);
            if (p[1] < -0.75f || near_find(&at, NULL, &b->near, p,
                                           t->normal + 3 * i, 1, 0.2f) < 1)
                continue;
            /* the scans stop at the neck: pull less there */
            t->w[i] = 0.6f * ramp(-0.75f, -0.4f, p[1]);
            sub3(t->goal + 3 * i, b->near.p + 3 * at, p);
        }
        memset(t->d, 0, 3 * n * sizeof *t->d);
        int smooth = (int)(60 * stiff) + 6;
        for (int k = 0; k < smooth; k++)
            body_relax(t->d, t->next, t->count, t->goal, t->w, n, b->mesh.f,
                       b->mesh.nf);
        for (size_t i = 0; i < 3 * n; i++)
            b->place[i] += t->d[i];
    }
}

/* Helpers go with the skin near them. */
static void body_carry_helpers(struct body *b, const float *before,
                               const struct near_tree *g)
{
    for (size_t i = b->nbody; i < b->mesh.nv; i++) {
        int32_t at[4];
        float w[4], *p = b->place + 3 * i, x[3];
        copy3(x, p);
        near_bind(at, w, g, x);
        for (int k = 0; k < 4; k++) {
            float d[3];
            sub3(d, b->place + 3 * at[k], before + 3 * at[k]);
            mad3(p, p, d, w[k]);
        }
    }
}

/* The body's mesh, which has its numbers of vertices and no others. */
static int body_read(struct body *b, const char *dir, struct arena *memory,
                     struct error *err)
{
    char path[4096];

    snprintf(path, sizeof path, "%s/base.obj", dir);
    if (wavefront_read(&b->mesh, path, "body", memory, err))
        return -1;
    if (b->mesh.nv != BASE_VERTICES)
        return error_set(err, EX_DATAERR, "%s: %zu vertices (expected %d)",
                         path, b->mesh.nv, BASE_VERTICES);
    for (size_t i = 0; i < 3 * b->mesh.nf; i++)
        if (b->mesh.f[i] >= BASE_BODY)
            return error_set(err, EX_DATAERR, "%s: group body has vertex %d "
                             "(expected less than %d)", path,
                             b->mesh.f[i] + 1, BASE_BODY);
    return 0;
}

int body_load(struct body *b, const struct scan_face *f, const char *dir,
              struct arena *memory, struct error *err)
{
    const size_t n = BASE_BODY;
    struct near_tree was;
    struct arena room = {0};
    struct fit t = {
        .d = arena_take(&room, 3 * n, sizeof(float)),
        .next = arena_take(&room, 3 * n, sizeof(float)),
        .goal = arena_take(&room, 3 * n, sizeof(float)),
        .normal = arena_take(&room, 3 * n, sizeof(float)),
        .w = arena_take(&room, n, sizeof(float)),
        .count = arena_take(&room, n, sizeof(float))
    };
    float *before = arena_take(&room, 3 * BASE_VERTICES, sizeof *before);
    float *normal = arena_take(&room, 3 * FACE_VERTICES, sizeof *normal);
    int rc = -1;

    *b = (struct body){
        .nbody = n, .place = arena_take(memory, 3 * BASE_VERTICES,
                                        sizeof *b->place)
    };
    if (arena_check(&room, "the body", err) || body_read(b, dir, memory, err) ||
        near_init(&b->near, f->neutral, FACE_NECK_END, memory, err))
        goto out;
    body_lay_on_eyes(b->place, b->mesh.v, b->mesh.nv, f);
    memcpy(before, b->place, 3 * b->mesh.nv * sizeof *before);
    surface_normals(normal, f->neutral, FACE_VERTICES, f->raw, f->nf);
    b->near.normal = normal;
    body_draw_to_scans(b, &t);
    b->near.normal = NULL;
    rc = near_init(&was, before, n, &room, err);
    if (rc == 0)
        body_carry_helpers(b, before, &was);
out:
    arena_release(&room);
    return rc;
}
