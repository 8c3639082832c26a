/* A few frames of each clip of a run, evenly spread, and the sheet of them. */
#include "lib/lab/report/clips.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/framesource.h"
#include "formats/image.h"

int run_find(char *path, size_t size, const char *dir, const char *name)
{
    DIR *d = opendir(dir);
    size_t n = strlen(name);
    int found = 0;

    for (struct dirent *e; d && !found && (e = readdir(d));)
        if (!strncmp(e->d_name, name, n) &&
            (!e->d_name[n] || e->d_name[n] == '.') &&
            !strstr(e->d_name + n, ".part") &&
            !strstr(e->d_name + n, ".spid") &&
            !strstr(e->d_name + n, ".html")) {
            snprintf(path, size, "%s/%s", dir, e->d_name);
            found = 1;
        }
    if (d)
        closedir(d);
    return found;
}

void clip_release(struct clip *c)
{
    for (size_t i = 0; i < c->count; i++)
        free(c->rgb[i]);
    memset(c, 0, sizeof *c);
}

/* By reading all of them: not every container says. */
static size_t clip_count_frames(const char *path, struct error *err)
{
    struct framesource_options opt = {0};
    struct framesource *s = framesource_open(&path, 1, &opt, err);
    struct frame frame;
    size_t n = 0;

    while (s && framesource_read(s, &frame, err) > 0)
        n++;
    framesource_close(s);
    return n;
}

/* Append a copy of the frame. -1: no memory. */
static int clip_keep(struct clip *c, const struct frame *f)
{
    size_t bytes = f->width * f->height * 3;
    uint8_t *rgb = malloc(bytes);

    if (!rgb)
        return -1;
    memcpy(rgb, f->rgb, bytes);
    c->width = f->width;
    c->height = f->height;
    c->index[c->count] = f->index;
    c->rgb[c->count++] = rgb;
    return 0;
}

int clip_read(struct clip *c, const char *path, struct error *err)
{
    struct framesource_options opt = {0};
    size_t total = clip_count_frames(path, err), n = 0;
    struct framesource *s = framesource_open(&path, 1, &opt, err);
    struct frame frame;
    int rc = s ? 0 : -1;

    memset(c, 0, sizeof *c);
    while (!rc && c->count < REPORT_FRAMES && n < total &&
           framesource_read(s, &frame, err) > 0) {
        size_t due = c->count * (total > 1 ? total - 1 : 0) /
                     (REPORT_FRAMES - 1);

        if (n++ == due && clip_keep(c, &frame))
            rc = error_set(err, EX_OSERR, "%s: out of memory", path);
    }
    framesource_close(s);
    if (!rc && !c->count)
        rc = err && err->code ? -1
                              : error_set(err, EX_DATAERR, "%s: no frames",
                                          path);
    return rc;
}


/* ---- the sheet ---------------------------------------------------------- */

enum { CELL = REPORT_CELL };

/* Box-filtered copy of a picture into a cell of the sheet. */
static void clip_sheet_put(uint8_t *sheet, size_t row, size_t column,
                           const uint8_t *rgb, size_t width, size_t height)
{
    const size_t stride = (size_t)REPORT_FRAMES * CELL;

    for (size_t y = 0; y < CELL; y++)
        for (size_t x = 0; x < CELL; x++) {
            size_t x0 = x * width / CELL, x1 = (x + 1) * width / CELL;
            size_t y0 = y * height / CELL, y1 = (y + 1) * height / CELL;
            unsigned sum[3] = {0}, n = 0;

            for (size_t v = y0; v < y1 || v == y0; v++)
                for (size_t u = x0; u < x1 || u == x0; u++, n++)
                    for (size_t c = 0; c < 3; c++)
                        sum[c] += rgb[(v * width + u) * 3 + c];
            uint8_t *out = sheet +
                ((row * CELL + y) * stride + column * CELL + x) * 3;
            for (size_t c = 0; c < 3; c++)
                out[c] = (uint8_t)((sum[c] + n / 2) / n);
        }
}

/* One row of the sheet: a clip, or the source picture in the first cell. */
static int clip_put_row(uint8_t *sheet, size_t row, const char *path,
                        bool picture, struct error *err)
{
    struct image im;
    struct clip c;

    if (picture) {
        if (image_read(&im, path, err))
            return -1;
        clip_sheet_put(sheet, row, 0, im.rgb, im.width, im.height);
        image_release(&im);
        return 0;
    }
    if (clip_read(&c, path, err))
        return -1;
    for (size_t i = 0; i < c.count; i++)
        clip_sheet_put(sheet, row, i, c.rgb[i], c.width, c.height);
    clip_release(&c);
    return 0;
}

int report_sheet(const char *path, const char *dir, struct error *err)
{
    static const char *const name[] = {"source", "driver", "star", "avatar",
                                       "dynamic", "static", "mouth"};

    enum { ROWS = sizeof name / sizeof *name };
    const size_t width = (size_t)REPORT_FRAMES * CELL;
    uint8_t *sheet = calloc(ROWS * width * CELL, 3);
    char file[4096];
    size_t rows = 0;
    int rc = sheet ? 0 : error_set(err, EX_OSERR, "out of memory");

    for (size_t i = 0; !rc && i < ROWS; i++)
        if (run_find(file, sizeof file, dir, name[i]))
            rc = clip_put_row(sheet, rows++, file, i == 0, err);
    if (!rc && !rows)
        rc = error_set(err, EX_NOINPUT, "%s: no source and no clip", dir);
    if (!rc)
        rc = image_write_png(path, sheet, width, rows * CELL, 3, err);
    free(sheet);
    return rc;
}
