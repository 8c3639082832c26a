/* Maximum flow by incremental breadth-first search (Goldberg et al. 2011,
 * "Maximum flows by incremental breadth-first search"): a tree grows from
 * either terminal, level by level, and where they meet, flow is pushed along
 * the shortest path.  Nodes that a push cuts off, orphans, find a parent of the
 * level below, or go up to the least level that has one.  Whole numbers: the
 * cut is exact. */
#include "lib/geom/grid_cut.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/list.h"

enum { FREE, SOURCE, SINK, TREES };             /* struct grid_cut_node.tree */
enum { TERMINAL = GRID_CUT_WAYS, NOBODY };      /* parent, if it is no way */

/* Nodes that wait. */
struct queue {
    int32_t *node;
    size_t count, room;
};

struct search {
    struct grid_cut_node *node;
    ptrdiff_t step[GRID_CUT_WAYS];  /* to a neighbour */
    int32_t *orphan;                /* of each level the first, or -1 */
    int32_t deepest;                /* level of an orphan */
    int32_t limit[TREES];           /* level that a tree has reached */
    struct queue active[TREES];     /* its nodes there, and some that were */
    struct queue grown;             /* those beyond, while a tree grows */
    int growing;
    bool failed;                    /* for want of memory */
};

/* ---- ties ---------------------------------------------------------------- */

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
static void grid_cut_steps(ptrdiff_t step[GRID_CUT_WAYS],
                           const struct grid_cut *g)
{
    const ptrdiff_t row = (ptrdiff_t)g->width + 2;
    const ptrdiff_t all[GRID_CUT_WAYS] = {-row - 1, -row, -row + 1, -1,
                                          1, row - 1, row, row + 1};

    memcpy(step, all, sizeof all);
}

void grid_cut_tie_terminal(struct grid_cut *g, size_t x, size_t y,
                           int32_t capacity)
{
    g->node[grid_cut_at(g, x, y)].excess += capacity;
}

void grid_cut_tie(struct grid_cut *g, size_t x, size_t y, int way,
                  int32_t capacity)
{
    struct grid_cut_node *n = g->node + grid_cut_at(g, x, y);
    ptrdiff_t step[GRID_CUT_WAYS];

    grid_cut_steps(step, g);
    n->left[way] = n[step[way]].left[GRID_CUT_WAYS - 1 - way] = capacity;
}

/* ---- waiting nodes ------------------------------------------------------- */

static void search_wait(struct search *s, struct queue *q, int32_t i)
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
static void search_orphan(struct search *s, int32_t i)
{
    struct grid_cut_node *n = s->node + i;

    n->parent = NOBODY;
    n->next = s->orphan[n->level];
    s->orphan[n->level] = i;
    if (n->level > s->deepest)
        s->deepest = n->level;
}

/* ---- orphans ------------------------------------------------------------- */

/* What can still flow from a neighbour to node i, or in the sink's tree the
 * other way. */
static int32_t search_left(const struct search *s, int32_t i, int way)
{
    const struct grid_cut_node *n = s->node + i;

    return n->tree == SOURCE ? n[s->step[way]].left[GRID_CUT_WAYS - 1 - way]
                             : n->left[way];
}

/* Node i takes a parent of the level below; else returns the least level of
 * those who could be one further up, or INT32_MAX. */
static int32_t search_parent(struct search *s, int32_t i)
{
    struct grid_cut_node *n = s->node + i;
    int32_t least = INT32_MAX;

    for (int k = 0; k < GRID_CUT_WAYS; k++) {
        const struct grid_cut_node *other = n + s->step[k];

        if (other->tree != n->tree || !search_left(s, i, k))
            continue;
        if (other->level == n->level - 1) {
            n->parent = (uint8_t)k;
            return other->level;
        }
        least = other->level < least ? other->level : least;
    }
    return least;
}

/* Node i leaves its level, and its children lose it: to one above `below`, or,
 * beyond where its tree may be, out of the tree. */
static void search_raise(struct search *s, int32_t i, int32_t below)
{
    struct grid_cut_node *n = s->node + i;
    const int tree = n->tree;
    const int32_t most = s->limit[tree] + (s->growing == tree);

    for (int k = 0; k < GRID_CUT_WAYS; k++) {
        const struct grid_cut_node *child = n + s->step[k];

        if (child->tree == tree && child->parent == GRID_CUT_WAYS - 1 - k)
            search_orphan(s, i + (int32_t)s->step[k]);
    }
    if (below >= most) {
        n->tree = FREE;
        return;
    }
    n->level = below + 1;
    search_orphan(s, i);
    if (n->level == most)       /* its neighbours have to be looked at there */
        search_wait(s, s->growing == tree ? &s->grown : &s->active[tree], i);
}

/* All orphans, from the lowest level up: below there are none then. */
static void search_adopt(struct search *s)
{
    for (int32_t level = 1; level <= s->deepest; level++)
        for (int32_t i; (i = s->orphan[level]) >= 0;) {
            s->orphan[level] = s->node[i].next;
            const int32_t below = search_parent(s, i);

            if (s->node[i].parent == NOBODY)
                search_raise(s, i, below);
        }
    s->deepest = 0;
}

/* ---- pushes -------------------------------------------------------------- */

/* The least of what is left on the way from node i to its terminal, and most.
 * `forth`: flow goes that way (the sink's tree). */
static int32_t search_room(const struct search *s, int32_t i, bool forth,
                           int32_t most)
{
    const struct grid_cut_node *n = s->node + i;

    for (; n->parent < GRID_CUT_WAYS; n += s->step[n->parent]) {
        const int32_t left = forth ? n->left[n->parent]
            : n[s->step[n->parent]].left[GRID_CUT_WAYS - 1 - n->parent];

        most = left < most ? left : most;
    }
    return abs(n->excess) < most ? abs(n->excess) : most;
}

/* Flow along the same way; who loses the tie to the parent is an orphan. */
static void search_flow(struct search *s, int32_t i, bool forth, int32_t flow)
{
    struct grid_cut_node *n = s->node + i;

    while (n->parent < GRID_CUT_WAYS) {
        struct grid_cut_node *up = n + s->step[n->parent];
        int32_t *own = &n->left[n->parent];
        int32_t *back = &up->left[GRID_CUT_WAYS - 1 - n->parent];

        *own += forth ? -flow : flow;
        *back += forth ? flow : -flow;
        if (!*(forth ? own : back))
            search_orphan(s, (int32_t)(n - s->node));
        n = up;
    }
    n->excess += forth ? flow : -flow;
    if (!n->excess)
        search_orphan(s, (int32_t)(n - s->node));
}

/* All that the path through the tie from node a of the source's tree to its
 * neighbour in the sink's can bear. */
static void search_push(struct search *s, int32_t a, int way)
{
    const int32_t b = a + (int32_t)s->step[way];
    int32_t *left = &s->node[a].left[way];
    const int32_t flow = search_room(s, b, true,
                                     search_room(s, a, false, *left));

    *left -= flow;
    s->node[b].left[GRID_CUT_WAYS - 1 - way] += flow;
    search_flow(s, a, false, flow);
    search_flow(s, b, true, flow);
    search_adopt(s);
}

/* ---- growth -------------------------------------------------------------- */

/* The neighbours of node i, at its tree's limit: those that are free join the
 * tree, and to the other tree's goes what can. */
static void search_look(struct search *s, int32_t i)
{
    struct grid_cut_node *n = s->node + i;
    const int tree = n->tree;
    const int32_t level = n->level;
    int k = 0;

    while (k < GRID_CUT_WAYS && n->tree == tree && n->level == level) {
        const int back = GRID_CUT_WAYS - 1 - k;
        const int32_t j = i + (int32_t)s->step[k];
        struct grid_cut_node *other = s->node + j;
        const int32_t left = tree == SOURCE ? n->left[k] : other->left[back];

        if (!left || other->tree == tree) {
            k++;
        } else if (other->tree != FREE) {
            search_push(s, tree == SOURCE ? i : j, tree == SOURCE ? k : back);
        } else {
            other->tree = (uint8_t)tree;
            other->level = level + 1;
            other->parent = (uint8_t)back;
            search_wait(s, &s->grown, j);
        }
    }
}

/* One level more of a tree. */
static void search_grow(struct search *s, int tree)
{
    struct queue *active = &s->active[tree];

    s->growing = tree;
    s->grown.count = 0;
    for (size_t k = 0; k < active->count; k++) {
        const struct grid_cut_node *n = s->node + active->node[k];

        if (n->tree == tree && n->level == s->limit[tree])
            search_look(s, active->node[k]);
    }
    const struct queue done = *active;
    *active = s->grown;
    s->grown = done;
    s->limit[tree]++;
}

/* The nodes beside the terminals, which are of level 1. */
static void search_begin(struct search *s, size_t nodes)
{
    for (size_t i = 0; i < nodes; i++) {
        struct grid_cut_node *n = s->node + i;

        n->tree = n->excess > 0 ? SOURCE : n->excess < 0 ? SINK : FREE;
        n->parent = n->excess ? TERMINAL : NOBODY;
        n->level = 1;
        s->orphan[i] = -1;
        if (n->excess)
            search_wait(s, &s->active[n->tree], (int32_t)i);
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
        search_begin(&s, nodes);
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
