/* What of a head goes with the shoulders, what moves against the skull and
 * what lines the mouth: from the head model's own arrays, so for any head. */
#include "lib/avatar/mesh_weights.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/head/mirror.h"

#define JAW_ANGLE 0.2f      /* radians the jaw is thought to open */
#define STILL_MM 0.5f       /* who moves less than this belongs to the skull */
#define MOVES_MM 2.0f

/* The neck blend goes from under the chin to the model's lower edge, about a
 * point a third of the way from the root to the neck joint. */
static void mesh_weights_neck(struct neck_blend *b, const struct head *h)
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
static float mesh_weights_expression(const struct head *h, size_t v)
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

/* Length of d (3). */
static float mesh_weights_norm(const float *d)
{
    return sqrtf(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
}

/* Expressions, lids and jaw of vertex v together, head units. */
static float mesh_weights_range(const struct head *h, size_t v)
{
    const float *x = h->v_template + 3 * v;
    const float *jaw = h->joint_template + 3 * JOINT_JAW;
    float arm = hypotf(x[1] - jaw[1], x[2] - jaw[2]);

    return mesh_weights_expression(h, v) +
           mesh_weights_norm(h->l_eyelid + 3 * v) +
           mesh_weights_norm(h->r_eyelid + 3 * v) +
           JAW_ANGLE * arm * head_jaw_share(h, v);
}

/* One pass over the vertices, then means for the midpoints. */
int mesh_weights_init(struct mesh_weights *w, const struct head *h,
                      const struct densify *d, struct error *err)
{
    size_t V = h->V, D = V + d->E;

    mesh_weights_neck(&w->blend, h);
    w->neck = malloc(D * sizeof *w->neck);
    w->moving = malloc(V * sizeof *w->moving);
    w->lining = calloc(D, sizeof *w->lining);
    w->mirror = malloc(V * sizeof *w->mirror);
    if (!w->neck || !w->moving || !w->lining || !w->mirror)
        return error_set(err, EX_OSERR, "no memory for %zu vertices", V);
    for (size_t v = 0; v < V; v++) {
        const float *skin = h->weights + HEAD_JOINTS * v;
        float mm = mesh_weights_range(h, v) / h->scale * 1e3f;
        float t = (mm - STILL_MM) / (MOVES_MM - STILL_MM);
        float eye = skin[JOINT_EYE_LEFT] + skin[JOINT_EYE_RIGHT];

        w->moving[v] = fminf(fmaxf(fmaxf(t, eye), 0), 1);
        w->neck[v] = neck_blend_weight(&w->blend, h->v_template[3 * v + 1]) *
                     (1 - head_jaw_share(h, v));
        w->lining[v] = h->region && h->region[v] == REGION_INNER_MOUTH;
    }
    densify_midpoints(w->neck + V, w->neck, d, 1);
    densify_midpoints(w->lining + V, w->lining, d, 1);
    for (size_t k = V; k < D; k++)      /* an edge to the lips is lip */
        w->lining[k] = w->lining[k] == 1;
    return head_mirror_vertices(w->mirror, h, err);
}

void mesh_weights_release(struct mesh_weights *w)
{
    free(w->neck);
    free(w->moving);
    free(w->lining);
    free(w->mirror);
    memset(w, 0, sizeof *w);
}
