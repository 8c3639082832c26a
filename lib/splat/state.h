/* Inside the rasteriser: its memory, and the kernels each instruction set
 * provides.  Not for other modules. */
#ifndef SPID_SPLAT_STATE_H
#define SPID_SPLAT_STATE_H

#include "lib/splat/types.h"

#define TILE 16                /* pixels; a tile is 4 rows of blocks */
#define CHUNK 256              /* list entries a tile works on at a time */
#define PAD 16                 /* arrays of Gaussians are whole vectors */
#define HIDDEN UINT32_MAX      /* key of a Gaussian that is not drawn */
#define SPLAT_MAX_THREADS 64

/* A Gaussian on the screen.  alpha at pixel distance (dx,dy) is 2^q, q = top -
 * (a dx^2 + b dx dy + c dy^2): the conic and the opacity carry log2 e.  Kept as
 * two squares, which do not cancel: q = top - falloff dy^2 - (root (dx - sy
 * dy))^2. */
struct projected_gaussian {
    float x, y;                /* centre, pixels */
    float top, falloff;        /* falloff = c - b^2 / 4a */
    float sx, sy;              /* -b/2c and -b/2a: dy per dx, dx per dy along
                                * which q is greatest */
    float wide;                /* where alpha_cut is reached, the largest dx */
    float root;                /* sqrt(a) */
};

/* Its floats by number. */
enum field { FX, FY, FTOP, FFALLOFF, FSX, FSY, FWIDE, FROOT, FIELDS };

/* Tiles [x0,x1) x [y0,y1) that a Gaussian may touch. */
struct rect {
    uint16_t x0, x1, y0, y1;
};

/* What a camera means to the kernels. */
struct view {
    float rt[12], fx, fy, cx, cy;
    float limx, limy;          /* 1.3 tan(half field of view) */
    float near, eps;           /* eps: DGR adds 1e-7 to z */
    float cut;                 /* log2 of alpha_cut */
    float t_cut;
    int width, height, tx, ty; /* pixels; tiles across and down */
    bool dgr;
    struct splat_place_view place;
};

/* Gaussians, one array per number, padded to 16. */
struct cloud {
    float *mean[3];            /* as loaded and moved */
    float *scale[3], *quat[4]; /* quat normalised unless DGR */
    float *top;                /* log2 opacity; -1e30 for 0 */
    float *uv[2], *seen;       /* with places: -1..1 across the source
                                * picture, and how much; else NULL */
    float *tilt[2];            /* likewise */
    float *around[2];          /* likewise: -1..1 across the grain */
    float *thin;               /* likewise: gaussians_thin */
    float *normal[3], *lit;    /* likewise: of the surface, and one over
                                * the photograph's light on it */
};

/* A Gaussian that the photograph shows only near source_mean (gaussian_seen). */
struct splat_fading {
    size_t at;                 /* its number */
    float seen, reach, source_mean[3];
};

struct splat_gradient_state;

/* Where a frame goes. */
struct target {
    float *image;
    uint16_t *half;
    float *alpha, *depth, *place;
    float *final_T;            /* for backward: T at the end, ... */
    float *background_free;    /* ... and the image without background ... */
    float *kept_place;         /* ... and the places */
    const float *background;
    splat_shade_fn *shade;
    void *ctx;
};

struct splat_state {
    enum cpu_level level;
    size_t work_size;          /* bytes of a struct splat_work */
    int threads;               /* that a frame's steps are cut for */
    int slots;                 /* of parallel_slot, at least threads */
    struct view view;
    struct splat_camera camera;
    bool grained;              /* some Gaussians have a place in the grain */
    bool projected;            /* projection, key, rect are of this camera */
    size_t dirty0, dirty1;     /* ... but for these Gaussians */

    /* one block, sized by N in splat_load */
    void *block;
    size_t block_bytes, screen_bytes;
    struct cloud cloud;
    struct splat_fading *fading;    /* (fadings), in order */
    size_t fadings;
    struct projected_gaussian *projection;   /* (N) */
    float (*color)[4];         /* (N) the first channels */
    float (*place)[4];         /* (N) place channels, or NULL */
    uint32_t *key;             /* (N) bits of z, or HIDDEN */
    float *fine[3];            /* (N) with gradients: what float loses of x, y,
                                * z; else NULL */
    struct rect *rect;         /* (N) */
    uint64_t *order;           /* (N) key << 32 | index, front to back */
    uint64_t *sort0, *sort1;   /* (N) room to sort */
    struct rect *ordered;      /* (N) rectangles in order */
    float *table;              /* (N, row) colours of more than 4 channels */
    int16_t *fixed;            /* (N, 32) the same in Q15 of fixed_scale */
    float fixed_scale[SPLAT_MAX_CHANNELS];
    int row;                   /* floats in a row of table: 16 or 32 */

    /* one block, sized by the picture in splat_init */
    void *screen;
    uint32_t *start, *end;     /* (tiles) list of each tile */
    uint32_t *zorder;          /* (tiles) in Z order */
    bool *empty;               /* (tiles) nothing was in it when it was last
                                * drawn, ... */
    struct target drawn_to;    /* ... to here */
    int32_t *count;            /* (threads, tiles + border), of each tile */
    uint32_t *histogram;       /* (threads, 2048) */
    float *gain_room;          /* of splat_relight */
    void *work;                /* (slots) struct work, of the kernels */

    uint32_t *list;            /* (tile, Gaussian) pairs */
    size_t list_room;

    struct splat_gradient_state *gradient;
};

/* Lay out in block what the picture's size decides, or with block NULL only
 * count; returns the bytes. */
size_t state_screen_layout(struct splat_state *st, char *block);
/* The same of what the number of Gaussians decides; n is padded to PAD. */
size_t state_cloud_layout(struct splat *s, char *block, size_t n);

/* Fill the arrays of s->state, which have room for g; numbers are checked. */
void pack_gaussians(struct splat *s, const struct gaussians *g);
/* Project what changed, sort, make the tiles' lists, draw.  -1 when there is
 * no memory for the lists. */
int frame_draw(struct splat *s, const struct target *out, struct error *err);

/* The calling thread's part of st->work. */
struct splat_work *state_work(const struct splat_state *st);

/* First of n that thread t works on. */
static inline size_t state_share(size_t n, int t, int threads)
{
    return n * (size_t)t / (size_t)threads;
}

#endif
