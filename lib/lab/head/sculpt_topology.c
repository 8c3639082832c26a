/* Connectivity of the sculpted head: a wrapped grid with concentric loops
 * around eye, mouth, ear and nostril; no poles on the skin. */
#include "lib/lab/head/sculpt_impl.h"

#include <assert.h>
#include <string.h>

/* A vertex of the half; its number. */
static int topology_half_vertex(struct half *h, enum part part, int ring,
                                int col, int row)
{
    assert(h->nv < HALF_VERTS);
    int v = h->nv++;
    h->part[v] = (unsigned char)part;
    h->ring[v] = (unsigned char)ring;
    h->col[v] = (short)col;
    h->row[v] = (short)row;
    h->snap[v] = 1;
    return v;
}

static void topology_half_quad(struct half *h, int a, int b, int c, int d)
{
    assert(h->nq < HALF_QUADS);
    int *q = h->quad[h->nq++];
    q[0] = a, q[1] = b, q[2] = c, q[3] = d;
}

struct block { int c0, c1, r0, r1; };
static const struct block blocks[] = {
    { EYE_C0, EYE_C1, EYE_R0, EYE_R1 },
    { 0, MOUTH_C1, MOUTH_R0, MOUTH_R1 },
    { EAR_C0, EAR_C1, EAR_R0, EAR_R1 },
    { NOS_C0, NOS_C1, NOS_R0, NOS_R1 },
};

/* Whether grid vertex (inclusive = 0) or cell (1) lies inside a block. */
static int topology_in_block(int r, int c, int cell)
{
    for (size_t i = 0; i < sizeof blocks / sizeof *blocks; i++) {
        const struct block *b = &blocks[i];
        if (cell && c >= b->c0 && c < b->c1 && r >= b->r0 && r < b->r1)
            return 1;
        /* the mouth block is open at the midline */
        int left = b->c0 == 0 ? c >= 0 : c > b->c0;
        if (!cell && left && c < b->c1 && r > b->r0 && r < b->r1)
            return 1;
    }
    return 0;
}

/* The skin by rows and columns, but for the blocks that have loops of their
 * own. */
static void topology_make_grid(struct half *h)
{
    for (int r = 0; r <= ROWS; r++)
        for (int c = 0; c <= COLS; c++) {
            h->grid[r][c] = topology_in_block(r, c, 0) ? -1
                          : topology_half_vertex(h, PART_GRID, 0, c, r);
            if (h->grid[r][c] >= 0 && (c == 0 || c == COLS))
                h->seam[h->grid[r][c]] = 1;
        }
    for (int r = 0; r < ROWS; r++)
        for (int c = 0; c < COLS; c++)
            if (!topology_in_block(r, c, 1))
                topology_half_quad(h, h->grid[r][c], h->grid[r][c + 1],
                                   h->grid[r + 1][c + 1], h->grid[r + 1][c]);
}

/* Crown: columns along the front, side and back of a rectangle of cells. */
static void topology_make_cap(struct half *h)
{
    for (int i = 0; i <= CAP; i++)
        for (int j = 0; j <= 2 * CAP; j++) {
            int c = j == 0 ? i : j == 2 * CAP ? COLS - i
                  : i == CAP ? CAP + j : -1;
            h->cap[i][j] = c >= 0 ? h->grid[ROWS][c]
                         : topology_half_vertex(h, PART_CAP, 0, i, j);
            h->seam[h->cap[i][j]] = i == 0;
        }
    for (int i = 0; i < CAP; i++)
        for (int j = 0; j < 2 * CAP; j++)
            topology_half_quad(h, h->cap[i][j], h->cap[i + 1][j],
                               h->cap[i + 1][j + 1], h->cap[i][j + 1]);
}

/* Border of a block, clockwise from outside, starting in the middle of the
 * column nearest the front: up, back, down, forward. */
static void topology_block_border(const struct half *h, const struct block *b,
                                  int *ring)
{
    int n = 0, mid = (b->r0 + b->r1) / 2;

    for (int r = mid; r < b->r1; r++) ring[n++] = h->grid[r][b->c0];
    for (int c = b->c0; c < b->c1; c++) ring[n++] = h->grid[b->r1][c];
    for (int r = b->r1; r > b->r0; r--) ring[n++] = h->grid[r][b->c1];
    for (int c = b->c1; c > b->c0; c--) ring[n++] = h->grid[b->r0][c];
    for (int r = b->r0; r < mid; r++) ring[n++] = h->grid[r][b->c0];
}

/* Rings 1..count inside ring 0 of n vertices (n + 1 with open ends). */
static void topology_make_rings(struct half *h, int *rings, int stride, int n,
                                int open, int count, enum part part)
{
    for (int k = 1; k <= count; k++) {
        int *out = rings + (k - 1) * stride, *in = rings + k * stride;
        for (int i = 0; i < n + open; i++) {
            in[i] = topology_half_vertex(h, part, k, i, 0);
            h->seam[in[i]] = open && (i == 0 || i == n);
        }
        for (int i = 0; i < n; i++) {
            int j = open ? i + 1 : (i + 1) % n;
            topology_half_quad(h, in[i], in[j], out[j], out[i]);
        }
    }
}

/* Close a block's innermost ring with the block's own cells. */
static void topology_make_fill(struct half *h, const struct block *b,
                               const int *ring, int *fill, enum part part,
                               int label)
{
    int w = b->c1 - b->c0, t = b->r1 - b->r0, n = 0, mid = t / 2;

    for (int r = mid; r < t; r++) fill[r * (w + 1)] = ring[n++];
    for (int c = 0; c < w; c++) fill[t * (w + 1) + c] = ring[n++];
    for (int r = t; r > 0; r--) fill[r * (w + 1) + w] = ring[n++];
    for (int c = w; c > 0; c--) fill[c] = ring[n++];
    for (int r = 0; r < mid; r++) fill[r * (w + 1)] = ring[n++];
    for (int r = 1; r < t; r++)
        for (int c = 1; c < w; c++)
            fill[r * (w + 1) + c] = topology_half_vertex(h, part, label, c, r);
    for (int r = 0; r < t; r++)
        for (int c = 0; c < w; c++) {
            const int *q = fill + r * (w + 1) + c;
            topology_half_quad(h, q[0], q[1], q[w + 2], q[w + 1]);
        }
}

/* Loops from the hole in the grid inwards, over the lips into the mouth. */
static void topology_make_mouth(struct half *h)
{
    int n = 0;
    int *ring = h->mouth[0];

    for (int c = 0; c < MOUTH_C1; c++) ring[n++] = h->grid[MOUTH_R1][c];
    for (int r = MOUTH_R1; r > MOUTH_R0; r--)
        ring[n++] = h->grid[r][MOUTH_C1];
    for (int c = MOUTH_C1; c >= 0; c--) ring[n++] = h->grid[MOUTH_R0][c];
    assert(n == MOUTH_N + 1);
    topology_make_rings(h, ring, MOUTH_N + 1, MOUTH_N, 1, MOUTH_RINGS,
                        PART_MOUTH);
}

/* Eyeball: rings around the line of sight, front pole first, back pole last. */
static void topology_make_ball(struct half *h)
{
    int v = h->ball_first = topology_half_vertex(h, PART_BALL, 0, 0, 0);

    for (int k = 1; k <= BALL_RINGS; k++)
        for (int i = 0; i < BALL_N; i++)
            topology_half_vertex(h, PART_BALL, k, i, 0);
    int back = topology_half_vertex(h, PART_BALL, BALL_RINGS + 1, 0, 0);
    for (int i = 0; i < BALL_N; i++) {
        int j = (i + 1) % BALL_N, last = v + 1 + (BALL_RINGS - 1) * BALL_N;
        topology_half_quad(h, v, v + 1 + i, v + 1 + j, -1);
        topology_half_quad(h, back, last + j, last + i, -1);
        for (int k = 0; k < BALL_RINGS - 1; k++) {
            int a = v + 1 + k * BALL_N, b = a + BALL_N;
            topology_half_quad(h, a + i, b + i, b + j, a + j);
        }
    }
}

void sculpt_topology(struct half *h)
{
    memset(h, 0, sizeof *h);
    topology_make_grid(h);
    topology_make_cap(h);
    topology_block_border(h, &blocks[0], h->eye[0]);
    topology_make_rings(h, h->eye[0], EYE_N, EYE_N, 0, EYE_RINGS, PART_EYE);
    topology_make_mouth(h);
    topology_block_border(h, &blocks[2], h->ear[0]);
    topology_make_rings(h, h->ear[0], EAR_N, EAR_N, 0, EAR_RINGS, PART_EAR);
    topology_make_fill(h, &blocks[2], h->ear[EAR_RINGS], h->ear_fill[0],
                       PART_EAR, EAR_RINGS + 1);
    topology_block_border(h, &blocks[3], h->nostril[0]);
    topology_make_rings(h, h->nostril[0], NOS_N, NOS_N, 0, NOS_RINGS,
                        PART_NOSTRIL);
    topology_make_fill(h, &blocks[3], h->nostril[NOS_RINGS], h->nostril_fill[0],
                       PART_NOSTRIL, NOS_RINGS + 1);
    topology_make_ball(h);
}
