/* What of a head bends with the neck, what moves against the skull and what
 * lines the mouth: from the head model's own arrays, so for any head. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/avatar/branches.h"

#define JAW_ANGLE 0.2f      /* radians the jaw is thought to open */
#define STILL_MM 0.5f       /* who moves less than this belongs to the skull */
#define MOVES_MM 2.0f

/* The neck bends from under the chin to the model's lower edge, about a point
 * a third of the way from the root to the neck joint. */
static void find_neck(struct bend *b, const struct head *h)
{
    const float *root = h->joint_template + 3 * JOINT_ROOT;
    const float *neck = h->joint_template + 3 * JOINT_NECK;
    float chin[HEAD_LANDMARKS * 3] = {0};

    for (int i = 0; i < 3; i++)
        b->pivot[i] = root[i] + (neck[i] - root[i]) / 3;
    b->bottom = h->v_template[1];
    for (size_t v = 1; v < h->V; v++)
        b->bottom = fminf(b->bottom, h->v_template[3 * v + 1]);
    if (h->has_landmarks)
        head_landmarks(chin, h, h->v_template);
    b->top = h->has_landmarks ? chin[3 * 8 + 1] : neck[1];
    if (!(b->top > b->bottom))          /* a head without a neck */
        b->bottom = b->top - 1;
}

/* Root mean square movement of vertex v, head units, when every expression
 * coefficient is drawn from N(0,1). */
static float expression_range(const struct head *h, size_t v)
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

static float length(const float *d)
{
    return sqrtf(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
}

/* Expressions, lids and jaw of vertex v together, head units. */
static float range_of(const struct head *h, size_t v)
{
    const float *x = h->v_template + 3 * v;
    const float *jaw = h->joint_template + 3 * JOINT_JAW;
    float arm = hypotf(x[1] - jaw[1], x[2] - jaw[2]);

    return expression_range(h, v) + length(h->l_eyelid + 3 * v) +
           length(h->r_eyelid + 3 * v) +
           JAW_ANGLE * arm * h->weights[HEAD_JOINTS * v + JOINT_JAW];
}

int mesh_weights(struct avatar *a, struct error *err)
{
    const struct head *h = a->head;
    size_t V = h->V, D = V + a->dense.E;

    find_neck(&a->bend, h);
    a->neck = malloc(D * sizeof *a->neck);
    a->moving = malloc(V * sizeof *a->moving);
    a->lining = calloc(D, sizeof *a->lining);
    if (!a->neck || !a->moving || !a->lining)
        return error_set(err, EX_OSERR, "no memory for %zu vertices", V);
    for (size_t v = 0; v < V; v++) {
        const float *w = h->weights + HEAD_JOINTS * v;
        float mm = range_of(h, v) / h->scale * 1e3f;
        float t = (mm - STILL_MM) / (MOVES_MM - STILL_MM);
        float eye = w[JOINT_EYE_LEFT] + w[JOINT_EYE_RIGHT];

        a->moving[v] = fminf(fmaxf(fmaxf(t, eye), 0), 1);
        a->neck[v] = bend_weight(&a->bend, h->v_template[3 * v + 1]) *
                     (1 - w[JOINT_JAW]);
        a->lining[v] = h->region && h->region[v] == REGION_INNER_MOUTH;
    }
    densify_midpoints(a->neck + V, a->neck, &a->dense, 1);
    densify_midpoints(a->lining + V, a->lining, &a->dense, 1);
    for (size_t k = V; k < D; k++)      /* an edge to the lips is lip */
        a->lining[k] = a->lining[k] == 1;
    return 0;
}
