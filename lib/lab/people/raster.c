/* Triangles and strands by spans, nearest sample first. */
#include "lib/lab/people/raster.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/lab/people/vec.h"

int raster_init(struct raster *r, int w, int h, struct error *err)
{
    size_t n = (size_t)w * (size_t)h;

    *r = (struct raster){ .w = w, .h = h };
    r->q = malloc(n * sizeof *r->q);
    r->id = malloc(n * sizeof *r->id);
    r->b1 = malloc(n * sizeof *r->b1);
    r->b2 = malloc(n * sizeof *r->b2);
    if (r->q && r->id && r->b1 && r->b2)
        return 0;
    raster_release(r);
    return error_set(err, EX_OSERR, "out of memory for %dx%d samples", w, h);
}

void raster_release(struct raster *r)
{
    free(r->q);
    free(r->id);
    free(r->b1);
    free(r->b2);
    *r = (struct raster){ 0 };
}

void raster_clear(struct raster *r)
{
    size_t n = (size_t)r->w * (size_t)r->h;

    memset(r->q, 0, n * sizeof *r->q);
    memset(r->id, 0xff, n * sizeof *r->id);
}

/* An edge function A x + B y + C, >= 0 inside.  Swapping its ends negates
 * every coefficient exactly, so neighbours leave no crack. */
struct edge {
    float a, b, c;
};

static struct edge raster_edge_of(const struct raster_vertex *p,
                                  const struct raster_vertex *q)
{
    return (struct edge){ p->y - q->y, q->x - p->x, p->x * q->y - q->x * p->y };
}

/* Narrow [lo, hi] to where the edge is >= 0 on the row at y. */
static void raster_edge_clip(const struct edge *e, float y, float *lo,
                             float *hi)
{
    float rest = e->b * y + e->c;

    if (e->a > 0) {
        float x = -rest / e->a;
        if (x > *lo)
            *lo = x;
    } else if (e->a < 0) {
        float x = -rest / e->a;
        if (x < *hi)
            *hi = x;
    } else if (rest < 0) {
        *hi = *lo - 1;
    }
}

/* A row of a triangle; the nearer sample wins. */
static void raster_fill_span(struct raster *r, int y, int x0, int x1,
                             uint32_t id, const float q[3], const float b[4],
                             float ox, float oy)
{
    size_t row = (size_t)y * (size_t)r->w;
    float fy = (float)y + 0.5f - oy;
    float q0 = q[2] + q[1] * fy;

    for (int x = x0; x <= x1; x++) {
        float fx = (float)x + 0.5f - ox;
        float qv = q0 + q[0] * fx;
        if (qv <= r->q[row + (size_t)x])
            continue;
        r->q[row + (size_t)x] = qv;
        r->id[row + (size_t)x] = id;
        r->b1[row + (size_t)x] = b[0] * fx + b[1] * fy;
        r->b2[row + (size_t)x] = b[2] * fx + b[3] * fy;
    }
}

/* Perspective-correct weights by edge functions, scanline by scanline. */
static void raster_triangle(struct raster *r, const struct raster_vertex *a,
                            const struct raster_vertex *b,
                            const struct raster_vertex *c, uint32_t id,
                            int cull)
{
    float area = (b->x - a->x) * (c->y - a->y) - (c->x - a->x) * (b->y - a->y);
    int flip = area < 0;

    if (area == 0 || (!flip && cull) || a->q <= 0 || b->q <= 0 || c->q <= 0)
        return;
    float ymin = minf(a->y, minf(b->y, c->y));
    float ymax = maxf(a->y, maxf(b->y, c->y));
    float xmin = minf(a->x, minf(b->x, c->x));
    float xmax = maxf(a->x, maxf(b->x, c->x));
    if (!(ymax > 0 && xmax > 0 && ymin < (float)r->h && xmin < (float)r->w))
        return;
    int y0 = ceil_int(maxf(ymin, 0) - 0.5f);
    int y1 = floor_int(minf(ymax, (float)r->h) - 0.5f);
    y0 = y0 < 0 ? 0 : y0;
    y1 = y1 >= r->h ? r->h - 1 : y1;
    float inv = 1 / area;
    /* weights of b and c as planes about a, and q from them */
    float w[4] = { (c->y - a->y) * inv, -(c->x - a->x) * inv,
                   -(b->y - a->y) * inv, (b->x - a->x) * inv };
    float q[3] = { w[0] * (b->q - a->q) + w[2] * (c->q - a->q),
                   w[1] * (b->q - a->q) + w[3] * (c->q - a->q), a->q };
    struct edge e[3] = { raster_edge_of(a, b), raster_edge_of(b, c),
                        raster_edge_of(c, a) };
    for (int i = 0; flip && i < 3; i++)
        e[i] = (struct edge){ -e[i].a, -e[i].b, -e[i].c };
    for (int y = y0; y <= y1; y++) {
        float lo = xmin, hi = xmax, fy = (float)y + 0.5f;
        for (int i = 0; i < 3; i++)
            raster_edge_clip(&e[i], fy, &lo, &hi);
        if (!(hi >= 0 && lo <= (float)r->w && hi >= lo))
            continue;
        int x0 = ceil_int(maxf(lo, 0) - 0.5f);
        int x1 = floor_int(minf(hi, (float)r->w) - 0.5f);
        x0 = x0 < 0 ? 0 : x0;
        x1 = x1 >= r->w ? r->w - 1 : x1;
        raster_fill_span(r, y, x0, x1, id, q, w, a->x, a->y);
    }
}

void raster_triangles(struct raster *r, const struct raster_vertex *v,
                      const int32_t *faces, size_t count, uint32_t base,
                      int cull)
{
    for (size_t i = 0; i < count; i++) {
        const int32_t *f = faces + 3 * i;
        raster_triangle(r, &v[f[0]], &v[f[1]], &v[f[2]], base + (uint32_t)i,
                        cull);
    }
}

/* A cheap hash to thin out strands that are narrower than a sample. */
static float raster_hash_strand(uint32_t id, int step)
{
    uint32_t h = id * 0x9e3779b1u ^ (uint32_t)step * 0x85ebca6bu;

    h ^= h >> 15;
    h *= 0x2c1b3c6du;
    h ^= h >> 13;
    return (float)(h >> 8) * (1.0f / 16777216.0f);
}

/* One sample, if it lies in the picture and nothing nearer does. */
static void raster_put(struct raster *r, int x, int y, float q, uint32_t id,
                       float t, float u)
{
    if (x < 0 || y < 0 || x >= r->w || y >= r->h)
        return;
    size_t k = (size_t)y * (size_t)r->w + (size_t)x;
    if (q <= r->q[k])
        return;
    r->q[k] = q;
    r->id[k] = id;
    r->b1[k] = t;
    r->b2[k] = u;
}

/* A strand's segment, a sample for each step along its longer axis. */
static void raster_segment(struct raster *r, const struct raster_vertex *a,
                           const struct raster_vertex *b, uint32_t id, float wa,
                           float wb)
{
    float dx = b->x - a->x, dy = b->y - a->y;
    int steep = fabsf(dy) > fabsf(dx);
    float major = steep ? dy : dx, minor = steep ? dx : dy;
    float pa = steep ? a->y : a->x, oa = steep ? a->x : a->y;
    int limit = steep ? r->h : r->w;

    if (a->q <= 0 || b->q <= 0 || fabsf(major) < 1e-6f)
        return;
    float slope = minor / major, grow = sqrtf(1 + slope * slope);
    float from = minf(pa, pa + major), to = maxf(pa, pa + major);
    if (!(to > 0 && from < (float)limit))
        return;
    int p0 = ceil_int(maxf(from, 0) - 0.5f);
    int p1 = ceil_int(minf(to, (float)limit) - 0.5f);
    for (int p = p0; p < p1; p++) {
        float along = (float)p + 0.5f - pa, t = along / major;
        float half = lerpf(wa, wb, t) * grow, mid = oa + slope * along;
        float q = lerpf(a->q, b->q, t);
        if (half < 0.5f) {
            if (raster_hash_strand(id, p) > 2 * half)
                continue;
            half = 0.5f;
        }
        int lo = ceil_int(mid - half - 0.5f);
        int hi = ceil_int(mid + half - 0.5f);
        for (int o = lo; o < hi; o++) {
            float u = ((float)o + 0.5f - mid) / half;
            raster_put(r, steep ? o : p, steep ? p : o, q, id, t, u);
        }
    }
}

void raster_strand(struct raster *r, const struct raster_vertex *v, int n,
                   uint32_t base, float half, float tip)
{
    for (int i = 0; i + 1 < n; i++) {
        float t0 = (float)i / (float)(n - 1);
        float t1 = (float)(i + 1) / (float)(n - 1);
        raster_segment(r, &v[i], &v[i + 1],
                       (base + (uint32_t)i) | RASTER_STRAND,
                       half * lerpf(1, tip, t0), half * lerpf(1, tip, t1));
    }
}
