/* The template avatar's points: what of a head goes with the shoulders, what
 * moves against the skull and what lines the mouth, from the head model's own
 * skinning weights, directions and regions. */
#include "lib/lab/head/avatar_make.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/avatar/branch.h"
#include "lib/avatar/completion.h"
#include "lib/base/vec3.h"
#include "lib/head/arkit.h"
#include "lib/head/lbs.h"
#include "lib/head/mirror.h"

#define JAW_ANGLE 0.2f      /* radians that the jaw opens, for `moving` */
/* `moving` is 0 where skin moves less than the one, 1 at the other. */
#define STILL_MM 0.5f
#define MOVES_MM 2.0f
/* `lid` is 0 where closing eyes lower skin less than the one, 1 from the other
 * on. */
#define LID_MIN_MM 1.0f
#define LID_MM 2.0f
/* Reach of lids: this share of the distance by which they close, and so many
 * mm at least, since brows move them too. */
#define LID_REACH 0.3f
#define LID_REACH_MM 1.5f
/* `seam` is 1 up to the one distance from the inner lips, 0 from the other on;
 * `crease` the same about the mouth's corners, and `lips` further out. */
#define SEAM_MM 1.0f
#define SEAM_END_MM 4.0f
#define LIPS_MM 6.0f
#define LIPS_END_MM 9.0f
#define CORNER_MM 3.0f
#define CORNER_END_MM 7.0f
#define DROP 0.4f           /* radians of a mouth wide open */
#define BROWS_PART 0.6f     /* of what brows stretch by: with more of it lids
                             * would cover the eyes' rims */
#define STRETCH_MAX 2.5f    /* the most that counts of what skin stretches by */
#define MARGIN 0.5f         /* a vertex moves with one above it if it comes down
                             * by this share of its way */

/* The neck blend behind the ears.  There the neck begins higher than at the
 * chin, at the height of the mouth's corners; the share of this grows from the
 * ears back to the neck joint.  A nape that turned with the head would stand
 * out beside the neck. */
struct points_nape {
    struct neck_blend blend;
    float front, back;          /* depths z where its share is 0, and 1 */
};

/* The neck blend goes from under the chin to the model's lower edge, about a
 * point a third of the way from the root to the neck joint. */
static void points_neck(struct neck_blend *b, struct points_nape *n,
                        const struct head *h)
{
    const float *root = h->joint_template + 3 * JOINT_ROOT;
    const float *neck = h->joint_template + 3 * JOINT_NECK;
    float mark[HEAD_LANDMARKS * 3] = {0};

    for (int i = 0; i < 3; i++)
        b->pivot[i] = root[i] + (neck[i] - root[i]) / 3;
    b->bottom = h->v_template[1];
    for (size_t v = 1; v < h->V; v++)
        b->bottom = fminf(b->bottom, h->v_template[3 * v + 1]);
    if (h->has_landmarks)
        head_landmarks(mark, h, h->v_template);
    b->top = h->has_landmarks ? mark[3 * 8 + 1] : neck[1];
    if (!(b->top > b->bottom))          /* a head without a neck */
        b->bottom = b->top - 1;
    n->blend = *b;
    n->front = n->back = neck[2];
    if (!h->has_landmarks)
        return;
    n->blend.top = fmaxf(b->top, mark[3 * 48 + 1]);
    n->blend.bottom = 0.5f * (b->top + b->bottom);
    n->front = fmaxf(n->front, mark[2]);
}

/* The nape's share: by height, and the more the further back. */
static float points_nape_at(const struct points_nape *n,
                            const float x[3])
{
    const float deep = n->front - n->back;

    if (!(deep > 0))
        return 0;
    return ramp(n->blend.top, n->blend.bottom, x[1]) *
           fminf(fmaxf((n->front - x[2]) / deep, 0), 1);
}

/* Root mean square movement of vertex v, head units, when every expression
 * coefficient is drawn from N(0,1). */
static float points_expression(const struct head *h, size_t v)
{
    const float *block = h->exp_dirs +
                         v / HEAD_BLOCK * h->nexp * 3 * HEAD_BLOCK;
    float sum = 0;

    for (size_t k = 0; k < h->nexp; k++)
        for (size_t c = 0; c < 3; c++) {
            float d = block[(3 * k + c) * HEAD_BLOCK + v % HEAD_BLOCK];

            sum += d * d;
        }
    return sqrtf(sum);
}

static float points_distance(const float x[3], const float y[3])
{
    float off[3];

    sub3(off, x, y);
    return length3(off);
}

/* Expressions, lids and jaw of vertex v together, head units. */
static float points_range(const struct head *h, size_t v)
{
    const float *x = h->v_template + 3 * v;
    const float *jaw = h->joint_template + 3 * JOINT_JAW;
    float arm = hypotf(x[1] - jaw[1], x[2] - jaw[2]);

    return points_expression(h, v) +
           length3(h->l_eyelid + 3 * v) +
           length3(h->r_eyelid + 3 * v) +
           JAW_ANGLE * arm * head_jaw_share(h, v);
}

/* fold (V): 0 on the lids' margin, where no neighbour below comes down (V) with
 * the vertex; else 1.  Neighbours beside and behind do not count. */
static void points_margin(float *fold, const float *down,
                          const struct head *h, const struct densify *d)
{
    for (size_t v = 0; v < d->V; v++)
        fold[v] = 0;
    for (size_t e = 0; e < 2 * d->E; e++) {
        const size_t i = (size_t)d->edge[e], j = (size_t)d->edge[e ^ 1];
        const float *x = h->v_template + 3 * i, *y = h->v_template + 3 * j;
        const float below = x[1] - y[1];

        if (below > fabsf(x[0] - y[0]) && below > fabsf(x[2] - y[2]) &&
            down[j] > MARGIN * down[i])
            fold[i] = 1;
    }
}

/* Upper lids, and what they stretch by when both eyes close; open (V+E): the
 * mean head's spacing, closed (V,3) is scratch. */
static void points_lids(struct head_avatar *w, const struct head *h,
                        const struct densify *d, const float *open,
                        float *closed)
{
    const size_t V = h->V, D = V + d->E;

    for (size_t i = 0; i < 3 * V; i++)
        closed[i] = h->v_template[i] + h->l_eyelid[i] + h->r_eyelid[i];
    for (size_t v = 0; v < V; v++)
        w->lid[v] = h->v_template[3 * v + 1] - closed[3 * v + 1];
    points_margin(w->fold, w->lid, h, d);
    densify_midpoints(w->lid + V, w->lid, d, 1);
    densify_midpoints(w->fold + V, w->fold, d, 1);
    densify_spacing(w->stretch, closed, d);
    for (size_t k = 0; k < D; k++) {
        float mm = w->lid[k] / h->scale * 1e3f;
        float t = (mm - LID_MIN_MM) / (LID_MM - LID_MIN_MM);
        float wider = w->stretch[k] / fmaxf(open[k], 1e-6f) - 1;

        w->lid[k] = fminf(fmaxf(t, 0), 1);
        w->fold[k] *= w->lid[k];
        w->reach[k] = 0;
        if (w->lid[k] > 0)
            w->reach[k] = -fmaxf(LID_REACH * mm, LID_REACH_MM) * 1e-3f *
                          h->scale / w->lid[k];
        w->stretch[k] = 1 + w->fold[k] * fmaxf(wider, 0);
    }
}

/* The inner lips' vertices furthest to either side; NULL without lips. */
static void points_corners(const float *corner[2], const struct head *h)
{
    corner[0] = corner[1] = NULL;
    for (size_t i = 0; i < h->nlip_inner; i++) {
        const float *x = h->v_template + 3 * (size_t)h->lip_inner[i];

        corner[0] = !corner[0] || x[0] < corner[0][0] ? x : corner[0];
        corner[1] = !corner[1] || x[0] > corner[1][0] ? x : corner[1];
    }
}

/* By the distance to the nearest vertex of the inner lips' ring. */
static void points_seam(struct head_avatar *w, const struct head *h,
                        const struct densify *d)
{
    const float *corner[2], mm = 1e3f / h->scale;

    points_corners(corner, h);
    for (size_t v = 0; v < h->V; v++) {
        const float *x = h->v_template + 3 * v;
        float nearest = 1e6f, aside = 1e6f;

        for (size_t i = 0; i < h->nlip_inner; i++)
            nearest = fminf(nearest, points_distance(
                x, h->v_template + 3 * (size_t)h->lip_inner[i]));
        for (int i = 0; i < 2 && corner[i]; i++)
            aside = fminf(aside, points_distance(x, corner[i]));
        w->seam[v] = 1 - branch_ramp(nearest * mm, SEAM_MM, SEAM_END_MM);
        w->crease[v] = fmaxf(w->seam[v], 1 - branch_ramp(
            aside * mm, CORNER_MM, CORNER_END_MM));
        w->lips[v] = 1 - branch_ramp(nearest * mm, LIPS_MM, LIPS_END_MM);
    }
    densify_midpoints(w->seam + h->V, w->seam, d, 1);
    densify_midpoints(w->crease + h->V, w->crease, d, 1);
    densify_midpoints(w->lips + h->V, w->lips, d, 1);
}

/* Into the stretch goes a part of what the skin of posed (V,3) stretches by;
 * rest (V+E): the mean head's spacing, wide (V+E) is scratch. */
static void points_add_stretch(struct head_avatar *w,
                               const struct densify *d,
                               const float *rest, const float *posed,
                               float *wide, float part)
{
    densify_spacing(wide, posed, d);
    for (size_t k = 0; k < d->V + d->E; k++) {
        const float by = wide[k] / fmaxf(rest[k], 1e-6f);

        w->stretch[k] = fmaxf(w->stretch[k],
                              1 + part * (fminf(by, STRETCH_MAX) - 1));
    }
}

/* What a dropped jaw stretches the mean head's skin by, and raised brows, which
 * draw it out of the upper lids' crease; rest (V+E): its spacing, posed (V,3)
 * and wide (V+E) are scratch. */
static int points_poses(struct head_avatar *w, const struct head *h,
                        const struct densify *d, const float *rest,
                        float *posed, float *wide, struct error *err)
{
    float *raised = calloc(h->nexp + 1, sizeof *raised);
    const struct head_motion brows = {.exp = raised};
    const struct head_motion drop = {.jaw = {DROP}};
    struct identity mean;

    if (!raised)
        return error_set(err, EX_OSERR, "out of memory");
    if (head_fold(&mean, h, NULL, 0, err)) {
        free(raised);
        return -1;
    }
    if (head_has_arkit(h)) {
        for (int e = 0; e < 2; e++)
            raised[ARKIT_BROW_INNER_UP_L + e] =
                raised[ARKIT_BROW_OUTER_UP_L + e] = 1;
        head_pose(posed, &mean, &brows);
        points_add_stretch(w, d, rest, posed, wide, BROWS_PART);
    }
    head_pose(posed, &mean, &drop);
    identity_release(&mean);
    free(raised);
    points_add_stretch(w, d, rest, posed, wide, 1);
    return 0;
}

/* Of each vertex: how far it moves against the skull, its share of the neck
 * blend, whether it lines the mouth. */
static void points_vertices(struct head_avatar *w, const struct head *h,
                            const struct neck_blend *blend,
                            const struct points_nape *nape)
{
    for (size_t v = 0; v < h->V; v++) {
        const float *skin = h->weights + HEAD_JOINTS * v;
        const float *x = h->v_template + 3 * v;
        float mm = points_range(h, v) / h->scale * 1e3f;
        float t = (mm - STILL_MM) / (MOVES_MM - STILL_MM);
        float eye = skin[JOINT_EYE_LEFT] + skin[JOINT_EYE_RIGHT];

        w->moving[v] = fmaxf(fmaxf(t, eye), 0);
        w->neck[v] = ramp(blend->top, blend->bottom, x[1]) *
                     (1 - head_jaw_share(h, v));
        w->neck[v] = fmaxf(w->neck[v], points_nape_at(nape, x));
        w->lining[v] = h->region && h->region[v] == REGION_INNER_MOUTH;
    }
}

/* One pass over the vertices, then means for the midpoints. */
int avatar_points_make(struct head_avatar *w, const struct head *h,
                       const struct densify *d, struct error *err)
{
    size_t V = h->V, D = V + d->E;
    struct points_nape nape;
    struct neck_blend blend;
    float *rest = malloc((2 * D + 3 * V) * sizeof *rest);

    if (!rest)
        return error_set(err, EX_OSERR, "no memory for %zu vertices", V);
    points_neck(&blend, &nape, h);
    memcpy(w->neck_blend, blend.pivot, sizeof blend.pivot);
    w->neck_blend[3] = blend.top;
    w->neck_blend[4] = blend.bottom;
    points_vertices(w, h, &blend, &nape);
    densify_midpoints(w->neck + V, w->neck, d, 1);
    densify_midpoints(w->lining + V, w->lining, d, 1);
    for (size_t k = V; k < D; k++)      /* edges from the lips to it, too */
        w->lining[k] = w->lining[k] > 0;
    float *wide = rest + D, *posed = wide + D;
    densify_spacing(rest, h->v_template, d);
    points_lids(w, h, d, rest, posed);
    int rc = points_poses(w, h, d, rest, posed, wide, err);
    free(rest);
    points_seam(w, h, d);
    if (rc || mirror_vertices(w->mirror, h->v_template, h->V, err))
        return -1;
    completion_mirror(w->mirror, w->mirror, d);
    return 0;
}
