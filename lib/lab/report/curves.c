/* Motion streams as curves, and their charts. */
#include "lib/lab/report/curves.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/list.h"
#include "lib/lab/eval/motion.h"
#include "lib/head/motion.h"
#include "lib/lab/report/html.h"
#include "lib/stream/records.h"
#include "lib/stream/stream.h"

#define DEGREES (180 / M_PI)
#define CURVES_EXPRESSIONS 6    /* charts of expression components */

void curves_release(struct curves *c)
{
    free(c->time);
    for (int k = 0; k < CURVES; k++)
        free(c->y[k]);
    memset(c, 0, sizeof *c);
}

/* Room for one frame more. */
static int curves_grow(struct curves *c, struct error *err)
{
    struct list_column all[CURVES + 1] = {{&c->time, sizeof *c->time}};

    for (int k = 0; k < CURVES; k++)
        all[k + 1] = (struct list_column){&c->y[k], sizeof *c->y[k]};
    return list_grow_columns(all, CURVES + 1, &c->room, c->n)
               ? error_set(err, EX_OSERR, "out of memory for motion") : 0;
}

/* Numbers of one MOTN record. */
static int curves_add(struct curves *c, const struct record *rec,
                      struct error *err)
{
    size_t nexp = motion_expressions(rec), i = c->n;
    struct motion m;
    double angles[3];

    if (nexp > ARKIT_EXP)
        nexp = 0;
    if (motion_read(&m, rec, nexp, err) || curves_grow(c, err))
        return -1;
    metric_euler_degrees(angles, m.R);
    c->time[i] = rec->time;
    for (int k = 0; k < 3; k++)
        c->y[CURVE_YAW + k][i] = angles[k];
    c->y[CURVE_JAW][i] = metric_jaw_open(m.pose.jaw) * DEGREES;
    c->y[CURVE_LID_LEFT][i] = m.pose.lid[0];
    c->y[CURVE_LID_RIGHT][i] = m.pose.lid[1];
    c->y[CURVE_GAZE_ACROSS][i] =
        0.5 * (m.pose.eye[1] + m.pose.eye[4]) * DEGREES;
    c->y[CURVE_GAZE_UP][i] =
        -0.5 * (m.pose.eye[0] + m.pose.eye[3]) * DEGREES;
    for (size_t k = 0; k < ARKIT_EXP; k++)
        c->y[CURVE_EXP + k][i] = k < nexp ? m.exp[k] : 0;
    c->n++;
    return 0;
}

/* The portrait window that CONF names. */
static void curves_take_window(struct curves *c, const struct record *rec)
{
    size_t bytes;
    const char *text = conf_text(&bytes, rec);
    cJSON *conf = text ? cJSON_ParseWithLength(text, bytes) : NULL;
    const cJSON *w = cJSON_GetObjectItem(conf, "window");
    double v[3] = {0};

    for (int k = 0; k < 3; k++) {
        const cJSON *x = cJSON_GetArrayItem(w, k);

        v[k] = cJSON_IsNumber(x) ? x->valuedouble : 0;
    }
    c->has_window = v[2] >= 1 && v[2] <= 100000 && isfinite(v[0]) &&
                    isfinite(v[1]);
    c->window = (struct square){v[0], v[1], v[2]};
    cJSON_Delete(conf);
}

/* CONF and MOTN. */
static int curves_take(const struct record *rec, void *curves,
                       struct error *err)
{
    if (record_is(rec, RECORD_CONF))
        curves_take_window(curves, rec);
    return record_is(rec, RECORD_MOTN) ? curves_add(curves, rec, err) : 0;
}

/* Up to the first motion. */
static int curves_take_first(const struct record *rec, void *curves,
                             struct error *err)
{
    const int rc = curves_take(rec, curves, err);

    return rc == 0 && record_is(rec, RECORD_MOTN) ? 1 : rc;
}

int curves_read(struct curves *c, const char *path, bool first,
                struct error *err)
{
    memset(c, 0, sizeof *c);
    return stream_load(path, first ? curves_take_first : curves_take, c,
                       err) < 0 ? -1 : 0;
}

/* ---- charts ------------------------------------------------------------- */

/* Mean |a - b| of n values; b of one value when still is set. */
static double curves_difference(const double *a, const double *b, size_t n,
                                bool still)
{
    double sum = 0;

    for (size_t i = 0; i < n; i++)
        sum += fabs(a[i] - b[still ? 0 : i]);
    return n ? sum / (double)n : 0;
}

/* What the curves say, in a line under them. */
static void curves_write_figures(FILE *f, const double *driver,
                                 const double *result, const double *still,
                                 size_t n, const char *unit)
{
    fputs("<p class=\"figures\">", f);
    if (result) {
        double r = metric_correlation(driver, result, n);

        fprintf(f, "Result: mean difference %.3g%s",
                curves_difference(driver, result, n, false), unit);
        if (isfinite(r))
            fprintf(f, ", correlation %.2f", r);
        fputs(". ", f);
    }
    if (still)
        fprintf(f, "Null line: mean difference %.3g%s.",
                curves_difference(driver, still, n, true), unit);
    fputs("</p>\n", f);
}

/* The motions that a chart is of. */
struct comparison {
    const struct curves *driver, *result, *truth, *still;
};

/* One quantity of all of them. */
static void curves_chart(FILE *f, const struct comparison *c, int k,
                         const char *title, const char *unit)
{
    struct html_curve curve[4];
    const size_t n = c->driver->n;
    size_t count = 0;
    double *flat = malloc((n + 1) * sizeof *flat);

    curve[count++] = (struct html_curve){"driver", c->driver->y[k]};
    if (c->result->n >= n)
        curve[count++] = (struct html_curve){"result", c->result->y[k]};
    if (c->truth->n >= n)
        curve[count++] = (struct html_curve){"truth", c->truth->y[k]};
    if (flat && c->still->n) {
        for (size_t i = 0; i < n; i++)
            flat[i] = c->still->y[k][0];
        curve[count++] = (struct html_curve){"null line", flat};
    }
    fputs("<div class=\"part\">", f);
    html_chart(f, title, c->driver->time, n, curve, count);
    curves_write_figures(f, c->driver->y[k],
                         c->result->n >= n ? c->result->y[k] : NULL,
                         c->still->n ? c->still->y[k] : NULL, n, unit);
    fputs("</div>\n", f);
    free(flat);
}

/* How much the driver moves component k: its standard deviation. */
static double curves_spread(const struct curves *c, int k)
{
    double mean = 0, sum = 0;

    for (size_t i = 0; i < c->n; i++)
        mean += c->y[k][i] / (double)c->n;
    for (size_t i = 0; i < c->n; i++)
        sum += (c->y[k][i] - mean) * (c->y[k][i] - mean);
    return c->n ? sqrt(sum / (double)c->n) : 0;
}

/* The components that the driver moves most, the largest first. */
static void curves_write_expressions(FILE *f, const struct comparison *c)
{
    bool done[ARKIT_EXP] = {false};

    for (int turn = 0; turn < CURVES_EXPRESSIONS; turn++) {
        double max = 1e-3;
        int best = -1;
        char title[64];

        for (int k = 0; k < ARKIT_EXP; k++) {
            double s = done[k] ? 0 : curves_spread(c->driver, CURVE_EXP + k);

            if (s > max) {
                max = s;
                best = k;
            }
        }
        if (best < 0)
            return;
        done[best] = true;
        if (arkit_name(best))
            snprintf(title, sizeof title, "Expression %d, ARKit's %s",
                     best + 1, arkit_name(best));
        else
            snprintf(title, sizeof title, "Expression %d", best + 1);
        curves_chart(f, c, CURVE_EXP + best, title, "");
    }
}

void curves_write(FILE *f, const struct curves *driver,
                  const struct curves *result, const struct curves *truth,
                  const struct curves *still)
{
    static const struct {
        int k;
        const char *title, *unit;
    } part[] = {{CURVE_YAW, "Yaw, degrees", "\302\260"},
                {CURVE_PITCH, "Pitch, degrees", "\302\260"},
                {CURVE_ROLL, "Roll, degrees", "\302\260"},
                {CURVE_JAW, "Jaw, degrees open", "\302\260"},
                {CURVE_LID_LEFT, "Left lid, 0 open to 1 closed", ""},
                {CURVE_LID_RIGHT, "Right lid, 0 open to 1 closed", ""},
                {CURVE_GAZE_ACROSS, "Gaze across, degrees", "\302\260"},
                {CURVE_GAZE_UP, "Gaze up, degrees", "\302\260"}};
    const struct comparison c = {driver, result, truth, still};

    fputs("<div class=\"charts\">\n", f);
    for (size_t i = 0; i < sizeof part / sizeof *part; i++)
        curves_chart(f, &c, part[i].k, part[i].title, part[i].unit);
    curves_write_expressions(f, &c);
    fputs("</div>\n", f);
}
