/* The prior of a matte: from the matte network, which sees the portrait at its
 * own size, or from the outline of the head. */
#include "lib/photo/matte.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/crop.h"

#define SIDE MATTE_SIDE
#define PIXELS (SIDE * SIDE)

struct matte {
    const uint8_t *head;        /* (SIDE,SIDE) */
    uint8_t rgb[3 * PIXELS];
    float input[3 * PIXELS], prior[PIXELS];
};

/* Columns and rows of what the network sees that are wholly in the picture. */
static void matte_extent(size_t x[2], size_t y[2], const struct matting *m)
{
    const size_t n = m->n;

    x[0] = y[0] = SIDE - 1;
    x[1] = y[1] = 1;
    for (size_t i = 0; i < PIXELS; i++) {
        const size_t u = i % SIDE, v = i / SIDE;

        if (!m->inside[v * n / SIDE * n + u * n / SIDE] ||
            !m->inside[((v + 1) * n - 1) / SIDE * n + ((u + 1) * n - 1) / SIDE])
            continue;
        x[0] = u < x[0] ? u : x[0];
        x[1] = u >= x[1] ? u + 1 : x[1];
        y[0] = v < y[0] ? v : y[0];
        y[1] = v >= y[1] ? v + 1 : y[1];
    }
}

/* What the network sees. */
static int matte_shrink(struct matte *k, const struct matting *m)
{
    const size_t n = m->n;
    const struct square all = {(double)n / 2, (double)n / 2, (double)n};

    size_t x[2], y[2];

    if (crop_resize_u8(k->rgb, SIDE, m->rgb, n, n, 3 * n, 3, all))
        return -1;
    for (size_t i = 0; i < 3 * PIXELS; i++)
        k->input[i] = (float)k->rgb[i] / 255;
    matte_extent(x, y, m);
    if (x[0] < x[1] && y[0] < y[1])
        square_repeat_edges(k->input, SIDE, 3, x, y);
    return 0;
}

/* The network's matte; false where the head is mostly nobody to it. */
static bool matte_ask(struct matte *k, struct matte_net *net)
{
    double seen = 0, all = 0;

    matte_net_forward(k->prior, k->input, net);
    for (size_t i = 0; i < PIXELS; i++) {
        k->prior[i] = (float)matte_net_alpha(k->prior[i]);
        seen += k->head[i] * k->prior[i];
        all += k->head[i];
    }
    return 2 * seen >= all;
}

/* How likely a place is the person's that lies r times as far out as an
 * outline does. */
static float matte_likely(double r)
{
    return (float)(1 / (1 + exp(10 * (r - 1.4))));
}

/* By the head alone, which is the person's: hair about it, which falls, and a
 * body below it.  In the picture these two are never so sure that they decide
 * what colours a person has; from far out they say what the background's are. */
static void matte_guess(struct matte *k, const struct matting *m)
{
    const size_t n = m->n;
    double x[2] = {SIDE, 0}, y[2] = {SIDE, 0};

    for (size_t i = 0; i < PIXELS; i++)
        if (k->head[i] > 127) {
            x[0] = fmin(x[0], (double)(i % SIDE));
            x[1] = fmax(x[1], (double)(i % SIDE) + 1);
            y[0] = fmin(y[0], (double)(i / SIDE));
            y[1] = fmax(y[1], (double)(i / SIDE) + 1);
        }
    const double half = (x[1] - x[0]) / 2, high = (y[1] - y[0]) / 2;
    for (size_t i = 0; i < PIXELS; i++) {
        const double u = ((double)(i % SIDE) + 0.5 - (x[0] + x[1]) / 2) / half;
        const double v = ((double)(i / SIDE) + 0.5 - (y[0] + y[1]) / 2) / high;
        const double below = v - 0.8, hair = hypot(u, v < 0 ? v : v / 1.7);

        const double beside = fabs(u) / (0.5 + 2 * below);

        k->prior[i] = fmaxf(matte_likely(hair),
                            below > 0 ? matte_likely(beside) : 0);
        if (m->inside[i / SIDE * n / SIDE * n + i % SIDE * n / SIDE])
            k->prior[i] *= 0.85f;
        k->prior[i] = fmaxf(k->prior[i], (float)k->head[i] / 255);
    }
}

/* Places that a path has come to, and where it goes on from, by the least of
 * the prior on it: a list for each of 256 levels. */
struct matte_front {
    uint8_t best[PIXELS], level[PIXELS];    /* of the paths; of the prior */
    int32_t last[256], next[2 * PIXELS], place[2 * PIXELS], count;
};

/* A path of such a level has come to a place. */
static void matte_reach(struct matte_front *f, size_t place, uint8_t level)
{
    if (level <= f->best[place])
        return;
    f->best[place] = level;
    f->place[f->count] = (int32_t)place;
    f->next[f->count] = f->last[level];
    f->last[level] = f->count++;
}

/* The paths that end at a place go on to those beside it. */
static void matte_step(struct matte_front *f, int32_t place, uint8_t level)
{
    static const int step[4][2] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};

    for (int s = 0; s < 4; s++) {
        const int x = place % SIDE + step[s][0], y = place / SIDE + step[s][1];
        const size_t to = (size_t)(y * SIDE + x);

        if (x >= 0 && y >= 0 && x < SIDE && y < SIDE)
            matte_reach(f, to, f->level[to] < level ? f->level[to] : level);
    }
}

int matte_connect(float *prior, const uint8_t *head, struct error *err)
{
    struct matte_front *f = calloc(1, sizeof *f);

    if (!f)
        return error_set(err, EX_OSERR, "no memory for the matte");
    memset(f->last, -1, sizeof f->last);
    for (size_t i = 0; i < PIXELS; i++)
        f->level[i] = (uint8_t)lrintf(255 * prior[i]);
    for (size_t i = 0; i < PIXELS; i++)
        if (head[i] > 127)
            matte_reach(f, i, f->level[i]);
    for (int level = 255; level > 0; level--)
        while (f->last[level] >= 0) {
            const int32_t now = f->last[level];

            f->last[level] = f->next[now];
            if (f->best[f->place[now]] == level)
                matte_step(f, f->place[now], (uint8_t)level);
        }
    for (size_t i = 0; i < PIXELS; i++)
        prior[i] = fminf(prior[i], (float)f->best[i] / 255);
    free(f);
    return 0;
}

int matte_find(struct matting *m, bool *seen, const uint8_t *head,
               struct matte_net *net, bool known, struct error *err)
{
    struct matte *k = malloc(sizeof *k);
    int rc = -1;

    if (!k || matte_shrink(k, m)) {
        error_set(err, EX_OSERR, "no memory for the matte");
        goto out;
    }
    k->head = head;
    *seen = net && matte_ask(k, net);
    if (!*seen)
        matte_guess(k, m);
    rc = matte_connect(k->prior, head, err) ||
         matting_solve(m, k->prior, SIDE, known, err) ? -1 : 0;
out:
    free(k);
    return rc;
}
