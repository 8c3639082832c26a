/* spid-report: what a folder of a run holds, as one HTML page; what is not
 * there is named as missing. */
#include "lib/lab/report/report.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>

#include "formats/image.h"
#include "formats/jsonfile.h"
#include "lib/lab/report/clips.h"
#include "lib/lab/report/curves.h"
#include "lib/lab/report/html.h"
#include "lib/lab/report/pair.h"

/* ---- pictures ----------------------------------------------------------- */

/* A line in place of a part whose file is not in the run. */
static void report_write_missing(FILE *f, const char *name)
{
    fputs("<p><em>", f);
    html_text(f, name);
    fputs(": not in this run</em></p>\n", f);
}

/* The frames kept of it, in a row. */
static int report_show_clip(FILE *f, const struct clip *c, struct error *err)
{
    int rc = 0;

    html_row(f);
    for (size_t i = 0; !rc && i < c->count; i++) {
        char caption[40];

        snprintf(caption, sizeof caption, "frame %zu", c->index[i]);
        rc = html_picture(f, c->frame[i].rgb, c->frame[i].width,
                          c->frame[i].height, caption, err);
    }
    html_row_end(f);
    return rc;
}

/* |a - b| times four, so that small errors are seen. */
static int report_show_errors(FILE *f, const struct clip *a,
                              const struct clip *b, struct error *err)
{
    const struct image *first = &a->frame[0];
    const size_t n = first->width * first->height * 3;
    uint8_t *map = malloc(n + 1);
    int rc = map ? 0 : error_set(err, EX_OSERR, "out of memory");

    html_section(f, "Error maps", "Absolute difference of driver and result, "
                 "times four: meaningful where both show one person.");
    html_row(f);
    for (size_t i = 0; !rc && i < a->count && i < b->count; i++) {
        char caption[64];
        double sum = 0;

        for (size_t k = 0; k < n; k++) {
            int d = abs(a->frame[i].rgb[k] - b->frame[i].rgb[k]);

            sum += d;
            map[k] = (uint8_t)(d > 63 ? 255 : 4 * d);
        }
        snprintf(caption, sizeof caption, "frame %zu, mean %.1f of 255",
                 a->index[i], sum / (double)(n ? n : 1));
        rc = html_picture(f, map, first->width, first->height, caption, err);
    }
    html_row_end(f);
    free(map);
    return rc;
}

/* Driver, results and branches, each with its frames side by side. */
static int report_write_clips(FILE *f, const char *dir, struct error *err)
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
                rc = report_show_clip(f, c, err);
        } else {
            report_write_missing(f, part[i].name);
        }
        clip_release(&other);
    }
    if (!rc && driver.count &&
        driver.frame[0].width == result.frame[0].width &&
        driver.frame[0].height == result.frame[0].height)
        rc = report_show_errors(f, &driver, &result, err);
    clip_release(&driver);
    clip_release(&result);
    return rc;
}

/* The photograph. */
static int report_write_source(FILE *f, const char *dir, struct error *err)
{
    struct image im;
    char path[4096];
    int rc;

    html_section(f, "Source", NULL);
    if (!run_find(path, sizeof path, dir, "source")) {
        report_write_missing(f, "source.png");
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

/* ---- motion ------------------------------------------------------------- */

/* The motions that the folder has. */
struct motions {
    struct curves driver, result, truth, still;
};

/* motion.spid, result.spid, truth.spid; the source's own motion is in the
 * identity or the avatar. */
static int report_motions_read(struct motions *m, const char *dir,
                               struct error *err)
{
    const struct {
        const char *name;
        struct curves *to;
        bool first;
    } part[] = {{"motion.spid", &m->driver, false},
                {"result.spid", &m->result, false},
                {"truth.spid", &m->truth, false},
                {"me.spid", &m->still, true},
                {"avatar.spid", &m->still, true}};
    char path[4096];

    memset(m, 0, sizeof *m);
    for (size_t i = 0; i < sizeof part / sizeof *part; i++)
        if (!part[i].to->n && run_find(path, sizeof path, dir, part[i].name) &&
            curves_read(part[i].to, path, part[i].first, err))
            return -1;
    return 0;
}

/* What the encoder saw in driver and result, as curves over time. */
static void report_write_motion(FILE *f, const struct motions *m)
{
    html_section(f, "Motion: driver against result",
                 "The encoder's view of the driver's frames and of the "
                 "result's.  The null line is the source photograph's own "
                 "motion: what an avatar that does not move would show.  "
                 "Click into a chart to see that moment.");
    if (!m->driver.n) {
        report_write_missing(f, "motion.spid");
        return;
    }
    if (!m->result.n)
        report_write_missing(f, "result.spid");
    if (!m->still.n)
        report_write_missing(f, "me.spid");
    curves_write(f, &m->driver, &m->result, &m->truth, &m->still);
}

/* Both clips over each other. */
static int report_write_wipe(FILE *f, const char *dir, const struct motions *m,
                             struct error *err)
{
    char driver[4096], result[4096];
    struct pair p;

    html_section(f, "Driver and result", NULL);
    if (!run_find(driver, sizeof driver, dir, "driver") ||
        !run_find(result, sizeof result, dir, "avatar")) {
        report_write_missing(f, "driver and avatar");
        return 0;
    }
    if (pair_make(&p, driver, result,
                  m->driver.has_window ? &m->driver.window : NULL, err))
        return -1;
    html_wipe(f, p.mp4, p.bytes, p.size, p.rate);
    pair_release(&p);
    return 0;
}

/* ---- limits -------------------------------------------------------------- */

/* Text without Markdown's marks for code. */
static void card_write_text(FILE *f, char *text)
{
    char *to = text;

    for (const char *p = text; *p; p++)
        if (*p != '`' && *p != '\n')
            *to++ = *p;
    *to = '\0';
    html_text(f, text);
}

/* The list under "## Limits" of the card (Markdown) at path.  0: written; 1: the
 * card has no such section; -1: it cannot be read. */
static int card_write_limits(FILE *f, const char *path, struct error *err)
{
    FILE *in = fopen(path, "r");
    char line[1024];
    bool here = false, item = false;

    if (!in)
        return error_set(err, EX_NOINPUT, "%s: %s", path, strerror(errno));
    while (fgets(line, sizeof line, in)) {
        if (strncmp(line, "## ", 3) == 0) {
            if (here && item)
                break;
            here = strncmp(line, "## Limits", 9) == 0;
        } else if (here && strncmp(line, "- ", 2) == 0) {
            fputs(item ? "</li>\n<li>" : "<ul>\n<li>", f);
            card_write_text(f, line + 2);
            item = true;
        } else if (item && line[strspn(line, " \n")]) {
            fputc(' ', f);
            card_write_text(f, line + strspn(line, " "));
        }
    }
    fclose(in);
    if (item)
        fputs("</li>\n</ul>\n", f);
    return item ? 0 : 1;
}

/* What the model's card says it cannot do. */
static int report_write_limits(FILE *f, const char *card, struct error *err)
{
    html_section(f, "Limits", "What the model's card says:");
    int rc = card ? card_write_limits(f, card, err) : 1;

    if (rc > 0)
        report_write_missing(f, "Limits of a README.md beside the model");
    return rc < 0 ? -1 : 0;
}

/* ---- times and figures -------------------------------------------------- */

/* stats.tsv: stage, calls, then times in ms with a header line naming them;
 * the median is shown. */
static int report_write_times(FILE *f, const char *dir)
{
    char path[4096], line[512];
    int column = -1;
    FILE *in = NULL;

    html_section(f, "Latency per frame", "Medians, from --stats.");
    if (run_find(path, sizeof path, dir, "stats.tsv"))
        in = fopen(path, "r");
    if (!in) {
        report_write_missing(f, "stats.tsv");
        return 0;
    }
    html_table_begin(f, (const char *const[]){"stage", "median"}, 2);
    while (fgets(line, sizeof line, in)) {
        char *save = NULL, *name = strtok_r(line, "\t\n", &save), *cell = name;

        for (int k = 0; cell; k++, cell = strtok_r(NULL, "\t\n", &save)) {
            char value[40];

            if (!strncmp(cell, "median", 6))
                column = k;
            else if (k > 0 && k == column) {
                snprintf(value, sizeof value, "%.3g ms", strtod(cell, NULL));
                html_table_row(f, (const char *const[]){name, value}, 2);
            }
        }
    }
    fclose(in);
    html_table_end(f);
    return 0;
}

/* Numbers of a JSON object, nested names joined by dots. */
static void report_write_numbers(FILE *f, const cJSON *j, const char *prefix)
{
    for (j = j ? j->child : NULL; j; j = j->next) {
        char name[200], value[40];

        snprintf(name, sizeof name, "%s%s%s", prefix, *prefix ? "." : "",
                 j->string ? j->string : "");
        if (cJSON_IsNumber(j)) {
            snprintf(value, sizeof value, "%.4g", j->valuedouble);
            html_table_row(f, (const char *const[]){name, value}, 2);
        } else if (cJSON_IsObject(j)) {
            report_write_numbers(f, j, name);
        }
    }
}

/* The table of spid-eval's JSON. */
static int report_write_metrics(FILE *f, const char *dir, struct error *err)
{
    char path[4096];

    html_section(f, "Metrics", "As defined in spid-eval(1).");
    if (!run_find(path, sizeof path, dir, "metrics.json")) {
        report_write_missing(f, "metrics.json");
        return 0;
    }
    cJSON *j = jsonfile_read(path, 1 << 20, err);
    if (!j)
        return -1;
    html_table_begin(f, (const char *const[]){"figure", "value"}, 2);
    report_write_numbers(f, j, "");
    html_table_end(f);
    cJSON_Delete(j);
    return 0;
}

int report_write(FILE *f, const char *dir, const char *card,
                 struct error *err)
{
    struct motions m = {0};
    struct stat sb;
    int rc = -1;

    if (stat(dir, &sb))
        return error_set(err, EX_NOINPUT, "%s: %s", dir, strerror(errno));
    if (!S_ISDIR(sb.st_mode))
        return error_set(err, EX_NOINPUT, "%s: not a folder", dir);
    html_begin(f);
    if (report_motions_read(&m, dir, err) ||
        report_write_wipe(f, dir, &m, err) || report_write_limits(f, card, err))
        goto out;
    report_write_motion(f, &m);
    if (report_write_source(f, dir, err) || report_write_clips(f, dir, err) ||
        report_write_times(f, dir) || report_write_metrics(f, dir, err))
        goto out;
    html_end(f);
    rc = 0;
out:
    curves_release(&m.driver);
    curves_release(&m.result);
    curves_release(&m.truth);
    curves_release(&m.still);
    return rc;
}
