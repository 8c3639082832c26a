/* Laying the mesh's rim over the matte's edge (outline.h). */
#include "lib/photo/outline.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/camera.h"
#include "lib/base/cholesky.h"
#include "lib/base/parallel.h"
#include "lib/head/lbs.h"
#include "lib/photo/overlay.h"

#define SHAPES 128              /* parameters of a shape that are fitted */
#define STEPS 3
#define SPREAD 0.35             /* of E_beta's numbers: less than about the truth,
                                 * since what else is off is taken for shape
                                 * (tests/bench/README.md, "Where the face is
                                 * thought to be") */
#define RIM_SPREAD 2.0          /* of the rim about the edge, pixels of 512, */
#define STAY_SPREAD 0.5         /* and of landmarks about where they were */
#define RIM 0.3f                /* cosine to the camera: at most, of the rim */
#define SEARCH 0.035            /* from the rim to the edge, of the side: half
                                 * and twice are as good (the table there) */
#define COLOUR_MAX 40.0         /* levels: more, and the edge is not the skin's
                                 * but that of hair or cloth before it; flat
                                 * from half to twice (there, too) */
#define HAIR 0.2f               /* a vertex with more of it is not skin */
#define FIRST_INNER 17          /* landmarks from here on stay */
#define ENOUGH 24               /* points of the rim */
#define GRAIN 64                /* vertices or rows that one thread takes */

/* One row of the equations: vertices, their shares, a direction in the
 * picture, and how far along it the point has to go. */
struct outline_row {
    int32_t vertex[3];
    float share[3];
    float along[2];
    double off, spread;
};

struct outline {
    const struct head *head;
    struct person *person;
    struct identity id;
    size_t shapes, n;           /* numbers sought; side of the picture */
    double scale;               /* its pixels per pixel of 512 */
    float cam[12];
    float *verts, *normal, *uv; /* (V,3) (V,3) (V,2) of the posed head, and */
    float *half, *z;            /* (V,2) (V) in the silhouette's pixels */
    float stay[2 * HEAD_LANDMARKS]; /* where the landmarks were */
    uint8_t *silhouette;        /* (n/2,n/2) of the posed head */
    struct outline_row *row;    /* (V + 2 landmarks) */
    size_t rows, points;        /* all; of the rim */
    double apart;               /* sum of |off| of the rim */
    double *g;                  /* (as many, SHAPES): how far each row's point
                                 * goes with each number of the shape */
    double *weight;             /* (as many) of the rows */
    double a[SHAPES * SHAPES], x[SHAPES];       /* the normal equations */
};

static void outline_release(struct outline *o)
{
    identity_release(&o->id);
    free(o->verts);
    free(o->silhouette);
    free(o->row);
    free(o->g);
}

static int outline_init(struct outline *o, struct person *p,
                        const struct head *h, struct error *err)
{
    const size_t rows = h->V + 2 * HEAD_LANDMARKS;

    memset(o, 0, sizeof *o);
    o->head = h;
    o->person = p;
    o->n = p->size;
    o->scale = (double)p->size / 512;
    o->shapes = p->nshape < SHAPES ? p->nshape : SHAPES;
    o->verts = malloc(11 * h->V * sizeof *o->verts);
    o->silhouette = malloc(o->n / 2 * (o->n / 2) + 1);
    o->row = malloc(rows * sizeof *o->row);
    o->g = malloc(rows * (SHAPES + 1) * sizeof *o->g);
    if (!o->verts || !o->silhouette || !o->row || !o->g) {
        outline_release(o);
        return error_set(err, EX_OSERR, "no memory for a head's outline");
    }
    o->normal = o->verts + 3 * h->V;
    o->uv = o->verts + 6 * h->V;
    o->half = o->verts + 8 * h->V;
    o->z = o->verts + 10 * h->V;
    o->weight = o->g + rows * SHAPES;
    motion_camera(o->cam, &p->source);
    return 0;
}

/* Pose the head with the person's shape. */
static int outline_pose(struct outline *o, struct error *err)
{
    const struct motion *m = &o->person->source;
    struct head_motion pose = m->pose;

    pose.exp = m->exp;
    identity_release(&o->id);
    if (head_fold(&o->id, o->head, o->person->shape, o->person->nshape, err))
        return -1;
    head_pose(o->verts, &o->id, &pose);
    head_normals(o->normal, o->head, o->verts);
    camera_project(o->uv, NULL, o->cam, (float)o->n, o->verts, o->head->V);
    camera_project(o->half, o->z, o->cam, (float)(o->n / 2), o->verts,
                   o->head->V);
    overlay_fill_mesh(o->silhouette, o->n / 2, o->head, o->half, o->z);
    return 0;
}

/* Level of a picture (n,n) at (x,y) pixels; 0 beside it. */
static int outline_at(const uint8_t *picture, size_t n, double x, double y)
{
    if (!(x >= 0 && y >= 0 && x < (double)n && y < (double)n))
        return 0;
    return picture[(size_t)y * n + (size_t)x];
}

/* How unlike the picture's colours at two places are, 0 to 255. */
static double outline_colour_distance(const struct outline *o,
                                      const double a[2], const double b[2])
{
    double sum = 0;

    for (int c = 0; c < 3; c++) {
        const uint8_t *rgb = o->person->rgb + c;
        const size_t i = (size_t)a[1] * o->n + (size_t)a[0];
        const size_t j = (size_t)b[1] * o->n + (size_t)b[0];

        sum += fabs((double)rgb[3 * i] - rgb[3 * j]);
    }
    return sum / 3;
}

/* Whether vertex v is skin that may lie on the rim. */
static bool outline_is_skin(const struct head *h, size_t v)
{
    const int r = h->region[v];

    return (r == REGION_SKIN || r == REGION_FACE || r == REGION_NECK ||
            r == REGION_EAR) &&
           !(h->hair && h->hair[v] > HAIR);
}

/* Direction in the picture in which vertex v's normal points; its cosine to
 * the camera. */
static float outline_normal(float along[2], const struct outline *o, size_t v)
{
    const float *n = o->normal + 3 * v, *x = o->verts + 3 * v;
    float q[3], p[3], dot = 0, square = 0;

    for (int r = 0; r < 3; r++) {
        const float *R = o->cam + 4 * r;

        q[r] = R[0] * n[0] + R[1] * n[1] + R[2] * n[2];
        p[r] = R[0] * x[0] + R[1] * x[1] + R[2] * x[2] + R[3];
        dot -= q[r] * p[r];
        square += p[r] * p[r];
    }
    const float length = hypotf(q[0], q[1]);
    along[0] = q[0] / fmaxf(length, 1e-6f);
    along[1] = q[1] / fmaxf(length, 1e-6f);
    return dot / sqrtf(square);
}

/* The place t along a direction from `at`. */
static void outline_along(double to[2], const float at[2],
                          const float along[2], double t)
{
    to[0] = at[0] + t * along[0];
    to[1] = at[1] + t * along[1];
}

/* How far from `at` the matte's edge is along a direction; infinite where none
 * is near. */
static double outline_edge(const struct outline *o, const float at[2],
                           const float along[2])
{
    const double step = 0.5 * o->scale, search = SEARCH * (double)o->n;
    const uint8_t *matte = o->person->matte;
    double best = INFINITY, a[2];
    bool inside = false;

    for (double t = -search; t < search; t += step) {
        outline_along(a, at, along, t);
        const bool now = outline_at(matte, o->n, a[0], a[1]) >= 128;

        if (inside && !now && fabs(t) < fabs(best))
            best = t;
        inside = now;
    }
    return best;
}

/* Whether vertex v of the rim has to go to the edge that far along a direction:
 * the edge has nothing but the wall outside, and v, if it is further in, is skin
 * and that edge the skin's.  Hair and cloth reach further out than the head, but
 * nothing of the head further than the person. */
static bool outline_bounds(const struct outline *o, size_t v,
                           const float along[2], double edge)
{
    const uint8_t *matte = o->person->matte;
    const float *at = o->uv + 2 * v;
    double out[2], rim[2], in[2];

    outline_along(out, at, along, edge + 4 * o->scale);
    outline_along(rim, at, along, edge - 2 * o->scale);
    outline_along(in, at, along, edge - 12 * o->scale);
    return out[0] >= 0 && out[1] >= 0 && out[0] < (double)o->n &&
           out[1] < (double)o->n &&
           outline_at(matte, o->n, out[0], out[1]) < 64 &&
           outline_at(matte, o->n, rim[0], rim[1]) > 64 &&
           outline_at(matte, o->n, in[0], in[1]) > 192 &&
           (edge < 0 || (outline_is_skin(o->head, v) &&
                         outline_colour_distance(o, rim, in) < COLOUR_MAX));
}

/* row[v]: vertex v's, if it is of the rim; else its spread is 0. */
PARALLEL(outline_vertex, v, const struct outline *, o, struct outline_row *, row)
{
    const float *at = o->uv + 2 * v;
    float along[2];
    double out[2];

    row[v].spread = 0;
    if (fabsf(outline_normal(along, o, v)) > RIM)
        return;
    outline_along(out, at, along, 2.5 * o->scale);
    if (outline_at(o->silhouette, o->n / 2, out[0] / 2, out[1] / 2))
        return;                 /* the head goes on behind it */
    const double off = outline_edge(o, at, along);
    if (isfinite(off) && outline_bounds(o, v, along, off))
        row[v] = (struct outline_row){{(int32_t)v}, {1}, {along[0], along[1]},
                                      off, RIM_SPREAD * o->scale};
}

/* The rows of the rim. */
static void outline_find_rim(struct outline *o)
{
    const size_t V = o->head->V;

    parallel_each(outline_vertex, V, GRAIN, o, o->row);
    o->rows = 0;
    o->apart = 0;
    for (size_t v = 0; v < V; v++)
        if (o->row[v].spread > 0) {
            o->apart += fabs(o->row[v].off);
            o->row[o->rows++] = o->row[v];
        }
    o->points = o->rows;
}

/* Where landmark l is in the picture. */
static void outline_landmark(float uv[2], const struct outline *o, size_t l)
{
    const int32_t *f = o->head->f + 3 * o->head->landmark_faces[l];

    for (int k = 0; k < 2; k++) {
        uv[k] = 0;
        for (int c = 0; c < 3; c++)
            uv[k] += o->head->landmark_bary[3 * l + c] * o->uv[2 * f[c] + k];
    }
}

/* The rows that keep the landmarks. */
static void outline_hold_landmarks(struct outline *o)
{
    for (size_t l = FIRST_INNER; l < HEAD_LANDMARKS; l++) {
        const int32_t *f = o->head->f + 3 * o->head->landmark_faces[l];
        const float *b = o->head->landmark_bary + 3 * l;
        float uv[2];

        outline_landmark(uv, o, l);
        for (int k = 0; k < 2; k++)
            o->row[o->rows++] = (struct outline_row){
                {f[0], f[1], f[2]}, {b[0], b[1], b[2]},
                {k == 0, k == 1}, o->stay[2 * l + k] - uv[k],
                STAY_SPREAD * o->scale};
    }
}

/* Row i's weight, and its g. */
PARALLEL(outline_derive, i, struct outline *, o)
{
    const struct head *h = o->head;
    const struct outline_row *r = o->row + i;
    const double apart = r->off / r->spread;
    double *g = o->g + i * SHAPES;

    o->weight[i] = 1 / (r->spread * r->spread * (1 + apart * apart / 9));
    memset(g, 0, o->shapes * sizeof *g);
    for (int c = 0; c < 3 && r->share[c] != 0; c++) {
        const size_t v = (size_t)r->vertex[c], b = v / HEAD_BLOCK;
        const float duv[2] = {r->along[0] * r->share[c],
                              r->along[1] * r->share[c]};
        float dx[3] = {0};

        camera_project_backward(dx, NULL, duv, NULL, o->cam, (float)o->n,
                                o->verts + 3 * v, 1);
        for (size_t k = 0; k < o->shapes; k++) {
            if (!head_shape_moves(h, b, k))
                continue;
            const float *d = h->shape_dirs +
                             (b * h->nshape + k) * 3 * HEAD_BLOCK +
                             v % HEAD_BLOCK;

            g[k] += (double)(dx[0] * d[0] + dx[1] * d[HEAD_BLOCK] +
                             dx[2] * d[2 * HEAD_BLOCK]);
        }
    }
}

/* Equation m, of all rows in their order. */
PARALLEL(outline_equation, m, struct outline *, o)
{
    double *a = o->a + o->shapes * m, x = 0;

    memset(a, 0, o->shapes * sizeof *a);
    for (size_t i = 0; i < o->rows; i++) {
        const double *g = o->g + i * SHAPES, by = o->weight[i] * g[m];

        x += by * o->row[i].off;
        for (size_t n = 0; n <= m; n++)
            a[n] += by * g[n];
    }
    o->x[m] = x;
}

/* One step of the shape; first (shapes): E_beta's. */
static void outline_step(struct outline *o, const float *first)
{
    const size_t K = o->shapes;
    double *x = o->x, *a = o->a;

    parallel_each(outline_derive, o->rows, GRAIN, o);
    parallel_each(outline_equation, K, 1, o);
    for (size_t k = 0; k < K; k++) {
        const double hold = 1 / (SPREAD * SPREAD);

        a[K * k + k] += hold;
        x[k] -= hold * ((double)o->person->shape[k] - first[k]);
    }
    cholesky_solve(x, a, K);
    for (size_t k = 0; k < K; k++)
        o->person->shape[k] += (float)x[k];
}

/* The landmarks as they are: there they stay. */
static void outline_keep_landmarks(struct outline *o)
{
    for (size_t l = FIRST_INNER; l < HEAD_LANDMARKS; l++)
        outline_landmark(o->stay + 2 * l, o, l);
}

/* The steps. */
static int outline_run(struct outline *o, struct outline_report *r,
                       struct error *err)
{
    float first[SHAPES];

    memcpy(first, o->person->shape, o->shapes * sizeof *first);
    for (int step = 0;; step++) {
        if (outline_pose(o, err))
            return -1;
        outline_find_rim(o);
        r->points = o->points;
        r->after = o->points ? o->apart / (double)o->points : 0;
        if (step == 0) {
            r->before = r->after;
            outline_keep_landmarks(o);
        }
        if (step == STEPS || o->points < ENOUGH)
            return 0;
        outline_hold_landmarks(o);
        outline_step(o, first);
    }
}

int outline_fit(struct outline_report *r, struct person *p,
                const struct head *head, struct error *err)
{
    struct outline o;

    memset(r, 0, sizeof *r);
    if (!head->region || !head->has_landmarks || !p->has_source)
        return 0;
    if (outline_init(&o, p, head, err))
        return -1;
    const int rc = outline_run(&o, r, err);
    outline_release(&o);
    return rc;
}
