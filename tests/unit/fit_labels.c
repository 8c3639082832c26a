/* Fitting the scans' head to labels: least squares, derivatives against
 * finite differences, known people recovered from their projected landmarks,
 * and label files that are damaged. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

#include "formats/safetensors.h"
#include "lib/base/random.h"
#include "lib/lab/fit/face_fit.h"
#include "lib/lab/fit/normal.h"
#include "lib/base/rotation.h"
#include "lib/head/lbs.h"
#include "tests/check.h"

#define HEAD_NAME "examples/model/head.safetensors"
#define N LANDMARK_FACE
enum { PEOPLE = 4, FRAMES = 6, ROUNDS = 6 };

/* ---- least squares ------------------------------------------------------- */

static void test_normal(void)
{
    enum { ROWS = 20, ALL = 5, FEW = 3 };
    struct normal e, part, few;
    struct random r;
    double row[ROWS][ALL], y[ROWS], x[ALL], z[FEW], slope = 0, own = 0;
    double bound[ALL] = {0}, gradient = 0;

    random_init(&r, 1, "fit normal");
    normal_init(&e, ALL, NULL);
    normal_init(&part, ALL, NULL);
    normal_init(&few, FEW, NULL);
    for (int i = 0; i < ROWS; i++) {
        for (int k = 0; k < ALL; k++)
            row[i][k] = random_normal(&r);
        y[i] = random_normal(&r);
        normal_add(&e, row[i], 1 + i % 3, y[i]);
        normal_add(&part, row[i], 1 + i % 3, y[i]);
    }
    normal_prior(&e, 2, 0.5, 1);
    normal_prior(&part, 2, 0.5, 1);
    normal_solve_bounded(bound, &e, -0.15, 0.15, 1e-13);
    normal_reduce(&few, &part, 1);
    normal_solve(z, &few);
    normal_solve(x, &e);
    for (int k = 0; k < ALL; k++) {
        double g = k == 2 ? 0.5 * (x[2] - 1) : 0;
        double b = k == 2 ? 0.5 * (bound[2] - 1) : 0;

        for (int i = 0; i < ROWS; i++) {
            double f = -y[i], fb = -y[i];

            for (int c = 0; c < ALL; c++) {
                f += row[i][c] * x[c];
                fb += row[i][c] * bound[c];
            }
            g += (1 + i % 3) * row[i][k] * f;
            b += (1 + i % 3) * row[i][k] * fb;
        }
        gradient = fmax(gradient, fabs(g));
        /* at a bound the gradient points out of it */
        own = fmax(own, fabs(bound[k]) < 0.15 ? fabs(b)
                                              : bound[k] > 0 ? b : -b);
    }
    for (int k = 0; k < FEW; k++)
        slope = fmax(slope, fabs(z[k] - x[k]));
    check("gradient at the solution", gradient, 1e-10);
    check("at the solution between bounds", own, 1e-8);
    check("others eliminated, the same solution", slope, 1e-10);
    normal_release(&e);
    normal_release(&part);
    normal_release(&few);
}

/* ---- points on the head -------------------------------------------------- */

/* Scans and a map whose mesh is the head's own; one vertex in ten. */
static void own_scan(struct scan *s, struct landmark_map *m,
                     const struct head *h)
{
    int n = 0;

    memset(s, 0, sizeof *s);
    s->neutral = arena_take(&s->memory, 3 * SCAN_VERTS, sizeof *s->neutral);
    s->f = arena_take(&s->memory, 3 * h->F, sizeof *s->f);
    REQUIRE(s->neutral && s->f, "out of memory");
    for (size_t i = 0; i < 3 * h->V; i++)
        s->neutral[i] = h->v_template[i] / h->scale;
    memcpy(s->f, h->f, 3 * h->F * sizeof *s->f);
    s->nf = h->F;
    for (size_t v = 0; n < N && v < h->V; v += 7) {
        int32_t r = h->region[v];

        if (r == REGION_EYEBALL || r == REGION_INNER_MOUTH ||
            r == REGION_NECK || h->v_template[3 * v + 2] < 0.1f)
            continue;
        m->vertex[n] = (int32_t)v;
        m->spread[n++] = 0;
    }
    for (int i = n; i < N; i++) {
        m->vertex[i] = m->vertex[i - n];
        m->spread[i] = 0;
    }
}

/* A landmark that the fit reads as lid, lip or brow must be one. */
static void take_landmark(struct landmark_map *m, const struct head *h,
                          int landmark, int of68)
{
    const int32_t *f = h->f + 3 * (size_t)h->landmark_faces[of68];
    const float *b = h->landmark_bary + 3 * of68;
    int best = b[0] > b[1] ? 0 : 1;

    m->vertex[landmark] = f[b[2] > b[best] ? 2 : best];
}

static void take_landmarks(struct landmark_map *m, const struct head *h)
{
    static const int pair[][2] = {
        {33, 36}, {133, 39}, {263, 45}, {362, 42}, {159, 38}, {158, 38},
        {160, 37}, {157, 38}, {145, 40}, {153, 40}, {144, 41}, {154, 40},
        {386, 43}, {385, 43}, {387, 44}, {384, 43}, {374, 47}, {380, 47},
        {373, 46}, {381, 47}, {13, 62}, {14, 66}, {82, 61}, {87, 67},
        {312, 63}, {317, 65}, {81, 61}, {178, 67}, {311, 63}, {402, 65},
        {61, 48}, {291, 54}, {78, 60}, {308, 64}, {152, 8}, {10, 27},
        {70, 17}, {63, 18}, {105, 19}, {66, 20}, {107, 21}, {336, 22},
        {296, 23}, {334, 24}, {293, 25}, {300, 26}
    };

    for (size_t i = 0; i < sizeof pair / sizeof *pair; i++)
        take_landmark(m, h, pair[i][0], pair[i][1]);
}

static void draw_weights(double *w, struct random *r)
{
    memset(w, 0, ARKIT_COUNT * sizeof *w);
    for (int k = 0; k < ARKIT_COUNT; k++)
        if (random_uniform(r) < 0.2)
            w[k] = 0.6 * random_uniform(r);
    /* what contradicts itself is not told apart */
    w[ARKIT_JAW_LEFT] = w[ARKIT_JAW_FORWARD] = 0;
}

/* The points against the posed head's vertices, and their slopes. */
static void test_points(const struct face_points *p, const struct head *h,
                        const struct landmark_map *m)
{
    static struct face_own o;
    static double x[N][3], lo[N][3], hi[N][3], d[N][3];
    double beta[FACE_SHAPES], w[ARKIT_COUNT], off = 0, slope = 0;
    float bf[FACE_SHAPES], wf[ARKIT_COUNT], exp[HEAD_MAX_EXP];
    float *verts = malloc(3 * h->V * sizeof *verts);
    struct head_motion pose = {.exp = exp};
    struct identity id;
    struct random r;

    random_init(&r, 5, "fit points");
    for (int k = 0; k < FACE_SHAPES; k++)
        bf[k] = (float)(beta[k] = random_normal(&r));
    draw_weights(w, &r);
    w[ARKIT_JAW_OPENED] = 0.7;
    w[ARKIT_EYE_BLINK_R] = 0.4;
    w[ARKIT_EYE_LOOK_UP_L] = w[ARKIT_EYE_LOOK_OUT_L] = 0.3;
    w[ARKIT_EYE_LOOK_DOWN_L] = w[ARKIT_EYE_LOOK_IN_L] = 0;
    for (int k = 0; k < ARKIT_COUNT; k++)
        wf[k] = (float)w[k];
    arkit_to_motion(exp, (int)h->nexp, pose.jaw, pose.lid, pose.eye, wf);
    REQUIRE(verts && !head_fold(&id, h, bf, FACE_SHAPES, NULL),
            "out of memory");
    head_pose(verts, &id, &pose);
    face_points_fold(&o, p, beta);
    face_points_pose(x, p, &o, w);
    for (int i = 0; i < N; i++)
        for (int c = 0; c < 3; c++)
            off = fmax(off, fabs(x[i][c] -
                                 (double)verts[3 * m->vertex[i] + c]));
    check("points of a posed head, head units", off, 2e-5);
    for (int k = 0; k < ARKIT_COUNT; k++) {
        double at = w[k];

        face_points_slope(d, p, &o, w, k);
        w[k] = at - 1e-5;
        face_points_pose(lo, p, &o, w);
        w[k] = at + 1e-5;
        face_points_pose(hi, p, &o, w);
        w[k] = at;
        for (int i = 0; i < N; i++)
            for (int c = 0; c < 3; c++)
                slope = fmax(slope, fabs(d[i][c] -
                                         (hi[i][c] - lo[i][c]) / 2e-5));
    }
    check("slopes against differences", slope, 1e-8);
    identity_release(&id);
    free(verts);
}

static void test_projection(void)
{
    struct fit_frame f = {.t = {0.1, -0.2, 11}};
    const double turn[3] = {2.8, 0.3, -0.4}, x[3] = {0.2, -0.1, 0.4};
    double uv[2], j[2][3], pose[2][6], lo[2], hi[2], worst = 0;
    const double h = 1e-5;

    rotation_exp_d(f.R, turn);
    fit_project(uv, j, pose, &f, x);
    for (int k = 0; k < 9; k++) {
        for (int side = -1; side < 2; side += 2) {
            struct fit_frame g = f;
            double y[3] = {x[0], x[1], x[2]}, d[3] = {0}, R[9];

            if (k < 3)
                y[k] += side * h;
            else if (k < 6)
                d[k - 3] = side * h;
            else
                g.t[k - 6] += side * h;
            rotation_exp_d(R, d);
            mat3_mul_d(g.R, R, f.R);
            fit_project(side < 0 ? lo : hi, NULL, NULL, &g, y);
        }
        for (int c = 0; c < 2; c++)
            worst = fmax(worst, fabs((hi[c] - lo[c]) / (2 * h) -
                                     (k < 3 ? j[c][k] : pose[c][k - 3])));
    }
    check("projection's derivatives, pixels per unit", worst, 1e-5);
}

/* ---- known people -------------------------------------------------------- */

/* What a frame was made from. */
struct truth {
    double w[ARKIT_COUNT], gaze[2], R[9];
};

/* Frame k's truth and label.  A person's first frame is calm. */
static void make_label(struct truth *t, struct label *l,
                       const struct face_points *p, const struct face_own *o,
                       int k, struct random *r)
{
    struct fit_frame f = {.t = {0, 0, 12}};
    double x[N][3], turn[3], flip[9] = {1, 0, 0, 0, -1, 0, 0, 0, -1}, R[9];
    double pupil[3];

    memset(t, 0, sizeof *t);
    if (k) {
        t->w[ARKIT_JAW_OPENED] = 0.5 * random_uniform(r);
        t->w[ARKIT_MOUTH_SMILE_L] = t->w[ARKIT_MOUTH_SMILE_R] =
            random_uniform(r);
        t->w[ARKIT_EYE_BLINK_L] = t->w[ARKIT_EYE_BLINK_R] =
            random_uniform(r);
        t->w[ARKIT_BROW_OUTER_UP_L] = t->w[ARKIT_BROW_OUTER_UP_R] =
            random_uniform(r);
        t->gaze[0] = 0.15 * random_normal(r);
        t->gaze[1] = 0.2 * random_normal(r);
    }
    for (int s = 0; s < 2; s++) {
        double out = s ? -t->gaze[1] : t->gaze[1];

        t->w[ARKIT_EYE_LOOK_DOWN_L + s] = fmax(t->gaze[0], 0) /
                                          ARKIT_EYE_DOWN;
        t->w[ARKIT_EYE_LOOK_UP_L + s] = fmax(-t->gaze[0], 0) / ARKIT_EYE_UP;
        t->w[ARKIT_EYE_LOOK_OUT_L + s] = fmax(out, 0) / ARKIT_EYE_OUT;
        t->w[ARKIT_EYE_LOOK_IN_L + s] = fmax(-out, 0) / ARKIT_EYE_IN;
    }
    for (int c = 0; c < 3; c++)
        turn[c] = (k ? 0.2 : 0.02) * random_normal(r);
    rotation_exp_d(R, turn);
    mat3_mul_d(t->R, flip, R);
    memcpy(f.R, t->R, sizeof f.R);
    face_points_pose(x, p, o, t->w);
    for (int i = 0; i < N; i++)
        fit_project(l->at[i], NULL, NULL, &f, x[i]);
    for (int s = 0; s < 2; s++) {
        face_pupil(pupil, o, s, t->gaze[0], t->gaze[1]);
        fit_project(l->at[landmark_iris[s]], NULL, NULL, &f, pupil);
    }
    /* as the labels know them: blinks to 0.67, no gaze */
    for (int i = 0; i < ARKIT_COUNT; i++)
        l->blend[i] = t->w[i] / (i == ARKIT_EYE_BLINK_L ||
                                 i == ARKIT_EYE_BLINK_R ? 1.5 :
                                 i == ARKIT_JAW_OPENED ? 1.25 : 1.1);
}

static void test_recovery(const struct face_points *p)
{
    static struct label label[PEOPLE * FRAMES];
    static struct truth truth[PEOPLE * FRAMES];
    static struct face_own o;
    struct labels l = {label, PEOPLE * FRAMES, PEOPLE, PEOPLE};
    struct face_fit f;
    struct error err = {0};
    struct random r;
    double beta[FACE_SHAPES], jaw = 0, lid = 0, smile = 0, gaze = 0, turn = 0;

    random_init(&r, 7, "fit recovery");
    for (int i = 0; i < PEOPLE; i++) {
        for (int k = 0; k < FACE_SHAPES; k++)
            beta[k] = 0.5 * random_normal(&r);
        face_points_fold(&o, p, beta);
        for (int k = 0; k < FRAMES; k++) {
            struct label *a = &label[i * FRAMES + k];

            a->person = a->clip = (size_t)i;
            a->frame = (uint64_t)k;
            make_label(&truth[i * FRAMES + k], a, p, &o, k, &r);
        }
    }
    REQUIRE(!face_fit_init(&f, p, &l, &err), "%s", err.text);
    for (int i = 0; i < ROUNDS; i++)
        REQUIRE(!face_fit_round(&f, &err), "%s", err.text);
    for (size_t i = 0; i < f.count; i++) {
        const struct fit_frame *a = &f.frame[i];
        const struct truth *t = &truth[i];
        double R[9], back[3];

        jaw += fabs(a->w[ARKIT_JAW_OPENED] - t->w[ARKIT_JAW_OPENED]);
        lid += fabs(a->w[ARKIT_EYE_BLINK_L] - t->w[ARKIT_EYE_BLINK_L]);
        smile += fabs(a->w[ARKIT_MOUTH_SMILE_R] - t->w[ARKIT_MOUTH_SMILE_R]);
        gaze += hypot(a->gaze[0][0] - t->gaze[0], a->gaze[0][1] - t->gaze[1]);
        mat3_mul_nt_d(R, a->R, t->R);
        rotation_log_d(back, R);
        turn += sqrt(back[0] * back[0] + back[1] * back[1] +
                     back[2] * back[2]);
    }
    const double n = (double)f.count, degree = 180 / M_PI;
    check("landmarks, pixels of 384", face_fit_error(&f), 0.3);
    check("jawOpen", jaw / n, 0.02);
    check("eyeBlink", lid / n, 0.12);
    check("mouthSmile", smile / n, 0.02);
    check("gaze, degrees", gaze / n * degree, 4);
    check("turn of the head, degrees", turn / n * degree, 1.5);
    face_fit_release(&f);
}

/* ---- label files --------------------------------------------------------- */

static float landmarks[3][LANDMARK_COUNT][3], blend[3][2];
static uint8_t found[3] = {1, 0, 1};

/* A label file whose landmarks have `points` points; NULL leaves names out. */
static const char *label_file(size_t points, const char *names,
                              const char *columns)
{
    static char path[200];
    const char *meta[] = {"blendshape_names", columns, "names", names, NULL};
    struct st_tensor t[3] = {
        {"landmarks", ST_F32, 3, {3, points, 3}, 9 * points, landmarks},
        {"blendshapes", ST_F32, 2, {3, 2}, 6, blend},
        {"found", ST_U8, 1, {3}, 3, found}
    };
    struct error err = {0};

    if (!names)
        meta[2] = NULL;
    snprintf(path, sizeof path, "/tmp/spid-fit-%ld.safetensors",
             (long)getpid());
    REQUIRE(!st_save(path, t, 3, meta, &err), "%s", err.text);
    return path;
}

static void label_refused(const char *what, const char *path, const char *word)
{
    struct labels l = {0};
    struct error err = {0};
    int rc = labels_read(&l, path, &(struct label_names){0}, &err);

    check_error(what, rc && err.code == EX_DATAERR && strstr(err.text, path) &&
                strstr(err.text, word), &err);
    labels_release(&l);
}

#define NAMES "[\"a/x_1.jpg#0\",\"real/y.mp4#3\",\"a/x_2.jpg#0\"]"
#define COLUMNS "[\"jawOpen\",\"browInnerUp\"]"

static void test_labels(void)
{
    static const char *const pair[1][2] = {{"x_1", "nobody"}};
    const struct label_names except = {{"b/", "real/"}, 2};
    struct labels l = {0};
    struct error err = {0};
    const char *path = label_file(LANDMARK_COUNT, NAMES, COLUMNS);

    blend[0][1] = 0.5f;
    path = label_file(LANDMARK_COUNT, NAMES, COLUMNS);
    check_that("a label file is read",
               !labels_read(&l, path, &except, &err) && l.count == 2);
    check_that("an unknown name in --same is refused",
               labels_sort(&l, pair, 1, &err) && err.code == EX_DATAERR &&
               strstr(err.text, "nobody"));
    check_that("two pictures of one person",
               !labels_sort(&l, NULL, 0, &err) && l.people == 1 &&
               l.clips == 2);
    check_that("a name for both sides counts twice",
               l.label[0].blend[ARKIT_BROW_INNER_UP_L] == 0.5 &&
               l.label[0].blend[ARKIT_BROW_INNER_UP_R] == 0.5);
    labels_release(&l);
    check_that("no labels are refused", labels_sort(&l, NULL, 0, &err) &&
               err.code == EX_DATAERR);
    label_refused("too few points", label_file(300, NAMES, COLUMNS),
                  "landmarks");
    label_refused("no names", label_file(LANDMARK_COUNT, NULL, COLUMNS),
                  "names");
    label_refused("a name without a frame",
                  label_file(LANDMARK_COUNT, "[\"a.jpg\",\"b#1\",\"c#1\"]",
                             COLUMNS), "a.jpg");
    label_refused("foreign blendshapes",
                  label_file(LANDMARK_COUNT, NAMES, "[\"p\",\"q\"]"),
                  "blendshape_names");
    landmarks[2][7][1] = NAN;
    label_refused("a landmark that is not a number",
                  label_file(LANDMARK_COUNT, NAMES, COLUMNS), "landmarks");
    landmarks[2][7][1] = 1e9f;
    label_refused("a landmark far away",
                  label_file(LANDMARK_COUNT, NAMES, COLUMNS), "row 2, point 7");
    REQUIRE(!truncate(path, 5000), "cannot cut a file");
    label_refused("a cut file", path, "");
    unlink(path);
}

int main(void)
{
    struct landmark_map map;
    struct face_points points;
    struct error err = {0};
    struct head head;
    struct scan scan;

    REQUIRE(!head_load(&head, HEAD_NAME, &err), "%s", err.text);
    own_scan(&scan, &map, &head);
    take_landmarks(&map, &head);
    REQUIRE(!face_points_init(&points, &head, &scan, &map, &err), "%s",
            err.text);
    test_normal();
    test_points(&points, &head, &map);
    test_projection();
    test_recovery(&points);
    test_labels();
    face_points_release(&points);
    scan_release(&scan);
    head_release(&head);
    return check_failures != 0;
}
