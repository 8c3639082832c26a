/* From a decoder's raw numbers to the attributes of Gaussians (section 3.2):
 * colour's first three and opacity through a sigmoid, scale GAUSSIAN_SCALE_MAX times one,
 * rotation normalised, position sigmoid (static) or an offset (mouth). */
#ifndef SPID_NET_GAUSSIAN_HEAD_H
#define SPID_NET_GAUSSIAN_HEAD_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/nn/graph.h"

#define GAUSSIAN_SCALE_MAX 0.05f    /* head units; the paper's, section 3.2 */

/* A view of caller's memory; N Gaussians. */
struct gaussian_out {
    float *color;      /* (N,colors), or those that are kept */
    float *opacity;    /* (N) */
    float *scale;      /* (N,3) */
    float *quat;       /* (N,4) w first, unit */
    float *position;   /* (N,positions); NULL when positions is 0 */
};

/* What the last numbers of a row are. */
enum gaussian_position {
    GAUSSIAN_POSITION_NONE,    /* dynamic: on its vertex */
    GAUSSIAN_POSITION_DEPTH,   /* static: p in [0,1], one number, sigmoid */
    GAUSSIAN_POSITION_OFFSET   /* mouth: q, three numbers, as they are */
};

struct gaussian_head {
    size_t colors;                   /* 32; the first three are RGB */
    size_t kept;                     /* of them, the first so many are written,
                                      * by the forward alone; 0: all */
    bool colors_only;                /* a row is its colours; the rest is the
                                      * caller's to say */
    enum gaussian_position position;
    /* The public base code's slips (golden README, 5.2 and 5.3): the first
     * three image columns' sigmoid (width > 0 is the image's), or rotation
     * normalised over the points of an item.  False does what was meant. */
    bool quirk_columns, quirk_rotation;
};

/* Numbers in a raw row: colors, opacity, scale 3, rotation 4, position; or
 * colors. */
size_t gaussian_head_width(const struct gaussian_head *h);

/* out <- raw (B,N,width of the head), stride floats from row to row.
 *   rgb_logit (B,N,3) is added to the RGB logits, or NULL (rgb_skip off)
 *   image_w  columns of the image the N points are, for quirk_columns */
void gaussian_head_forward(struct gaussian_out *out, const float *raw,
                           const float *rgb_logit,
                           const struct gaussian_head *h, size_t B, size_t N,
                           size_t stride, size_t image_w);
/* draw (B,N,stride) is written; drgb_logit (B,N,3) too unless NULL.  dout's
 * fields hold gradients (NULL: zero); raw and rgb_logit as in the forward. */
void gaussian_head_backward(float *draw, float *drgb_logit,
                            const struct gaussian_out *dout, const float *raw,
                            const float *rgb_logit,
                            const struct gaussian_head *h, size_t B, size_t N,
                            size_t stride, size_t image_w);

/* The same as a graph: outputs "color" (N,colors), "opacity" (N,1), "scale"
 * (N,3), "quat" (N,4) and, where there are positions, "position" (N,1 or 3)
 * from raw (N,width of the head) and rgb_logit (N,3); or the first of them. */
void gaussian_head_graph(struct graph *g, int raw, int rgb_logit, size_t N,
                         const struct gaussian_head *h);

#endif
