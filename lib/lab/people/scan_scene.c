/* The head's motion from the act, the camera that sees it so, the figure
 * rendered and put on film. */
#include "lib/lab/people/scan_scene.h"

#include <math.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/camera.h"
#include "lib/base/cholesky.h"
#include "lib/base/vec3.h"

int scan_worker_init(struct scan_worker *c, const struct head *h, int size,
                   struct error *err)
{
    struct arena *a = &c->memory;

    *c = (struct scan_worker){0};
    c->verts = arena_take(a, 3 * h->V, sizeof *c->verts);
    c->bend = arena_take(a, 3 * h->V, sizeof *c->bend);
    c->exact = arena_take(a, 3 * h->V, sizeof *c->exact);
    return arena_check(a, "a head", err)
           || scan_stage_init(&c->stage, size, err)
           || scan_film_init(&c->film, size, err) ? -1 : 0;
}

void scan_worker_release(struct scan_worker *c)
{
    scan_stage_release(&c->stage);
    scan_film_release(&c->film);
    arena_release(&c->memory);
}

int scan_scene_init(struct scan_scene *c, const struct scan_assets *a,
                   const struct head *h, uint64_t seed, uint64_t index,
                   float effects, int size, struct error *err)
{
    struct scan_person p;
    const size_t n = 3 * (size_t)size * (size_t)size;
    const size_t shapes = h->nshape < SCAN_IDENTITIES ? h->nshape
                                                      : SCAN_IDENTITIES;
    float *tmp;

    *c = (struct scan_scene){.size = size};
    if (h->nshape > SCENE_SHAPES)
        return error_set(err, EX_DATAERR, "head of %zu shapes (expected at "
                         "most %d)", h->nshape, SCENE_SHAPES);
    c->wall = arena_take(&c->memory, n, sizeof *c->wall);
    tmp = arena_take(&c->memory, n, sizeof *tmp);
    scan_person_draw(&p, a, seed, index, effects);
    memcpy(c->beta, p.beta, shapes * sizeof *c->beta);
    if (arena_check(&c->memory, "a picture", err)
        || head_fold(&c->id, h, c->beta, shapes, err)
        || (!a->plain
            && follow_init(&c->follow, &a->follow, &c->id, &c->memory, err))
        || figure_init(&c->figure, a, &p, err)) {
        scan_scene_release(c);
        return -1;
    }
    scan_backdrop(c->wall, tmp, &c->figure, size);
    return 0;
}

void scan_scene_release(struct scan_scene *c)
{
    figure_release(&c->figure);
    identity_release(&c->id);
    arena_release(&c->memory);
    *c = (struct scan_scene){0};
}

/* ---- where the head is -------------------------------------------------- */

/* rot (3,3) of a face's camera, radians: diag(1,-1,-1) for a face to the
 * camera; yaw turns it to its left. */
static void scene_face_rotation(float rot[9], float yaw, float pitch,
                                float roll)
{
    static const float front[9] = { 1, 0, 0, 0, -1, 0, 0, 0, -1 };
    float a[9], b[9], c[9], t[9];

    axis33(a, 1, yaw);
    axis33(b, 0, pitch);
    axis33(c, 2, roll);
    mat3_mul(t, a, b);
    mat3_mul(b, c, t);
    mat3_mul(rot, front, b);
}

/* Camera of head and shoulders: the head turns about the top of the neck. */
static void scene_place_body(struct scan_view *v, const struct figure *f,
                             const struct act *act)
{
    const struct scan_person *p = &f->look;
    float at[3], pivot[3], head[3];

    scene_face_rotation(v->rot, act->yaw, act->pitch, act->roll);
    scene_face_rotation(v->body, 0.35f * p->act.yaw + 0.2f * act->yaw,
                        0.06f * act->pitch, 0.1f * act->roll);
    for (int k = 0; k < 3; k++)
        at[k] = p->rest[k]
                + act->drift[k] * (k < 2 ? 0.035f : 0.02f * p->rest[2]);
    /* a nearer camera sees the same size through a shorter lens */
    float nearer = p->camera.distance / p->rest[2];
    at[2] *= nearer;
    v->focal = 0.5f * CAMERA_FOCAL * nearer;
    rot3(pivot, v->body, f->pivot);
    rot3(head, v->rot, f->pivot);
    for (int k = 0; k < 3; k++)
        v->trans[k] = at[k] + pivot[k] - head[k];
}

/* ---- the toolkit's camera ----------------------------------------------- */

/* One step of Gauss and Newton: rot, trans under focal CAMERA_FOCAL / 2 that
 * put verts where the view does.  Rotation by a small vector on the left. */
static void scene_camera_step(float rot[9], float trans[3], const float *verts,
                              const struct head *h, const struct scan_view *v)
{
    double a[36] = {0}, x[6] = {0};
    double f = 0.5 * (double)CAMERA_FOCAL;

    for (size_t i = 0; i < h->V; i += 5) {
        float p[3], q[3];
        if (verts[3 * i + 2] < 0.1f || verts[3 * i + 1] < -0.55f)
            continue;
        rot3(p, v->rot, verts + 3 * i);
        mad3(p, p, v->trans, 1);
        rot3(q, rot, verts + 3 * i);
        double r[3] = {(double)q[0], (double)q[1], (double)q[2]};
        mad3(q, q, trans, 1);
        double z = (double)q[2], px = (double)q[0], py = (double)q[1];
        for (int k = 0; k < 2; k++) {
            double e = (double)(v->focal * p[k] / p[2])
                       - f * (double)q[k] / z;
            double dx = k ? 0 : f / z, dy = k ? f / z : 0;
            double dz = -f * (k ? py : px) / (z * z);
            double j[6] = {dz * r[1] - dy * r[2], dx * r[2] - dz * r[0],
                           dy * r[0] - dx * r[1], dx, dy, dz};
            for (int m = 0; m < 6; m++) {
                for (int n = 0; n < 6; n++)
                    a[6 * m + n] += j[m] * j[n];
                x[m] += j[m] * e;
            }
        }
    }
    for (int m = 0; m < 6; m++)
        a[7 * m] *= 1 + 1e-9;
    cholesky_solve(x, a, 6);
    float w[3] = {(float)x[0], (float)x[1], (float)x[2]}, d[9], o[9];
    rodrigues33(d, w);
    mat3_mul(o, d, rot);
    memcpy(rot, o, sizeof o);
    for (int k = 0; k < 3; k++)
        trans[k] += (float)x[3 + k];
}

/* The true motion as the toolkit's camera has it: exact for a far camera, the
 * nearest fit for a near one. */
static void scene_find_camera(struct motion *m, const float *verts,
                              const struct head *h, const struct figure *f,
                              const struct scan_view *v)
{
    float nearer = 2 * v->focal / CAMERA_FOCAL;

    memcpy(m->R, v->rot, sizeof m->R);
    copy3(m->t, v->trans);
    if (f->look.camera.distance == f->look.rest[2])
        return;
    m->t[2] /= nearer;
    for (int i = 0; i < 6; i++)
        scene_camera_step(m->R, m->t, verts, h, v);
}

/* The head's motion during the exposure, pixels. */
static void scene_find_move(float move[2], const struct scan_scene *c,
                            const struct act *now, double time,
                            const struct synth_turn *turn)
{
    const struct scan_person *p = &c->figure.look;
    struct act before;
    float px = 0.5f * CAMERA_FOCAL * (float)c->size / p->rest[2];

    act_at(&before, &c->figure.assets->act, &p->act,
           time - (double)p->camera.shutter, turn);
    move[0] = px * (0.035f * (now->drift[0] - before.drift[0])
                    + 0.45f * (now->yaw - before.yaw));
    move[1] = px * (0.035f * (now->drift[1] - before.drift[1])
                    + 0.45f * (now->pitch - before.pitch));
}

/* Camera frame to pixels. */
static void scene_project(float xy[2], const float p[3],
                          const struct scan_view *v, int size)
{
    for (int j = 0; j < 2; j++)
        xy[j] = (float)size * (0.5f + v->focal * p[j] / p[2]);
}

/* worker->verts by the reference in double, which is the same on every
 * processor. */
static void scene_pose_head(struct scan_worker *worker,
                            const struct scan_scene *c,
                            const struct motion *m)
{
    const struct head *h = c->id.head;
    double beta[SCENE_SHAPES], exp[HEAD_MAX_EXP];
    struct head_motion_d d = head_motion_widen(exp, &m->pose, h->nexp);

    d.beta = beta;
    for (size_t k = 0; k < h->nshape; k++)
        beta[k] = (double)c->beta[k];
    head_pose_d(worker->exact, NULL, h, &d);
    for (size_t i = 0; i < 3 * h->V; i++)
        worker->verts[i] = (float)worker->exact[i];
}

int scan_scene_render(const struct scan_print *out, struct motion *m,
               float lmk[68][2], float (*points)[2],
               struct scan_worker *worker,
               const struct scan_scene *c, uint64_t frame, double time,
               const struct synth_turn *turn, struct error *err)
{
    const struct figure *f = &c->figure;
    const struct head *h = c->id.head;
    struct scan_view v;
    struct act act;
    float at[68 * 3], move[2];

    memset(m, 0, sizeof *m);
    act_at(&act, &f->assets->act, &f->look.act, time, turn);
    m->pose.exp = m->exp;
    arkit_to_motion(m->exp, (int)h->nexp, m->pose.jaw, m->pose.lid,
                    m->pose.eye, act.weight);
    scene_pose_head(worker, c, m);
    scene_place_body(&v, f, &act);
    scene_find_camera(m, worker->verts, h, f, &v);
    worker->stage.follow = &c->follow;
    worker->stage.verts = worker->verts;
    worker->stage.bend = worker->bend;
    if (scan_stage_render(&worker->stage, f, &act, &v, err))
        return -1;
    scene_find_move(move, c, &act, time, turn);
    scan_expose(out, &worker->film, &worker->stage, c->wall, frame, time, move);
    head_landmarks(at, h, worker->verts);
    for (int k = 0; k < 68; k++) {
        float p[3];
        rot3(p, v.rot, at + 3 * k);
        mad3(p, p, v.trans, 1);
        scene_project(lmk[k], p, &v, c->size);
    }
    for (int k = 0; !f->assets->plain && k < LANDMARK_FACE; k++)
        scene_project(points[k], worker->stage.place
                      + 3 * f->assets->point[k], &v, c->size);
    return 0;
}
