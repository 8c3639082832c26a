/* The shared part of the cases 01 to 05. */
#include "tests/golden/golden_net.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

bool golden_failed(struct golden *g, int rc, const struct error *err)
{
    if (!rc)
        return false;
    printf("%s: %s\n", g->name, err->text);
    g->failed++;
    return true;
}

void golden_net_begin(struct golden_net *n, struct golden *g)
{
    static const int from[4] = { 0, 2, 3, 1 };    /* of (B,C,h,w) */
    cJSON *shape = golden_json(g, "input_shape");

    memset(n, 0, sizeof *n);
    n->g = g;
    for (int i = 0; i < 4 && shape; i++)
        n->in[i] = (size_t)cJSON_GetArrayItem(shape, from[i])->valuedouble;
    cJSON_Delete(shape);
    params_init(&n->ps);
}

bool golden_net_ready(struct golden_net *n, int rc, bool signed_range,
                      struct error *err)
{
    const size_t *in = n->in;

    if (golden_failed(n->g, rc || params_allocate(&n->ps, err) ||
                                params_allocate_gradients(&n->ps, err), err))
        return false;
    golden_weights_open(&n->w, n->g, NULL);
    golden_weights_fill(&n->ps, &n->w, n->g, "");
    float *image = golden_image("input.image", n->g->seed, in[0] * in[3],
                                in[1], in[2], signed_range);
    n->rgb = layout_rows(image, in[0], in[1] * in[2], in[3]);
    free(image);
    return true;
}

void golden_net_end(struct golden_net *n)
{
    free(n->rgb);
    golden_weights_close(&n->w);
    params_release(&n->ps);
}

void golden_net_gradient(struct golden *g, const struct params *ps,
                         const char *tensor, bool l2)
{
    char name[160];
    size_t t = params_find(ps, tensor);

    snprintf(name, sizeof name, "grad.%s", tensor);
    (l2 ? golden_compare_l2 : golden_compare)(g, name, param_g(ps, t),
                                              ps->tensor[t].count);
}
