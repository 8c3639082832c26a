/* Maximum flow by incremental breadth-first search (Goldberg et al. 2011,
 * "Maximum flows by incremental breadth-first search"): a tree grows from
 * either terminal, level by level, and where they meet, flow is augmented along
 * the shortest path.  Nodes whose edge to their parent is saturated by that are
 * orphans: they find another parent in the level below, or are relabelled to
 * the least level that has one.  Capacities are whole numbers, so the cut is
 * exact. */
#include "lib/geom/grid_cut.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/list.h"

enum { FREE, SOURCE, SINK, TREES };             /* struct grid_cut_node.tree */
/* struct grid_cut_node.parent where it is no neighbour. */
enum { TERMINAL = GRID_CUT_NEIGHBOURS, NO_PARENT };

/* Nodes to be scanned. */
struct queue {
    int32_t *node;
    size_t count, room;
};

struct search {
    struct grid_cut_node *node;
    ptrdiff_t step[GRID_CUT_NEIGHBOURS];    /* to a neighbour's number */
    int32_t *orphan;                /* each level's first, or -1 */
    int32_t deepest;                /* greatest level of an orphan */
    int32_t limit[TREES];           /* greatest level of a tree's nodes */
    struct queue active[TREES];     /* the nodes there; some have left since */
    struct queue grown;             /* nodes of the next level, while a tree
                                     * grows */
    int growing;                    /* that tree */
    bool failed;                    /* out of memory */
};

/* ---- edges --------------------------------------------------------------- */

/* The direction that leads back. */
static int grid_cut_opposite(int dir)
{
    return GRID_CUT_NEIGHBOURS - 1 - dir;
}

int grid_cut_init(struct grid_cut *g, size_t width, size_t height,
                  struct error *err)
{
    memset(g, 0, sizeof *g);
    g->width = width;
    g->height = height;
    g->node = calloc((width + 2) * (height + 2), sizeof *g->node);
    return g->node ? 0 : error_set(err, EX_OSERR, "no memory for a cut of "
                                   "%zu x %zu pixels", width, height);
}

void grid_cut_release(struct grid_cut *g)
{
    free(g->node);
    memset(g, 0, sizeof *g);
}

void grid_cut_clear(struct grid_cut *g)
{
    memset(g->node, 0,
           (g->width + 2) * (g->height + 2) * sizeof *g->node);
}

/* The number of (x,y). */
static size_t grid_cut_at(const struct grid_cut *g, size_t x, size_t y)
{
    return (y + 1) * (g->width + 2) + x + 1;
}

/* From a node's number to its neighbours'. */
static void grid_cut_steps(ptrdiff_t step[GRID_CUT_NEIGHBOURS],
                           const struct grid_cut *g)
{
    const ptrdiff_t row = (ptrdiff_t)g->width + 2;
    const ptrdiff_t all[GRID_CUT_NEIGHBOURS] = {
        -row - 1, -row, -row + 1, -1, 1, row - 1, row, row + 1
    };

    memcpy(step, all, sizeof all);
}

void grid_cut_link_terminal(struct grid_cut *g, size_t x, size_t y,
                            int32_t capacity)
{
    g->node[grid_cut_at(g, x, y)].excess += capacity;
}

void grid_cut_link(struct grid_cut *g, size_t x, size_t y, int dir,
                   int32_t capacity)
{
    struct grid_cut_node *n = g->node + grid_cut_at(g, x, y);
    ptrdiff_t step[GRID_CUT_NEIGHBOURS];

    grid_cut_steps(step, g);
    n->residual[dir] = capacity;
    n[step[dir]].residual[grid_cut_opposite(dir)] = capacity;
}

/* ---- queues -------------------------------------------------------------- */

static void search_enqueue(struct search *s, struct queue *q, int32_t i)
{
    if (q->count == q->room) {
        int32_t *more = list_grow(q->node, &q->room, q->count, sizeof *more);

        s->failed |= !more;
        if (!more)
            return;
        q->node = more;
    }
    q->node[q->count++] = i;
}

/* Node i has no parent any more. */
static void search_make_orphan(struct search *s, int32_t i)
{
    struct grid_cut_node *n = s->node + i;

    n->parent = NO_PARENT;
    n->next = s->orphan[n->level];
    s->orphan[n->level] = i;
    if (n->level > s->deepest)
        s->deepest = n->level;
}

/* ---- orphans ------------------------------------------------------------- */

/* Residual capacity of the edge between node i and a neighbour, in the
 * direction of the flow: towards i in the source's tree, from i in the
 * sink's. */
static int32_t search_residual(const struct search *s, int32_t i, int dir)
{
    const struct grid_cut_node *n = s->node + i;

    return n->tree == SOURCE
               ? n[s->step[dir]].residual[grid_cut_opposite(dir)]
               : n->residual[dir];
}

/* Give node i a parent in the level below, and return that level; where there
 * is none, the least level of a possible parent, or INT32_MAX. */
static int32_t search_find_parent(struct search *s, int32_t i)
{
    struct grid_cut_node *n = s->node + i;
    int32_t least = INT32_MAX;

    for (int k = 0; k < GRID_CUT_NEIGHBOURS; k++) {
        const struct grid_cut_node *other = n + s->step[k];

        if (other->tree != n->tree || !search_residual(s, i, k))
            continue;
        if (other->level == n->level - 1) {
            n->parent = (uint8_t)k;
            return other->level;
        }
        least = other->level < least ? other->level : least;
    }
    return least;
}

/* Relabel node i, whose children become orphans: to the level above `below`,
 * or, beyond its tree's limit, out of the tree. */
static void search_relabel(struct search *s, int32_t i, int32_t below)
{
    struct grid_cut_node *n = s->node + i;
    const int tree = n->tree;
    const int32_t most = s->limit[tree] + (s->growing == tree);

    for (int k = 0; k < GRID_CUT_NEIGHBOURS; k++) {
        const struct grid_cut_node *child = n + s->step[k];

        if (child->tree == tree && child->parent == grid_cut_opposite(k))
            search_make_orphan(s, i + (int32_t)s->step[k]);
    }
    if (below >= most) {
        n->tree = FREE;
        return;
    }
    n->level = below + 1;
    search_make_orphan(s, i);
    if (n->level == most)       /* its neighbours have to be scanned there */
        search_enqueue(s, s->growing == tree ? &s->grown : &s->active[tree], i);
}

/* Adopt all orphans, from the lowest level up. */
static void search_adopt(struct search *s)
{
    for (int32_t level = 1; level <= s->deepest; level++)
        for (int32_t i; (i = s->orphan[level]) >= 0;) {
            s->orphan[level] = s->node[i].next;
            const int32_t below = search_find_parent(s, i);

            if (s->node[i].parent == NO_PARENT)
                search_relabel(s, i, below);
        }
    s->deepest = 0;
}

/* ---- augmentation -------------------------------------------------------- */

/* The least of `most` and the residual capacities on the path between node i
 * and its terminal.  forth: the flow goes from i to the terminal, the sink. */
static int32_t search_bottleneck(const struct search *s, int32_t i, bool forth,
                                 int32_t most)
{
    const struct grid_cut_node *n = s->node + i;

    for (; n->parent < GRID_CUT_NEIGHBOURS; n += s->step[n->parent]) {
        const struct grid_cut_node *up = n + s->step[n->parent];
        const int32_t residual =
            forth ? n->residual[n->parent]
                  : up->residual[grid_cut_opposite(n->parent)];

        most = residual < most ? residual : most;
    }
    return abs(n->excess) < most ? abs(n->excess) : most;
}

/* Augment the same path; nodes with a saturated edge to the parent are
 * orphans. */
static void search_augment(struct search *s, int32_t i, bool forth,
                           int32_t flow)
{
    struct grid_cut_node *n = s->node + i;

    while (n->parent < GRID_CUT_NEIGHBOURS) {
        struct grid_cut_node *up = n + s->step[n->parent];
        int32_t *own = &n->residual[n->parent];
        int32_t *back = &up->residual[grid_cut_opposite(n->parent)];

        *own += forth ? -flow : flow;
        *back += forth ? flow : -flow;
        if (!*(forth ? own : back))
            search_make_orphan(s, (int32_t)(n - s->node));
        n = up;
    }
    n->excess += forth ? flow : -flow;
    if (!n->excess)
        search_make_orphan(s, (int32_t)(n - s->node));
}

/* Saturate the path through the edge from node a of the source's tree to its
 * neighbour in the sink's. */
static void search_augment_path(struct search *s, int32_t a, int dir)
{
    const int32_t b = a + (int32_t)s->step[dir];
    int32_t *residual = &s->node[a].residual[dir];
    const int32_t flow =
        search_bottleneck(s, b, true,
                          search_bottleneck(s, a, false, *residual));

    *residual -= flow;
    s->node[b].residual[grid_cut_opposite(dir)] += flow;
    search_augment(s, a, false, flow);
    search_augment(s, b, true, flow);
    search_adopt(s);
}

/* ---- growth -------------------------------------------------------------- */

/* The neighbours of node i, which is at its tree's limit: free ones join the
 * tree, and paths through those of the other tree are augmented. */
static void search_scan(struct search *s, int32_t i)
{
    struct grid_cut_node *n = s->node + i;
    const int tree = n->tree;
    const int32_t level = n->level;
    int k = 0;

    while (k < GRID_CUT_NEIGHBOURS && n->tree == tree && n->level == level) {
        const int back = grid_cut_opposite(k);
        const int32_t j = i + (int32_t)s->step[k];
        struct grid_cut_node *other = s->node + j;
        const int32_t residual = tree == SOURCE ? n->residual[k]
                                                : other->residual[back];

        if (!residual || other->tree == tree) {
            k++;
        } else if (other->tree != FREE) {
            search_augment_path(s, tree == SOURCE ? i : j,
                                tree == SOURCE ? k : back);
        } else {
            other->tree = (uint8_t)tree;
            other->level = level + 1;
            other->parent = (uint8_t)back;
            search_enqueue(s, &s->grown, j);
        }
    }
}

/* Grow a tree by a level. */
static void search_grow(struct search *s, int tree)
{
    struct queue *active = &s->active[tree];

    s->growing = tree;
    s->grown.count = 0;
    for (size_t k = 0; k < active->count; k++) {
        const struct grid_cut_node *n = s->node + active->node[k];

        if (n->tree == tree && n->level == s->limit[tree])
            search_scan(s, active->node[k]);
    }
    const struct queue done = *active;
    *active = s->grown;
    s->grown = done;
    s->limit[tree]++;
}

/* The trees of level 1: nodes with an edge to a terminal. */
static void search_init(struct search *s, size_t nodes)
{
    for (size_t i = 0; i < nodes; i++) {
        struct grid_cut_node *n = s->node + i;

        n->tree = n->excess > 0 ? SOURCE : n->excess < 0 ? SINK : FREE;
        n->parent = n->excess ? TERMINAL : NO_PARENT;
        n->level = 1;
        s->orphan[i] = -1;
        if (n->excess)
            search_enqueue(s, &s->active[n->tree], (int32_t)i);
    }
    s->limit[SOURCE] = s->limit[SINK] = 1;
}

int grid_cut_run(struct grid_cut *g, struct error *err)
{
    const size_t nodes = (g->width + 2) * (g->height + 2);
    struct search s = {.node = g->node,
                       .orphan = malloc(nodes * sizeof *s.orphan)};
    struct queue *const active = s.active;

    grid_cut_steps(s.step, g);
    s.failed = !s.orphan;
    if (!s.failed)
        search_init(&s, nodes);
    while (!s.failed && active[SOURCE].count && active[SINK].count)
        search_grow(&s, s.limit[SOURCE] <= s.limit[SINK] ? SOURCE : SINK);
    g->known = active[SOURCE].count ? SINK : SOURCE;
    free(s.orphan);
    free(active[SOURCE].node);
    free(active[SINK].node);
    free(s.grown.node);
    return s.failed ? error_set(err, EX_OSERR, "no memory for a cut of %zu x "
                                "%zu pixels", g->width, g->height)
                    : 0;
}

bool grid_cut_is_source(const struct grid_cut *g, size_t x, size_t y)
{
    const int tree = g->node[grid_cut_at(g, x, y)].tree;

    return g->known == SOURCE ? tree == SOURCE : tree != SINK;
}
