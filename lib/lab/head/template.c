/* The head's tensors from one file and into another. */
#include "lib/lab/head/template.h"

#include "lib/base/half.h"
#include "lib/head/runs.h"

/* Metres: what a direction moves by less than this it does not move. */
#define DELTA_MIN 2e-6

/* A tensor of dimensions a, b and c, those that are 0 left out, in t's memory;
 * of any length, which is *n then, where a is 0.  NULL and *err. */
static void *template_read(struct template *t, const char *name, bool integer,
                           size_t a, size_t b, size_t c, size_t *n,
                           struct error *err)
{
    const struct safetensors *st = t->file.st;
    const size_t dim[3] = {a, b, c};
    const int ndim = c ? 3 : b ? 2 : 1;
    size_t count;
    void *x = integer ? (void *)st_load_i32(st, name, ndim, dim, &count, err)
                      : (void *)st_load_f32(st, name, ndim, dim, &count, err);

    if (x && n)
        *n = count / ((b ? b : 1) * (c ? c : 1));
    return arena_keep(&t->file.memory, x, err);
}

int template_load(struct template *t, const char *path, struct error *err)
{
    enum { V = TEMPLATE_VERTICES };

    *t = (struct template){.nv = V};
    if (headfile_open(&t->file, path, err))
        return -1;
    if ((t->v_template = template_read(t, "v_template", 0, V, 3, 0, NULL,
                                       err)) &&
        (t->f = template_read(t, "f", 1, 0, 3, 0, &t->nf, err)) &&
        (t->shapedirs = headfile_directions(&t->file, "shapedirs", V,
                                            TEMPLATE_DIRECTIONS, err)) &&
        (t->posedirs = headfile_directions(&t->file, "posedirs", V,
                                           TEMPLATE_POSES, err)) &&
        (t->l_eyelid = template_read(t, "l_eyelid", 0, V, 3, 0, NULL, err)) &&
        (t->r_eyelid = template_read(t, "r_eyelid", 0, V, 3, 0, NULL, err)) &&
        (t->region = template_read(t, "region", 1, V, 0, 0, NULL, err)) &&
        (t->lid_vertices = template_read(t, "lid_vertices", 1, 0, 0, 0,
                                         &t->nlid, err)) &&
        (t->lid_sides = template_read(t, "lid_sides", 1, t->nlid, 0, 0, NULL,
                                      err)) &&
        (t->lid_shapedirs = template_read(t, "lid_shapedirs", 0, t->nlid, 3,
                                          TEMPLATE_LID_SHAPES, NULL, err)))
        return 0;
    template_release(t);
    return -1;
}

void template_release(struct template *t)
{
    headfile_close(&t->file);
    *t = (struct template){0};
}

/* Directions `name` (V,3,K) as runs r, or plain. */
static int template_put_directions(struct headfile *f, struct runs *r,
                                   const char *const name[3],
                                   const float *dirs, size_t K, bool plain,
                                   struct error *err)
{
    const size_t V = TEMPLATE_VERTICES;

    headfile_drop(f, name[0]);
    if (plain) {
        headfile_put(f, name[0], ST_F32, dirs, V, 3, K);
        return 0;
    }
    if (runs_pack(r, dirs, V, K, DELTA_MIN, err))
        return -1;
    headfile_put(f, name[1], ST_I32, r->run, r->n, 3, 0);
    headfile_put(f, name[2], ST_F16, r->value, r->rows, 3, 0);
    return 0;
}

int template_save(struct template *t, const char *path, bool plain,
                  struct error *err)
{
    static const char *const shapes[] = {"shapedirs", "shapedirs_runs",
                                         "shapedirs_values"};
    static const char *const poses[] = {"posedirs", "posedirs_runs",
                                        "posedirs_values"};
    struct runs shape = {0}, pose = {0};
    struct headfile *f = &t->file;
    const size_t n = 3 * t->nlid * TEMPLATE_LID_SHAPES;
    uint16_t *lid = headfile_add(f, "lid_shapedirs", ST_F16, t->nlid, 3,
                                 TEMPLATE_LID_SHAPES, err);

    for (size_t i = 0; lid && i < n; i++)
        lid[i] = float_to_half(t->lid_shapedirs[i]);
    headfile_put(f, "lid_vertices", ST_I32, t->lid_vertices, t->nlid, 0, 0);
    headfile_put(f, "lid_sides", ST_I32, t->lid_sides, t->nlid, 0, 0);
    headfile_put(f, "l_eyelid", ST_F32, t->l_eyelid, t->nv, 3, 0);
    headfile_put(f, "r_eyelid", ST_F32, t->r_eyelid, t->nv, 3, 0);
    const int rc = !lid ||
        template_put_directions(f, &shape, shapes, t->shapedirs,
                                TEMPLATE_DIRECTIONS, plain, err) ||
        template_put_directions(f, &pose, poses, t->posedirs, TEMPLATE_POSES,
                                plain, err) || headfile_save(f, path, err)
        ? -1 : 0;

    runs_release(&shape);
    runs_release(&pose);
    return rc;
}
