/* Everything of an actor into the camera's frame. */
#include "lib/lab/people/motion.h"
#include "lib/lab/people/stage.h"

#include <math.h>
#include <string.h>

#include "lib/base/camera.h"
#include "lib/lab/people/vec.h"

static void pose_rigid(float o[3], const float r[9], const float t[3],
                       const float p[3])
{
    rot3(o, r, p);
    for (int k = 0; k < 3; k++)
        o[k] += t[k];
}

/* The head's vertices, and ours where their anchors take them. */
static void pose_place_vertices(struct stage *s, const struct actor *a,
                                const struct synth_motion *m)
{
    struct head_motion hm = { .exp = m->exp };
    const struct head *h = a->head;
    float jaw[9], joint[3];

    memcpy(hm.jaw, m->jaw, sizeof hm.jaw);
    memcpy(hm.eye, m->eye, sizeof hm.eye);
    memcpy(hm.lid, m->lid, sizeof hm.lid);
    head_pose(s->verts, &a->id, &hm);
    rodrigues33(jaw, m->jaw);
    for (int k = 0; k < 3; k++)
        joint[k] = (float)a->id.joints[3 * JOINT_JAW + k];
    for (size_t i = h->V; i < a->nv; i++) {
        float *p = s->verts + 3 * i;
        copy3(p, a->neutral + 3 * i);
        if (a->anchor[i] == ANCHOR_JAW) {
            float d[3];
            sub3(d, p, joint);
            pose_rigid(p, jaw, joint, d);
        }
    }
    if (h->nlip_inner > 2)
        mouth_pose(s->verts, a);
    for (size_t i = 0; i < a->nv; i++) {
        float *o = s->place + 3 * i, b[3];
        const float *p = s->verts + 3 * i;
        float w = i < h->V ? a->neck[i] : a->anchor[i] == ANCHOR_BODY;
        pose_rigid(o, m->rot, m->trans, p);
        if (w > 0) {
            pose_rigid(b, m->body, m->body_trans, p);
            lerp3(o, o, b, w);
        }
    }
}

/* Unit normals of all vertices, faces by their area. */
static void pose_find_normals(struct stage *s, const struct actor *a)
{
    memset(s->normal, 0, 3 * a->nv * sizeof(float));
    for (size_t f = 0; f < a->nf; f++) {
        const int32_t *v = a->faces + 3 * f;
        float e[3], g[3], n[3];
        sub3(e, s->place + 3 * v[1], s->place + 3 * v[0]);
        sub3(g, s->place + 3 * v[2], s->place + 3 * v[0]);
        cross3(n, e, g);
        for (int k = 0; k < 3; k++)
            mad3(s->normal + 3 * v[k], s->normal + 3 * v[k], n, 1);
    }
    for (size_t i = 0; i < a->nv; i++)
        unit3(s->normal + 3 * i);
}

/* An orthonormal frame on face f of points p, as columns of m. */
static void pose_face_frame(float m[9], const float *p, const int32_t *f)
{
    float e[3], g[3], n[3], b[3];

    sub3(e, p + 3 * f[1], p + 3 * f[0]);
    sub3(g, p + 3 * f[2], p + 3 * f[0]);
    cross3(n, e, g);
    unit3(n);
    unit3(e);
    cross3(b, n, e);
    columns33(m, e, b, n);
}

/* A strand that rides on a face of the skin. */
static void pose_strand(struct stage *s, const struct actor *a,
                        const struct strand *t)
{
    const int32_t *f = a->head->f + 3 * t->face;
    float rest[9], now[9], turn[9], rt[9];

    pose_face_frame(rest, a->neutral, f);
    pose_face_frame(now, s->place, f);
    for (int i = 0; i < 9; i++)
        rt[i] = rest[3 * (i % 3) + i / 3];
    mul33(turn, now, rt);
    /* the root keeps its place between the corners */
    const struct strand_point *q = a->point + t->first;
    const float *o = a->neutral + 3 * f[0];
    float d[3], e1[3], e2[3], n1[3], n2[3], root[3], at[3];
    sub3(e1, a->neutral + 3 * f[1], o);
    sub3(e2, a->neutral + 3 * f[2], o);
    sub3(n1, s->place + 3 * f[1], s->place + 3 * f[0]);
    sub3(n2, s->place + 3 * f[2], s->place + 3 * f[0]);
    sub3(d, q[0].p, o);
    float a11 = dot3(e1, e1), a12 = dot3(e1, e2), a22 = dot3(e2, e2);
    float b1 = dot3(d, e1), b2 = dot3(d, e2);
    float det = a11 * a22 - a12 * a12 + 1e-20f;
    float x = (b1 * a22 - b2 * a12) / det, y = (b2 * a11 - b1 * a12) / det;
    mad3(root, o, e1, x);
    mad3(root, root, e2, y);
    mad3(at, s->place + 3 * f[0], n1, x);
    mad3(at, at, n2, y);
    for (int i = 0; i < t->points; i++) {
        float *p = s->tuft + 3 * (t->first + (size_t)i);
        sub3(d, q[i].p, root);
        pose_rigid(p, turn, at, d);
        rot3(s->tuft_normal + 3 * (t->first + (size_t)i), turn, q[i].n);
    }
}

static void pose_landmark_place(float o[3], const struct stage *s,
                                const struct head *h, int k)
{
    const int32_t *f = h->f + 3 * h->landmark_faces[k];

    o[0] = o[1] = o[2] = 0;
    for (int c = 0; c < 3; c++)
        mad3(o, o, s->place + 3 * f[c], h->landmark_bary[3 * k + c]);
}

/* A lash: its root runs along the lid between two landmarks. */
static void pose_lash(struct stage *s, const struct actor *a,
                      const struct strand *t, const struct synth_motion *m)
{
    int k = -2 - t->face;
    float p[3], q[3], shut = m->lid[k < 42 ? 1 : 0];

    pose_landmark_place(p, s, a->head, k);
    pose_landmark_place(q, s, a->head, k + 1);
    lerp3(p, p, q, t->random);
    for (int i = 0; i < t->points; i++) {
        const struct strand_point *o = a->point + t->first + i;
        size_t at = 3 * (t->first + (size_t)i);
        float d[3];
        copy3(d, o->p);
        d[1] = lerpf(d[1], -0.5f * d[1] - 0.3f * d[2], shut);
        pose_rigid(s->tuft + at, m->rot, p, d);
        rot3(s->tuft_normal + at, m->rot, o->n);
    }
}

/* Strands ride on their face, their lid or the head; loose ones go over to the
 * shoulders. */
static void pose_place_strands(struct stage *s, const struct actor *a,
                               const struct synth_motion *m)
{
    float top = a->lmk[8][1], base = a->neck_base[1] - 0.15f;

    for (size_t i = 0; i < a->nstrand; i++) {
        const struct strand *t = &a->strand[i];
        for (int j = 0; j < t->points; j++)
            s->owner[t->first + (size_t)j] = (uint32_t)i;
        if (t->face >= 0) {
            pose_strand(s, a, t);
            continue;
        }
        if (t->face < -1) {
            pose_lash(s, a, t, m);
            continue;
        }
        for (int j = 0; j < t->points; j++) {
            const struct strand_point *q = a->point + t->first + j;
            float *p = s->tuft + 3 * (t->first + (size_t)j), b[3];
            pose_rigid(p, m->rot, m->trans, q->p);
            rot3(s->tuft_normal + 3 * (t->first + (size_t)j), m->rot, q->n);
            float w = t->loose > 0 ? ramp(top, base, q->p[1]) : 0;
            if (w > 0) {
                pose_rigid(b, m->body, m->body_trans, q->p);
                lerp3(p, p, b, w);
            }
        }
    }
}

static void pose_project(struct raster_vertex *o, const float *p, size_t n,
                         float size)
{
    float f = camera_focal(size);

    for (size_t i = 0; i < n; i++) {
        float z = p[3 * i + 2];
        float q = z > CAMERA_NEAR ? 1 / z : 0;
        o[i] = (struct raster_vertex){ f * p[3 * i] * q + 0.5f * size,
                                       f * p[3 * i + 1] * q + 0.5f * size, q };
    }
}

void stage_pose(struct stage *s, const struct actor *a,
                const struct synth_motion *m)
{
    float cam[12], lmk[68 * 3];

    pose_place_vertices(s, a, m);
    pose_find_normals(s, a);
    pose_place_strands(s, a, m);
    pose_project(s->spot, s->place, a->nv, (float)s->eye.w);
    pose_project(s->tuft_spot, s->tuft, a->npoint, (float)s->eye.w);
    camera_make(cam, m->rot, m->trans);
    head_landmarks(lmk, a->head, s->verts);
    camera_project(&s->lmk[0][0], NULL, cam, (float)s->size, lmk, 68);
}
