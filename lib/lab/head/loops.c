/* Vertices in the order in which the head's file has them: grid, crown, then
 * the loops of each block from its border inwards, then the eyeball. */
#include "lib/lab/head/loops.h"

#include <assert.h>
#include <stddef.h>
#include <string.h>

/* The next vertex of the half. */
static int loops_vertex(struct loops *l, enum loops_part part, int ring,
                        int row)
{
    assert(l->nv < LOOPS_HALF);
    int v = l->nv++;

    l->part[v] = (unsigned char)part;
    l->ring[v] = (unsigned char)ring;
    l->row[v] = (short)row;
    return v;
}

struct block { int c0, c1, r0, r1; };
static const struct block blocks[] = {
    { EYE_C0, EYE_C1, EYE_R0, EYE_R1 },
    { 0, MOUTH_C1, MOUTH_R0, MOUTH_R1 },
    { EAR_C0, EAR_C1, EAR_R0, EAR_R1 },
    { NOS_C0, NOS_C1, NOS_R0, NOS_R1 },
};

/* Whether a place of the grid lies inside a block. */
static int loops_in_block(int r, int c)
{
    for (size_t i = 0; i < sizeof blocks / sizeof *blocks; i++) {
        const struct block *b = &blocks[i];
        /* the mouth block is open at the midline */
        int left = b->c0 == 0 ? c >= 0 : c > b->c0;

        if (left && c < b->c1 && r > b->r0 && r < b->r1)
            return 1;
    }
    return 0;
}

static void loops_make_grid(struct loops *l)
{
    for (int r = 0; r <= ROWS; r++)
        for (int c = 0; c <= COLS; c++) {
            l->grid[r][c] = loops_in_block(r, c) ? -1
                          : loops_vertex(l, PART_GRID, 0, r);
            if (l->grid[r][c] >= 0 && (c == 0 || c == COLS))
                l->seam[l->grid[r][c]] = 1;
        }
}

/* Crown: what the grid's rim does not bring of CAP x 2 CAP cells. */
static void loops_make_cap(struct loops *l)
{
    for (int i = 0; i < CAP; i++)
        for (int j = 1; j < 2 * CAP; j++)
            l->seam[loops_vertex(l, PART_CAP, 0, 0)] = i == 0;
}

/* Border of a block, clockwise from outside, starting in the middle of the
 * column nearest the front: up, back, down, forward. */
static void loops_border(const struct loops *l, const struct block *b,
                         int *ring)
{
    int n = 0, mid = (b->r0 + b->r1) / 2;

    for (int r = mid; r < b->r1; r++) ring[n++] = l->grid[r][b->c0];
    for (int c = b->c0; c < b->c1; c++) ring[n++] = l->grid[b->r1][c];
    for (int r = b->r1; r > b->r0; r--) ring[n++] = l->grid[r][b->c1];
    for (int c = b->c1; c > b->c0; c--) ring[n++] = l->grid[b->r0][c];
    for (int r = b->r0; r < mid; r++) ring[n++] = l->grid[r][b->c0];
}

/* Rings 1..count inside ring 0 of n vertices (n + 1 with open ends), and the
 * block's cells that close the innermost one (`fill` of them). */
static void loops_make_rings(struct loops *l, int *rings, int n, int open,
                             int count, int fill, enum loops_part part)
{
    for (int k = 1; k <= count; k++)
        for (int i = 0; i < n + open; i++) {
            int v = loops_vertex(l, part, k, 0);

            rings[k * (n + open) + i] = v;
            l->seam[v] = open && (i == 0 || i == n);
        }
    while (fill--)
        loops_vertex(l, part, count + 1, 0);
}

/* The cells inside a block that is closed by them. */
static int loops_inside(const struct block *b)
{
    return (b->c1 - b->c0 - 1) * (b->r1 - b->r0 - 1);
}

/* Loops from the hole in the grid inwards, over the lips into the mouth. */
static void loops_make_mouth(struct loops *l)
{
    int n = 0, *ring = l->mouth[0];

    for (int c = 0; c < MOUTH_C1; c++) ring[n++] = l->grid[MOUTH_R1][c];
    for (int r = MOUTH_R1; r > MOUTH_R0; r--)
        ring[n++] = l->grid[r][MOUTH_C1];
    for (int c = MOUTH_C1; c >= 0; c--) ring[n++] = l->grid[MOUTH_R0][c];
    loops_make_rings(l, ring, MOUTH_N, 1, MOUTH_RINGS, 0, PART_MOUTH);
}

/* Eyeball: rings around the line of sight, front pole first, back pole last. */
static void loops_make_ball(struct loops *l)
{
    l->ball_first = loops_vertex(l, PART_BALL, 0, 0);
    for (int k = 1; k <= BALL_RINGS; k++)
        for (int i = 0; i < BALL_N; i++)
            loops_vertex(l, PART_BALL, k, 0);
    loops_vertex(l, PART_BALL, BALL_RINGS + 1, 0);
}

void loops_make(struct loops *l)
{
    memset(l, 0, sizeof *l);
    loops_make_grid(l);
    loops_make_cap(l);
    loops_border(l, &blocks[0], l->eye[0]);
    loops_make_rings(l, l->eye[0], EYE_N, 0, EYE_RINGS, 0, PART_EYE);
    loops_make_mouth(l);
    loops_border(l, &blocks[2], l->ear[0]);
    loops_make_rings(l, l->ear[0], EAR_N, 0, EAR_RINGS,
                     loops_inside(&blocks[2]), PART_EAR);
    loops_border(l, &blocks[3], l->nostril[0]);
    loops_make_rings(l, l->nostril[0], NOS_N, 0, NOS_RINGS,
                     loops_inside(&blocks[3]), PART_NOSTRIL);
    loops_make_ball(l);
    int all = l->nv;
    for (int v = 0; v < l->nv; v++) {
        l->mirror[v] = l->seam[v] ? v : all++;
        l->mirror[l->mirror[v]] = v;
    }
    assert(all == LOOPS_VERTICES);
}
