/* Reading and writing GAUS. */
#include "lib/stream/gaus.h"

#include <string.h>
#include <sysexits.h>

/* The array of that name with n rows of `width` numbers (a plain list for a
 * width of 1).  NULL and *err when it is missing or of another type or shape;
 * no rows are no excuse, for a size of 0 would accept any in record_get. */
static const void *gaus_rows(const struct record *rec, const char *name,
                             enum dtype dtype, size_t n, size_t width,
                             struct error *err)
{
    const size_t dims[2] = {n, width};
    const struct array *a = record_find(rec, name);

    if (a && n == 0 && array_count(a) != 0) {
        error_set(err, EX_DATAERR, "%s %s has %zu numbers (expected none)",
                  rec->type, name, array_count(a));
        return NULL;
    }
    return record_get(rec, name, dtype, width > 1 ? 2 : 1, dims, err);
}

/* The same into *out when the record has it. */
static int gaus_optional(const float **out, const struct record *rec,
                         const char *name, size_t n, size_t width,
                         struct error *err)
{
    if (!record_find(rec, name))
        return 0;
    *out = gaus_rows(rec, name, DTYPE_F32, n, width, err);
    return *out ? 0 : -1;
}

/* Colours in float or half. */
static int gaus_read_color(struct gaus *g, const struct record *rec,
                           struct error *err)
{
    const struct array *a = record_find(rec, "color");
    const bool half = a && a->dtype == DTYPE_F16;
    const size_t dims[2] = {g->n, 0};
    const void *p = record_get(rec, "color", half ? DTYPE_F16 : DTYPE_F32, 2,
                               dims, err);

    if (!p)
        return -1;
    if (a->dim[0] != g->n || a->dim[1] == 0)
        return error_set(err, EX_DATAERR, "GAUS color is %zu x %zu (expected "
                         "%zu rows of at least one channel)", a->dim[0],
                         a->dim[1], g->n);
    g->channels = a->dim[1];
    g->color = half ? NULL : p;
    g->color_half = half ? p : NULL;
    return 0;
}

/* Branch and vertex of each, where said. */
static int gaus_read_labels(struct gaus *g, const struct record *rec,
                            struct error *err)
{
    static const size_t any[1] = {0};

    if (record_find(rec, "branch") &&
        !(g->branch = gaus_rows(rec, "branch", DTYPE_U8, g->n, 1, err)))
        return -1;
    if (!record_find(rec, "vertex"))
        return 0;
    g->vertex = record_get(rec, "vertex", DTYPE_I32, 1, any, err);
    if (!g->vertex)
        return -1;
    g->vertices = record_find(rec, "vertex")->dim[0];
    return 0;
}

/* How the mouth goes with the chin, where said. */
static int gaus_read_jaw(struct gaus *g, const struct record *rec,
                         struct error *err)
{
    const struct array *a = record_find(rec, "jaw");

    if (!a && !record_find(rec, "chin"))
        return 0;
    if (!a)
        return error_set(err, EX_DATAERR, "GAUS has chin without jaw");
    g->jaws = a->dim[0];
    return gaus_optional(&g->jaw, rec, "jaw", g->jaws, 3, err) ||
                   !(g->chin = gaus_rows(rec, "chin", DTYPE_F32, 3, 1, err))
               ? -1
               : 0;
}

int gaus_read(struct gaus *g, const struct record *rec, struct error *err)
{
    static const size_t any[2] = {0, 3};

    memset(g, 0, sizeof *g);
    g->mean = record_get(rec, "mean", DTYPE_F32, 2, any, err);
    if (!g->mean || record_check_finite(rec, err))
        return -1;
    g->n = record_find(rec, "mean")->dim[0];
    g->scale = gaus_rows(rec, "scale", DTYPE_F32, g->n, 3, err);
    if (!g->scale)
        return -1;
    g->quat = gaus_rows(rec, "quat", DTYPE_F32, g->n, 4, err);
    if (!g->quat)
        return -1;
    g->opacity = gaus_rows(rec, "opacity", DTYPE_F32, g->n, 1, err);
    if (!g->opacity || gaus_read_color(g, rec, err) ||
        gaus_read_labels(g, rec, err) ||
        gaus_optional(&g->lip, rec, "lip", 3, 1, err) ||
        gaus_read_jaw(g, rec, err) ||
        gaus_optional(&g->bend, rec, "bend", g->n, 1, err) ||
        gaus_optional(&g->pivot, rec, "pivot", 3, 1, err) ||
        gaus_optional(&g->source, rec, "source", 3, 3, err) ||
        gaus_optional(&g->light, rec, "light", 3, 1, err) ||
        gaus_optional(&g->uv, rec, "uv", g->n, 2, err) ||
        gaus_optional(&g->seen, rec, "seen", g->n, 1, err) ||
        gaus_optional(&g->view, rec, "view", 3, 4, err) ||
        gaus_optional(&g->reach, rec, "reach", g->n, 1, err) ||
        gaus_optional(&g->tilt, rec, "tilt", g->n, 2, err) ||
        gaus_optional(&g->cam, rec, "cam", 3, 4, err))
        return -1;
    if (!g->uv != !g->seen || !g->uv != !g->view)
        return error_set(err, EX_DATAERR, "GAUS has %s without %s",
                         g->uv ? "uv" : g->seen ? "seen" : "view",
                         !g->uv ? "uv" : g->seen ? "view" : "seen");
    return 0;
}

int gaus_arrays(struct array a[STREAM_MAX_ARRAYS], const struct gaus *g)
{
    const size_t n = g->n;
    const void *color = g->color ? (const void *)g->color : g->color_half;
    const enum dtype type = g->color ? DTYPE_F32 : DTYPE_F16;
    const struct array all[] = {
        array_make("mean", DTYPE_F32, g->mean, 2, n, 3, 0, 0),
        array_make("scale", DTYPE_F32, g->scale, 2, n, 3, 0, 0),
        array_make("quat", DTYPE_F32, g->quat, 2, n, 4, 0, 0),
        array_make("opacity", DTYPE_F32, g->opacity, 1, n, 0, 0, 0),
        array_make("color", type, color, 2, n, g->channels, 0, 0),
        array_make("branch", DTYPE_U8, g->branch, 1, n, 0, 0, 0),
        array_make("lip", DTYPE_F32, g->lip, 1, 3, 0, 0, 0),
        array_make("jaw", DTYPE_F32, g->jaw, 2, g->jaws, 3, 0, 0),
        array_make("chin", DTYPE_F32, g->chin, 1, 3, 0, 0, 0),
        array_make("vertex", DTYPE_I32, g->vertex, 1, g->vertices, 0, 0, 0),
        array_make("bend", DTYPE_F32, g->bend, 1, n, 0, 0, 0),
        array_make("pivot", DTYPE_F32, g->pivot, 1, 3, 0, 0, 0),
        array_make("source", DTYPE_F32, g->source, 2, 3, 3, 0, 0),
        array_make("light", DTYPE_F32, g->light, 1, 3, 0, 0, 0),
        array_make("uv", DTYPE_F32, g->uv, 2, n, 2, 0, 0),
        array_make("seen", DTYPE_F32, g->seen, 1, n, 0, 0, 0),
        array_make("view", DTYPE_F32, g->view, 2, 3, 4, 0, 0),
        array_make("reach", DTYPE_F32, g->reach, 1, n, 0, 0, 0),
        array_make("tilt", DTYPE_F32, g->tilt, 2, n, 2, 0, 0),
        array_make("cam", DTYPE_F32, g->cam, 2, 3, 4, 0, 0)
    };

    return array_present(a, all, sizeof all / sizeof *all);
}

int gaus_write(struct stream_writer *w, uint64_t frame, double time,
               const struct gaus *g, struct error *err)
{
    struct array a[STREAM_MAX_ARRAYS];

    return stream_write(w, RECORD_GAUS, frame, time, a, gaus_arrays(a, g),
                        err);
}
