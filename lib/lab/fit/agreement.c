/* Measures of labels and of the fitted head beside each other; correlation and
 * slope of what varies within a clip. */
#include "lib/lab/fit/agreement.h"

#include <math.h>
#include <string.h>
#include <sysexits.h>

#define AGREEMENT_MIN 8         /* frames that say something */

enum { MEASURES = 10, MEASURE_GAZE = 6 };

static const char *const agreement_name[MEASURES] = {
    "mouth", "width", "lid_l", "lid_r", "brow_l", "brow_r", "gaze_x_l",
    "gaze_x_r", "gaze_y_l", "gaze_y_r"
};

/* A brow's upper row. */
static const int agreement_brow[2][5] = {
    {300, 293, 334, 296, 336}, {70, 63, 105, 66, 107}
};

/* From the middle of an eye's corners to the mean of n points, along d, as a
 * share of the distance between the eyes' outer corners. */
static double agreement_over(const double (*at)[2], int side, const int *point,
                             int n, const double d[2], double unit)
{
    double sum = 0;

    for (int c = 0; c < 2; c++) {
        double to = 0;

        for (int i = 0; i < n; i++)
            to += at[point[i]][c] / n;
        for (int i = 0; i < 2; i++)
            to -= at[landmark_corner[side][i]][c] / 2;
        sum += to * d[c] / unit;
    }
    return sum;
}

/* The measures of landmarks at (478). */
static void agreement_measure(double m[MEASURES], const double (*at)[2])
{
    double across[2], down[2], unit;

    for (int c = 0; c < 2; c++)
        across[c] = at[263][c] - at[33][c];
    unit = fmax(hypot(across[0], across[1]), 1e-6);
    for (int c = 0; c < 2; c++)
        across[c] /= unit;
    down[0] = -across[1];
    down[1] = across[0];
    m[0] = ((at[14][0] - at[13][0]) * down[0] +
            (at[14][1] - at[13][1]) * down[1]) / unit;
    m[1] = hypot(at[61][0] - at[291][0], at[61][1] - at[291][1]) / unit;
    for (int side = 0; side < 2; side++) {
        const int *iris = &landmark_iris[side];

        m[2 + side] = fit_lid_gap(at, side, down);
        m[4 + side] = agreement_over(at, side, agreement_brow[side], 5, down,
                                     unit);
        m[6 + side] = agreement_over(at, side, iris, 1, across, unit);
        m[8 + side] = agreement_over(at, side, iris, 1, down, unit);
    }
}

/* Sums of a pair of measures. */
struct agreement_sums {
    double n, x, y, xx, xy, yy;
};

/* Sums from which mean, spread and correlation follow. */
static void agreement_add(struct agreement_sums *s, double x, double y)
{
    s->n += 1;
    s->x += x;
    s->y += y;
    s->xx += x * x;
    s->xy += x * y;
    s->yy += y * y;
}

/* Correlation and slope of y over x. */
static void agreement_print(FILE *out, const struct agreement_sums *s)
{
    double n = fmax(s->n, 1);
    double xx = s->xx - s->x * s->x / n, yy = s->yy - s->y * s->y / n;
    double xy = s->xy - s->x * s->y / n;

    if (s->n < AGREEMENT_MIN || xx <= 0 || yy <= 0)
        fprintf(out, "\t\t");
    else
        fprintf(out, "\t%.3f\t%.2f", xy / sqrt(xx * yy), xy / xx);
}

/* A clip's line: frames first .. first+n. */
static void agreement_line(FILE *out, const struct face_fit *f, size_t first,
                           size_t n, const char *name)
{
    struct agreement_sums s[MEASURES] = {{0}};
    double uv[LANDMARK_COUNT][2], a[MEASURES], b[MEASURES];

    for (size_t k = first; k < first + n; k++) {
        const struct fit_frame *frame = &f->frame[k];

        face_fit_landmarks(uv, f, k);
        agreement_measure(a, (const double (*)[2])frame->at);
        agreement_measure(b, (const double (*)[2])uv);
        for (int i = 0; i < MEASURES; i++)
            if (i < MEASURE_GAZE || frame->closed[i % 2] < 0.5)
                agreement_add(&s[i], a[i], b[i]);
    }
    fprintf(out, "%s\t%zu", name, n);
    for (int i = 0; i < MEASURES; i++)
        agreement_print(out, &s[i]);
    fputc('\n', out);
}

int agreement_write(FILE *out, const struct face_fit *f, struct error *err)
{
    fprintf(out, "clip\tframes");
    for (int i = 0; i < MEASURES; i++)
        fprintf(out, "\t%s\tslope", agreement_name[i]);
    fputc('\n', out);
    for (size_t i = 0, n; i < f->count; i += n) {
        const struct label *l = f->frame[i].label;

        for (n = 1; i + n < f->count && f->frame[i + n].label->clip == l->clip;
             n++)
            ;
        if (n >= AGREEMENT_MIN)
            agreement_line(out, f, i, n, l->file);
    }
    agreement_line(out, f, 0, f->count, "all");
    if (fflush(out) || ferror(out))
        return error_set(err, EX_IOERR, "cannot write the table");
    return 0;
}
