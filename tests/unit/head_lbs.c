/* Posing: float kernels of every instruction set against the double
 * reference, and their gradients against its central differences. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "lib/base/cpu.h"
#include "lib/base/random.h"
#include "lib/head/lbs.h"
#include "tests/check.h"
#include "tests/unit/random_head.h"

#define NS 7
#define NE 5

static void check_at(size_t V, const char *what, double value, double limit)
{
    char line[80];

    snprintf(line, sizeof line, "%-9s V=%-5zu %s",
             cpu_level_name(cpu_level()), V, what);
    check(line, value, limit);
}

/* A head of V random vertices, everything non-zero. */
static void make_head(struct head *h, struct random *r, size_t V)
{
    static const int32_t parents[5] = {-1, 0, 1, 1, 1}, face[3] = {0, 0, 0};
    struct head_arrays a = {
        .V = V, .F = 1, .nshape = NS, .nexp = NE, .f = face,
        .v_template = random_numbers(r, 3 * V, 0.1), .parents = parents,
        .shapedirs = random_numbers(r, 3 * V * (NS + NE), 0.01),
        .posedirs = random_numbers(r, 3 * V * 36, 0.01),
        .l_eyelid = random_numbers(r, 3 * V, 0.01),
        .r_eyelid = random_numbers(r, 3 * V, 0.01),
        .lip_inner = face, .nlip_inner = 1
    };

    /* lids of two vertices, one each, that depend on the first shapes */
    int32_t lid[2] = {0, (int32_t)(V - 1)}, side[2] = {0, 1};
    a.nlid = 2;
    a.nlid_shape = NS - 2;
    a.lid_vertices = lid;
    a.lid_sides = side;
    a.lid_shapedirs = random_numbers(r, 6 * (NS - 2), 0.01);
    float *w = random_numbers(r, 5 * V, 1), *J = calloc(5 * V, sizeof *J);

    for (size_t v = 0; v < V; v++) {
        float sum = 0;

        for (int j = 0; j < 5; j++)
            sum += w[5 * v + j] = fabsf(w[5 * v + j]);
        for (int j = 0; j < 5; j++)
            w[5 * v + j] /= sum;
    }
    for (size_t j = 0; j < 5; j++)
        J[j * V + j * 7 % V] = 1;
    a.weights = w;
    a.J_regressor = J;
    float *hair = random_numbers(r, V, 1);
    struct error err = {0};

    hair[V - 1] = 1.5f;
    for (size_t v = 0; v + 1 < V; v++)
        hair[v] = fabsf(hair[v]);
    a.hair = hair;
    check_at(V, "hair denser than 1 is refused",
             head_init(h, &a, &err) ? 0 : 1, 0.5);
    hair[V - 1] = 1;
    random_head_init(h, &a);
    free(hair);
    free(w);
    free(J);
}

/* One set of parameters in both precisions. */
struct params_pair {
    float beta[NS], exp[NE];
    double beta_d[NS], exp_d[NE];
    struct head_motion m;
    struct head_motion_d d;
};

static void lbs_draw(struct params_pair *p, struct random *r, double angle)
{
    memset(p, 0, sizeof *p);
    for (int i = 0; i < NS; i++)
        p->beta_d[i] = p->beta[i] = (float)random_range(r, -2, 2);
    for (int i = 0; i < NE; i++)
        p->exp_d[i] = p->exp[i] = i == 2 ? 0 : (float)random_range(r, -2, 2);
    float *at[5] = {p->m.global, p->m.neck, p->m.jaw, p->m.eye, p->m.eye + 3};
    for (int i = 0; i < 15; i++)
        p->d.pose[i] = at[i / 3][i % 3] =
            i / 3 == 1 ? 0 : (float)random_range(r, -angle, angle);
    for (int i = 0; i < 2; i++)
        p->d.lid[i] = p->m.lid[i] = (float)random_uniform(r);
    p->m.exp = p->exp;
    p->d.beta = p->beta_d;
    p->d.exp = p->exp_d;
}

static void lbs_forward(const struct head *h, struct random *r, double angle)
{
    size_t V = h->V;
    float *verts = malloc((3 * V + 8) * sizeof *verts);
    double *ref = malloc(3 * V * sizeof *ref), worst = 0;
    struct params_pair p;
    struct identity id;
    struct error err;

    lbs_draw(&p, r, angle);
    for (int i = 0; i < 8; i++)
        verts[3 * V + (size_t)i] = 12345;
    head_fold(&id, h, p.beta, NS, &err);
    head_pose(verts, &id, &p.m);
    head_pose_d(ref, NULL, h, &p.d);
    for (size_t i = 0; i < 3 * V; i++)
        worst = fmax(worst, fabs(verts[i] - ref[i]));
    for (int i = 0; i < 8; i++)
        worst = verts[3 * V + (size_t)i] == 12345 ? worst : INFINITY;
    /* the head is about 1 unit: a few float roundings */
    check_at(V, "vertices against double", worst, 5e-7);
    identity_release(&id);
    free(verts);
    free(ref);
}

static double lbs_loss(const struct head *h, const struct params_pair *p,
                       const double *probe)
{
    size_t n = 3 * h->V;
    double *v = malloc(n * sizeof *v), joints[15], sum = 0;

    head_pose_d(v, joints, h, &p->d);
    for (size_t i = 0; i < n; i++)
        sum += probe[i] * v[i];
    for (size_t i = 0; i < 15; i++)
        sum += probe[n + i] * joints[i];
    free(v);
    return sum;
}

/* Float gradients by differences of the double reference. */
static void lbs_gradients(const struct head *h, struct random *r, double angle)
{
    size_t n = 3 * h->V + 15;
    double *probe = malloc(n * sizeof *probe), worst = 0, size = 1;
    float *probe_f = malloc(n * sizeof *probe_f);
    float gb[NS] = {0}, ge[NE] = {0};
    struct head_motion_grad g = {.beta = gb, .exp = ge};
    struct params_pair p;
    struct identity id;
    struct error err;

    lbs_draw(&p, r, angle);
    for (size_t i = 0; i < n; i++)
        probe_f[i] = (float)(probe[i] = (float)random_range(r, -1, 1));
    head_fold(&id, h, p.beta, NS, &err);
    head_pose_backward(&g, probe_f, probe_f + n - 15, &id, &p.m);
    struct {
        double *x;
        float *g;
        int n;
    } part[] = {
        {p.beta_d, gb, NS}, {p.exp_d, ge, NE}, {p.d.pose, g.global, 3},
        {p.d.pose + 3, g.neck, 3}, {p.d.pose + 6, g.jaw, 3},
        {p.d.pose + 9, g.eye, 6}, {p.d.lid, g.lid, 2}
    };
    for (size_t k = 0; k < sizeof part / sizeof *part; k++)
        for (int i = 0; i < part[k].n; i++)
            size = fmax(size, fabs(part[k].g[i]));
    for (size_t k = 0; k < sizeof part / sizeof *part; k++)
        for (int i = 0; i < part[k].n; i++) {
            double keep = part[k].x[i], step = 1e-5;

            part[k].x[i] = keep + step;
            double up = lbs_loss(h, &p, probe);
            part[k].x[i] = keep - step;
            double d = (up - lbs_loss(h, &p, probe)) / (2 * step);
            part[k].x[i] = keep;
            worst = fmax(worst, fabs(d - part[k].g[i]) / size);
        }
    check_at(h->V, "gradients by differences of double", worst, 2e-6);
    identity_release(&id);
    free(probe);
    free(probe_f);
}

static int lbs_run(void)
{
    static const size_t sizes[] = {1, 31, 32, 33, 500, 5023};
    static const double angles[] = {0, 1e-6, 0.3, 1.81};
    struct random r;

    random_init(&r, 10, "head_lbs");
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        struct head h;

        make_head(&h, &r, sizes[i]);
        for (size_t k = 0; k < 4; k++) {
            lbs_forward(&h, &r, angles[k]);
            if (sizes[i] <= 500)
                lbs_gradients(&h, &r, angles[k]);
        }
        head_release(&h);
    }
    return check_status();
}

/* One child per instruction set: the level is decided once per process. */
int main(void)
{
    static const char *const level[] = {"baseline", "avx2", "avx512"};
    int bad = 0;

    for (int i = 0; i < 3; i++) {
        int status = 1;

        fflush(stdout);
        pid_t pid = fork();
        if (pid == 0) {
            setenv("SPID_CPU", level[i], 1);
            status = lbs_run();
            fflush(stdout);
            _exit(status);
        }
        waitpid(pid, &status, 0);
        bad |= status != 0;
    }
    return bad;
}
