/* From samples to shaders and back: blocks of one material at a time. */
#include "lib/lab/people/stage.h"

#include <string.h>

#include "lib/lab/people/vec.h"

/* Strands come after the materials of faces. */
#define QUEUES (MATERIAL_COUNT + STRAND_KINDS)

struct gather {
    struct stage *s;
    const struct actor *a;
    const struct shade_env *env;
    const struct shade_kernels *kernels;
    struct shade_block block[QUEUES];
    uint32_t at[QUEUES][SHADE_N];
    int count[QUEUES];
    struct shade_cloth teeth, mouth, inner;
    struct shade_strand strand[STRAND_KINDS];
};

/* A sample on a face: what its corners hold, by barycentric weights. */
static void gather_face(struct gather *g, int queue, int i, size_t at,
                        uint32_t id)
{
    const struct stage *s = g->s;
    struct shade_block *b = &g->block[queue];
    const int32_t *f = g->a->faces + 3 * id;
    float w[3] = { 0, s->eye.b1[at], s->eye.b2[at] };
    const struct paint *q[3];
    const float *p[3], *n[3];

    w[0] = 1 - w[1] - w[2];
    for (int c = 0; c < 3; c++) {
        q[c] = g->a->paint + f[c];
        p[c] = s->place + 3 * f[c];
        n[c] = s->normal + 3 * f[c];
    }
    for (int k = 0; k < 3; k++) {
        b->p[k][i] = w[0] * p[0][k] + w[1] * p[1][k] + w[2] * p[2][k];
        b->n[k][i] = w[0] * n[0][k] + w[1] * n[1][k] + w[2] * n[2][k];
        b->c[k][i] = w[0] * q[0]->c[k] + w[1] * q[1]->c[k] + w[2] * q[2]->c[k];
    }
    for (int k = 0; k < PAINT_COUNT; k++)
        b->k[k][i] = w[0] * q[0]->k[k] + w[1] * q[1]->k[k] + w[2] * q[2]->k[k];
    /* sheets are seen from both sides */
    float d = 0;
    for (int k = 0; k < 3; k++)
        d += b->n[k][i] * b->p[k][i];
    if (d > 0 && id >= g->a->head->F)
        for (int k = 0; k < 3; k++)
            b->n[k][i] = -b->n[k][i];
}

/* A sample on a strand: along its axis. */
static void gather_strand(struct gather *g, int queue, int i, size_t at,
                          uint32_t point)
{
    const struct stage *s = g->s;
    struct shade_block *b = &g->block[queue];
    const struct strand *t = &g->a->strand[s->owner[point]];
    float x = s->eye.b1[at];
    const float *p = s->tuft + 3 * point, *n = s->tuft_normal + 3 * point;

    for (int k = 0; k < 3; k++) {
        b->p[k][i] = lerpf(p[k], p[3 + k], x);
        b->n[k][i] = lerpf(n[k], n[3 + k], x);
        b->c[k][i] = p[3 + k] - p[k];
    }
    const struct strand_point *q = g->a->point + point;
    b->k[0][i] = t->face < -1 ? 0 : t->random;
    b->k[1][i] = s->eye.b2[at];
    b->k[2][i] = lerpf(q[0].open, q[1].open, x);
}

/* Shade a full block of a queue by its material, and put the colours back. */
static void gather_flush(struct gather *g, int queue)
{
    struct shade_block *b = &g->block[queue];
    const struct persona *p = &g->a->look;

    switch (queue) {
    case MATERIAL_SKIN: g->kernels->skin(b, g->env, &p->skin); break;
    case MATERIAL_EYE: g->kernels->eye(b, g->env, &p->eye); break;
    case MATERIAL_TEETH: g->kernels->cloth(b, g->env, &g->teeth); break;
    case MATERIAL_MOUTH: g->kernels->cloth(b, g->env, &g->mouth); break;
    case MATERIAL_CLOTH: g->kernels->cloth(b, g->env, &p->cloth); break;
    case MATERIAL_INNER: g->kernels->cloth(b, g->env, &g->inner); break;
    default:
        g->kernels->strand(b, g->env, &g->strand[queue - MATERIAL_COUNT]);
    }
    for (int i = 0; i < g->count[queue]; i++) {
        float *o = g->s->sample + 3 * (size_t)g->at[queue][i];
        for (int k = 0; k < 3; k++)
            o[k] = b->rgb[k][i];
    }
    g->count[queue] = 0;
}

/* Put a sample into the queue of its material; full blocks are shaded. */
static void gather_take(struct gather *g, size_t at, uint32_t id, float ao)
{
    uint32_t point = id & ~RASTER_STRAND;
    int queue, i;

    if (id & RASTER_STRAND)
        queue = MATERIAL_COUNT + g->a->strand[g->s->owner[point]].kind;
    else
        queue = g->a->material[id];
    i = g->count[queue]++;
    g->at[queue][i] = (uint32_t)at;
    /* teeth are lit through the lips as well */
    g->block[queue].ao[i] = queue == MATERIAL_TEETH ? 0.45f + 0.55f * ao : ao;
    if (id & RASTER_STRAND)
        gather_strand(g, queue, i, at, point);
    else
        gather_face(g, queue, i, at, id);
    if (g->count[queue] == SHADE_N)
        gather_flush(g, queue);
}

/* Materials that are the same in all samples of a person. */
static void gather_prepare(struct gather *g)
{
    const struct persona *p = &g->a->look;

    g->teeth = (struct shade_cloth){ .gloss = 0.35f, .wet = 1, .grain = 0.02f,
                                     .scale = 1 };
    copy3(g->teeth.base, p->tooth);
    copy3(g->teeth.second, p->tooth);
    g->mouth = (struct shade_cloth){ .gloss = 0.9f, .wet = 1, .grain = 0.1f,
                                     .bump = 0.2f, .scale = 1 };
    copy3(g->mouth.base, p->tongue);
    copy3(g->mouth.second, p->gum);
    g->inner = g->mouth;
    g->inner.gloss = 0.1f;
    for (int k = 0; k < 3; k++)
        g->inner.base[k] = g->inner.second[k] = p->gum[k] * 0.35f;
    struct shade_strand *s = g->strand;
    s[STRAND_HAIR] = (struct shade_strand){ .spread = p->hair.spread,
                                            .gloss = 0.5f * p->hair.gloss,
                                            .tint = p->hair.gloss,
                                            .soft = 0.05f };
    copy3(s[STRAND_HAIR].base, p->hair.color);
    s[STRAND_BROW] = (struct shade_strand){ .spread = 0.3f, .gloss = 0.1f,
                                            .tint = 0.3f, .soft = 0.2f };
    copy3(s[STRAND_BROW].base, p->brow_color);
    s[STRAND_BEARD] = s[STRAND_BROW];
    copy3(s[STRAND_BEARD].base, p->beard_color);
    s[STRAND_LASH] = (struct shade_strand){ .base = { .012f, .010f, .009f } };
    s[STRAND_FRAME] = (struct shade_strand){ .gloss = 1.5f, .tint = 0.5f,
                                             .soft = 0.2f };
    copy3(s[STRAND_FRAME].base, p->frame_color);
}

void stage_shade(struct stage *s, const struct actor *a,
                 const struct shade_env *env)
{
    struct gather g;

    memset(&g, 0, sizeof g);
    g.s = s;
    g.a = a;
    g.env = env;
    g.kernels = shade_kernels();
    gather_prepare(&g);
    for (int y = 0; y < s->eye.h; y++)
        for (int x = 0; x < s->eye.w; x++) {
            size_t at = (size_t)y * (size_t)s->eye.w + (size_t)x;
            uint32_t id = s->eye.id[at];
            if (id == RASTER_NONE)
                continue;
            size_t pixel = (size_t)(y / STAGE_GRID) * (size_t)s->size
                           + (size_t)(x / STAGE_GRID);
            gather_take(&g, at, id, s->ao[pixel]);
        }
    for (int q = 0; q < QUEUES; q++)
        if (g.count[q])
            gather_flush(&g, q);
}

/* The region of what was drawn. */
static uint8_t gather_label_of(const struct stage *s, const struct actor *a,
                               uint32_t id)
{
    static const uint8_t kinds[STRAND_KINDS] = { LABEL_HAIR, LABEL_BROW,
        LABEL_LASH, LABEL_BEARD, LABEL_GLASSES };

    if (id == RASTER_NONE)
        return LABEL_NONE;
    if (id & RASTER_STRAND)
        return kinds[a->strand[s->owner[id & ~RASTER_STRAND]].kind];
    return a->label[id];
}

/* Mean of a pixel's samples; its label is the commonest of them. */
void stage_resolve(struct stage *s, const struct actor *a)
{
    for (int y = 0; y < s->size; y++)
        for (int x = 0; x < s->size; x++) {
            size_t pixel = (size_t)y * (size_t)s->size + (size_t)x;
            float sum[3] = { 0, 0, 0 };
            int hit = 0, best = 0;
            uint8_t l[STAGE_GRID * STAGE_GRID];
            for (int i = 0; i < STAGE_GRID * STAGE_GRID; i++) {
                int u = x * STAGE_GRID + i % STAGE_GRID;
                int v = y * STAGE_GRID + i / STAGE_GRID;
                size_t at = (size_t)v * (size_t)s->eye.w + (size_t)u;
                uint32_t id = s->eye.id[at];
                l[i] = gather_label_of(s, a, id);
                if (id == RASTER_NONE)
                    continue;
                hit++;
                for (int k = 0; k < 3; k++)
                    sum[k] += s->sample[3 * at + (size_t)k];
            }
            for (int i = 0; i < STAGE_GRID * STAGE_GRID; i++) {
                int same = 0;
                for (int j = 0; j < STAGE_GRID * STAGE_GRID; j++)
                    same += l[j] == l[i];
                if (same > best) {
                    best = same;
                    s->label[pixel] = l[i];
                }
            }
            float w = 1.0f / (STAGE_GRID * STAGE_GRID);
            for (int k = 0; k < 3; k++)
                s->light[3 * pixel + (size_t)k] = sum[k] * w;
            s->cover[pixel] = (float)hit * w;
        }
}
