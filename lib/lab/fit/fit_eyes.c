/* Gaze and lids of a frame. */
#include <math.h>
#include <string.h>

#include "lib/lab/fit/face_fit.h"
#include "lib/lab/fit/normal.h"

#define FIT_DEGREE (M_PI / 180)
#define FIT_IRIS 0.8            /* pixels that an iris' centre may be off */
#define FIT_TOGETHER_UP (0.7 * FIT_DEGREE)      /* eyes apart, up and down */
#define FIT_TOGETHER_SIDE (2 * FIT_DEGREE)      /* and to the sides */
#define FIT_WANDER (12 * FIT_DEGREE)    /* from half way to the camera */
#define FIT_IRIS_OWN 0.5        /* share of an iris offset that is the
                                 * person's own: the rest is gaze */
#define FIT_SHUT 0.03           /* gap of closed lids in the labels, of the
                                 * eye's width */

/* ---- gaze ---------------------------------------------------------------- */

/* Pitch and yaw of an eye that looks into the camera. */
static void fit_to_camera(double gaze[2], const struct fit_frame *frame)
{
    double d[3], length = 0;

    for (int i = 0; i < 3; i++) {
        d[i] = -(frame->R[i] * frame->t[0] + frame->R[3 + i] * frame->t[1] +
                 frame->R[6 + i] * frame->t[2]);
        length += d[i] * d[i];
    }
    gaze[0] = -asin(d[1] / sqrt(length));
    gaze[1] = atan2(d[0], d[2]);
}

/* From the pupil's pixel to the label's iris, and the derivative of the
 * pixel by the head's x and y there. */
static void fit_iris_miss(double miss[2], double j[2][3],
                          const struct fit_person *p,
                          const struct fit_frame *frame, int side,
                          const double gaze[2])
{
    double x[3], uv[2];

    face_pupil(x, &p->face, side, gaze[0], gaze[1]);
    fit_project(uv, j, NULL, frame, x);
    for (int c = 0; c < 2; c++)
        miss[c] = frame->at[landmark_iris[side]][c] - uv[c];
}

/* What the iris is off on a person who is taken to look into the camera when
 * calm. */
static void fit_iris_person(double iris[2][2], const struct face_fit *f,
                            const struct fit_person *p)
{
    double a[2][4] = {{0}}, b[2][2] = {{0}}, gaze[2], miss[2], j[2][3];

    for (size_t k = 0; k < p->count; k++) {
        const struct fit_frame *frame = &f->frame[p->first + k];

        fit_to_camera(gaze, frame);
        for (int side = 0; frame->calm && side < 2; side++) {
            struct normal e = {2, a[side], b[side]};

            fit_iris_miss(miss, j, p, frame, side, gaze);
            for (int c = 0; c < 2; c++)
                normal_add(&e, j[c], 1, miss[c]);
        }
    }
    for (int side = 0; side < 2; side++) {
        struct normal e = {2, a[side], b[side]};

        normal_solve(iris[side], &e);
    }
}

void fit_iris(struct face_fit *f)
{
    double mean[2][2] = {{0}};

    for (size_t k = 0; k < f->people; k++) {
        struct fit_person *p = &f->person[k];

        fit_iris_person(p->iris, f, p);
        for (int i = 0; i < 4; i++)
            mean[i / 2][i % 2] += p->iris[i / 2][i % 2] / (double)f->people;
    }
    for (size_t k = 0; k < f->people; k++)
        for (int i = 0; i < 4; i++) {
            double *own = &f->person[k].iris[i / 2][i % 2];
            double all = mean[i / 2][i % 2];

            *own = all + FIT_IRIS_OWN * (*own - all);
        }
}

/* Unknowns are the four angles; rows of one eye's iris. */
static void fit_gaze_rows(struct normal *e, const struct fit_person *p,
                          const struct fit_frame *frame, int side)
{
    const double step = 1e-4, *g = frame->gaze[side];
    double seen = fmin(fmax((0.85 - frame->closed[side]) / 0.3, 0.02), 1);
    double sigma = FIT_IRIS / seen, miss[2], j[2][3], slope[2][2];

    for (int k = 0; k < 2; k++) {
        double plus[2] = {g[0], g[1]}, minus[2] = {g[0], g[1]}, m[2];

        plus[k] += step;
        minus[k] -= step;
        fit_iris_miss(miss, j, p, frame, side, plus);
        fit_iris_miss(m, j, p, frame, side, minus);
        for (int c = 0; c < 2; c++)
            slope[c][k] = (m[c] - miss[c]) / (2 * step);
    }
    fit_iris_miss(miss, j, p, frame, side, g);
    for (int c = 0; c < 2; c++) {
        double row[4] = {0};

        row[2 * side] = slope[c][0];
        row[2 * side + 1] = slope[c][1];
        miss[c] -= j[c][0] * p->iris[side][0] + j[c][1] * p->iris[side][1];
        normal_add(e, row, 1 / (sigma * sigma),
                   miss[c] + slope[c][0] * g[0] + slope[c][1] * g[1]);
    }
}

/* The angles as ARKit's weights. */
static void fit_gaze_weights(struct fit_frame *frame)
{
    for (int side = 0; side < 2; side++) {
        double *w = frame->w + side, down = frame->gaze[side][0];
        double out = side ? -frame->gaze[side][1] : frame->gaze[side][1];

        w[ARKIT_EYE_LOOK_DOWN_L] = fmax(down, 0) / ARKIT_EYE_DOWN;
        w[ARKIT_EYE_LOOK_UP_L] = fmax(-down, 0) / ARKIT_EYE_UP;
        w[ARKIT_EYE_LOOK_OUT_L] = fmax(out, 0) / ARKIT_EYE_OUT;
        w[ARKIT_EYE_LOOK_IN_L] = fmax(-out, 0) / ARKIT_EYE_IN;
    }
}

void fit_gaze(const struct fit_person *p, struct fit_frame *frame)
{
    static const double apart[2][4] = {{1, 0, -1, 0}, {0, 1, 0, -1}};
    double a[20], x[4], ahead[2];
    struct normal e = {4, a, a + 16};

    fit_to_camera(ahead, frame);
    for (int round = 0; round < 3; round++) {
        normal_clear(&e);
        for (int side = 0; side < 2; side++)
            fit_gaze_rows(&e, p, frame, side);
        normal_add(&e, apart[0], pow(FIT_TOGETHER_UP, -2), 0);
        normal_add(&e, apart[1], pow(FIT_TOGETHER_SIDE, -2), 0);
        for (size_t k = 0; k < 4; k++)
            normal_prior(&e, k, pow(FIT_WANDER, -2), ahead[k % 2] / 2);
        normal_solve(x, &e);
        memcpy(frame->gaze, x, sizeof frame->gaze);
    }
    fit_gaze_weights(frame);
}

/* ---- lids ---------------------------------------------------------------- */

/* The fit's gap with lid and wide as given. */
static double fit_own_gap(const struct face_fit *f, const struct fit_person *p,
                          struct fit_frame *frame, int side, double lid,
                          double wide, const double down[2])
{
    double x[LANDMARK_FACE][3], uv[LANDMARK_FACE][2];

    frame->w[ARKIT_EYE_BLINK_L + side] = lid;
    frame->w[ARKIT_EYE_WIDE_L + side] = wide;
    fit_points(x, f, p, frame);
    for (int i = 0; i < LANDMARK_FACE; i++)
        fit_project(uv[i], NULL, NULL, frame, x[i]);
    return fit_lid_gap((const double (*)[2])uv, side, down);
}

void fit_lids(const struct face_fit *f, const struct fit_person *p,
              struct fit_frame *frame)
{
    double down[2] = {-frame->R[1], -frame->R[4]};
    double length = fmax(hypot(down[0], down[1]), 1e-6);

    down[0] /= length;
    down[1] /= length;
    for (int side = 0; side < 2; side++) {
        double gap = fit_lid_gap((const double (*)[2])frame->at, side, down);
        double open = fit_own_gap(f, p, frame, side, 0, 0, down), wide = 0;
        double lid = 0;

        if (gap <= open)
            lid = 1 - fmax(gap - FIT_SHUT, 0) / fmax(open - FIT_SHUT, 0.02);
        else
            wide = (gap - open) /
                   fmax(fit_own_gap(f, p, frame, side, 0, 1, down) - open,
                        0.02);
        frame->w[ARKIT_EYE_BLINK_L + side] = fmin(fmax(lid, 0), 1);
        frame->w[ARKIT_EYE_WIDE_L + side] = fmin(wide, 1);
    }
}
