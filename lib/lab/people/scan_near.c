/* Points by the cell they lie in, in a hash table. */
#include "lib/lab/people/scan_near.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/lab/people/vec.h"

static int near_cell_of(const struct near_grid *g, const float x[3], int k)
{
    int c = (int)floorf((x[k] - g->lo[k]) / g->cell);

    return c < 0 ? 0 : c >= g->dim[k] ? g->dim[k] - 1 : c;
}

static size_t near_slot_of(const struct near_grid *g, const float x[3])
{
    return ((size_t)near_cell_of(g, x, 2) * (size_t)g->dim[1]
            + (size_t)near_cell_of(g, x, 1)) * (size_t)g->dim[0]
           + (size_t)near_cell_of(g, x, 0);
}

int near_init(struct near_grid *g, const float *p, size_t n, float cell,
              struct arena *memory, struct error *err)
{
    float hi[3];
    size_t cells = 1;

    *g = (struct near_grid){.p = p, .n = n, .cell = cell};
    for (int k = 0; k < 3; k++) {
        g->lo[k] = hi[k] = p[k];
        for (size_t i = 1; i < n; i++) {
            g->lo[k] = minf(g->lo[k], p[3 * i + (size_t)k]);
            hi[k] = maxf(hi[k], p[3 * i + (size_t)k]);
        }
        g->dim[k] = (int)((hi[k] - g->lo[k]) / cell) + 1;
        g->dim[k] = g->dim[k] > 256 ? 256 : g->dim[k];
        cells *= (size_t)g->dim[k];
    }
    g->start = arena_take(memory, cells + 1, sizeof *g->start);
    g->item = arena_take(memory, n, sizeof *g->item);
    if (arena_check(memory, "points", err))
        return -1;
    for (size_t i = 0; i < n; i++)
        g->start[near_slot_of(g, p + 3 * i) + 1]++;
    for (size_t i = 0; i < cells; i++)
        g->start[i + 1] += g->start[i];
    for (size_t i = n; i-- > 0;)
        g->item[--g->start[near_slot_of(g, p + 3 * i) + 1]] = (int32_t)i;
    /* starts have moved down by one slot */
    memmove(g->start, g->start + 1, cells * sizeof *g->start);
    g->start[cells] = (int32_t)n;
    return 0;
}

/* Point i at squared distance d into the sorted list of at most k. */
static int near_insert(int32_t *index, float *d2, int have, int k, int32_t i,
                       float d)
{
    int at = have < k ? have : k - 1;

    if (have == k && d >= d2[k - 1])
        return have;
    while (at > 0 && d2[at - 1] > d) {
        d2[at] = d2[at - 1];
        index[at] = index[at - 1];
        at--;
    }
    d2[at] = d;
    index[at] = i;
    return have < k ? have + 1 : k;
}

/* Take those of a cell's points that are near enough and whose normals agree
 * into the k nearest. */
static int near_scan_slot(int32_t *index, float *d2, int have, int k,
                          const struct near_grid *g, size_t slot,
                          const float x[3], const float *n, float limit)
{
    for (int32_t j = g->start[slot]; j < g->start[slot + 1]; j++) {
        int32_t i = g->item[j];
        float d[3], l;
        sub3(d, g->p + 3 * i, x);
        l = dot3(d, d);
        if (l > limit || (n && g->normal
                          && dot3(n, g->normal + 3 * i) < 0.5f))
            continue;
        have = near_insert(index, d2, have, k, i, l);
    }
    return have;
}

/* Squared distance of x from the grid: 0 inside. */
static float near_outside(const struct near_grid *g, const float x[3])
{
    float sum = 0;

    for (int k = 0; k < 3; k++) {
        float below = g->lo[k] - x[k];
        float above = -below - (float)g->dim[k] * g->cell;
        float out = maxf(maxf(below, above), 0);
        sum += out * out;
    }
    return sum;
}

int near_find(int32_t *index, float *d2, const struct near_grid *g,
              const float x[3], const float *n, int k, float reach)
{
    float d[NEAR_MAX];
    int have = 0, rings = (int)ceilf(reach / g->cell) + 1;
    int at[3], widest = 0;
    float outside = near_outside(g, x);

    k = k > NEAR_MAX ? NEAR_MAX : k;
    for (int a = 0; a < 3; a++) {
        at[a] = near_cell_of(g, x, a);
        widest = g->dim[a] > widest ? g->dim[a] : widest;
    }
    rings = rings > widest ? widest : rings;
    for (int r = 0; r <= rings; r++) {
        float done = (float)(r - 1) * g->cell;
        /* a cell of this ring lies so far along one axis, and x beyond the
         * grid along others or further on along the same */
        if (have == k && r > 1 && d[k - 1] < done * done + outside)
            break;
        for (int z = at[2] - r; z <= at[2] + r; z++)
            for (int y = at[1] - r; y <= at[1] + r; y++) {
                int shell = abs(z - at[2]) == r || abs(y - at[1]) == r;
                if (z < 0 || y < 0 || z >= g->dim[2] || y >= g->dim[1])
                    continue;
                for (int u = at[0] - r; u <= at[0] + r;
                     u += shell || r == 0 ? 1 : 2 * r) {
                    if (u < 0 || u >= g->dim[0])
                        continue;
                    size_t slot = ((size_t)z * (size_t)g->dim[1] + (size_t)y)
                                  * (size_t)g->dim[0] + (size_t)u;
                    have = near_scan_slot(index, d, have, k, g, slot, x, n,
                                          reach * reach);
                }
            }
    }
    for (int i = 0; d2 && i < have; i++)
        d2[i] = d[i];
    return have;
}

void near_bind(int32_t index[4], float weight[4], const struct near_grid *g,
               const float x[3])
{
    float d2[4], sum = 0;
    int have = near_find(index, d2, g, x, NULL, 4, 1e3f);

    for (int i = 0; i < 4; i++) {
        if (i >= have)
            index[i] = index[0];
        weight[i] = i < have ? 1 / (d2[i] + 1e-5f) : 0;
        sum += weight[i];
    }
    for (int i = 0; i < 4; i++)
        weight[i] /= sum;
}
