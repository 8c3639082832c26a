/* Each landmark's place on our skin, found by the vertex of the scans that it
 * means, with its own rows of the blendshapes: all that the fit looks at. */
#include "lib/lab/fit/face_points.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/rotation.h"
#include "lib/lab/head/nearest.h"
#include "lib/lab/head/surface.h"

#define N LANDMARK_FACE
#define FAR 0.1                 /* head units: 2 cm */

/* A point of the head: a triangle and its barycentric coordinates. */
struct face_place {
    const int32_t *corner;
    double bary[3];
};

/* ---- which point each landmark is ---------------------------------------- */

/* faces (F,3) = the head's of the skin; how many. */
static size_t face_skin(int32_t *faces, const struct head *h)
{
    size_t n = 0;

    for (size_t i = 0; i < h->F; i++) {
        const int32_t *f = h->f + 3 * i;
        bool skin = true;

        for (int k = 0; h->region && k < 3; k++)
            skin = skin && h->region[f[k]] != REGION_EYEBALL &&
                   h->region[f[k]] != REGION_INNER_MOUTH;
        if (skin)
            memcpy(faces + 3 * n++, f, 3 * sizeof *f);
    }
    return n;
}

/* place (468) = of each landmark the point of the skin, whose faces come from
 * room, nearest to its vertex that looks the same way: lips and lids keep
 * their own. */
static int face_find_all(struct face_place *place, const struct head *h,
                         const struct scan *scan, const struct landmark_map *m,
                         struct arena *room, struct error *err)
{
    int32_t *faces = arena_take(room, 3 * h->F, sizeof *faces);
    float *normal = arena_take(room, 3 * SCAN_VERTS, sizeof *normal);
    struct nearest skin;

    if (arena_check(room, "landmarks", err) ||
        nearest_init(&skin, h->v_template, faces, face_skin(faces, h), room,
                     err))
        return -1;
    surface_normals(normal, scan->neutral, SCAN_VERTS, scan->f, scan->nf);
    for (int i = 0; i < N; i++) {
        const float *x = scan->neutral + 3 * m->vertex[i];
        const double u = (double)h->scale;
        const double p[3] = {u * x[0], u * x[1], u * x[2]};
        struct nearest_hit hit;

        nearest_facing(&hit, &skin, p, normal + 3 * m->vertex[i], FAR);
        if (hit.face < 0)
            return error_set(err, EX_DATAERR, "head has no skin");
        place[i].corner = faces + 3 * hit.face;
        memcpy(place[i].bary, hit.bary, sizeof hit.bary);
    }
    return 0;
}

/* ---- their directions ---------------------------------------------------- */

/* out (468,3) = vertices x (V,3) at the places. */
static void face_take(double (*out)[3], const float *x,
                      const struct face_place *place)
{
    for (int i = 0; i < N; i++)
        for (int c = 0; c < 3; c++) {
            out[i][c] = 0;
            for (int k = 0; k < 3; k++)
                out[i][c] += place[i].bary[k] *
                             (double)x[3 * place[i].corner[k] + c];
        }
}

/* out (count,468,3) = directions first.. of n in the posing layout; scratch
 * (V,3). */
static void face_take_all(double (*out)[3], float *scratch,
                          const struct head *h, const float *dirs, size_t n,
                          size_t first, size_t count,
                          const struct face_place *place)
{
    for (size_t k = 0; k < count; k++) {
        head_direction(scratch, h, dirs, n, first + k);
        face_take(out + k * N, scratch, place);
    }
}

/* What shape k adds to a closed lid. */
static void face_take_lids(struct face_points *p, float *scratch,
                           const struct head *h,
                           const struct face_place *place)
{
    for (int side = 0; side < 2; side++) {
        face_take(p->lid + side * N, side ? h->r_eyelid : h->l_eyelid, place);
        for (size_t k = 0; k < FACE_SHAPES; k++) {
            memset(scratch, 0, 3 * h->V * sizeof *scratch);
            for (size_t i = 0; k < h->nlid_shape && i < 3 * h->nlid; i++)
                if (h->lid_sides[i / 3] == side)
                    scratch[3 * (size_t)h->lid_vertices[i / 3] + i % 3] =
                        h->lid_shapedirs[i * h->nlid_shape + k];
            face_take(p->lid_shape + ((size_t)side * FACE_SHAPES + k) * N,
                      scratch, place);
        }
    }
}

/* The eyeball's vertex that looks furthest ahead. */
static size_t face_find_pupil(const struct head *h, int side)
{
    const float *joint = h->joint_template + 3 * (JOINT_EYE_LEFT + side);
    size_t best = 0;
    double max = -INFINITY, axis[3];

    scan_eye_axis(axis, side);
    for (size_t v = 0; v < h->V; v++) {
        double ahead = 0;

        if (h->weights[HEAD_JOINTS * v + JOINT_EYE_LEFT + (size_t)side] < 0.5f)
            continue;
        for (size_t c = 0; c < 3; c++)
            ahead += axis[c] * (double)(h->v_template[3 * v + c] - joint[c]);
        if (ahead > max) {
            max = ahead;
            best = v;
        }
    }
    return best;
}

/* Eye joint and pupil of every shape. */
static void face_take_eye(struct face_points *p, float *scratch,
                          const struct head *h, int side)
{
    struct face_eye *e = &p->eye[side];
    const size_t joint = 3 * (JOINT_EYE_LEFT + (size_t)side);
    const size_t v = face_find_pupil(h, side);

    for (size_t c = 0; c < 3; c++) {
        e->joint[c] = (double)h->joint_template[joint + c];
        e->pupil[c] = (double)h->v_template[3 * v + c] - e->joint[c];
    }
    for (size_t k = 0; k < FACE_SHAPES; k++) {
        head_direction(scratch, h, h->shape_dirs, h->nshape, k);
        for (size_t c = 0; c < 3; c++) {
            e->joint_shape[k][c] = (double)h->joint_shape[15 * k + joint + c];
            e->pupil_shape[k][c] = (double)scratch[3 * v + c] -
                                   e->joint_shape[k][c];
        }
    }
}

/* Spread lowers trust, as do points that are placed alike on everybody. */
static void face_set_weights(struct face_points *p,
                             const struct landmark_map *m)
{
    double sum = 0;

    for (int i = 0; i < N; i++)
        sum += p->weight[i] = 1 / (0.1 + m->spread[i]);
    for (int i = 0; i < N; i++)
        p->weight[i] *= N / sum;
    for (int i = 0; i < LANDMARK_OVAL; i++)
        p->weight[landmark_oval[i]] *= 0.3;
    for (int i = 0; i < LANDMARK_LIP; i++)
        p->weight[landmark_lip[i]] *= 2;
    for (int i = 0; i < 2 * LANDMARK_LID; i++)
        p->weight[landmark_lid[i / LANDMARK_LID][i % LANDMARK_LID]] *= 2;
}

/* Every array of p, in one piece. */
static int face_points_reserve(struct face_points *p, struct error *err)
{
    const size_t shapes = FACE_SHAPES * N;

    memset(p, 0, sizeof *p);
    p->rest = calloc((1 + 2) * N + 3 * shapes + (ARKIT_COUNT + FACE_POSES) * N,
                     sizeof *p->rest);
    if (!p->rest)
        return error_set(err, EX_OSERR, "out of memory");
    p->shape = p->rest + N;
    p->exp = p->shape + shapes;
    p->pose = p->exp + ARKIT_COUNT * N;
    p->lid = p->pose + FACE_POSES * N;
    p->lid_shape = p->lid + 2 * N;
    return 0;
}

int face_points_init(struct face_points *p, const struct head *head,
                     const struct scan *scan, const struct landmark_map *m,
                     struct error *err)
{
    struct face_place place[N];
    struct arena room = {0};
    float *scratch = arena_take(&room, 3 * head->V, sizeof *scratch);
    int rc = -1;

    memset(p, 0, sizeof *p);
    if (!head_has_arkit(head) || head->nshape < FACE_SHAPES) {
        error_set(err, EX_CONFIG, "head is not registered to the scans "
                  "(expected one of spid-head --from)");
        goto out;
    }
    if (face_find_all(place, head, scan, m, &room, err) ||
        face_points_reserve(p, err))
        goto out;
    face_take(p->rest, head->v_template, place);
    face_take_all(p->shape, scratch, head, head->shape_dirs, head->nshape, 0,
                  FACE_SHAPES, place);
    face_take_all(p->exp, scratch, head, head->exp_dirs, head->nexp, 0,
                  ARKIT_COUNT, place);
    face_take_all(p->pose, scratch, head, head->pose_dirs, HEAD_POSE_DIRS,
                  9 * (JOINT_JAW - 1), FACE_POSES, place);
    face_take_lids(p, scratch, head, place);
    for (int side = 0; side < 2; side++)
        face_take_eye(p, scratch, head, side);
    face_set_weights(p, m);
    rc = 0;
out:
    arena_release(&room);
    return rc;
}

void face_points_release(struct face_points *p)
{
    free(p->rest);
    memset(p, 0, sizeof *p);
}

/* ---- posing -------------------------------------------------------------- */

/* x (n,3) += s d (n,3) */
static void face_mad(double (*x)[3], double s, const double (*d)[3],
                     size_t n)
{
    for (size_t i = 0; s != 0 && i < n; i++)
        for (int c = 0; c < 3; c++)
            x[i][c] += s * d[i][c];
}

void face_points_fold(struct face_own *o, const struct face_points *p,
                      const double beta[FACE_SHAPES])
{
    memcpy(o->at, p->rest, sizeof o->at);
    memcpy(o->lid, p->lid, sizeof o->lid);
    for (int side = 0; side < 2; side++) {
        memcpy(o->joint[side], p->eye[side].joint, sizeof o->joint[side]);
        memcpy(o->pupil[side], p->eye[side].pupil, sizeof o->pupil[side]);
    }
    for (size_t k = 0; k < FACE_SHAPES; k++) {
        face_mad(o->at, beta[k], p->shape + k * N, N);
        for (size_t side = 0; side < 2; side++) {
            face_mad(o->lid[side], beta[k],
                     p->lid_shape + (side * FACE_SHAPES + k) * N, N);
            for (size_t c = 0; c < 3; c++) {
                o->joint[side][c] += beta[k] *
                                     p->eye[side].joint_shape[k][c];
                o->pupil[side][c] += beta[k] *
                                     p->eye[side].pupil_shape[k][c];
            }
        }
    }
}

/* Angles of the joints under w: jaw, left eye, right eye; axis times angle.
 * As arkit_to_motion has them, in double. */
static void face_joints(double a[3][3], const double w[ARKIT_COUNT])
{
    memset(a, 0, 9 * sizeof **a);
    a[0][0] = ARKIT_JAW_OPEN * w[ARKIT_JAW_OPENED];
    a[0][1] = ARKIT_JAW_SIDE * (w[ARKIT_JAW_LEFT] - w[ARKIT_JAW_RIGHT]);
    for (int side = 0; side < 2; side++) {
        const double *s = w + side;
        double out = ARKIT_EYE_OUT * s[ARKIT_EYE_LOOK_OUT_L] -
                     ARKIT_EYE_IN * s[ARKIT_EYE_LOOK_IN_L];

        a[1 + side][0] = ARKIT_EYE_DOWN * s[ARKIT_EYE_LOOK_DOWN_L] -
                         ARKIT_EYE_UP * s[ARKIT_EYE_LOOK_UP_L];
        a[1 + side][1] = side ? -out : out;
    }
}

void face_points_pose(double x[N][3], const struct face_points *p,
                      const struct face_own *o, const double w[ARKIT_COUNT])
{
    double a[3][3], R[9];

    memcpy(x, o->at, sizeof o->at);
    for (size_t k = 0; k < ARKIT_COUNT; k++)
        if (!arkit_is_rig((int)k))
            face_mad(x, w[k], p->exp + k * N, N);
    face_joints(a, w);
    for (size_t j = 0; j < 3; j++) {
        rotation_exp_d(R, a[j]);
        for (size_t i = 0; i < 9; i++)
            face_mad(x, R[i] - (i % 4 == 0), p->pose + (9 * j + i) * N, N);
    }
    for (int side = 0; side < 2; side++)
        face_mad(x, w[ARKIT_EYE_BLINK_L + side],
                 o->lid[side], N);
}

void face_points_slope(double d[N][3], const struct face_points *p,
                       const struct face_own *o, const double w[ARKIT_COUNT],
                       int k)
{
    double zero[ARKIT_COUNT] = {0}, a[3][3], da[3][3], one[9], g[3];

    memset(d, 0, sizeof o->at);
    if (!arkit_is_rig(k)) {
        memcpy(d, p->exp + (size_t)k * N, sizeof o->at);
        return;
    }
    if (k == ARKIT_EYE_BLINK_L || k == ARKIT_EYE_BLINK_R) {
        memcpy(d, o->lid[k - ARKIT_EYE_BLINK_L], sizeof o->at);
        return;
    }
    face_joints(a, w);
    zero[k] = 1;
    face_joints(da, zero);
    for (size_t j = 0; j < 3; j++)
        for (size_t i = 0; i < 9; i++) {
            memset(one, 0, sizeof one);
            memset(g, 0, sizeof g);
            one[i] = 1;
            rotation_exp_backward_d(g, one, a[j]);
            face_mad(d, g[0] * da[j][0] + g[1] * da[j][1] +
                     g[2] * da[j][2], p->pose + (9 * j + i) * N, N);
        }
}

void face_pupil(double x[3], const struct face_own *o, int side, double pitch,
                double yaw)
{
    double R[9], a[3] = {pitch, yaw, 0};

    rotation_exp_d(R, a);
    for (int i = 0; i < 3; i++)
        x[i] = o->joint[side][i] + R[3 * i] * o->pupil[side][0] +
               R[3 * i + 1] * o->pupil[side][1] +
               R[3 * i + 2] * o->pupil[side][2];
}
