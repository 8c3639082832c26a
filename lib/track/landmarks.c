/* Landmark poses at the cost of a few vertices: the corners of the triangles
 * that landmarks hang on. */
#include "lib/track/landmarks.h"

#include <string.h>
#include <sysexits.h>

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
    return head_part_init(&l->part, id, pick, n, err);
}

void landmarks_release(struct landmarks *l)
{
    head_part_release(&l->part);
    memset(l, 0, sizeof *l);
}

void landmarks_pose(float *lmk, struct landmarks *l,
                    const struct head_motion *m)
{
    const float *verts = head_part_pose(&l->part, m);

    for (int i = 0; i < HEAD_LANDMARKS; i++)
        for (int c = 0; c < 3; c++) {
            float v = 0;
            for (int k = 0; k < 3; k++)
                v += l->bary[3 * i + k] * verts[3 * l->corner[3 * i + k] + c];
            lmk[3 * i + c] = v;
        }
}
