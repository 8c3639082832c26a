/* Joints, skinning weights, pose correctives and eyelids. */
#include "lib/lab/head/sculpt_impl.h"

#include <stdlib.h>

/* Where the joints are, mm. */
static const struct vec joint_at[SCULPT_JOINTS] = {
    { 0, -120, -18 },           /* root: base of the neck */
    { 0, -62, -22 },            /* neck: first vertebra */
    { 0, -6, 6 },               /* jaw: between the ear canals */
    { 31.5, 25, 68 }, { -31.5, 25, 68 } };

/* How much the jaw carries a point: below the line from the joint to the
 * corner of the mouth, in front of the ear, above the throat. */
double sculpt_jaw_weight(const struct half *h, int src, struct vec p)
{
    if (h->part[src] == PART_MOUTH) {
        int j = h->col[src], ring = h->ring[src];
        double lower = ramp(MOUTH_CORNER - 2.5, MOUTH_CORNER + 2.5, j);
        if (ring >= 3)
            return lower;
        double below = ramp(-44, -60, p.y);
        return mix(below, lower, ring / 3.0);
    }
    if (h->part[src] == PART_BALL || h->part[src] == PART_EYE ||
        h->part[src] == PART_NOSTRIL || h->part[src] == PART_EAR)
        return 0;
    double line = -8 - (p.z - 6) * 38 / 75;        /* joint to mouth corner */
    double below = ramp(8, -20, p.y - line);
    double front = ramp(2, 34, p.z);
    double throat = ramp(-128, -98, p.y - 0.25 * (p.z - 60));
    return below * front * throat;
}

/* Balls by their eyes; skin between neck, head and jaw by place. */
static void sculpt_rig_weights(struct sculpt *s, const struct full *m)
{
    for (int v = 0; v < m->nv; v++) {
        float *w = s->weights + SCULPT_JOINTS * v;
        struct vec p = m->p[v];
        if (m->h->part[m->src[v]] == PART_BALL) {
            w[m->side[v] > 0 ? 3 : 4] = 1;
            continue;
        }
        double jaw = sculpt_jaw_weight(m->h, m->src[v], p);
        double neck = ramp(-150, -95, p.y - 0.25 * fmax(0, p.z));
        w[2] = (float)(jaw * neck);
        w[1] = (float)(neck - w[2]);
        w[0] = 1 - w[1] - w[2];
    }
}

/* Does joint j hang on vertex v: eyes on their ball, the others on the skin of
 * about their height. */
static int sculpt_rig_carries(const struct full *m, int j, int v)
{
    int part = m->h->part[m->src[v]];

    if (j >= 3)
        return part == PART_BALL && (m->side[v] > 0) == (j == 3);
    return (part == PART_GRID || part == PART_EAR) &&
           fabs(m->p[v].y - joint_at[j].y) < 18 &&
           norm(sub(m->p[v], joint_at[j])) < 100;
}

/* Each joint is a mean over skin around it, so that it follows the shape.
 * Weights linear in the distance from the plain mean u move it to its place
 * and keep the sum: w = (1 + (x - u) . A^-1 (at - u)) / n, A the covariance,
 * taken as diagonal and repeated until the place is met. */
static void sculpt_rig_regressor(struct sculpt *s, const struct full *m)
{
    for (int j = 0; j < SCULPT_JOINTS; j++) {
        float *row = s->j_regressor + (size_t)j * s->nv;
        struct vec u = vec(0, 0, 0), q = vec(1, 1, 1), k = vec(0, 0, 0);
        double n = 0;
        for (int v = 0; v < m->nv; v++)
            if (sculpt_rig_carries(m, j, v)) {
                u = add(u, m->p[v]);
                n++;
            }
        u = mul(u, 1 / n);
        for (int v = 0; v < m->nv; v++)
            if (sculpt_rig_carries(m, j, v)) {
                struct vec d = sub(m->p[v], u);
                q = add(q, mul(vec(d.x * d.x, d.y * d.y, d.z * d.z), 1 / n));
            }
        for (int round = 0; round < 200; round++) {
            struct vec c = vec(0, 0, 0);
            for (int v = 0; v < m->nv; v++) {
                row[v] = 0;
                if (!sculpt_rig_carries(m, j, v))
                    continue;
                row[v] = (float)((1 + dot(sub(m->p[v], u), k)) / n);
                c = add(c, mul(m->p[v], row[v]));
            }
            struct vec e = sub(joint_at[j], c);
            k = add(k, mul(vec(e.x / q.x, e.y / q.y, e.z / q.z), 0.6));
        }
    }
}

/* Opening the jaw draws the cheek in and the corner of the mouth back: the
 * entries of R_jaw - I that grow with a turn about x are (1,1) and (2,2),
 * falling, and (2,1), rising. */
static void sculpt_rig_correctives(struct sculpt *s, const struct full *m)
{
    for (int v = 0; v < m->nv; v++) {
        struct vec p = m->p[v];
        double x = fabs(p.x) - 40, y = p.y + 38, z = p.z - 66;
        double g = exp(-(x * x + y * y + z * z) / (2 * 17 * 17));
        if (m->h->part[m->src[v]] == PART_BALL)
            continue;
        float *d = s->posedirs + (size_t)v * 3 * SCULPT_POSES;
        double side = m->side[v] < 0 ? -1 : 1;
        d[0 * SCULPT_POSES + 9 + 7] = (float)(-0.012 * g * side);
        d[2 * SCULPT_POSES + 9 + 7] = (float)(-0.008 * g);
    }
}

/* What closes a lid, of either side, in metres. */
static int sculpt_rig_eyelids(struct sculpt *s, const struct full *m)
{
    struct vec *delta = calloc((size_t)m->nhalf, sizeof *delta);

    if (!delta)
        return -1;
    sculpt_eyelid(m->h, delta);
    for (int v = 0; v < m->nv; v++) {
        struct vec d = delta[m->src[v]];
        float *out = (m->side[v] > 0 ? s->l_eyelid : s->r_eyelid) + 3 * v;
        out[0] = (float)(1e-3 * d.x * m->side[v]);
        out[1] = (float)(1e-3 * d.y);
        out[2] = (float)(1e-3 * d.z);
    }
    free(delta);
    return 0;
}

int sculpt_rig(struct sculpt *s, const struct full *m)
{
    static const int32_t parents[] = { -1, 0, 1, 1, 1 };

    for (int j = 0; j < SCULPT_JOINTS; j++)
        s->parents[j] = parents[j];
    sculpt_rig_weights(s, m);
    sculpt_rig_regressor(s, m);
    sculpt_rig_correctives(s, m);
    return sculpt_rig_eyelids(s, m);
}
