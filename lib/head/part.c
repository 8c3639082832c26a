/* Cutting vertices out of a head: their columns of all that poses it. */
#include "lib/head/part.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#define B HEAD_BLOCK

/* to (blocks', rows, parts * B) = the columns of from (blocks, rows, parts *
 * B) that belong to the vertices pick [n]. */
static float *head_part_gather(const float *from, size_t rows, size_t parts,
                               const int32_t *pick, size_t n)
{
    const size_t blocks = (n + B - 1) / B, line = parts * B;
    float *to;

    if (rows == 0)
        rows = 1;
    to = aligned_alloc(64, blocks * rows * line * sizeof *to);
    if (!to)
        return NULL;
    memset(to, 0, blocks * rows * line * sizeof *to);
    for (size_t i = 0; i < n; i++) {
        const size_t v = (size_t)pick[i];
        for (size_t r = 0; r < rows; r++)
            for (size_t p = 0; p < parts; p++)
                to[((i / B) * rows + r) * line + p * B + i % B]
                    = from[((v / B) * rows + r) * line + p * B + v % B];
    }
    return to;
}

/* Which of the directions (blocks, rows, 3 * B) move a block, as head.h's
 * exp_live has it: (blocks, words). */
static uint64_t *head_part_live(const float *dirs, size_t blocks, size_t rows,
                                size_t words)
{
    uint64_t *live = calloc(blocks * words + 1, sizeof *live);

    for (size_t i = 0; live && dirs && i < blocks * rows; i++)
        for (size_t k = 0; k < 3 * B; k++)
            if (dirs[i * 3 * B + k] != 0)
                live[i / rows * words + i % rows / 64] |=
                    (uint64_t)1 << i % rows % 64;
    return live;
}

int head_part_init(struct head_part *p, const struct identity *id,
                   const int32_t *vertex, size_t n, struct error *err)
{
    const struct head *h = id->head;
    struct head *s = &p->head;

    *s = *h;
    s->V = n;
    s->F = 0;
    s->blocks = (n + B - 1) / B;
    s->exp_dirs = head_part_gather(h->exp_dirs, h->nexp, 3, vertex, n);
    s->pose_dirs = head_part_gather(h->pose_dirs, HEAD_POSE_DIRS, 3, vertex, n);
    s->skin = head_part_gather(h->skin, HEAD_JOINTS, 1, vertex, n);
    s->lids = head_part_gather(id->lids, 2, 3, vertex, n);
    s->nlid = 0;
    s->shape_live = NULL;
    s->exp_live = head_part_live(s->exp_dirs, s->blocks, h->nexp,
                                 HEAD_MAX_EXP / 64);
    s->pose_live = head_part_live(s->pose_dirs, s->blocks, HEAD_POSE_DIRS, 1);
    p->id = *id;
    p->id.head = s;
    p->id.lids = s->lids;
    p->id.own_lids = NULL;
    p->id.shaped = head_part_gather(id->shaped, 1, 3, vertex, n);
    p->verts = malloc(3 * s->blocks * B * sizeof *p->verts);
    if (s->exp_dirs && s->pose_dirs && s->skin && s->lids && s->exp_live &&
        s->pose_live && p->id.shaped && p->verts)
        return 0;
    head_part_release(p);
    return error_set(err, EX_OSERR, "no memory for %zu vertices", n);
}

void head_part_release(struct head_part *p)
{
    free(p->head.exp_dirs);
    free(p->head.pose_dirs);
    free(p->head.skin);
    free(p->head.lids);
    free(p->head.exp_live);
    free(p->head.pose_live);
    free(p->id.shaped);
    free(p->verts);
    memset(p, 0, sizeof *p);
}

const float *head_part_pose(struct head_part *p, const struct head_motion *m)
{
    head_pose(p->verts, &p->id, m);
    return p->verts;
}
