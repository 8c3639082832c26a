/* The renderer as its callers see it: options checked and memory made, then
 * Gaussians in, pictures out.  The work itself: pack.c (layout), frame.c (one
 * frame: project, sort, tile lists, draw), backward.c (gradients), and the
 * kernels in *_tmpl.c. */
#include "lib/splat/splat.h"

#include <float.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/pages.h"
#include "lib/base/parallel.h"
#include "lib/base/sort.h"
#include "lib/splat/backward.h"
#include "lib/splat/kernels.h"

struct splat_camera splat_camera_square(const float rt[12], int size,
                                        float focal)
{
    struct splat_camera cam;

    memcpy(cam.rt, rt, sizeof cam.rt);
    cam.fx = cam.fy = focal * 0.5f * (float)size;
    cam.cx = cam.cy = 0.5f * (float)size;
    return cam;
}

struct splat_options splat_defaults(int width, int height, int channels)
{
    return (struct splat_options){
        .width = width, .height = height, .channels = channels,
        .alpha_cut = 1.0f / 255, .t_cut = 1e-4f,
        .fixed16 = channels > SPLAT_COLORS};
}

/* ---- init ---------------------------------------------------------------- */

/* EX_USAGE names the option that is out of range. */
static int splat_check_options(const struct splat_options *o, struct error *err)
{
    if (o->width < 1 || o->height < 1 || o->width > SPLAT_MAX_SIZE ||
        o->height > SPLAT_MAX_SIZE)
        return error_set(err, EX_USAGE, "size %d x %d (expected 1 to %d on "
                         "each side)", o->width, o->height, SPLAT_MAX_SIZE);
    if (o->channels < 1 || o->channels > SPLAT_MAX_CHANNELS)
        return error_set(err, EX_USAGE, "%d channels (expected 1 to %d)",
                         o->channels, SPLAT_MAX_CHANNELS);
    if (o->rules != SPLAT_GSPLAT && o->rules != SPLAT_DGR)
        return error_set(err, EX_USAGE, "rules %d (expected gsplat or dgr)",
                         o->rules);
    if (!(o->alpha_cut >= 0x1p-24f && o->alpha_cut < 1))
        return error_set(err, EX_USAGE, "alpha cut %g (expected 6e-8 to 1)",
                         o->alpha_cut);
    if (!(o->t_cut >= 0 && o->t_cut < 1))
        return error_set(err, EX_USAGE, "T cut %g (expected 0 to 1)",
                         o->t_cut);
    if (o->exp_degree && (o->exp_degree < 2 || o->exp_degree > 5))
        return error_set(err, EX_USAGE, "exp degree %d (expected 2 to 5)",
                         o->exp_degree);
    return 0;
}

/* Interleave the bits of x and y. */
static uint64_t splat_morton(uint32_t x, uint32_t y)
{
    uint64_t z = 0;

    for (int b = 0; b < 16; b++)
        z |= (uint64_t)(x >> b & 1) << (2 * b) |
             (uint64_t)(y >> b & 1) << (2 * b + 1);
    return z;
}

/* The tiles along a Z curve: neighbours share Gaussians.  -1: no memory. */
static int splat_make_zorder(struct splat_state *st)
{
    uint32_t tx = (uint32_t)st->view.tx, ty = (uint32_t)st->view.ty;
    uint64_t *z = malloc((size_t)tx * ty * sizeof *z);

    if (!z)
        return -1;
    for (uint32_t t = 0; t < tx * ty; t++)
        z[t] = splat_morton(t % tx, t / tx) << 24 | t;
    sort_keys(z, (size_t)tx * ty);
    for (uint32_t t = 0; t < tx * ty; t++)
        st->zorder[t] = (uint32_t)(z[t] & 0xffffff);
    free(z);
    return 0;
}

/* The options that others imply, and what of the state they decide. */
static void splat_settle_options(struct splat *s, struct splat_state *st,
                                 const struct splat_options *opt)
{
    s->opt = *opt;
    if (!opt->exp_degree)
        s->opt.exp_degree = opt->gradients ? 5 : 3;
    if (opt->gradients) {           /* backward starts from the picture */
        s->opt.fixed16 = false;
        s->opt.exp_degree = s->opt.exp_degree <= 3 ? 3 : 5;
    }
    st->level = opt->level_set ? opt->level : cpu_level();
    st->work_size = splat_kernels(st->level)->work_size();
    st->threads = opt->threads > 0 ? opt->threads : parallel_width();
    if (st->threads > SPLAT_MAX_THREADS)
        st->threads = SPLAT_MAX_THREADS;
    st->slots = parallel_width() > st->threads ? parallel_width() : st->threads;
    if (opt->channels > 4 || (opt->channels == 4 && opt->depth) ||
        (opt->gradients && (opt->channels > 3 || opt->place)))
        st->row = opt->channels > 16 ? 32 : 16;
    st->view.width = opt->width;
    st->view.height = opt->height;
    st->view.tx = (opt->width + TILE - 1) / TILE;
    st->view.ty = (opt->height + TILE - 1) / TILE;
    st->view.dgr = opt->rules == SPLAT_DGR;
    st->view.eps = st->view.dgr ? 1e-7f : 0;
    st->view.near = opt->near > 0 ? opt->near : st->view.dgr ? 0.2f : 0.01f;
    st->view.cut = log2f(opt->alpha_cut);
    st->view.t_cut = opt->t_cut;
}

int splat_init(struct splat *s, const struct splat_options *opt,
               struct error *err)
{
    memset(s, 0, sizeof *s);
    if (splat_check_options(opt, err))
        return -1;
    struct splat_state *st = calloc(1, sizeof *st);

    if (!st)
        return error_set(err, EX_OSERR, "out of memory");
    s->state = st;
    splat_settle_options(s, st, opt);
    s->bytes = state_screen_layout(st, NULL);
    st->screen_bytes = s->bytes;
    st->screen = pages_alloc(s->bytes);
    if (!st->screen)
        goto out;
    state_screen_layout(st, st->screen);
    memset(st->empty, 0, (size_t)st->view.tx * (size_t)st->view.ty *
                            sizeof *st->empty);
    if (splat_make_zorder(st) || (opt->gradients && backward_init(s)))
        goto out;
    return 0;
out:
    splat_release(s);
    return error_set(err, EX_OSERR, "out of memory");
}

void splat_release(struct splat *s)
{
    struct splat_state *st = s->state;

    if (st) {
        backward_release(s);
        pages_free(st->block, st->block_bytes);
        pages_free(st->screen, st->screen_bytes);
        free(st->list);
        free(st->fading);
        free(st);
    }
    memset(s, 0, sizeof *s);
}

/* ---- load ---------------------------------------------------------------- */

#define CHECKED 65536            /* numbers at once */

struct splat_check {
    const float *x;
    size_t n;
    float lo, hi;
    atomic_size_t bad;          /* the first that is not within */
};

/* One chunk. */
static void splat_check_part(void *ctx, size_t k)
{
    struct splat_check *c = ctx;
    const size_t end = (k + 1) * CHECKED < c->n ? (k + 1) * CHECKED : c->n;
    size_t min = SIZE_MAX;

    for (size_t i = k * CHECKED; i < end; i++)
        if (!(c->x[i] >= c->lo && c->x[i] <= c->hi))
            min = i < min ? i : min;
    for (size_t bad = c->bad; min < bad;)
        if (atomic_compare_exchange_weak(&c->bad, &bad, min))
            break;
}

/* Every number within lo .. hi, or EX_DATAERR with its place. */
static int splat_check_array(const float *x, size_t n, size_t row,
                             const char *name, float lo, float hi,
                             const char *expected, struct error *err)
{
    struct splat_check c = {.x = x, .n = n * row, .lo = lo, .hi = hi,
                            .bad = SIZE_MAX};

    parallel_for((c.n + CHECKED - 1) / CHECKED, 1, splat_check_part, &c);
    const size_t bad = c.bad;
    if (bad == SIZE_MAX)
        return 0;
    return error_set(err, EX_DATAERR, "%s[%zu] is %g (expected %s)", name,
                     bad, x[bad], expected);
}

/* What the kernels take for granted of Gaussians. */
static int splat_check_gaussians(const struct splat *s,
                                 const struct gaussians *g, struct error *err)
{
    static const char finite[] = "a finite number";

    if (g->channels < s->opt.channels)
        return error_set(err, EX_DATAERR, "color has %d channels (expected at "
                         "least %d)", g->channels, s->opt.channels);
    if (splat_check_array(g->mean, g->n, 3, "mean", -FLT_MAX, FLT_MAX, finite,
                          err) ||
        splat_check_array(g->scale, g->n, 3, "scale", 0, FLT_MAX,
                          "a finite number, not negative", err) ||
        splat_check_array(g->quat, g->n, 4, "quat", -FLT_MAX, FLT_MAX, finite,
                          err) ||
        splat_check_array(g->opacity, g->n, 1, "opacity", 0, 1, "0 to 1",
                          err))
        return -1;
    if (s->opt.place &&
        ((g->uv && splat_check_array(g->uv, g->n, 2, "uv", -1e6f, 1e6f,
                                     "-1e6 to 1e6", err)) ||
         (g->seen && splat_check_array(g->seen, g->n, 1, "seen", 0, 1,
                                       "0 to 1", err)) ||
         (g->tilt && splat_check_array(g->tilt, g->n, 2, "tilt", -1e6f, 1e6f,
                                       "-1e6 to 1e6", err)) ||
         (g->around && splat_check_array(g->around, g->n, 2, "around", -1e6f,
                                         1e6f, "-1e6 to 1e6", err)) ||
         (g->normal && splat_check_array(g->normal, g->n, 3, "normal", -1.01f,
                                         1.01f, "-1 to 1", err)) ||
         (g->normal && splat_check_array(g->light, 1, 3, "light", -1.01f,
                                         1.01f, "-1 to 1", err)) ||
         (g->reach && splat_check_array(g->reach, g->n, 1, "reach", -FLT_MAX,
                                        FLT_MAX, "a finite number", err))))
        return -1;
    if (g->color)
        return splat_check_array(g->color, g->n, (size_t)g->channels, "color",
                                 -FLT_MAX, FLT_MAX, finite, err);
    for (size_t i = 0; i < g->n * (size_t)g->channels; i++)
        if ((g->color_half[i] & 0x7c00) == 0x7c00)
            return error_set(err, EX_DATAERR, "color[%zu] is not finite "
                             "(expected a finite number)", i);
    return 0;
}

/* Remember those of g that have a reach, when there are places. */
static int splat_load_tethers(struct splat *s, const struct gaussians *g,
                              struct error *err)
{
    struct splat_state *st = s->state;
    const bool some = s->opt.place && g->reach && g->seen;
    size_t n = 0;

    for (size_t i = 0; i < g->n && some; i++)
        n += g->reach[i] != 0;
    free(st->fading);
    st->fading = NULL;
    st->fadings = 0;
    if (n == 0)
        return 0;
    st->fading = malloc(n * sizeof *st->fading);
    if (!st->fading)
        return error_set(err, EX_OSERR, "%zu Gaussians: out of memory", n);
    for (size_t i = 0; i < g->n; i++) {
        const float *source = (g->source_mean ? g->source_mean : g->mean) + 3 * i;

        if (g->reach[i] != 0)
            st->fading[st->fadings++] = (struct splat_fading){
                i, g->seen[i], g->reach[i], {source[0], source[1], source[2]}};
    }
    return 0;
}

int splat_load(struct splat *s, const struct gaussians *g, struct error *err)
{
    struct splat_state *st = s->state;
    size_t n = (g->n + PAD - 1) / PAD * PAD + PAD;

    if (g->n >= UINT32_MAX / 64)
        return error_set(err, EX_DATAERR, "%zu Gaussians (expected at most "
                         "%u)", g->n, UINT32_MAX / 64);
    if (splat_check_gaussians(s, g, err) || splat_load_tethers(s, g, err))
        return -1;
    if (!st->block || s->n != g->n) {
        size_t bytes = state_cloud_layout(s, NULL, n);

        pages_free(st->block, st->block_bytes);
        s->bytes += bytes - st->block_bytes;
        st->block_bytes = bytes;
        st->block = pages_alloc(bytes);
        if (!st->block) {
            s->n = 0;
            return error_set(err, EX_OSERR, "%zu Gaussians: out of memory",
                             g->n);
        }
        state_cloud_layout(s, st->block, n);
    }
    s->n = g->n;
    pack_gaussians(s, g);
    st->projected = false;
    if (s->opt.gradients)
        return backward_load(s, g, err);
    return 0;
}

/* ---- moving -------------------------------------------------------------- */

/* Gaussians first .. first + count - 1 exist. */
static int splat_check_range(const struct splat *s, size_t first, size_t count,
                             struct error *err)
{
    if (first > s->n || count > s->n - first)
        return error_set(err, EX_DATAERR, "Gaussians %zu to %zu move "
                         "(expected below %zu)", first, first + count, s->n);
    return 0;
}

/* These are projected again. */
static void splat_mark_moved(struct splat_state *st, size_t first, size_t count)
{
    if (first < st->dirty0)
        st->dirty0 = first;
    if (first + count > st->dirty1)
        st->dirty1 = first + count;
}

/* How far the photograph shows those of them that have a reach. */
static void splat_pull_tethers(struct splat_state *st, const float *mean,
                               size_t first, size_t count)
{
    for (size_t k = 0; k < st->fadings; k++) {
        const struct splat_fading *t = &st->fading[k];

        if (t->at >= first && t->at - first < count)
            st->cloud.seen[t->at] = gaussian_seen(
                t->seen, t->reach, t->source_mean, mean + 3 * (t->at - first));
    }
}

int splat_update(struct splat *s, const float *mean, size_t first,
                 size_t count, struct error *err)
{
    struct splat_state *st = s->state;

    if (splat_check_range(s, first, count, err) ||
        splat_check_array(mean, count, 3, "mean", -FLT_MAX, FLT_MAX,
                          "a finite number", err))
        return -1;
    for (size_t i = 0; i < count; i++)
        for (int k = 0; k < 3; k++)
            st->cloud.mean[k][first + i] = mean[3 * i + (size_t)k];
    splat_pull_tethers(st, mean, first, count);
    splat_mark_moved(st, first, count);
    return 0;
}

/* ---- drawing ------------------------------------------------------------- */

/* What the kernels take for granted of a camera. */
static int splat_check_camera(const struct splat_camera *cam, struct error *err)
{
    const float *P = cam->rt;
    double det = P[0] * ((double)P[5] * P[10] - (double)P[6] * P[9]) -
                 P[1] * ((double)P[4] * P[10] - (double)P[6] * P[8]) +
                 P[2] * ((double)P[4] * P[9] - (double)P[5] * P[8]);

    if (splat_check_array(P, 12, 1, "cam", -1e18f, 1e18f, "a finite number",
                          err))
        return -1;
    if (!(fabs(det) > 1e-12))
        return error_set(err, EX_DATAERR, "cam has a singular rotation "
                         "(determinant %g, expected 1)", det);
    if (!(cam->fx > 0 && cam->fy > 0 && cam->fx < 1e9f && cam->fy < 1e9f))
        return error_set(err, EX_DATAERR, "focal length %g, %g (expected a "
                         "positive number of pixels)", cam->fx, cam->fy);
    if (!(fabsf(cam->cx) < 1e9f && fabsf(cam->cy) < 1e9f))
        return error_set(err, EX_DATAERR, "principal point %g, %g (expected "
                         "finite numbers)", cam->cx, cam->cy);
    return 0;
}

/* What a camera means to the kernels; an equal one changes nothing. */
static void splat_set_camera(struct splat_state *st,
                             const struct splat_camera *cam)
{
    struct view *v = &st->view;

    if (!memcmp(&st->camera, cam, sizeof *cam))
        return;
    st->camera = *cam;
    st->projected = false;
    memcpy(v->rt, cam->rt, sizeof v->rt);
    v->fx = cam->fx;
    v->fy = cam->fy;
    v->cx = cam->cx;
    v->cy = cam->cy;
    v->limx = 0.65f * (float)v->width / cam->fx;
    v->limy = 0.65f * (float)v->height / cam->fy;
}

/* What was asked for fits what the renderer was made for. */
static int splat_check_pictures(const struct splat *s,
                                const struct splat_pictures *out,
                                const struct splat_place_view *view,
                                struct error *err)
{
    if (!s->state->block)
        return error_set(err, EX_SOFTWARE, "nothing loaded (expected "
                         "splat_load before splat_draw)");
    if (out->depth && !s->opt.depth)
        return error_set(err, EX_SOFTWARE, "depth asked for (expected the "
                         "option when the renderer was made)");
    if ((out->place || out->shade) && !(s->opt.place && view))
        return error_set(err, EX_SOFTWARE, "places asked for (expected a view "
                         "and the option when the renderer was made)");
    return 0;
}

/* Another view: the place channels are made again, where the Gaussians are
 * projected. */
static void splat_set_view(struct splat_state *st,
                           const struct splat_place_view *view)
{
    if (!view || !memcmp(&st->view.place, view, sizeof *view))
        return;
    st->view.place = *view;
    st->projected = false;
}

int splat_draw(struct splat *s, const struct splat_pictures *out,
               const struct splat_camera *cam,
               const struct splat_place_view *view, const float *background,
               struct error *err)
{
    struct target to = {.image = out->image, .half = out->half,
                        .alpha = out->alpha, .depth = out->depth,
                        .place = out->place, .background = background,
                        .shade = out->shade, .ctx = out->ctx};

    if (splat_check_pictures(s, out, view, err) ||
        splat_check_camera(cam, err) ||
        (view && splat_check_array((const float *)view, SPLAT_PLACE_VIEW, 1, "view", -1e6f, 1e6f,
                                   "-1e6 to 1e6", err)))
        return -1;
    splat_set_camera(s->state, cam);
    splat_set_view(s->state, view);
    if (s->opt.gradients)
        backward_keep(s, &to);
    return frame_draw(s, &to, err);
}
