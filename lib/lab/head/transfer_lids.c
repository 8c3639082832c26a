/* The lids of the scans' head: eyeBlink and its correction, for the mean and
 * by identity. */
#include "lib/lab/head/transfer.h"

#include <string.h>

#include "lib/head/arkit.h"
#include "lib/lab/head/scan_lids.h"

enum { ROW = 3 * SCAN_VERTS };

/* shape (SCAN_VERTS,3) = the correction of both lids for the mean face with
 * `identity` added, less that of the mean; of the mean when it is NULL. */
static void lid_correction(float *shape, float *folded, const struct scan *scan,
                           const struct scan_lids *l, const float *identity)
{
    memset(shape, 0, ROW * sizeof *shape);
    scan_lids_add(shape, l, scan->neutral, identity ? -1 : 1,
                  identity ? -1 : 1);
    if (!identity)
        return;
    for (size_t i = 0; i < ROW; i++)
        folded[i] = scan->neutral[i] + identity[i];
    scan_lids_add(shape, l, folded, 1, 1);
}

/* The shape on our vertex v. */
static void lid_carried(double d[3], const struct registration *r,
                        const float *shape, size_t v)
{
    memset(d, 0, 3 * sizeof *d);
    if (r->match[v].trust > 0)
        match_point(d, &r->match[v], shape);
}

/* Left lids lie where x > 0: the mean's correction is added to both. */
static void lid_add_mean(struct template *s, const struct registration *r,
                         const float *shape)
{
    for (size_t v = 0; v < s->nv; v++) {
        float *lid = s->v_template[3 * v] > 0 ? s->l_eyelid : s->r_eyelid;
        double d[3];

        lid_carried(d, r, shape, v);
        for (size_t c = 0; c < 3; c++)
            lid[3 * v + c] += (float)d[c];
    }
}

/* Which of our vertices a correction moves by more than a micrometre or two:
 * those that follow the margins for the mean. */
static int lid_list_vertices(struct template *s, const struct registration *r,
                             const float *shape, struct error *err)
{
    s->nlid = 0;
    s->lid_vertices = arena_take(&s->file.memory, s->nv, sizeof *s->lid_vertices);
    s->lid_sides = arena_take(&s->file.memory, s->nv, sizeof *s->lid_sides);
    if (arena_check(&s->file.memory, "lids", err))
        return -1;
    for (size_t v = 0; v < s->nv; v++) {
        double d[3];

        lid_carried(d, r, shape, v);
        if (d[0] * d[0] + d[1] * d[1] + d[2] * d[2] < 1e-10)
            continue;
        s->lid_vertices[s->nlid] = (int32_t)v;
        s->lid_sides[s->nlid++] = s->v_template[3 * v] < 0;
    }
    s->lid_shapedirs = arena_take(&s->file.memory, 3 * s->nlid * TEMPLATE_LID_SHAPES,
                                  sizeof *s->lid_shapedirs);
    return arena_check(&s->file.memory, "lids", err);
}

int transfer_lids(struct template *s, const struct registration *r,
                  struct error *err)
{
    const struct scan *scan = r->scan;
    const float *blink = scan->expression + (size_t)ROW * ARKIT_EYE_BLINK_L;
    struct scan_lids l;
    float *shape = arena_take(&s->file.memory, 2 * ROW, sizeof *shape);

    if (scan_lids_init(&l, scan->neutral, blink, blink + ROW, 1, &s->file.memory,
                       err))
        return -1;
    lid_correction(shape, NULL, scan, &l, NULL);
    lid_add_mean(s, r, shape);
    /* a shape that opens both eyes moves all that ever follows */
    lid_correction(shape, shape + ROW, scan, &l, scan->identity);
    if (lid_list_vertices(s, r, shape, err))
        return -1;
    for (size_t k = 0; k < TEMPLATE_LID_SHAPES; k++) {
        lid_correction(shape, shape + ROW, scan, &l,
                       scan->identity + k * (size_t)ROW);
        for (size_t i = 0; i < s->nlid; i++) {
            double d[3];

            lid_carried(d, r, shape, (size_t)s->lid_vertices[i]);
            for (size_t c = 0; c < 3; c++)
                s->lid_shapedirs[(3 * i + c) * TEMPLATE_LID_SHAPES + k] =
                    (float)d[c];
        }
    }
    return 0;
}
