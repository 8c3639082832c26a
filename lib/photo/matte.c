/* The prior of a matte: from the matte network, which sees the portrait at its
 * own size, or from the outline of the head. */
#include "lib/photo/matte.h"

#include <math.h>
#include <stdlib.h>
#include <sysexits.h>

#include "lib/base/crop.h"

#define SIDE MATTE_SIDE
#define PIXELS (SIDE * SIDE)

struct matte {
    const uint8_t *head;        /* (SIDE,SIDE) */
    struct extent inside;
    uint8_t rgb[3 * PIXELS];
    float input[3 * PIXELS], prior[PIXELS], joined[PIXELS];
};

/* What the network sees. */
static int matte_shrink(struct matte *k, const struct matting *m)
{
    const size_t n = m->n;
    const struct square all = {(double)n / 2, (double)n / 2, (double)n};

    if (crop_resize_u8(k->rgb, SIDE, m->rgb, n, n, 3 * n, 3, all))
        return -1;
    for (size_t i = 0; i < 3 * PIXELS; i++)
        k->input[i] = (float)k->rgb[i] / 255;
    k->inside = extent_resize(m->inside, n, SIDE);
    extent_repeat_edges(k->input, SIDE, 3, k->inside);
    return 0;
}

/* The network's matte, beyond the picture at least the head; false where that is
 * mostly nobody to it. */
static bool matte_ask(struct matte *k, struct matte_net *net)
{
    double seen = 0, all = 0;

    matte_net_forward(k->prior, k->input, net);
    for (size_t i = 0; i < PIXELS; i++) {
        k->prior[i] = (float)matte_net_alpha(k->prior[i]);
        seen += k->head[i] * k->prior[i];
        all += k->head[i];
        if (!extent_has(&k->inside, i % SIDE, i / SIDE))
            k->prior[i] = fmaxf(k->prior[i], (float)k->head[i] / 255);
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
static void matte_guess(struct matte *k)
{
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
        const double aside = fabs(u) / (0.5 + 2 * below);

        k->prior[i] = fmaxf(matte_likely(hair),
                            below > 0 ? matte_likely(aside) : 0);
        if (extent_has(&k->inside, i % SIDE, i / SIDE))
            k->prior[i] *= 0.85f;
        k->prior[i] = fmaxf(k->prior[i], (float)k->head[i] / 255);
    }
}

/* A place by one beside it; whether it grew. */
static inline bool matte_grow(float *at, float prior, float neighbour)
{
    if (neighbour <= *at || prior <= *at)
        return false;
    *at = neighbour < prior ? neighbour : prior;
    return true;
}

/* A row by the one beside it, then along itself to both ends. */
static bool matte_spread(float *row, const float *prior, const float *neighbour)
{
    bool grew = false;

    for (size_t x = 0; x < SIDE; x++)
        grew |= matte_grow(row + x, prior[x], neighbour[x]);
    for (size_t x = 1; x < SIDE; x++)
        grew |= matte_grow(row + x, prior[x], row[x - 1]);
    for (size_t x = SIDE - 1; x > 0; x--)
        grew |= matte_grow(row + x - 1, prior[x - 1], row[x]);
    return grew;
}

void matte_connect(float *out, const float *prior, const uint8_t *head)
{
    bool grew;

    for (size_t i = 0; i < PIXELS; i++)
        out[i] = head[i] > 127 ? prior[i] : 0;
    do {
        grew = false;
        for (size_t i = 0; i < PIXELS; i += SIDE)
            grew |= matte_spread(out + i, prior + i, out + (i ? i - SIDE : 0));
        for (size_t i = PIXELS - SIDE; i > 0; i -= SIDE)
            grew |= matte_spread(out + i - SIDE, prior + i - SIDE, out + i);
    } while (grew);
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
        matte_guess(k);
    matte_connect(k->joined, k->prior, head);
    rc = matting_solve(m, k->joined, SIDE, known, err);
out:
    free(k);
    return rc;
}
