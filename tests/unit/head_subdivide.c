/* A subdivided head, and a person's offset on it, against LAM's animation by
 * its definition in plain double: canonical points with the expression added,
 * skinned by weights that are the mean of their edge's ends. */
#include "lib/lab/head/subdivide.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "formats/safetensors.h"
#include "lib/base/densify.h"
#include "lib/base/random.h"
#include "lib/head/person.h"
#include "tests/check.h"

enum {
    G = 7, V = G * G, F = 2 * (G - 1) * (G - 1), NS = 5, NE = 4, K = NS + NE,
    J = HEAD_JOINTS, LIDS = 6
};

/* A head of random numbers as its file holds them. */
struct flame {
    float v[V * 3], dirs[V * 3 * K], pose[V * 3 * 36], reg[J * V], w[V * J];
    float lid[2][V * 3], hair[V], bary[HEAD_LANDMARKS * 3];
    float lid_dirs[LIDS * 3 * NS];
    int32_t f[F * 3], parents[J], inner[3], upper[2], face[HEAD_LANDMARKS];
    int32_t region[V], lid_vertex[LIDS], lid_side[LIDS];
};

static void give_up(const struct error *err)
{
    printf("%s\n", err->text);
    exit(1);
}

static void flame_draw(float *x, size_t n, double bound, struct random *r)
{
    for (size_t i = 0; i < n; i++)
        x[i] = (float)random_range(r, -bound, bound);
}

/* Rows of n numbers that are positive and sum to 1. */
static void flame_draw_sums(float *x, size_t rows, size_t n, struct random *r)
{
    for (size_t i = 0; i < rows; i++) {
        float sum = 0;

        for (size_t k = 0; k < n; k++)
            sum += x[i * n + k] = (float)random_range(r, 0.01, 1);
        for (size_t k = 0; k < n; k++)
            x[i * n + k] /= sum;
    }
}

static void flame_make(struct flame *m, bool jaw)
{
    struct random r;

    random_init(&r, 3, "subdivide");
    flame_draw(m->v, V * 3, 0.1, &r);
    flame_draw(m->dirs, V * 3 * K, 0.01, &r);
    flame_draw(m->pose, V * 3 * 36, 0.01, &r);
    flame_draw(m->lid[0], V * 3, 0.01, &r);
    flame_draw(m->lid[1], V * 3, 0.01, &r);
    flame_draw(m->lid_dirs, LIDS * 3 * NS, 0.002, &r);
    flame_draw_sums(m->reg, J, V, &r);
    flame_draw_sums(m->w, V, J, &r);
    flame_draw_sums(m->bary, HEAD_LANDMARKS, 3, &r);
    for (int v = 0; v < V; v++) {
        m->hair[v] = (float)random_range(&r, 0, 1);
        m->region[v] = v % REGION_COUNT;
        if (!jaw) {
            m->w[J * v] += m->w[J * v + JOINT_JAW];
            m->w[J * v + JOINT_JAW] = 0;
        }
    }
    for (int i = 0; i < F; i++) {
        const int c = i / 2, at = c / (G - 1) * G + c % (G - 1), odd = i % 2;

        m->f[3 * i] = at + odd;
        m->f[3 * i + 1] = at + G + odd;
        m->f[3 * i + 2] = odd ? at + G : at + 1;
    }
    memcpy(m->parents, (int32_t[]){-1, 0, 1, 1, 1}, sizeof m->parents);
    memcpy(m->inner, (int32_t[]){3, 11, 20}, sizeof m->inner);
    memcpy(m->upper, (int32_t[]){4, 12}, sizeof m->upper);
    for (int i = 0; i < HEAD_LANDMARKS; i++)
        m->face[i] = i % F;
    for (int i = 0; i < LIDS; i++) {
        m->lid_vertex[i] = 5 + i;
        m->lid_side[i] = i % 2;
    }
}

static void flame_save(const struct flame *m, const char *path)
{
    const char *const meta[] = {"nshape", "5", "scale", "5", NULL};
    struct error err = {0};
#define T(NAME, TYPE, AT, N, A, B, C)                                        \
    {.name = NAME, .dtype = TYPE, .ndim = N, .dim = {A, B, C},               \
     .count = (size_t)(A) * ((B) ? (B) : 1) * ((C) ? (C) : 1), .data = AT}
    const struct st_tensor t[] = {
        T("v_template", ST_F32, m->v, 2, V, 3, 0),
        T("f", ST_I32, m->f, 2, F, 3, 0),
        T("shapedirs", ST_F32, m->dirs, 3, V, 3, K),
        T("posedirs", ST_F32, m->pose, 3, V, 3, 36),
        T("J_regressor", ST_F32, m->reg, 2, J, V, 0),
        T("weights", ST_F32, m->w, 2, V, J, 0),
        T("parents", ST_I32, m->parents, 1, J, 0, 0),
        T("l_eyelid", ST_F32, m->lid[0], 2, V, 3, 0),
        T("r_eyelid", ST_F32, m->lid[1], 2, V, 3, 0),
        T("lip_inner", ST_I32, m->inner, 1, 3, 0, 0),
        T("lip_upper_outer", ST_I32, m->upper, 1, 2, 0, 0),
        T("landmark_faces", ST_I32, m->face, 1, HEAD_LANDMARKS, 0, 0),
        T("landmark_bary", ST_F32, m->bary, 2, HEAD_LANDMARKS, 3, 0),
        T("region", ST_I32, m->region, 1, V, 0, 0),
        T("hair", ST_F32, m->hair, 1, V, 0, 0),
        T("lid_vertices", ST_I32, m->lid_vertex, 1, LIDS, 0, 0),
        T("lid_sides", ST_I32, m->lid_side, 1, LIDS, 0, 0),
        T("lid_shapedirs", ST_F32, m->lid_dirs, 3, LIDS, 3, NS),
    };
#undef T

    if (st_save(path, t, sizeof t / sizeof *t, meta, &err))
        give_up(&err);
}

/* R of axis times angle. */
static void rodrigues(double R[3][3], const float r[3])
{
    const double a = sqrt((double)r[0] * r[0] + (double)r[1] * r[1] +
                          (double)r[2] * r[2]);

    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            const double u = a ? r[i] / a : 0, v = a ? r[k] / a : 0;
            const int next = (i + 1) % 3 == k;
            const double cross = i == k || !a ? 0
                               : (next ? -1 : 1) * r[3 - i - k] / a;

            R[i][k] = (i == k) * cos(a) + (1 - cos(a)) * u * v +
                      sin(a) * cross;
        }
}

/* Each joint's way A_j = [R | t] of rest to posed, metres. */
static void joint_ways(double A[J][3][4], const struct flame *m,
                       const float *beta, const struct head_motion *pose)
{
    const float *turn[J] = {pose->global, pose->neck, pose->jaw, pose->eye,
                            pose->eye + 3};
    double at[J][3], R[J][3][3];

    for (int j = 0; j < J; j++)
        for (int i = 0; i < 3; i++) {
            at[j][i] = 0;
            for (int v = 0; v < V; v++) {
                double x = m->v[3 * v + i];

                for (int k = 0; k < K; k++)
                    x += (k < NS ? beta[k] : pose->exp[k - NS]) *
                         (double)m->dirs[(3 * v + i) * K + k];
                at[j][i] += m->reg[j * V + v] * x;
            }
        }
    for (int j = 0; j < J; j++) {
        const int p = m->parents[j];

        rodrigues(R[j], turn[j]);
        for (int i = 0; i < 3; i++) {
            double t = at[j][i];

            for (int k = 0; k < 3; k++) {
                A[j][i][k] = 0;
                for (int l = 0; p >= 0 && l < 3; l++)
                    A[j][i][k] += A[p][i][l] * R[j][l][k];
                if (p < 0)
                    A[j][i][k] = R[j][i][k];
                else
                    t += (A[p][i][k] - (i == k)) * at[j][k];
            }
            A[j][i][3] = t + (p < 0 ? 0 : A[p][i][3]);
        }
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++)
                A[j][i][3] -= A[j][i][k] * at[j][k];
    }
}

/* out (3), head units: point k posed, moved at rest by offset (3). */
static void animate(double out[3], const struct flame *m, const size_t end[2],
                    const float *beta, const struct head_motion *pose,
                    const float *offset, double A[J][3][4])
{
    double x[4] = {0, 0, 0, 1};

    for (int i = 0; i < 3; i++) {
        x[i] = offset ? (double)offset[i] / 5 : 0;
        for (int e = 0; e < 2; e++) {
            const size_t at = 3 * end[e] + (size_t)i;

            x[i] += 0.5 * m->v[at];
            for (int k = 0; k < K; k++)
                x[i] += 0.5 * (k < NS ? beta[k] : pose->exp[k - NS]) *
                        (double)m->dirs[at * K + (size_t)k];
        }
    }
    for (int i = 0; i < 3; i++) {
        out[i] = 0;
        for (int j = 0; j < J; j++)
            for (int k = 0; k < 4; k++)
                out[i] += 2.5 * ((double)m->w[J * end[0] + (size_t)j] +
                                 m->w[J * end[1] + (size_t)j]) *
                          A[j][i][k] * x[k];
    }
}

/* Greatest distance from the definition, of points beside the lids. */
static double animation_error(const struct flame *m, const struct head *fine,
                              const struct densify *d)
{
    static const float beta[NS] = {0.7f, -1.2f, 0.3f, 2, -0.5f};
    static const float psi[NE] = {1.1f, -0.4f, 0.9f, -2};
    const struct head_motion pose = {
        .exp = psi, .global = {0.1f, -0.2f, 0.3f}, .neck = {0.2f, 0.1f, 0},
        .jaw = {0.4f, 0.02f, -0.1f}, .eye = {0.1f, 0.2f, 0, -0.1f, 0.3f, 0.2f}
    };
    struct person p = {.nshape = NS, .noffset = fine->V};
    struct identity id;
    struct error err = {0};
    struct random r;
    double A[J][3][4], worst = 0;

    p.shape = (float *)(uintptr_t)beta;
    p.offset = malloc(3 * fine->V * sizeof *p.offset);
    float *verts = malloc(3 * fine->V * sizeof *verts);
    if (!p.offset || !verts)
        exit(1);
    random_init(&r, 9, "offset");
    flame_draw(p.offset, 3 * fine->V, 0.3, &r);
    if (person_fold(&id, fine, &p, &err))
        give_up(&err);
    head_pose(verts, &id, &pose);
    joint_ways(A, m, beta, &pose);
    for (size_t k = 0; k < fine->V; k++) {
        double want[3];
        size_t end[2];

        densify_ends(end, d, k);
        animate(want, m, end, beta, &pose, p.offset + 3 * k, A);
        for (int i = 0; i < 3; i++)
            worst = fmax(worst, fabs(want[i] - verts[3 * k + (size_t)i]));
    }
    /* an offset of another mesh is refused */
    p.noffset--;
    identity_release(&id);
    check_range("another mesh's offset", person_fold(&id, fine, &p, &err) == -1
                && strstr(err.text, "SHAP offset has"), 1, 1);
    free(p.offset);
    free(verts);
    return worst;
}

/* Lids and landmarks of any identity are where they were, and every midpoint
 * between its ends. */
static double rest_error(const struct head *fine, const struct head *coarse,
                         const struct densify *d)
{
    static const float beta[NS] = {-0.3f, 1.5f, 0.2f, -1, 0.8f};
    const struct head_motion pose = {.lid = {0.7f, 0.4f}};
    float lmk[2][3 * HEAD_LANDMARKS], *verts[2];
    const struct head *head[2] = {coarse, fine};
    double worst = 0;

    for (int i = 0; i < 2; i++) {
        struct error err = {0};
        struct identity id;

        verts[i] = malloc(3 * fine->V * sizeof **verts);
        if (!verts[i] || head_fold(&id, head[i], beta, NS, &err))
            exit(1);
        head_pose(verts[i], &id, &pose);
        head_landmarks(lmk[i], head[i], verts[i]);
        identity_release(&id);
    }
    for (size_t k = 0; k < fine->V; k++) {
        size_t end[2];

        densify_ends(end, d, k);
        for (size_t i = 0; i < 3; i++)
            worst = fmax(worst, fabs(0.5 * verts[0][3 * end[0] + i] +
                                     0.5 * verts[0][3 * end[1] + i] -
                                     verts[1][3 * k + i]));
    }
    for (int i = 0; i < 3 * HEAD_LANDMARKS; i++)
        worst = fmax(worst, fabs(lmk[0][i] - lmk[1][i]));
    free(verts[0]);
    free(verts[1]);
    return worst;
}

/* Both ends of the mesh: every edge of old is two new ones, every face four. */
static void check_mesh(const struct head *fine, const struct densify *d)
{
    struct error err = {0};
    struct densify again;

    if (densify_init(&again, fine->f, fine->F, fine->V, &err))
        give_up(&err);
    check_range("vertices", (double)fine->V, V + (double)d->E,
                V + (double)d->E);
    check_range("faces", (double)fine->F, 4 * F, 4 * F);
    check_range("edges", (double)again.E, 2 * (double)d->E + 3 * F,
                2 * (double)d->E + 3 * F);
    densify_release(&again);
}

int main(void)
{
    static struct flame m;
    struct error err = {0};
    struct head fine, coarse, other;
    struct densify d;
    char name[3][64];

    for (int i = 0; i < 3; i++)
        snprintf(name[i], sizeof name[i], "/tmp/spid-subdivide-%d-%d",
                 (int)getpid(), i);
    flame_make(&m, false);
    flame_save(&m, name[2]);
    if (subdivide_head(name[1], name[2], &err) ||
        head_load(&other, name[1], &err))
        give_up(&err);
    flame_make(&m, true);
    flame_save(&m, name[0]);
    if (subdivide_head(name[1], name[0], &err) ||
        head_load(&coarse, name[0], &err) || head_load(&fine, name[1], &err) ||
        densify_init(&d, coarse.f, coarse.F, coarse.V, &err))
        give_up(&err);
    check_mesh(&fine, &d);
    check("animation", animation_error(&m, &fine, &d), 2e-6);
    check("rest, lids, landmarks", rest_error(&fine, &coarse, &d), 1e-6);
    check_range("extends", subdivide_extends(&fine, &coarse), 1, 1);
    check_range("another extends", subdivide_extends(&other, &coarse), 0, 0);
    check_range("extends itself", subdivide_extends(&fine, &fine), 0, 0);
    check_range("pose correctives, skinned jaw", fine.pose_dirs[0] != 0, 0, 0);
    check_range("pose correctives, none skinned", other.pose_dirs[0] != 0, 1,
                1);
    for (int i = 0; i < 3; i++)
        unlink(name[i]);
    densify_release(&d);
    head_release(&fine);
    head_release(&coarse);
    head_release(&other);
    return check_status();
}
