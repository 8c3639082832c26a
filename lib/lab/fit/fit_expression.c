/* A frame's expression under its camera. */
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/lab/fit/face_fit.h"
#include "lib/lab/fit/normal.h"

#define N LANDMARK_FACE
#define FIT_FREE (ARKIT_COUNT - 10)     /* lids and gaze are fitted apart */
#define FIT_SIGMA 2.0           /* pixels of a point */
#define FIT_LIPS 0.6            /* of a gap or a width of the lips */
#define FIT_BROWS 0.2           /* of the brows' height */
#define FIT_MAX 1.2             /* largest weight */

/* Component of unknown i: those before the lids and after the gaze. */
static int fit_component(size_t i)
{
    return (int)i + (i < ARKIT_EYE_BLINK_L ? 0 : 10);
}

/* How far a weight may be from what the blendshapes say: they never show some,
 * and hardly measure brows. */
static double fit_prior_sigma(int k)
{
    if (k <= ARKIT_BROW_OUTER_UP_R)
        return 0.5;
    if (k <= ARKIT_CHEEK_SQUINT_R || k == ARKIT_JAW_FORWARD ||
        k == ARKIT_JAW_LEFT || k == ARKIT_JAW_RIGHT ||
        k == ARKIT_MOUTH_FROWN_L || k == ARKIT_MOUTH_FROWN_R ||
        k >= ARKIT_NOSE_SNEER_L)
        return 0.08;
    return k == ARKIT_JAW_OPENED ? 0.3 : 0.18;
}

/* A frame's rows: derivatives of its landmarks' pixels by the unknowns, and
 * what is missing from the labels. */
struct fit_rows {
    double g[N][2][FIT_FREE], r[N][2];
};

/* The residual of every point, and how it moves with each free weight. */
static void fit_rows_fill(struct fit_rows *s, const struct face_fit *f,
                          const struct fit_person *p,
                          const struct fit_frame *frame)
{
    double x[N][3], d[N][3], j[N][2][3], uv[2];

    fit_points(x, f, p, frame);
    for (int i = 0; i < N; i++) {
        fit_project(uv, j[i], NULL, frame, x[i]);
        for (int c = 0; c < 2; c++)
            s->r[i][c] = frame->at[i][c] - uv[c];
    }
    for (size_t k = 0; k < FIT_FREE; k++) {
        face_points_slope(d, f->points, &p->face, frame->w, fit_component(k));
        for (int i = 0; i < N; i++)
            for (int c = 0; c < 2; c++)
                s->g[i][c][k] = j[i][c][0] * d[i][0] + j[i][c][1] * d[i][1] +
                                j[i][c][2] * d[i][2];
    }
}

/* A span's row, axis c. */
static double fit_span_row(double *g, const struct fit_rows *s,
                           const struct landmark_span *span, int c)
{
    double r = 0;

    memset(g, 0, FIT_FREE * sizeof *g);
    for (int i = 0; i < span->nfrom + span->nto; i++) {
        bool from = i < span->nfrom;
        int at = from ? span->from[i] : span->to[i - span->nfrom];
        double share = from ? -1.0 / span->nfrom : 1.0 / span->nto;

        for (int k = 0; k < FIT_FREE; k++)
            g[k] += share * s->g[at][c][k];
        r += share * s->r[at][c];
    }
    return r;
}

/* Rows are of changes from the present weights; the unknowns are weights. */
static void fit_add_row(struct normal *e, const double *g, double sigma,
                        double weight, double r,
                        const struct fit_frame *frame)
{
    for (size_t k = 0; k < FIT_FREE; k++)
        r += g[k] * frame->w[fit_component(k)];
    normal_add(e, g, weight / (sigma * sigma), r);
}

int fit_expression(const struct face_fit *f, const struct fit_person *p,
                   struct fit_frame *frame, struct error *err)
{
    struct fit_rows *s = malloc(sizeof *s);
    struct normal e;
    double g[FIT_FREE], x[FIT_FREE];

    if (!s)
        return error_set(err, EX_OSERR, "out of memory");
    if (normal_init(&e, FIT_FREE, err)) {
        free(s);
        return -1;
    }
    fit_rows_fill(s, f, p, frame);
    for (int i = 0; i < N; i++)
        for (int c = 0; c < 2; c++)
            fit_add_row(&e, s->g[i][c], FIT_SIGMA, f->points->weight[i],
                        s->r[i][c], frame);
    for (int i = 0; i < LANDMARK_SPANS; i++)
        for (int c = 0; c < 2; c++) {
            double r = fit_span_row(g, s, &landmark_span[i], c);

            fit_add_row(&e, g, i < SPAN_BROW ? FIT_LIPS : FIT_BROWS, 1, r,
                        frame);
        }
    for (size_t k = 0; k < FIT_FREE; k++) {
        double sigma = fit_prior_sigma(fit_component(k));

        normal_prior(&e, k, 1 / (sigma * sigma),
                     frame->prior[fit_component(k)]);
        x[k] = frame->w[fit_component(k)];
    }
    normal_solve_bounded(x, &e, 0, FIT_MAX, 1e-4);
    for (size_t k = 0; k < FIT_FREE; k++)
        frame->w[fit_component(k)] = x[k];
    normal_release(&e);
    free(s);
    return 0;
}
