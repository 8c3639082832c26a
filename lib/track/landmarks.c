/* Landmark poses at the cost of a few vertices: the corners of the triangles
 * that landmarks hang on, cut out of the head as a head of their own. */
#include "lib/track/landmarks.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#define B HEAD_BLOCK

/* to (blocks', rows, parts * B) = the columns of from (blocks, rows, parts *
 * B) that belong to the vertices pick [n]. */
static float *landmarks_gather(const float *from, size_t rows, size_t parts,
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

/* Index of v in pick [*n], added when it is new. */
static int32_t landmarks_pick(int32_t *pick, size_t *n, int32_t v)
{
    for (size_t i = 0; i < *n; i++)
        if (pick[i] == v)
            return (int32_t)i;
    pick[*n] = v;
    return (int32_t)(*n)++;
}

int landmarks_init(struct landmarks *l, const struct identity *id,
                   struct error *err)
{
    const struct head *h = id->head;
    struct head *s = &l->sub;
    int32_t pick[HEAD_LANDMARKS * 3];
    size_t n = 0;

    memset(l, 0, sizeof *l);
    if (!h->has_landmarks)
        return error_set(err, EX_CONFIG, "the head model has no landmarks "
                         "(expected landmark_faces and landmark_bary)");
    for (int i = 0; i < HEAD_LANDMARKS; i++)
        for (int k = 0; k < 3; k++)
            l->corner[3 * i + k] =
                landmarks_pick(pick, &n, h->f[3 * h->landmark_faces[i] + k]);
    l->bary = h->landmark_bary;
    *s = *h;
    s->V = n;
    s->F = 0;
    s->blocks = (n + B - 1) / B;
    s->exp_dirs = landmarks_gather(h->exp_dirs, h->nexp, 3, pick, n);
    s->pose_dirs = landmarks_gather(h->pose_dirs, HEAD_POSE_DIRS, 3, pick, n);
    s->skin = landmarks_gather(h->skin, HEAD_JOINTS, 1, pick, n);
    s->lids = landmarks_gather(id->lids, 2, 3, pick, n);
    s->nlid = 0;
    s->shape_live = s->exp_live = s->pose_live = NULL;
    l->id = *id;
    l->id.head = s;
    l->id.lids = s->lids;
    l->id.own_lids = NULL;
    l->id.shaped = landmarks_gather(id->shaped, 1, 3, pick, n);
    l->verts = malloc(3 * s->blocks * B * sizeof *l->verts);
    if (s->exp_dirs && s->pose_dirs && s->skin && s->lids && l->id.shaped
        && l->verts)
        return 0;
    landmarks_release(l);
    return error_set(err, EX_OSERR, "no memory for the landmarks");
}

void landmarks_release(struct landmarks *l)
{
    free(l->sub.exp_dirs);
    free(l->sub.pose_dirs);
    free(l->sub.skin);
    free(l->sub.lids);
    free(l->id.shaped);
    free(l->verts);
    memset(l, 0, sizeof *l);
}

void landmarks_pose(float *lmk, struct landmarks *l,
                    const struct head_motion *m)
{
    head_pose(l->verts, &l->id, m);
    for (int i = 0; i < HEAD_LANDMARKS; i++)
        for (int c = 0; c < 3; c++) {
            float v = 0;
            for (int k = 0; k < 3; k++)
                v += l->bary[3 * i + k]
                     * l->verts[3 * l->corner[3 * i + k] + c];
            lmk[3 * i + c] = v;
        }
}
