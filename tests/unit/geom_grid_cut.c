/* The minimum cut of a grid against a plain one (paths by breadth-first search
 * over a matrix of capacities), on small grids of random capacities: the cut's
 * capacity is the flow's, and where it is the only one the sides are the
 * same. */
#include <string.h>

#include "lib/base/random.h"
#include "lib/geom/grid_cut.h"
#include "tests/check.h"

enum { MOST = 30, NODES = MOST + 2 };   /* pixels; and the terminals */

struct grid {
    size_t w, h;
    int32_t capacity[NODES][NODES];     /* source MOST, sink MOST + 1 */
};

/* The neighbour of (x,y) in that direction, or MOST beyond the border. */
static size_t grid_neighbour(const struct grid *g, size_t x, size_t y, int dir)
{
    static const int dx[GRID_CUT_NEIGHBOURS] = {-1, 0, 1, -1, 1, -1, 0, 1};
    static const int dy[GRID_CUT_NEIGHBOURS] = {-1, -1, -1, 0, 0, 1, 1, 1};
    const size_t u = x + (size_t)dx[dir], v = y + (size_t)dy[dir];

    return u < g->w && v < g->h ? v * g->w + u : MOST;
}

/* The same random edges in both; some pixels have none to a
 * terminal. */
static void grid_draw(struct grid *g, struct grid_cut *cut, struct random *r,
                      uint32_t largest)
{
    memset(g->capacity, 0, sizeof g->capacity);
    for (size_t i = 0; i < g->w * g->h; i++) {
        const size_t x = i % g->w, y = i / g->w;
        int32_t to = random_below(r, 3) ? (int32_t)random_below(r, 2 * largest)
                                        : (int32_t)largest;

        to -= (int32_t)largest;
        g->capacity[MOST][i] = to > 0 ? to : 0;
        g->capacity[i][MOST + 1] = to < 0 ? -to : 0;
        grid_cut_link_terminal(cut, x, y, to);
        for (int dir = 0; dir < GRID_CUT_NEIGHBOURS / 2; dir++) {
            const size_t j = grid_neighbour(g, x, y, dir);
            const int32_t capacity = (int32_t)random_below(r, largest);

            if (j == MOST)
                continue;
            g->capacity[i][j] = g->capacity[j][i] = capacity;
            grid_cut_link(cut, x, y, dir, capacity);
        }
    }
}

/* from[i]: before node i on a shortest path from the source (NODES: none);
 * whether the sink has one. */
static bool plain_search(size_t from[NODES], int32_t left[NODES][NODES])
{
    size_t queue[NODES] = {MOST}, count = 1;

    for (size_t i = 0; i < NODES; i++)
        from[i] = NODES;
    from[MOST] = MOST;
    for (size_t k = 0; k < count; k++)
        for (size_t j = 0; j < NODES; j++)
            if (from[j] == NODES && left[queue[k]][j] > 0) {
                from[j] = queue[k];
                queue[count++] = j;
            }
    return from[MOST + 1] != NODES;
}

/* The flow; left becomes what it leaves. */
static int64_t plain_flow(int32_t left[NODES][NODES])
{
    size_t from[NODES];
    int64_t all = 0;

    while (plain_search(from, left)) {
        int32_t flow = INT32_MAX;

        for (size_t i = MOST + 1; i != MOST; i = from[i])
            flow = left[from[i]][i] < flow ? left[from[i]][i] : flow;
        for (size_t i = MOST + 1; i != MOST; i = from[i]) {
            left[from[i]][i] -= flow;
            left[i][from[i]] += flow;
        }
        all += flow;
    }
    return all;
}

/* The capacity of what ties the source's side to the sink's. */
static int64_t cut_capacity(const struct grid *g, const struct grid_cut *cut)
{
    bool source[NODES] = {[MOST] = true};
    int64_t sum = 0;

    for (size_t i = 0; i < g->w * g->h; i++)
        source[i] = grid_cut_is_source(cut, i % g->w, i / g->w);
    for (size_t i = 0; i < NODES; i++)
        for (size_t j = 0; j < NODES; j++)
            sum += source[i] && !source[j] ? g->capacity[i][j] : 0;
    return sum;
}

/* Pixels on another side than the plain cut has them; 0 where there are several
 * cuts: who is neither reached from the source nor reaches the sink may be on
 * either. */
static size_t cut_differs(const struct grid *g, const struct grid_cut *cut,
                          int32_t left[NODES][NODES])
{
    int32_t back[NODES][NODES];
    size_t from[NODES], to[NODES], n = 0;

    plain_search(from, left);
    for (size_t i = 0; i < NODES; i++)      /* the sink's side, from the sink */
        for (size_t j = 0; j < NODES; j++) {
            const size_t a = i < MOST ? i : 2 * MOST + 1 - i;
            const size_t b = j < MOST ? j : 2 * MOST + 1 - j;

            back[a][b] = left[j][i];
        }
    plain_search(to, back);
    for (size_t i = 0; i < g->w * g->h; i++) {
        const bool source = grid_cut_is_source(cut, i % g->w, i / g->w);

        n += (from[i] != NODES && !source) || (to[i] != NODES && source);
    }
    return n;
}

/* Grids of one size: how many cuts are not the least, or elsewhere. */
static size_t cut_check_size(size_t w, size_t h, uint32_t largest,
                             struct random *r)
{
    static struct grid g;
    struct error err = {0};
    struct grid_cut cut;
    size_t bad = 0;

    g.w = w;
    g.h = h;
    REQUIRE(grid_cut_init(&cut, w, h, &err) == 0, "%s", err.text);
    for (int i = 0; i < 60; i++) {
        grid_cut_clear(&cut);
        grid_draw(&g, &cut, r, largest);
        REQUIRE(grid_cut_run(&cut, &err) == 0, "%s", err.text);
        int32_t left[NODES][NODES];

        memcpy(left, g.capacity, sizeof left);
        bad += plain_flow(left) != cut_capacity(&g, &cut);
        bad += cut_differs(&g, &cut, left);
    }
    grid_cut_release(&cut);
    return bad;
}

int main(void)
{
    static const size_t size[][2] = {
        {1, 1}, {1, 2}, {30, 1}, {1, 30}, {2, 2}, {3, 5}, {15, 2}, {5, 6}
    };
    struct random r;

    random_init(&r, 1, "grid cut");
    for (size_t i = 0; i < sizeof size / sizeof *size; i++)
        for (uint32_t largest = 4; largest <= 4000000; largest *= 1000) {
            char what[80];

            snprintf(what, sizeof what, "%zu x %zu, capacity < %u: cuts that "
                     "differ", size[i][0], size[i][1], largest);
            check(what, (double)cut_check_size(size[i][0], size[i][1], largest,
                                               &r), 0);
        }
    return check_status();
}
