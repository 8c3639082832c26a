/* GLB files: Gaussians come back as written; the head's skin, morph targets
 * and keyframes reproduce head_pose (glTF skinning, done here by hand). */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "formats/glb.h"
#include "formats/splats.h"
#include "lib/base/random.h"
#include "lib/export/export_head.h"
#include "lib/base/rotation.h"
#include "tests/check.h"
#include "tests/reference/rotation.h"

enum { V = 96, NSHAPE = 2, NEXP = 3, N = 500 };

static float *glb_fill(struct random *r, size_t n, double lo, double hi)
{
    float *x = malloc(n * sizeof *x);

    for (size_t i = 0; i < n; i++)
        x[i] = (float)random_range(r, lo, hi);
    return x;
}

static void quat_matrix(float R[9], const float q[4])
{
    double Rd[9], qd[4] = {q[0], q[1], q[2], q[3]};

    rotation_quat_d(Rd, qd);
    for (int i = 0; i < 9; i++)
        R[i] = (float)Rd[i];
}

/* ---- Gaussians ---------------------------------------------------------- */

static void splats_round_trip(struct random *r)
{
    struct error err = {0};
    struct gaussians s = {.n = N, .channels = 5,
                          .mean = glb_fill(r, 3 * N, -0.1, 0.1),
                          .scale = glb_fill(r, 3 * N, 0.001, 0.01),
                          .quat = glb_fill(r, 4 * N, -1, 1),
                          .opacity = glb_fill(r, N, 0, 1),
                          .color = glb_fill(r, 5 * N, 0, 1)};
    struct splats back;
    double mean = 0, color = 0, turn = 0;
    char path[64];

    snprintf(path, sizeof path, "/tmp/spid-export-%d.glb", (int)getpid());
    if (glb_write_splats(path, &s, 0.5f, &err) ||
        glb_read_splats(&back, 2, path, &err) || back.n != N) {
        check_error("Gaussians as glTF, read back", false, &err);
        return;
    }
    for (size_t i = 0; i < N; i++) {
        float A[9], B[9];
        for (size_t k = 0; k < 3; k++) {
            mean = fmax(mean, fabs(back.mean[3 * i + k] - s.mean[3 * i + k]));
            color = fmax(color, fabs(back.color[3 * i + k] -
                                     s.color[5 * i + k]));
        }
        quat_matrix(A, s.quat + 4 * i);
        quat_matrix(B, back.quat + 4 * i);
        turn = fmax(turn, rotation_distance(A, B));
    }
    check("Gaussians: centres", mean, 0);
    check("Gaussians: colours through f_dc", color, 1e-6);
    check("Gaussians: rotations (radians)", turn, 1e-3);
    splats_release(&back);
    s.n = 0;
    check("no Gaussians are refused",
          glb_write_splats(path, &s, 1, &err) != -1, 0);
    unlink(path);
    free((void *)s.mean);
    free((void *)s.scale);
    free((void *)s.quat);
    free((void *)s.opacity);
    free((void *)s.color);
}

/* ---- the head ----------------------------------------------------------- */

struct toy {
    struct head head;
    struct identity id;
};

static int toy_init(struct toy *t, struct random *r, struct error *err)
{
    static const int32_t parents[] = {-1, 0, 1, 1, 1};
    int32_t faces[3 * (V - 2)], lip[] = {0, 1, 2};
    float *regressor = calloc(5 * V, sizeof *regressor);
    float *weights = calloc(5 * V, sizeof *weights);
    struct head_arrays a = {
        .V = V, .F = V - 2, .nshape = NSHAPE, .nexp = NEXP,
        .v_template = glb_fill(r, 3 * V, -0.1, 0.1), .f = faces,
        .shapedirs = glb_fill(r, 3 * V * (NSHAPE + NEXP), -0.01, 0.01),
        .posedirs = glb_fill(r, 3 * V * 36, -0.002, 0.002),
        .J_regressor = regressor, .weights = weights, .parents = parents,
        .l_eyelid = calloc(3 * V, sizeof(float)),
        .r_eyelid = calloc(3 * V, sizeof(float)), .lip_inner = lip,
        .lip_upper_outer = lip, .nlip_inner = 3, .nlip_upper_outer = 3};

    for (int32_t i = 0; i < V - 2; i++)
        for (int32_t k = 0; k < 3; k++)
            faces[3 * i + k] = i + k;
    /* glTF's joints do not move with the expression: nor do these */
    for (size_t j = 0; j < 5; j++) {
        regressor[j * V + 7 * j] = 1;
        for (size_t c = 0; c < 3; c++)
            memset((float *)a.shapedirs +
                   (21 * j + c) * (NSHAPE + NEXP) + NSHAPE, 0,
                   NEXP * sizeof(float));
    }
    for (size_t v = 0; v < V; v++) {
        weights[5 * v + v % 5] = 0.75f;
        weights[5 * v + (v + 1) % 5] = 0.25f;
    }
    int rc = head_init(&t->head, &a, err);
    float beta[NSHAPE] = {0.7f, -0.4f};
    if (!rc)
        rc = head_fold(&t->id, &t->head, beta, NSHAPE, err);
    free((void *)a.v_template);
    free((void *)a.shapedirs);
    free((void *)a.posedirs);
    free((void *)a.l_eyelid);
    free((void *)a.r_eyelid);
    free(regressor);
    free(weights);
    return rc;
}

/* M = M * (translate, rotate) of a node, row-major 3x4. */
static void node_apply(double M[12], const double t[3], const float q[4])
{
    const float wxyz[4] = {q[3], q[0], q[1], q[2]};
    float R[9];
    double out[12];

    quat_matrix(R, wxyz);
    for (int i = 0; i < 3; i++) {
        out[4 * i + 3] = M[4 * i + 3];
        for (int j = 0; j < 3; j++) {
            out[4 * i + j] = 0;
            for (int k = 0; k < 3; k++)
                out[4 * i + j] += M[4 * i + k] * R[3 * k + j];
            out[4 * i + 3] += M[4 * i + j] * t[j];
        }
    }
    memcpy(M, out, sizeof out);
}

/* What a glTF viewer does with frame f: morph, then skin. */
static void gltf_vertex(double out[3], const struct export_head *e, size_t f,
                        size_t v)
{
    const struct head *h = e->head;
    double p[3], M[5][12];

    for (size_t c = 0; c < 3; c++) {
        p[c] = e->position[3 * v + c];
        for (size_t k = 0; k < e->targets; k++)
            p[c] += (double)e->weight[f * e->targets + k] *
                    e->delta[(k * h->V + v) * 3 + c];
    }
    memset(out, 0, 3 * sizeof *out);
    for (size_t j = 0; j < 5; j++) {
        static const double unit[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
        const float *J = e->joints + 3 * j;
        double t[3];
        int parent = h->parents[j];
        memcpy(M[j], parent < 0 ? unit : M[parent], sizeof unit);
        for (size_t c = 0; c < 3; c++)
            t[c] = parent < 0 ? e->translation[3 * f + c]
                              : J[c] - e->joints[3 * parent + (int)c];
        node_apply(M[j], t, e->rotation + (f * 5 + j) * 4);
        for (size_t c = 0; c < 3; c++) {
            double x = M[j][4 * c + 3];
            for (size_t k = 0; k < 3; k++)
                x += M[j][4 * c + k] * (p[k] - J[k]);
            out[c] += h->weights[5 * v + j] * x;
        }
    }
}

/* The file read back is posed as the same sums here. */
static void file_matches(const struct export_head *e)
{
    float *verts = malloc(3 * V * sizeof *verts);
    int32_t faces[3 * (V - 2)];
    struct error err = {0};
    double worst = 0;
    char path[64];

    snprintf(path, sizeof path, "/tmp/spid-export-%d.glb", (int)getpid());
    if (export_head_write(e, path, &err) ||
        glb_read_posed(verts, faces, V, V - 2, path, &err)) {
        check_error("the head as glTF, read back", false, &err);
    }
    for (size_t v = 0; v < V; v++) {
        double p[3];
        gltf_vertex(p, e, 0, v);
        for (size_t i = 0; i < 3; i++)
            worst = fmax(worst, fabs(p[i] - (double)verts[3 * v + i]));
    }
    check("the file's first frame, read back (m)", worst, 1e-6);
    check("the file's faces, read back",
          memcmp(faces, e->head->f, sizeof faces) != 0, 0);
    check("another number of vertices is refused",
          glb_read_posed(verts, faces, V - 1, V - 2, path, &err) != -1, 0);
    unlink(path);
    free(verts);
}

static void head_matches_pose(struct random *r)
{
    struct error err = {0};
    struct toy t = {0};
    struct export_head e = {0};
    struct export_head_options opt = {NEXP, true, "clip"};
    float psi[NEXP] = {0.8f, -0.6f, 0.3f}, verts[3 * V];
    struct export_motion m = {
        .time = 0, .pose = {.exp = psi, .jaw = {0.3f, 0.05f, -0.02f},
                            .eye = {0.1f, 0.2f, 0, -0.1f, 0.15f, 0}},
        .cam = {1, 0, 0, 0.2f, 0, -1, 0, -0.1f, 0, 0, -1, 12}};
    double worst = 0;

    if (toy_init(&t, r, &err) || export_head_init(&e, &t.id, &opt, &err) ||
        export_head_frame(&e, &m, &err)) {
        check_error("a head to write", false, &err);
        goto out;
    }
    head_pose(verts, &t.id, &m.pose);
    for (size_t v = 0; v < V; v++) {
        double p[3];
        gltf_vertex(p, &e, 0, v);
        for (int i = 0; i < 3; i++) {
            double x = m.cam[4 * i + 3];
            for (int j = 0; j < 3; j++)
                x += m.cam[4 * i + j] * verts[3 * v + (size_t)j];
            x *= (i ? -1 : 1) / t.head.scale;
            worst = fmax(worst, fabs(p[i] - x));
        }
    }
    check("glTF skinning against head_pose (m)", worst, 2e-6);
    file_matches(&e);
    check("a time that does not increase is refused",
          export_head_frame(&e, &m, &err) != -1, 0);
out:
    export_head_release(&e);
    identity_release(&t.id);
    head_release(&t.head);
}

int main(void)
{
    struct random r;

    random_init(&r, 20, "export");
    splats_round_trip(&r);
    head_matches_pose(&r);
    return check_status();
}
