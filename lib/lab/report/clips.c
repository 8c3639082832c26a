/* A few frames of each clip of a run, evenly spread, and the sheet of them. */
#include "lib/lab/report/clips.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/framesource.h"
#include "lib/lab/data/contact_sheet.h"

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
        image_release(&c->frame[i]);
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

        if (n++ == due && !(rc = frame_copy(&c->frame[c->count], &frame, err)))
            c->index[c->count++] = frame.index;
    }
    framesource_close(s);
    if (!rc && !c->count)
        rc = err && err->code ? -1
                              : error_set(err, EX_DATAERR, "%s: no frames",
                                          path);
    return rc;
}

/* ---- the sheet ---------------------------------------------------------- */

/* One row of the sheet: a clip, or the source picture in the first cell. */
static int clip_put_row(struct contact_sheet *sheet, size_t row,
                        const char *path, bool picture, struct error *err)
{
    struct clip c = {.count = 1};
    int rc = picture ? image_read(&c.frame[0], path, err)
                     : clip_read(&c, path, err);

    for (size_t i = 0; i < c.count && rc == 0; i++)
        rc = contact_sheet_image(sheet, row, i, &c.frame[i], err);
    clip_release(&c);
    return rc;
}

int report_sheet(const char *path, const char *dir, struct error *err)
{
    static const char *const name[] = {"source", "driver", "star", "avatar",
                                       "dynamic", "static", "mouth"};

    enum { ROWS = sizeof name / sizeof *name };
    struct contact_sheet sheet;
    char file[4096];
    size_t rows = 0, row = 0;
    int rc = 0;

    for (size_t i = 0; i < ROWS; i++)
        rows += run_find(file, sizeof file, dir, name[i]) != 0;
    if (!rows)
        return error_set(err, EX_NOINPUT, "%s: no source and no clip", dir);
    if (contact_sheet_init(&sheet, rows, REPORT_FRAMES, REPORT_CELL, err))
        return -1;
    for (size_t i = 0; !rc && i < ROWS; i++)
        if (run_find(file, sizeof file, dir, name[i]))
            rc = clip_put_row(&sheet, row++, file, i == 0, err);
    if (!rc)
        return contact_sheet_save(&sheet, path, err);
    contact_sheet_release(&sheet);
    return rc;
}
