/* Gaussians, row by row as they are given, to one array per number. */
#include "lib/splat/state.h"

#include <math.h>
#include <string.h>

#include "lib/base/half.h"
#include "lib/base/parallel.h"

/* Channel c of Gaussian i. */
static float pack_color(const struct gaussians *g, size_t i, int c)
{
    size_t at = i * (size_t)g->channels + (size_t)c;

    return g->color ? g->color[at] : half_to_float(g->color_half[at]);
}

/* Everything but the 16-bit colours of Gaussian i: the quaternion normalised
 * unless DGR, opacity as its logarithm, which is what the exponent adds to. */
PARALLEL(pack_one, i, struct splat *, s, const struct gaussians *, g)
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
    }
    bool drawn = o > 0 && o >= s->opt.prune &&
                 (!s->opt.branches || !g->branch ||
                  s->opt.branches >> g->branch[i] & 1);

    st->cloud.top[i] = drawn ? log2f(o) : -1e30f;
    if (st->place) {
        st->cloud.seen[i] = gaussians_seen(g, i);
        st->cloud.thin[i] = gaussians_thin(g, i);
        st->cloud.lit[i] =
            g->normal ? 1 / gaussian_light(g->normal + 3 * i, g->light) : 1;
        for (int k = 0; k < 3; k++)
            st->cloud.normal[k][i] =
                g->normal ? g->normal[3 * i + (size_t)k] : 0;
        for (int k = 0; k < 2; k++) {
            const size_t at = 2 * i + (size_t)k;

            st->cloud.uv[k][i] = g->uv ? 2 * g->uv[at] - 1 : 0;
            st->cloud.tilt[k][i] = g->tilt ? g->tilt[at] : 0;
            st->cloud.around[k][i] = g->around ? 2 * g->around[at] - 1
                                               : SPLAT_PLACE_NOWHERE;
        }
    }
    for (int c = 0; c < 4; c++)
        st->color[i][c] =
            c < s->opt.channels ? pack_color(g, i, c) : 0;
    if (st->table)
        for (int c = 0; c < st->row; c++)
            st->table[i * (size_t)st->row + (size_t)c] =
                c < s->opt.channels ? pack_color(g, i, c) : 0;
}

PARALLEL(pack_fixed_part, i, float *, max, const struct gaussians *, g,
         struct splat_state *, st, int, C)
{
    for (int e = 0; e < 32; e++) {
        /* element e of a row: lane e/8, low or high half of the lane */
        int c = e / 8 * 4 + e % 4 + (e % 8 >= 4 ? 16 : 0);
        float x = c < C && max[c] > 0 ? pack_color(g, i, c) / max[c] * 32767
                                       : 0;

        st->fixed[i * 32 + (size_t)e] = (int16_t)lrintf(x);
    }
}

/* Colours in Q15 of each channel's greatest magnitude.  Within each group of
 * 8 the two halves are spread so that interleaving the rows of two Gaussians
 * (unpack low, high) puts channels 0..15 in the first and 16..31 in the
 * second vector. */
static void pack_fixed(struct splat *s, const struct gaussians *g)
{
    struct splat_state *st = s->state;
    float max[SPLAT_MAX_CHANNELS] = {0};
    int C = s->opt.channels;

    for (size_t i = 0; i < g->n; i++)
        for (int c = 0; c < C; c++) {
            const float x = fabsf(pack_color(g, i, c));

            max[c] = x > max[c] ? x : max[c];
        }
    for (int c = 0; c < SPLAT_MAX_CHANNELS; c++)
        st->fixed_scale[c] = max[c] / (32767.0f * 32767.0f);

    parallel_each(pack_fixed_part, g->n, g->n > 10000 ? 1 : g->n, max, g, st,
                  C);
}

void pack_gaussians(struct splat *s, const struct gaussians *g)
{
    struct splat_state *st = s->state;
    size_t n = (g->n + PAD - 1) / PAD * PAD + PAD;

    st->grained = st->place && g->around;
    parallel_each(pack_one, g->n, g->n > 10000 ? 1 : g->n, s, g);
    for (size_t i = g->n; i < n; i++)
        st->cloud.top[i] = -1e30f;
    if (st->fixed)
        pack_fixed(s, g);
}
