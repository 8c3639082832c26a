/* How time and memory grow: curves, their exponents (slopes of the logarithms)
 * and what of them does not grow; and the curves of the rasteriser. */
#include "lib/lab/bench/bench_growth.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sysexits.h>

#include "lib/lab/bench/bench_splat.h"

#define GROWTH_GAUSSIANS 100000         /* where they stay as many */
#define GROWTH_SIDE 512

/* ---- curves -------------------------------------------------------------- */

bool growth_goes_on(const struct growth *g, double x)
{
    if (g->n == 0)
        return true;
    return g->n < GROWTH_POINTS &&
           1e-3 * g->ms[g->n - 1] * x / g->x[g->n - 1] < g->b->seconds;
}

int growth_add(struct growth *g, double x, const struct bench_times *t,
               double mb, int threads, struct error *err)
{
    char config[96], knob[64] = "default";

    snprintf(config, sizeof config, "%.9g %s (%s)", x, g->of, g->how);
    if (isfinite(mb))
        snprintf(knob, sizeof knob, "peak %.0f MB", mb);
    g->x[g->n] = x;
    g->ms[g->n] = t->min;
    g->mb[g->n++] = mb;
    return bench_add(g->b, "growth", config, knob, threads, t, NAN, NAN)
               ? 0 : error_set(err, EX_OSERR, "out of memory");
}

/* The exponent of ms ~ x^e between points first and last, *r2 beside it. */
static double growth_exponent(const struct growth *g, size_t first,
                              size_t last, double *r2)
{
    double x[GROWTH_POINTS], y[GROWTH_POINTS];
    size_t n = 0;

    for (size_t i = first; i <= last; i++, n++) {
        x[n] = log(g->x[i]);
        y[n] = log(g->ms[i]);
    }
    struct bench_line l = bench_fit(x, y, n);
    if (r2)
        *r2 = l.r2;
    return l.slope;
}

/* ms = *fixed + *each x, by least squares of what is off as a share of ms. */
static void growth_split(double *fixed, double *each, const struct growth *g)
{
    double a = 0, b = 0, c = 0, p = 0, q = 0;

    for (size_t i = 0; i < g->n; i++) {
        double u = 1 / g->ms[i], v = g->x[i] / g->ms[i];

        a += u * u;
        b += u * v;
        c += v * v;
        p += u;
        q += v;
    }
    const double det = a * c - b * b;
    *fixed = det > 0 ? (p * c - q * b) / det : 0;
    *each = det > 0 ? (q * a - p * b) / det : 0;
}

void growth_note(struct growth *g)
{
    char steps[160] = "";
    double r2, fixed, each, slope;

    if (g->n < 2)
        return;
    for (size_t i = 0; i + 1 < g->n; i++) {
        size_t at = strlen(steps);

        snprintf(steps + at, sizeof steps - at, " %.2f",
                 growth_exponent(g, i, i + 1, NULL));
    }
    slope = growth_exponent(g, 0, g->n - 1, &r2);
    growth_split(&fixed, &each, g);
    bench_note(g->b, "growth, %s %.9g to %.9g (%s): time ~ x^%.2f (r2 %.3f), "
               "from point to point%s", g->of, g->x[0], g->x[g->n - 1], g->how,
               slope, r2, steps);
    if (fixed > 0 && each > 0)
        bench_note(g->b, "    %.3g ms + %.3g ms each: under %.3g the part that "
                   "does not grow is the larger", fixed, each, fixed / each);
    if (isfinite(g->mb[0]))
        bench_note(g->b, "    memory %.0f MB at the first point, %.0f at the "
                   "last", g->mb[0], g->mb[g->n - 1]);
}

/* ---- the rasteriser ------------------------------------------------------ */

/* One point: n Gaussians on so many threads, side x side pixels. */
static int growth_draw(struct growth *g, double x, size_t n, int side,
                       int threads, struct error *err)
{
    const double seconds = g->b->seconds / 40;
    struct bench_times t;

    return bench_splat_time(&t, seconds, n, side, threads, err) ||
           growth_add(g, x, &t, NAN, threads, err) ? -1 : 0;
}

/* Time over Gaussians, at one size. */
static int growth_gaussians(struct bench *b, struct error *err)
{
    static const size_t count[] = {10000, 30000, 100000, 300000, 1000000};
    struct growth g = {.b = b, .of = "Gaussians",
                       .how = "512x512, 3 channels"};

    for (size_t i = 0; i < 5 && growth_goes_on(&g, (double)count[i]); i++)
        if (growth_draw(&g, (double)count[i], count[i], GROWTH_SIDE,
                        b->threads, err))
            return -1;
    growth_note(&g);
    return 0;
}

/* Time over pixels, with the same Gaussians. */
static int growth_pixels(struct bench *b, struct error *err)
{
    struct growth g = {.b = b, .of = "pixels",
                       .how = "100,000 Gaussians, 3 channels"};

    for (int side = 128; side <= 2048; side *= 2) {
        const double x = (double)side * side;

        if (!growth_goes_on(&g, x))
            break;
        if (growth_draw(&g, x, GROWTH_GAUSSIANS, side, b->threads, err))
            return -1;
    }
    growth_note(&g);
    return 0;
}

/* Time over threads; a doubling should halve it. */
static int growth_threads(struct bench *b, struct error *err)
{
    struct growth g = {.b = b, .of = "threads",
                       .how = "100,000 Gaussians, 512x512"};

    for (int t = 1; t <= b->threads && g.n < GROWTH_POINTS; t *= 2)
        if (growth_draw(&g, t, GROWTH_GAUSSIANS, GROWTH_SIDE, t, err))
            return -1;
    growth_note(&g);
    return 0;
}

int bench_growth(struct bench *b, struct error *err)
{
    /* programs first, while this process is small: see process_run */
    return growth_of_programs(b, err) || growth_gaussians(b, err) ||
           growth_pixels(b, err) || growth_threads(b, err) ? -1 : 0;
}
