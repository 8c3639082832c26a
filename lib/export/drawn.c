/* What an exported file is worth: read back, drawn by our renderer beside our
 * own Gaussians or mesh, and compared in decibels and in metres. */
#include "lib/export/drawn.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/glb.h"
#include "formats/ply.h"
#include "formats/splatfile.h"
#include "lib/base/arena.h"
#include "lib/splat/splat.h"

/* A camera before the face. */
static const float drawn_front[12] = {1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 12};

/* The picture (DRAWN_SIZE, DRAWN_SIZE, 3) by these rules. */
static int drawn_render(float *image, const struct gaussians *g,
                        const float rt[12], enum splat_rules rules,
                        struct error *err)
{
    const struct splat_camera cam = splat_camera_square(rt, DRAWN_SIZE, 12);
    struct splat_options opt = splat_defaults(DRAWN_SIZE, DRAWN_SIZE, 3);
    struct splat splat = {0};
    int rc = -1;

    opt.rules = rules;
    opt.exp_degree = 5;
    if (!splat_init(&splat, &opt, err) && !splat_load(&splat, g, err) &&
        !splat_draw(&splat, &(struct splat_pictures){.image = image}, &cam,
                    NULL, NULL, err))
        rc = 0;
    splat_release(&splat);
    return rc;
}

/* To what a picture can show. */
static double drawn_clamp(float x)
{
    return fmin(fmax((double)x, 0), 1);
}

/* PSNR and greatest difference of two pictures as a screen shows them. */
static double drawn_psnr(double *worst, const float *a, const float *b)
{
    const size_t n = (size_t)DRAWN_SIZE * DRAWN_SIZE * 3;
    double sum = 0;

    *worst = 0;
    for (size_t i = 0; i < n; i++) {
        double d = fabs(drawn_clamp(a[i]) - drawn_clamp(b[i]));

        *worst = fmax(*worst, d);
        sum += d * d;
    }
    return sum > 0 ? -10 * log10(sum / (double)n) : INFINITY;
}

/* Draw the file's Gaussians g and the scene's; fill d's row of this format. */
static int drawn_measure(struct drawn *d, enum drawn_format format,
                         const char *path, const struct gaussians *g,
                         const struct scene *s, struct error *err)
{
    const size_t n = (size_t)DRAWN_SIZE * DRAWN_SIZE * 3;
    float *own = malloc(2 * n * sizeof *own);
    const float *cam = s->has_cam ? s->cam : drawn_front;
    double worst, ignored;
    int rc = -1;

    if (!own)
        return error_set(err, EX_OSERR, "out of memory");
    float *other = own + n;
    if (drawn_render(own, &s->g, cam, SPLAT_GSPLAT, err) ||
        drawn_render(other, g, cam, SPLAT_GSPLAT, err))
        goto out;
    double db = drawn_psnr(&worst, own, other);
    if (d->files == 0) {
        if (drawn_render(other, g, cam, SPLAT_DGR, err))
            goto out;
        d->viewer_db = drawn_psnr(&ignored, own, other);
    }
    d->psnr_db = d->files ? fmin(d->psnr_db, db) : db;
    d->max_abs = fmax(d->max_abs, worst);
    d->n = g->n;
    d->files++;
    rc = 0;
    if ((format == DRAWN_PLY || format == DRAWN_GLB) && db < DRAWN_MIN)
        rc = error_set(err, EX_SOFTWARE, "%s: read back and drawn it is %.1f "
                       "dB from our picture (expected at least %d)", path, db,
                       DRAWN_MIN);
out:
    free(own);
    return rc;
}

int drawn_compare(struct drawn *d, enum drawn_format format, const char *path,
                  const struct scene *s, bool turned, float unit,
                  struct error *err)
{
    struct splats back = {0};   /* what the file gave back, in head units */
    struct gaussians g;
    int rc;

    switch (format) {
    case DRAWN_PLY:
    case DRAWN_PLY_PACKED:
        rc = ply_read(&back, path, turned, err);
        break;
    case DRAWN_SPLAT: rc = splatfile_read(&back, path, err); break;
    default: rc = glb_read_splats(&back, unit, path, err); break;
    }
    g = splats_set(&back);
    if (rc == 0 && g.n != s->g.n)
        rc = error_set(err, EX_SOFTWARE, "%s: %zu Gaussians read back "
                       "(expected %zu)", path, g.n, s->g.n);
    if (rc == 0)
        rc = drawn_measure(d, format, path, &g, s, err);
    splats_release(&back);
    return rc;
}

/* ---- the head ----------------------------------------------------------- */

/* A picture of the mesh's vertices from the front, each a Gaussian in the
 * colour of its normal, the middle of `around` in its middle. */
static int drawn_mesh(float *image, const float *verts, const float *around,
                      const struct head *h, struct error *err)
{
    const size_t V = h->V;
    float *x = malloc(14 * V * sizeof *x);
    double middle[3] = {0};

    if (!x)
        return error_set(err, EX_OSERR, "out of memory");
    float *mean = x, *scale = x + 3 * V, *color = x + 6 * V;
    float *quat = x + 9 * V, *opacity = x + 13 * V;
    head_normals(color, h, verts);
    for (size_t i = 0; i < 3 * V; i++)
        middle[i % 3] += (double)around[i] / (double)V;
    for (size_t i = 0; i < 3 * V; i++) {
        mean[i] = h->scale * (verts[i] - (float)middle[i % 3]);
        scale[i] = DRAWN_VERTEX_MM * 1e-3f * h->scale;
        color[i] = 0.5f + 0.5f * color[i];
    }
    for (size_t v = 0; v < V; v++) {
        memcpy(quat + 4 * v, (float[4]){1, 0, 0, 0}, 4 * sizeof *quat);
        opacity[v] = 1;
    }
    const struct gaussians g = {.n = V, .channels = 3, .mean = mean,
                                .scale = scale, .quat = quat,
                                .opacity = opacity, .color = color};
    int rc = drawn_render(image, &g, drawn_front, SPLAT_GSPLAT, err);

    free(x);
    return rc;
}

/* The mesh read back (metres) against our own vertices: metres, and both
 * drawn. */
static int drawn_measure_mesh(struct drawn_head *d, const char *path,
                              const float *back, const float *own,
                              const struct head *h, struct error *err)
{
    const size_t n = (size_t)DRAWN_SIZE * DRAWN_SIZE * 3;
    float *image = malloc(2 * n * sizeof *image);
    int rc = -1;

    d->vertices = h->V;
    d->metres = 0;
    for (size_t v = 0; v < h->V; v++) {
        double sum = 0;

        for (size_t c = 3 * v; c < 3 * v + 3; c++)
            sum += ((double)back[c] - (double)own[c]) *
                   ((double)back[c] - (double)own[c]);
        d->metres = fmax(d->metres, sqrt(sum));
        if (!isfinite(sum)) {
            error_set(err, EX_SOFTWARE, "%s: vertex %zu read back is not "
                      "finite", path, v);
            goto out;
        }
    }
    if (!image) {
        error_set(err, EX_OSERR, "out of memory");
        goto out;
    }
    if (drawn_mesh(image, own, own, h, err) ||
        drawn_mesh(image + n, back, own, h, err))
        goto out;
    d->psnr_db = drawn_psnr(&d->max_abs, image, image + n);
    rc = 0;
out:
    free(image);
    return rc;
}

int drawn_head_compare(struct drawn_head *d, const char *path,
                       const float *verts, const struct head *h,
                       struct error *err)
{
    struct arena room = {0};
    float *back = arena_take(&room, 3 * h->V, sizeof *back);
    int32_t *faces = arena_take(&room, 3 * h->F, sizeof *faces);
    int rc = arena_check(&room, "a head", err) ||
             glb_read_posed(back, faces, h->V, h->F, path, err) ? -1 : 0;

    if (rc == 0)
        rc = memcmp(faces, h->f, 3 * h->F * sizeof *faces)
                 ? error_set(err, EX_SOFTWARE, "%s: the faces read back are "
                             "others", path)
                 : drawn_measure_mesh(d, path, back, verts, h, err);
    arena_release(&room);
    return rc;
}
