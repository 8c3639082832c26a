#include "lib/splat/splat.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sysexits.h>

#include "lib/base/half.h"
#include "lib/base/isa.h"
#include "lib/splat/backward.h"
#include "lib/splat/frame.h"

#define ALIGN 64

#ifdef SPID_X86
#define SPLAT_FIXED16 true     /* the kernels multiply 16-bit numbers */
#else
#define SPLAT_FIXED16 false
#endif

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

/* ---- kernels ------------------------------------------------------------- */

#define DECLARE(isa)                                                      \
    void splat_project_##isa(struct splat_state *, size_t, size_t);       \
    void splat_tile_##isa(const struct splat *, struct splat_work *,      \
                          uint32_t, const struct target *);               \
    void splat_tile_backward_##isa(const struct splat *,                  \
                                   struct splat_work *, uint32_t,         \
                                   const float *, const float *);         \
    void splat_gaussian_backward_##isa(                                   \
        const struct splat *, size_t, size_t,                             \
        const struct splat_gradients *, double *);                        \
    size_t splat_work_size_##isa(void);
#define TABLE(isa)                                                        \
    {splat_project_##isa, splat_tile_##isa, splat_tile_backward_##isa,    \
     splat_gaussian_backward_##isa, splat_work_size_##isa}

DECLARE(baseline)
#ifdef SPID_X86
DECLARE(avx2)
DECLARE(avx512)
#endif

const struct splat_kernels *splat_kernels(enum cpu_level level)
{
    static const struct splat_kernels table[] = {
        TABLE(baseline),
#ifdef SPID_X86
        TABLE(avx2), TABLE(avx512)
#endif
    };

    return &table[level];
}

/* ---- memory -------------------------------------------------------------- */

void *splat_block(size_t bytes)
{
    size_t huge = (size_t)2 << 20;
    size_t align = bytes >= huge ? huge : ALIGN;
    void *p = aligned_alloc(align, (bytes + align - 1) / align * align);

#ifdef MADV_HUGEPAGE
    if (p && bytes >= huge)
        madvise(p, bytes, MADV_HUGEPAGE);
#endif
    return p;
}

/* Take bytes of a block; with base NULL only count. */
static void *carve(char *base, size_t *used, size_t bytes)
{
    void *p = base ? base + *used : NULL;

    *used += (bytes + ALIGN - 1) / ALIGN * ALIGN + ALIGN;
    return p;
}

/* Lay out what the picture's size decides; returns the bytes. */
static size_t screen_layout(struct splat_state *st, char *base)
{
    size_t tiles = (size_t)st->view.tx * (size_t)st->view.ty, used = 0;
    size_t cells = (size_t)(st->view.tx + 1) * (size_t)(st->view.ty + 1);
    size_t T = (size_t)st->threads;

    st->start = carve(base, &used, tiles * sizeof *st->start);
    st->end = carve(base, &used, tiles * sizeof *st->end);
    st->zorder = carve(base, &used, tiles * sizeof *st->zorder);
    st->count = carve(base, &used, T * cells * sizeof *st->count);
    st->histogram = carve(base, &used, T * 2048 * sizeof *st->histogram);
    st->work = carve(base, &used, T * st->work_size);
    return used;
}

/* Lay out what the number of Gaussians decides; n padded to 16. */
static size_t cloud_layout(struct splat *s, char *base, size_t n)
{
    struct splat_state *st = s->state;
    size_t used = 0, row = n * sizeof(float);

    for (int k = 0; k < 3; k++) {
        st->cloud.mean[k] = carve(base, &used, row);
        st->cloud.scale[k] = carve(base, &used, row);
    }
    for (int k = 0; k < 4; k++)
        st->cloud.quat[k] = carve(base, &used, row);
    st->cloud.top = carve(base, &used, row);
    st->record = carve(base, &used, n * sizeof *st->record);
    st->color = carve(base, &used, n * sizeof *st->color);
    st->key = carve(base, &used, n * sizeof *st->key);
    for (int k = 0; k < 3; k++)
        st->fine[k] = s->opt.gradients ? carve(base, &used, row) : NULL;
    st->rect = carve(base, &used, n * sizeof *st->rect);
    st->sort0 = carve(base, &used, n * sizeof *st->sort0);
    st->sort1 = carve(base, &used, n * sizeof *st->sort1);
    st->order = carve(base, &used, n * sizeof *st->order);
    st->ordered = carve(base, &used, n * sizeof *st->ordered);
    st->loaded_mean = carve(base, &used, 3 * row);
    st->table = NULL;
    st->fixed = NULL;
    if (st->row && s->opt.fixed16 && SPLAT_FIXED16)
        st->fixed = carve(base, &used, n * 32 * sizeof *st->fixed);
    if (st->row && (!st->fixed || s->opt.gradients))
        st->table = carve(base, &used, (size_t)st->row * row);
    return used;
}

/* ---- init ---------------------------------------------------------------- */

static int check_options(const struct splat_options *o, struct error *err)
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
static uint64_t morton(uint32_t x, uint32_t y)
{
    uint64_t z = 0;

    for (int b = 0; b < 16; b++)
        z |= (uint64_t)(x >> b & 1) << (2 * b) |
             (uint64_t)(y >> b & 1) << (2 * b + 1);
    return z;
}

static int by_value(const void *a, const void *b)
{
    uint64_t p = *(const uint64_t *)a, q = *(const uint64_t *)b;

    return p < q ? -1 : p > q;
}

static int make_zorder(struct splat_state *st)
{
    uint32_t tx = (uint32_t)st->view.tx, ty = (uint32_t)st->view.ty;
    uint64_t *z = malloc((size_t)tx * ty * sizeof *z);

    if (!z)
        return -1;
    for (uint32_t t = 0; t < tx * ty; t++)
        z[t] = morton(t % tx, t / tx) << 24 | t;
    qsort(z, (size_t)tx * ty, sizeof *z, by_value);
    for (uint32_t t = 0; t < tx * ty; t++)
        st->zorder[t] = (uint32_t)(z[t] & 0xffffff);
    free(z);
    return 0;
}

int splat_init(struct splat *s, const struct splat_options *opt,
               struct error *err)
{
    memset(s, 0, sizeof *s);
    if (check_options(opt, err))
        return -1;
    struct splat_state *st = calloc(1, sizeof *st);

    if (!st)
        return error_set(err, EX_OSERR, "out of memory");
    s->opt = *opt;
    if (!opt->exp_degree)
        s->opt.exp_degree = opt->gradients ? 5 : 3;
    if (opt->gradients) {           /* backward starts from the picture */
        s->opt.fixed16 = false;
        s->opt.exp_degree = s->opt.exp_degree <= 3 ? 3 : 5;
    }
    s->state = st;
    st->level = opt->level_set ? opt->level : cpu_level();
    st->work_size = splat_kernels(st->level)->work_size();
    st->threads = opt->threads > 0 ? opt->threads : omp_get_max_threads();
    if (st->threads > SPLAT_MAX_THREADS)
        st->threads = SPLAT_MAX_THREADS;
    if (opt->channels > 4 || (opt->channels == 4 && opt->depth) ||
        (opt->gradients && opt->channels > 3))
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
    s->bytes = screen_layout(st, NULL);
    st->screen = splat_block(s->bytes);
    if (!st->screen)
        goto out;
    screen_layout(st, st->screen);
    if (make_zorder(st) || (opt->gradients && backward_init(s)))
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
        free(st->block);
        free(st->screen);
        free(st->list);
        free(st);
    }
    memset(s, 0, sizeof *s);
}

/* ---- load ---------------------------------------------------------------- */

static int check_array(const float *x, size_t n, size_t row, const char *name,
                       float lo, float hi, const char *expected,
                       struct error *err)
{
    size_t bad = SIZE_MAX;

#pragma omp parallel for reduction(min : bad) if (n * row > 100000)
    for (size_t i = 0; i < n * row; i++)
        if (!(x[i] >= lo && x[i] <= hi))
            bad = i < bad ? i : bad;
    if (bad == SIZE_MAX)
        return 0;
    return error_set(err, EX_DATAERR, "%s[%zu] is %g (expected %s)", name,
                     bad, x[bad], expected);
}

#define WIDEST 3e38f

static int check_gaussians(const struct splat *s, const struct gaussians *g,
                           struct error *err)
{
    static const char finite[] = "a finite number";

    if (g->channels < s->opt.channels)
        return error_set(err, EX_DATAERR, "color has %d channels (expected at "
                         "least %d)", g->channels, s->opt.channels);
    if (check_array(g->mean, g->n, 3, "mean", -WIDEST, WIDEST, finite, err) ||
        check_array(g->scale, g->n, 3, "scale", 0, WIDEST,
                    "a finite number, not negative", err) ||
        check_array(g->quat, g->n, 4, "quat", -WIDEST, WIDEST, finite, err) ||
        check_array(g->opacity, g->n, 1, "opacity", 0, 1, "0 to 1", err))
        return -1;
    if (g->color)
        return check_array(g->color, g->n, (size_t)g->channels, "color",
                           -WIDEST, WIDEST, finite, err);
    for (size_t i = 0; i < g->n * (size_t)g->channels; i++)
        if ((g->color_half[i] & 0x7c00) == 0x7c00)
            return error_set(err, EX_DATAERR, "color[%zu] is not finite "
                             "(expected a finite number)", i);
    return 0;
}

static float color_of(const struct gaussians *g, size_t i, int c)
{
    size_t at = i * (size_t)g->channels + (size_t)c;

    return g->color ? g->color[at] : half_to_float(g->color_half[at]);
}

static void pack_one(struct splat *s, const struct gaussians *g, size_t i)
{
    struct splat_state *st = s->state;
    const float *q = g->quat + 4 * i;
    float len = 1, o = g->opacity[i];

    if (!st->view.dgr) {
        double l2 = 0;

        for (int k = 0; k < 4; k++)
            l2 += (double)q[k] * q[k];
        len = (float)fmax(sqrt(l2), 1e-12);
    }
    for (int k = 0; k < 4; k++)
        st->cloud.quat[k][i] = q[k] / len;
    for (int k = 0; k < 3; k++) {
        st->cloud.mean[k][i] = g->mean[3 * i + (size_t)k];
        st->cloud.scale[k][i] = g->scale[3 * i + (size_t)k];
        st->loaded_mean[3 * i + (size_t)k] = g->mean[3 * i + (size_t)k];
    }
    bool drawn = o > 0 && o >= s->opt.prune &&
                 (!s->opt.branches || !g->branch ||
                  s->opt.branches >> g->branch[i] & 1);

    st->cloud.top[i] = drawn ? log2f(o) : -1e30f;
    for (int c = 0; c < 4; c++)
        st->color[i][c] =
            c < s->opt.channels ? color_of(g, i, c) : 0;
    if (st->table)
        for (int c = 0; c < st->row; c++)
            st->table[i * (size_t)st->row + (size_t)c] =
                c < s->opt.channels ? color_of(g, i, c) : 0;
}

/* Colours in Q15 of each channel's greatest magnitude.  Within each group of
 * 8 the two halves are spread so that interleaving the rows of two Gaussians
 * (unpack low, high) puts channels 0..15 in the first and 16..31 in the
 * second vector. */
static void pack_fixed(struct splat *s, const struct gaussians *g)
{
    struct splat_state *st = s->state;
    float most[SPLAT_MAX_CHANNELS] = {0};
    int C = s->opt.channels;

    for (size_t i = 0; i < g->n; i++)
        for (int c = 0; c < C; c++)
            most[c] = fmaxf(most[c], fabsf(color_of(g, i, c)));
    for (int c = 0; c < SPLAT_MAX_CHANNELS; c++)
        st->fixed_scale[c] = most[c] / (32767.0f * 32767.0f);
#pragma omp parallel for if (g->n > 10000)
    for (size_t i = 0; i < g->n; i++)
        for (int e = 0; e < 32; e++) {
            /* element e of a row: lane e/8, low or high half of the lane */
            int c = e / 8 * 4 + e % 4 + (e % 8 >= 4 ? 16 : 0);
            float x = c < C && most[c] > 0
                ? color_of(g, i, c) / most[c] * 32767 : 0;

            st->fixed[i * 32 + (size_t)e] = (int16_t)lrintf(x);
        }
}

int splat_load(struct splat *s, const struct gaussians *g, struct error *err)
{
    struct splat_state *st = s->state;
    size_t n = (g->n + 15) / 16 * 16 + 16;

    if (g->n >= UINT32_MAX / 64)
        return error_set(err, EX_DATAERR, "%zu Gaussians (expected at most "
                         "%u)", g->n, UINT32_MAX / 64);
    if (check_gaussians(s, g, err))
        return -1;
    if (!st->block || s->n != g->n) {
        size_t bytes = cloud_layout(s, NULL, n);

        free(st->block);
        s->bytes += bytes - st->block_bytes;
        st->block_bytes = bytes;
        st->block = splat_block(bytes);
        if (!st->block) {
            s->n = 0;
            return error_set(err, EX_OSERR, "%zu Gaussians: out of memory",
                             g->n);
        }
        memset(st->block, 0, bytes);
        cloud_layout(s, st->block, n);
    }
    s->n = g->n;
#pragma omp parallel for num_threads(st->threads) if (g->n > 10000)
    for (size_t i = 0; i < g->n; i++)
        pack_one(s, g, i);
    for (size_t i = g->n; i < n; i++)
        st->cloud.top[i] = -1e30f;
    if (st->fixed)
        pack_fixed(s, g);
    st->projected = false;
    if (s->opt.gradients)
        return backward_load(s, g, err);
    return 0;
}

/* ---- moving -------------------------------------------------------------- */

static int check_range(const struct splat *s, size_t first, size_t count,
                       struct error *err)
{
    if (first > s->n || count > s->n - first)
        return error_set(err, EX_DATAERR, "Gaussians %zu to %zu move "
                         "(expected below %zu)", first, first + count, s->n);
    return 0;
}

static void mark(struct splat_state *st, size_t first, size_t count)
{
    if (first < st->dirty0)
        st->dirty0 = first;
    if (first + count > st->dirty1)
        st->dirty1 = first + count;
}

int splat_update(struct splat *s, const float *mean, size_t first,
                 size_t count, struct error *err)
{
    struct splat_state *st = s->state;

    if (check_range(s, first, count, err) ||
        check_array(mean, count, 3, "mean", -WIDEST, WIDEST,
                    "a finite number", err))
        return -1;
    for (size_t i = 0; i < count; i++)
        for (int k = 0; k < 3; k++)
            st->cloud.mean[k][first + i] = mean[3 * i + (size_t)k];
    mark(st, first, count);
    return 0;
}

int splat_shift(struct splat *s, const float shift[3], size_t first,
                size_t count, struct error *err)
{
    struct splat_state *st = s->state;

    if (check_range(s, first, count, err) ||
        check_array(shift, 1, 3, "shift", -WIDEST, WIDEST, "a finite number",
                    err))
        return -1;
    for (size_t i = first; i < first + count; i++)
        for (int k = 0; k < 3; k++)
            st->cloud.mean[k][i] =
                st->loaded_mean[3 * i + (size_t)k] + shift[k];
    mark(st, first, count);
    return 0;
}

/* ---- drawing ------------------------------------------------------------- */

static int check_camera(const struct splat_camera *cam, struct error *err)
{
    const float *P = cam->rt;
    double det = P[0] * ((double)P[5] * P[10] - (double)P[6] * P[9]) -
                 P[1] * ((double)P[4] * P[10] - (double)P[6] * P[8]) +
                 P[2] * ((double)P[4] * P[9] - (double)P[5] * P[8]);

    if (check_array(P, 12, 1, "cam", -1e18f, 1e18f, "a finite number", err))
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

static void set_camera(struct splat_state *st, const struct splat_camera *cam)
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

static int draw(struct splat *s, struct target *out,
                const struct splat_camera *cam, struct error *err)
{
    if (!s->state->block)
        return error_set(err, EX_SOFTWARE, "nothing loaded (expected "
                         "splat_load before splat_forward)");
    if (out->depth && !s->opt.depth)
        return error_set(err, EX_SOFTWARE, "depth asked for (expected the "
                         "option when the renderer was made)");
    if (check_camera(cam, err))
        return -1;
    set_camera(s->state, cam);
    if (s->opt.gradients)
        backward_keep(s, out);
    return frame_draw(s, out, err);
}

int splat_forward(struct splat *s, float *image, float *alpha, float *depth,
                  const struct splat_camera *cam, const float *background,
                  struct error *err)
{
    struct target out = {.image = image, .alpha = alpha, .depth = depth,
                         .background = background};

    return draw(s, &out, cam, err);
}

int splat_forward_half(struct splat *s, uint16_t *image, float *alpha,
                       float *depth, const struct splat_camera *cam,
                       const float *background, struct error *err)
{
    struct target out = {.half = image, .alpha = alpha, .depth = depth,
                         .background = background};

    return draw(s, &out, cam, err);
}
