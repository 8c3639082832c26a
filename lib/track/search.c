/* A lattice of squares at each size, as many at a time as E_m is planned for.
 * E_m was taught to be sure of crops that are off by a tenth of their side, and
 * is unsure of those off by four tenths: between lies the lattice's step. */
#include "lib/track/search.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#define SEARCH_SIDE 240         /* pixels of the shorter side, to twice that */
#define SEARCH_MAX 1.25         /* crop's side over the shorter one's */
#define SEARCH_RATIO 1.5        /* of one level's sides to the next one's */
#define SEARCH_STEP 0.4         /* from square to square, over their side: of 301
                                 * faces each is found as with 0.3: tests/bench/
                                 * README.md, "From a photograph to the first
                                 * frame", as HOPELESS of pass.c */
#define SEARCH_EDGE 0.25        /* the same from the picture's border to the
                                 * first one's middle */

int search_init(struct search *s, struct motion_encoder *net,
                struct error *err)
{
    const size_t crop = 3 * CROP_NET * CROP_NET;
    const size_t n = net->batch * (crop + MOTION_OUT);

    memset(s, 0, sizeof *s);
    s->net = net;
    s->rgb = malloc(n * sizeof *s->rgb);
    if (!s->rgb)
        return error_set(err, EX_OSERR, "no memory to look for a face");
    /* a live driver's memory is all there before its first frame */
    memset(s->rgb, 0, n * sizeof *s->rgb);
    s->out = s->rgb + net->batch * crop;
    return 0;
}

void search_release(struct search *s)
{
    free(s->rgb);
    memset(s, 0, sizeof *s);
}

/* Keep q among the surest, of neighbours the surer one. */
static size_t search_keep(struct square *best, float *confidence, size_t n,
                          struct square q, float how)
{
    size_t at = n;

    for (size_t i = 0; i < n; i++)
        if (hypot(best[i].x - q.x, best[i].y - q.y) < SEARCH_APART * q.size) {
            if (confidence[i] >= how)
                return n;
            at = i;
            break;
        }
    if (at == SEARCH_BEST && confidence[--at] >= how)
        return n;
    n += at == n;
    for (; at > 0 && confidence[at - 1] < how; at--) {
        best[at] = best[at - 1];
        confidence[at] = confidence[at - 1];
    }
    best[at] = q;
    confidence[at] = how;
    return n;
}

const struct mipmap_level *search_take(struct mipmap *picture)
{
    const struct mipmap_level *l = picture->level;
    size_t k = 0;

    while ((l[k].W < l[k].H ? l[k].W : l[k].H) >= 2 * SEARCH_SIDE)
        k++;
    return mipmap_whole(picture, k);
}

/* E_m on `count` squares of the picture. */
static size_t search_encode(struct search *s, struct square *best,
                            float *confidence, size_t n,
                            const struct mipmap_level *l,
                            const struct square *q, size_t count)
{
    const size_t crop = 3 * CROP_NET * CROP_NET;

    for (size_t i = 0; i < s->net->batch; i++)  /* the last one fills up */
        crop_sample_u8(s->rgb + i * crop, CROP_NET, l->rgb, l->W, l->H,
                       3 * l->W, q[i < count ? i : count - 1]);
    motion_encoder_forward(s->out, s->rgb, s->net);
    for (size_t i = 0; i < count; i++)
        n = search_keep(best, confidence, n, q[i], motion_encoder_confidence(s->net, i));
    return n;
}

/* Squares of this side along `length` pixels. */
static size_t search_along(double side, size_t length)
{
    const double room = (double)length - 2 * SEARCH_EDGE * side;

    return room <= 0 ? 1 : 1 + (size_t)ceil(room / (SEARCH_STEP * side));
}

/* The middle of number i of n. */
static double search_middle(size_t i, size_t n, double side, size_t length)
{
    const double edge = SEARCH_EDGE * side;

    return n == 1 ? 0.5 * (double)length
                  : edge + ((double)length - 2 * edge) * (double)i /
                               (double)(n - 1);
}

size_t search_level(struct square best[SEARCH_BEST], struct search *s,
                    struct mipmap *picture, size_t level)
{
    const struct mipmap_level *l = search_take(picture);
    const double shrunk = (double)(1u << (l - picture->level));
    const double side = SEARCH_MAX * fmin((double)l->W, (double)l->H) /
                        pow(SEARCH_RATIO, (double)level);
    const size_t nx = search_along(side, l->W), ny = search_along(side, l->H);
    float confidence[SEARCH_BEST] = {0};
    struct square q[16];
    size_t n = 0, waiting = 0;

    if (side < 16)
        return 0;
    for (size_t k = 0; k < nx * ny; k++) {
        q[waiting++] = (struct square){search_middle(k % nx, nx, side, l->W),
                                       search_middle(k / nx, ny, side, l->H),
                                       side};
        if (waiting < s->net->batch && waiting < 16 && k + 1 < nx * ny)
            continue;
        n = search_encode(s, best, confidence, n, l, q, waiting);
        waiting = 0;
    }
    for (size_t i = 0; i < n; i++) {
        best[i].x *= shrunk;
        best[i].y *= shrunk;
        best[i].size *= shrunk;
    }
    return n;
}
