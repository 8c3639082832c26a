/* A figure into the camera's frame: expression, gaze, what rides on the skin,
 * the turn of the head on its neck; normals and the sky's light by corner. */
#include <math.h>
#include <string.h>

#include "lib/base/camera.h"
#include "lib/lab/head/surface.h"
#include "lib/lab/people/scan_stage.h"
#include "lib/base/vec3.h"

#define TWIST 16                /* steps between shoulders and head */

/* ---- the face ----------------------------------------------------------- */

/* Eyeballs turn about their centres; the scans' gazes move lids alone. */
static void pose_turn_eyes(struct scan_stage *s)
{
    const struct figure *f = s->figure;
    static const size_t range[2][2] = {
        {FACE_TEETH_END, FACE_EYE_LEFT_END},
        {FACE_EYE_LEFT_END, FACE_EYE_RIGHT_END}};
    float exp[ARKIT_EXP], jaw[3], lid[2], eye[6], r[9];

    arkit_to_motion(exp, ARKIT_EXP, jaw, lid, eye, s->act->weight);
    for (int e = 0; e < 2; e++) {
        rodrigues33(r, eye + 3 * e);
        for (size_t i = range[e][0]; i < range[e][1]; i++) {
            float d[3], *p = s->face + 3 * i;
            sub3(d, p, f->eye[e]);
            rot3(p, r, d);
            mad3(p, p, f->eye[e], 1);
        }
    }
}

/* Corners where their part rides: on the face, the skull, the body or
 * nothing. */
static void pose_place_corners(struct scan_stage *s)
{
    const struct figure *f = s->figure;

    for (int i = 0; i < f->nparts; i++) {
        const struct figure_part *p = &f->parts[i];
        for (size_t c = p->c0; c < p->c1; c++) {
            float *o = s->head + 3 * c;
            if (p->ride == RIDE_FACE) {
                copy3(o, s->face + 3 * f->bind[4 * c]);
                continue;
            }
            copy3(o, f->place + 3 * c);
            for (size_t k = 0; p->ride == RIDE_SKIN && k < 4; k++) {
                float d[3];
                size_t v = (size_t)f->bind[4 * c + k];
                sub3(d, s->face + 3 * v, f->rest + 3 * v);
                mad3(o, o, d, f->weight[4 * c + k]);
            }
        }
    }
}

/* ---- the neck ----------------------------------------------------------- */

struct twist {
    float r[TWIST + 1][9], t[TWIST + 1][3];
};

/* Transforms from the head's (0) to the shoulders' (TWIST), about the pivot
 * that both leave in place. */
static void pose_make_twist(struct twist *o, const struct scan_view *v,
                            const float pivot[3])
{
    float rel[9], bt[9], w[3], at[3];

    for (int i = 0; i < 9; i++)
        bt[i] = v->body[3 * (i % 3) + i / 3];
    mat3_mul(rel, v->rot, bt);     /* shoulders -> head */
    float c = clampf(0.5f * (rel[0] + rel[4] + rel[8] - 1), -1, 1);
    float angle = acosf(c), s = sinf(angle);
    float g = s > 1e-4f ? angle / (2 * s) : 0.5f;
    w[0] = (rel[7] - rel[5]) * g;
    w[1] = (rel[2] - rel[6]) * g;
    w[2] = (rel[3] - rel[1]) * g;
    rot3(at, v->rot, pivot);
    mad3(at, at, v->trans, 1);
    for (int i = 0; i <= TWIST; i++) {
        float part[3] = {0, 0, 0}, q[9], p[3];
        mad3(part, part, w, 1 - (float)i / TWIST);
        rodrigues33(q, part);
        mat3_mul(o->r[i], q, v->body);
        rot3(p, o->r[i], pivot);
        sub3(o->t[i], at, p);
    }
}

/* What stands before the camera sways about the head's middle. */
static void pose_place_front(struct scan_stage *s, const struct figure_part *p)
{
    const struct figure *f = s->figure;
    float focal = s->view.focal * (float)s->grid, half = 0.5f * (float)s->grid;
    float at[3];

    mad3(at, s->view.trans, s->act->drift, 0.08f);
    for (size_t c = p->c0; c < p->c1; c++) {
        float *o = s->place + 3 * c;
        mad3(o, at, f->place + 3 * c, 1);
        float q = o[2] > CAMERA_NEAR ? 1 / o[2] : 0;
        copy3(s->normal + 3 * c, f->normal + 3 * c);
        s->spot[c] = (struct raster_vertex){focal * o[0] * q + half,
                                            focal * o[1] * q + half, q};
    }
}

/* To pixels, parts of the neck turned by their share. */
static void pose_to_camera(struct scan_stage *s)
{
    const struct figure *f = s->figure;
    struct twist t;
    float focal = s->view.focal * (float)s->grid, half = 0.5f * (float)s->grid;

    pose_make_twist(&t, &s->view, f->pivot);
    for (size_t c = 0; c < f->nc; c++) {
        float x = f->neck[c] * TWIST, *o = s->place + 3 * c;
        int i = (int)x;
        i = i >= TWIST ? TWIST - 1 : i;
        float g = x - (float)i, a[3], n[3];
        rot3(o, t.r[i], s->head + 3 * c);
        mad3(o, o, t.t[i], 1);
        copy3(n, s->normal + 3 * c);
        rot3(s->normal + 3 * c, t.r[g > 0.5f ? i + 1 : i], n);
        if (g > 0) {
            rot3(a, t.r[i + 1], s->head + 3 * c);
            mad3(a, a, t.t[i + 1], 1);
            lerp3(o, o, a, g);
        }
        float z = o[2], q = z > CAMERA_NEAR ? 1 / z : 0;
        s->spot[c] = (struct raster_vertex){focal * o[0] * q + half,
                                            focal * o[1] * q + half, q};
    }
}

/* ---- light -------------------------------------------------------------- */

/* Share of the light between the lips that reaches a point in the mouth. */
static float pose_mouth_light(const struct scan_stage *s, const float *p)
{
    const int32_t *lmk = s->figure->assets->face.landmark;
    const float *up = s->face + 3 * lmk[62], *low = s->face + 3 * lmk[66];
    float gap = maxf(up[1] - low[1], 0), mid = 0.5f * (up[1] + low[1]);
    float deep = maxf(0.5f * (up[2] + low[2]) - p[2], 0);
    float off = maxf(fabsf(p[1] - mid) - 0.5f * gap, 0);
    float side = fabsf(p[0] - up[0]);
    float open = 0.8f * gap + 0.016f;

    return clampf(0.8f * open / (open + 2.5f * deep + 1.2f * off
                                 + 5 * side * side), 0.02f, 1);
}

/* Per channel of corner c, the sky's light h over what a free surface with
 * that normal would get; a little comes back from the skin around. */
static void pose_light_corner(struct scan_stage *s, size_t c,
                              enum ride ride,
                              const struct harmonic2 h[3])
{
    static const float bounce[3] = {0.50f, 0.32f, 0.26f};
    const struct figure *f = s->figure;
    const float *n = f->normal + 3 * c, *m = f->moment + 10 * c;
    const int32_t vertex = f->bind[4 * c];
    const bool face = ride == RIDE_FACE;
    const bool inside = face && vertex >= FACE_NECK_END
                        && (vertex < FACE_SOCKET_END
                            || (vertex >= FACE_ORBIT_END
                                && vertex < FACE_TEETH_END));
    const bool eye = face && vertex >= FACE_TEETH_END
                     && vertex < FACE_EYE_RIGHT_END;
    const float in = inside ? pose_mouth_light(s, s->head + 3 * c) : 1;

    for (size_t k = 0; k < 3; k++) {
        float free = maxf(harmonic2_diffuse(&h[k], n), 1e-3f);
        float b = inside ? in
                  : clampf(harmonic2_moments(&h[k], m) / free, 0.02f, 1.1f);
        if (eye)
            b = maxf(b, 0.25f);
        s->bright[3 * c + k] = b / (1 - bounce[k] * (1 - minf(b, 1)));
    }
}

/* The light on every corner; what is free of the head has its own. */
static void pose_find_light(struct scan_stage *s)
{
    const struct figure *f = s->figure;
    struct harmonic2 sky[3], body[3];
    float back[9], upright[9];

    for (int i = 0; i < 9; i++) {
        back[i] = s->view.rot[3 * (i % 3) + i / 3];
        upright[i] = s->view.body[3 * (i % 3) + i / 3];
    }
    for (int k = 0; k < 3; k++) {
        harmonic2_turn(&sky[k], &f->light.sky[k], back);
        harmonic2_turn(&body[k], &f->light.sky[k], upright);
    }
    for (int i = 0; i < f->nparts; i++) {
        const struct figure_part *p = &f->parts[i];
        const struct harmonic2 *h = p->ride == RIDE_BODY ? body : sky;
        for (size_t c = p->c0; c < p->c1; c++)
            if (p->ride == RIDE_FREE)
                s->bright[3 * c] = s->bright[3 * c + 1]
                    = s->bright[3 * c + 2] = 0.9f;
            else
                pose_light_corner(s, c, p->ride, h);
    }
}

void scan_pose(struct scan_stage *s)
{
    const struct figure *f = s->figure;
    float *normal = s->normal;

    memcpy(s->face, f->rest, 3 * FACE_VERTICES * sizeof *s->face);
    if (f->assets->plain) {
        scan_plain_pose(s->face, f->assets->plain, f->rest, s->verts);
    } else {
        scan_face_express(s->face, &f->assets->face, f->rest, s->act->weight);
        follow_bend(s->face, s->bend, s->follow, &f->assets->face, f->rest,
                    s->verts, s->act->weight);
        pose_turn_eyes(s);
    }
    surface_normals(s->face_normal, s->face, FACE_VERTICES, f->assets->face.raw,
                  f->assets->face.nf);
    pose_place_corners(s);
    pose_find_light(s);
    /* normals in the head's frame, turned in place */
    for (int i = 0; i < f->nparts; i++) {
        const struct figure_part *p = &f->parts[i];
        for (size_t c = p->c0; c < p->c1; c++)
            copy3(normal + 3 * c, p->ride == RIDE_FACE || p->ride == RIDE_SKIN
                                  ? s->face_normal + 3 * f->bind[4 * c]
                                  : f->normal + 3 * c);
    }
    pose_to_camera(s);
    for (int i = 0; i < f->nparts; i++)
        if (f->parts[i].ride == RIDE_FREE)
            pose_place_front(s, &f->parts[i]);
}
