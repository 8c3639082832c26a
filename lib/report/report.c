/* spid-report: what a folder of a run holds, as one HTML page; what is not
 * there is named as missing. */
#include "lib/report/report.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>

#include "formats/image.h"
#include "lib/metric/motion.h"
#include "lib/record/motion.h"
#include "lib/report/clips.h"
#include "lib/report/html.h"
#include "lib/stream/stream.h"

/* ---- pictures ----------------------------------------------------------- */

/* A line in place of a part whose file is not in the run. */
static void write_missing(FILE *f, const char *name)
{
    fputs("<p><em>", f);
    html_text(f, name);
    fputs(": not in this run</em></p>\n", f);
}

/* The frames kept of it, in a row. */
static int show_clip(FILE *f, const struct clip *c, struct error *err)
{
    int rc = 0;

    html_row(f);
    for (size_t i = 0; !rc && i < c->count; i++) {
        char caption[40];

        snprintf(caption, sizeof caption, "frame %zu", c->index[i]);
        rc = html_picture(f, c->rgb[i], c->width, c->height, caption, err);
    }
    html_row_end(f);
    return rc;
}

/* |a - b| times four, so that small errors are seen. */
static int show_errors(FILE *f, const struct clip *a, const struct clip *b,
                       struct error *err)
{
    size_t n = a->width * a->height * 3;
    uint8_t *map = malloc(n + 1);
    int rc = map ? 0 : error_set(err, EX_OSERR, "out of memory");

    html_section(f, "Error maps", "Absolute difference of driver and result, "
                 "times four: meaningful where both show one person.");
    html_row(f);
    for (size_t i = 0; !rc && i < a->count && i < b->count; i++) {
        char caption[64];
        double sum = 0;

        for (size_t k = 0; k < n; k++) {
            int d = abs(a->rgb[i][k] - b->rgb[i][k]);

            sum += d;
            map[k] = (uint8_t)(d > 63 ? 255 : 4 * d);
        }
        snprintf(caption, sizeof caption, "frame %zu, mean %.1f of 255",
                 a->index[i], sum / (double)(n ? n : 1));
        rc = html_picture(f, map, a->width, a->height, caption, err);
    }
    html_row_end(f);
    free(map);
    return rc;
}

/* Driver, results and branches, each with its frames side by side. */
static int write_clips(FILE *f, const char *dir, struct error *err)
{
    static const struct {
        const char *name, *title;
    } part[] = {{"driver", "Driver"}, {"avatar", "Result (SpiD)"},
                {"star", "Result without refiner (SpiD*)"},
                {"dynamic", "Dynamic branch alone"},
                {"static", "Static branch alone"},
                {"mouth", "Mouth branch alone"}};
    struct clip driver = {0}, result = {0};
    char path[4096];
    int rc = 0;

    for (size_t i = 0; !rc && i < sizeof part / sizeof *part; i++) {
        struct clip other = {0};
        struct clip *c = i == 0 ? &driver : i == 1 ? &result : &other;

        html_section(f, part[i].title, NULL);
        if (run_find(path, sizeof path, dir, part[i].name)) {
            rc = clip_read(c, path, err);
            if (!rc)
                rc = show_clip(f, c, err);
        } else {
            write_missing(f, part[i].name);
        }
        clip_release(&other);
    }
    if (!rc && driver.count && driver.width == result.width &&
        driver.height == result.height)
        rc = show_errors(f, &driver, &result, err);
    clip_release(&driver);
    clip_release(&result);
    return rc;
}

/* The photograph. */
static int write_source(FILE *f, const char *dir, struct error *err)
{
    struct image im;
    char path[4096];
    int rc;

    html_section(f, "Source", NULL);
    if (!run_find(path, sizeof path, dir, "source")) {
        write_missing(f, "source.png");
        return 0;
    }
    if (image_read(&im, path, err))
        return -1;
    html_row(f);
    rc = html_picture(f, im.rgb, im.width, im.height, "source", err);
    html_row_end(f);
    image_release(&im);
    return rc;
}

/* ---- motion curves ------------------------------------------------------ */

enum { YAW, PITCH, ROLL, JAW, LID_LEFT, LID_RIGHT, CURVES };

struct motion_curves {
    size_t n, room;
    double *time;
    double *y[CURVES];
};

static void curves_release(struct motion_curves *m)
{
    free(m->time);
    for (int k = 0; k < CURVES; k++)
        free(m->y[k]);
    memset(m, 0, sizeof *m);
}

/* Room for one frame more. */
static int curves_grow(struct motion_curves *m)
{
    size_t room = m->room ? 2 * m->room : 256;
    double *t;

    if (m->n < m->room)
        return 0;
    if (!(t = realloc(m->time, room * sizeof *t)))
        return -1;
    m->time = t;
    for (int k = 0; k < CURVES; k++) {
        if (!(t = realloc(m->y[k], room * sizeof *t)))
            return -1;
        m->y[k] = t;
    }
    m->room = room;
    return 0;
}

/* Angles, jaw and lids of one MOTN record. */
static int curves_add(struct motion_curves *m, const struct record *rec,
                      struct error *err)
{
    struct motion now;
    double angles[3];

    if (motion_read(&now, rec, 0, err))
        return -1;
    if (curves_grow(m))
        return error_set(err, EX_OSERR, "out of memory for %zu frames",
                         m->n);
    metric_euler_degrees(angles, now.R);
    m->time[m->n] = rec->time;
    for (int k = 0; k < 3; k++)
        m->y[YAW + k][m->n] = angles[k];
    m->y[JAW][m->n] = metric_jaw_open(now.pose.jaw);
    m->y[LID_LEFT][m->n] = now.pose.lid[0];
    m->y[LID_RIGHT][m->n] = now.pose.lid[1];
    m->n++;
    return 0;
}

/* Those of every MOTN record of a stream. */
static int curves_read(struct motion_curves *m, const char *path,
                       struct error *err)
{
    struct stream_options opt = {0};
    struct stream_reader *r = stream_open(path, &opt, err);
    struct record rec;
    int rc = r ? 1 : -1;

    while (rc > 0 && (rc = stream_read(r, &rec, err)) > 0)
        if (record_is(&rec, "MOTN") && curves_add(m, &rec, err))
            rc = -1;
    stream_close(r);
    return rc;
}

/* What the encoder saw, as curves over time. */
static int write_motion(FILE *f, const char *dir, const char *file,
                        const char *title, struct error *err)
{
    struct motion_curves m = {0};
    char path[4096];
    int rc = 0;

    html_section(f, title, NULL);
    if (!run_find(path, sizeof path, dir, file)) {
        write_missing(f, file);
        return 0;
    }
    rc = curves_read(&m, path, err);
    if (!rc) {
        const struct html_curve pose[] = {{"yaw", m.y[YAW]},
                                          {"pitch", m.y[PITCH]},
                                          {"roll", m.y[ROLL]}};
        const struct html_curve face[] = {{"jaw (rad)", m.y[JAW]},
                                          {"left lid", m.y[LID_LEFT]},
                                          {"right lid", m.y[LID_RIGHT]}};

        html_chart(f, "Head pose in degrees", "s", m.time, m.n, pose, 3);
        html_chart(f, "Jaw and eyelids", "s", m.time, m.n, face, 3);
    }
    curves_release(&m);
    return rc;
}

/* ---- times and figures -------------------------------------------------- */

/* stats.tsv: stage, calls, then times in ms with a header line naming them;
 * the median is shown. */
static int write_times(FILE *f, const char *dir)
{
    enum { MOST = 40 };
    char path[4096], line[512], names[MOST][64];
    const char *name[MOST];
    double value[MOST];
    size_t n = 0;
    int column = -1;
    FILE *in = NULL;

    html_section(f, "Latency per frame", "Medians, from --stats.");
    if (run_find(path, sizeof path, dir, "stats.tsv"))
        in = fopen(path, "r");
    if (!in) {
        write_missing(f, "stats.tsv");
        return 0;
    }
    while (n < MOST && fgets(line, sizeof line, in)) {
        char *save = NULL, *cell = strtok_r(line, "\t\n", &save);

        for (int k = 0; cell; k++, cell = strtok_r(NULL, "\t\n", &save)) {
            if (!strncmp(cell, "median", 6))
                column = k;
            else if (k == 0)
                snprintf(names[n], sizeof names[n], "%s", cell);
            else if (k == column) {
                name[n] = names[n];
                value[n++] = strtod(cell, NULL);
                break;
            }
        }
    }
    fclose(in);
    html_bars(f, "Stages", "ms", name, value, n);
    return 0;
}

/* Numbers of a JSON object, nested names joined by dots. */
static void write_numbers(FILE *f, const cJSON *j, const char *prefix)
{
    for (j = j ? j->child : NULL; j; j = j->next) {
        char name[200], value[40];

        snprintf(name, sizeof name, "%s%s%s", prefix, *prefix ? "." : "",
                 j->string ? j->string : "");
        if (cJSON_IsNumber(j)) {
            snprintf(value, sizeof value, "%.4g", j->valuedouble);
            html_table_row(f, (const char *const[]){name, value}, 2);
        } else if (cJSON_IsObject(j)) {
            write_numbers(f, j, name);
        }
    }
}

/* A file of at most a megabyte as text; "" when it cannot be opened. */
static char *read_small(const char *path)
{
    enum { MOST = 1 << 20 };
    FILE *in = fopen(path, "r");
    char *text = malloc(MOST + 1);

    if (in && text)
        text[fread(text, 1, MOST, in)] = 0;
    if (in)
        fclose(in);
    else if (text)
        *text = 0;
    return text;
}

/* The table of spid-eval's JSON. */
static int write_metrics(FILE *f, const char *dir, struct error *err)
{
    char path[4096];

    html_section(f, "Metrics", "As defined in spid-eval(1).");
    if (!run_find(path, sizeof path, dir, "metrics.json")) {
        write_missing(f, "metrics.json");
        return 0;
    }
    char *text = read_small(path);
    cJSON *j = text ? cJSON_Parse(text) : NULL;
    free(text);
    if (!j)
        return error_set(err, EX_DATAERR, "%s: not JSON", path);
    html_table_begin(f, (const char *const[]){"figure", "value"}, 2);
    write_numbers(f, j, "");
    html_table_end(f);
    cJSON_Delete(j);
    return 0;
}

int report_write(FILE *f, const char *dir, struct error *err)
{
    struct stat sb;

    if (stat(dir, &sb))
        return error_set(err, EX_NOINPUT, "%s: %s", dir, strerror(errno));
    if (!S_ISDIR(sb.st_mode))
        return error_set(err, EX_NOINPUT, "%s: not a folder", dir);
    html_begin(f, "SpiD run");
    if (write_source(f, dir, err) || write_clips(f, dir, err) ||
        write_motion(f, dir, "motion.spid", "Motion", err) ||
        write_motion(f, dir, "truth.spid", "True motion", err) ||
        write_times(f, dir) || write_metrics(f, dir, err))
        return -1;
    html_end(f);
    return 0;
}
