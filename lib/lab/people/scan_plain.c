/* A plain figure in the scans' place: the head's own mesh, teeth and a hollow
 * behind its lips, and what scan_plain_looks.c makes by formulas.  It lies in
 * arrays of the scans' layout, so that all that draws them draws it. */
#include "lib/lab/people/scan.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/head/lbs.h"
#include "lib/lab/people/noise.h"
#include "lib/base/vec3.h"

/* ---- where the parts lie in the scans' layout ---------------------------- */

enum {
    NARROW = 6706,              /* vertices of the narrow face end here */
    BOWL_RINGS = 4,             /* of the hollow behind the lips */
    BOWL = FACE_NECK_END,
    ARCH = 15, ARCH_ROWS = 2,   /* places along a row of teeth, heights */
    TEETH = FACE_GUMS_END, LOWER = TEETH + ARCH * ARCH_ROWS,
    BALL = SCAN_IRIS_LEFT - SCAN_EYE_LEFT       /* that scan_eye_motion reads */
};

struct scan_plain {
    const struct head *head;    /* borrowed */
    int32_t *at;                /* (V) the scans' vertex that stands for it */
    int32_t *ball[2];           /* (nball) the head's vertices of each eye */
    size_t nball[2];
    size_t narrow;              /* vertices of the narrow face */
};

/* The narrow face: what looks to the front, without hair. */
static bool plain_is_narrow(const struct head *h, size_t v)
{
    const float *p = h->v_template + 3 * v;

    return p[2] > 0.15f && p[1] > -0.5f && (!h->hair || h->hair[v] < 0.1f);
}

static int plain_lay_out(struct scan_plain *p, const struct head *h,
                         struct arena *memory, struct error *err)
{
    int32_t rest = NARROW;

    p->head = h;
    p->at = arena_take(memory, h->V, sizeof *p->at);
    for (int e = 0; e < 2; e++)
        p->ball[e] = arena_take(memory, h->V, sizeof *p->ball[e]);
    if (arena_check(memory, "a figure", err))
        return -1;
    for (size_t v = 0; v < h->V; v++) {
        int e = h->v_template[3 * v] < 0;
        size_t n = p->nball[e];

        if (h->region[v] == REGION_EYEBALL && n < BALL) {
            p->at[v] = (e ? FACE_EYE_LEFT_END : FACE_TEETH_END) + (int32_t)n;
            p->ball[e][p->nball[e]++] = (int32_t)v;
        } else {
            p->at[v] = plain_is_narrow(h, v)
                           ? (int32_t)p->narrow++ : rest++;
        }
    }
    if (!p->narrow || p->narrow > NARROW || rest > FACE_NECK_END
        || !p->nball[0] || !p->nball[1])
        return error_set(err, EX_DATAERR, "head of %zu vertices (expected the "
                         "built-in head's 5140)", h->V);
    return 0;
}

/* out (FACE_VERTICES,3) <- x (V,3), the head's vertices or a shape of theirs;
 * face and eyes fill their room with copies, since it is averaged over. */
static void plain_scatter(float *out, const struct scan_plain *p,
                          const float *x)
{
    for (size_t v = 0; v < p->head->V; v++)
        copy3(out + 3 * p->at[v], x + 3 * v);
    for (size_t i = p->narrow; i < NARROW; i++)
        copy3(out + 3 * i, out + 3 * (i % p->narrow));
    for (size_t e = 0; e < 2; e++)
        for (size_t i = 0; i < BALL; i++)
            copy3(out + 3 * ((e ? FACE_EYE_LEFT_END : FACE_TEETH_END) + i),
                  x + 3 * p->ball[e][i % p->nball[e]]);
}

/* ---- the mouth ---------------------------------------------------------- */

/* Where a row of teeth stands behind the lips' middle. */
static void plain_tooth(float o[3], const float lip[3], bool lower, int i,
                        int row)
{
    float t = ((float)i / (ARCH - 1) - 0.5f) * 2.6f;
    float wide = lower ? 0.085f : 0.095f;

    o[0] = lip[0] + wide * sinf(t);
    o[1] = lip[1] + (lower ? -0.060f : 0.080f) * (float)row
           + (lower ? -0.022f : -0.040f);
    o[2] = lip[2] - (lower ? 0.085f : 0.070f) - 0.12f * (1 - cosf(t));
}

/* The middle of n vertices of the head. */
static void plain_middle(float c[3], const float *x, const struct scan_plain *p,
                         const int32_t *v, size_t n)
{
    c[0] = c[1] = c[2] = 0;
    for (size_t i = 0; i < n; i++)
        mad3(c, c, x + 3 * p->at[v[i]], 1 / (float)n);
}

static void plain_lip(float c[3], const float *x, const struct scan_plain *p)
{
    plain_middle(c, x, p, p->head->lip_inner, p->head->nlip_inner);
}

/* Of x (FACE_VERTICES,3): the hollow hangs on the lips (n,3), upper teeth on
 * the middle of the resting ones, lower ones follow the jaw (3). */
static void plain_hang_mouth(float *x, const struct scan_plain *p,
                             const float *rest_lip, const float *jaw)
{
    const struct head *h = p->head;
    size_t n = h->nlip_inner;
    float c[3], o[3];

    plain_lip(c, x, p);
    for (size_t k = 0; k < BOWL_RINGS; k++) {
        float deep = (float)(k + 1) / BOWL_RINGS;
        float wide = 1.4f * sqrtf(1 - deep * deep);

        for (size_t i = 0; i < n; i++) {
            float *to = x + 3 * (BOWL + k * n + i), d[3];

            sub3(d, x + 3 * p->at[h->lip_inner[i]], c);
            d[1] += (d[1] < 0 ? -0.04f : 0.04f) * ramp(0, 0.25f, deep);
            mad3(to, c, d, wide);
            to[2] = c[2] - 0.05f - 0.30f * deep;
        }
    }
    for (int lower = 0; lower < 2; lower++)
        for (int i = 0; i < ARCH * ARCH_ROWS; i++) {
            float *to = x + 3 * ((lower ? LOWER : TEETH) + i);

            plain_tooth(o, rest_lip, lower, i % ARCH, i / ARCH);
            mad3(to, o, jaw, lower ? 1 : 0);
        }
}

void scan_plain_pose(float *x, const struct scan_plain *p, const float *rest,
                     const float *verts)
{
    float lip[3], a[3], b[3], jaw[3];

    plain_scatter(x, p, verts);
    plain_lip(lip, rest, p);
    plain_middle(a, rest, p, p->head->chin, p->head->nchin);
    plain_middle(b, x, p, p->head->chin, p->head->nchin);
    sub3(jaw, b, a);
    plain_hang_mouth(x, p, lip, jaw);
}

/* ---- the mesh ----------------------------------------------------------- */

/* One more face, of scans' vertices. */
static void plain_face(struct scan_face *f, enum face_part part, int32_t a,
                       int32_t b, int32_t c)
{
    int32_t v[3] = {a, b, c};

    memcpy(f->raw + 3 * f->nf, v, sizeof v);
    f->part[f->nf++] = (uint8_t)part;
}

/* A strip between two rows of n vertices, closed or not. */
static void plain_strip(struct scan_face *f, enum face_part part, int32_t a,
                        int32_t b, int n, bool closed)
{
    for (int i = 0; i < (closed ? n : n - 1); i++) {
        int32_t j = (i + 1) % n;

        plain_face(f, part, a + i, b + i, a + j);
        plain_face(f, part, a + j, b + i, b + j);
    }
}

static void plain_make_faces(struct scan_face *f, const struct scan_plain *p)
{
    const struct head *h = p->head;
    const int32_t n = (int32_t)h->nlip_inner;

    for (size_t i = 0; i < h->F; i++) {
        const int32_t *v = h->f + 3 * i;
        bool ball = h->region[v[0]] == REGION_EYEBALL;

        plain_face(f, !ball ? PART_SKIN : h->v_template[3 * v[0]] > 0
                                            ? PART_SCLERA_LEFT
                                            : PART_SCLERA_RIGHT,
                   p->at[v[0]], p->at[v[1]], p->at[v[2]]);
    }
    for (int i = 0; i < n; i++) {
        int32_t a = p->at[h->lip_inner[i]];
        int32_t b = p->at[h->lip_inner[(i + 1) % n]];

        plain_face(f, PART_GUM, a, BOWL + i, b);
        plain_face(f, PART_GUM, b, BOWL + i, BOWL + (i + 1) % n);
    }
    for (int k = 1; k < BOWL_RINGS; k++)
        plain_strip(f, PART_GUM, BOWL + (k - 1) * n, BOWL + k * n, n, true);
    plain_strip(f, PART_TEETH, TEETH, TEETH + ARCH, ARCH, false);
    plain_strip(f, PART_TEETH, LOWER, LOWER + ARCH, ARCH, false);
}

/* A corner for every vertex, of a face or not. */
static void plain_make_corners(struct scan_face *f)
{
    f->nc = FACE_VERTICES;
    for (int32_t v = 0; v < FACE_VERTICES; v++) {
        f->source[v] = v;
        plain_uv(f->uv + 2 * v, f->neutral + 3 * v, f->eye[0][1]);
    }
    memcpy(f->faces, f->raw, 3 * f->nf * sizeof *f->faces);
}

/* Identities as the head has them; d (V,3) is scratch. */
static void plain_make_shapes(struct scan_face *f, const struct scan_plain *p,
                              float *d)
{
    const struct head *h = p->head;
    const size_t one = 3 * FACE_VERTICES;
    static const float still[3];
    float lip[3];

    plain_scatter(f->neutral, p, h->v_template);
    plain_lip(lip, f->neutral, p);
    plain_hang_mouth(f->neutral, p, lip, still);
    for (size_t k = 0; k < SCAN_IDENTITIES; k++) {
        float *to = f->identity + k * one;

        head_direction(d, h, h->shape_dirs, h->nshape, k);
        plain_scatter(to, p, d);
        plain_lip(lip, to, p);
        for (size_t i = BOWL; i < LOWER + ARCH * ARCH_ROWS; i++)
            if (i < BOWL + BOWL_RINGS * h->nlip_inner || i >= TEETH)
                copy3(to + 3 * i, lip);
    }
}

/* Vertices of the 68 landmarks: the nearest corner of each one's face. */
static void plain_find_landmarks(struct scan_face *f,
                                 const struct scan_plain *p)
{
    const struct head *h = p->head;

    for (int k = 0; k < FACE_LANDMARKS; k++) {
        const float *w = h->landmark_bary + 3 * k;
        int best = w[1] > w[0] ? 1 : 0;

        best = w[2] > w[best] ? 2 : best;
        f->landmark[k] = p->at[h->f[3 * h->landmark_faces[k] + best]];
    }
}

static int plain_make_face(struct scan_face *f, const struct scan_plain *p,
                           struct arena *memory, struct error *err)
{
    const size_t nf = p->head->F + 2 * (BOWL_RINGS * p->head->nlip_inner)
                      + 4 * (ARCH - 1);
    const size_t one = 3 * FACE_VERTICES;
    float *scratch = arena_take(memory, 3 * p->head->V, sizeof *scratch);

    scan_face_find_eyes(f);
    f->raw = arena_take(memory, 3 * nf, sizeof *f->raw);
    f->faces = arena_take(memory, 3 * nf, sizeof *f->faces);
    f->part = arena_take(memory, nf, 1);
    f->source = arena_take(memory, FACE_VERTICES, sizeof *f->source);
    f->uv = arena_take(memory, 2 * FACE_VERTICES, sizeof *f->uv);
    f->neutral = arena_take(memory, one, sizeof *f->neutral);
    f->identity = arena_take(memory, SCAN_IDENTITIES * one,
                             sizeof *f->identity);
    if (arena_check(memory, "a face", err))
        return -1;
    plain_make_shapes(f, p, scratch);
    plain_make_faces(f, p);
    plain_make_corners(f);
    plain_find_landmarks(f, p);
    return 0;
}

/* ---- all of it ---------------------------------------------------------- */

/* What vertices are and how hairy: the head's own. */
static int plain_make_labels(struct scan_assets *a, struct error *err)
{
    const struct scan_plain *p = a->plain;

    a->label = arena_take(&a->memory, FACE_VERTICES, 1);
    a->hairy = arena_take(&a->memory, FACE_VERTICES, sizeof *a->hairy);
    if (arena_check(&a->memory, "a figure", err))
        return -1;
    memset(a->label, LABEL_SKIN, FACE_VERTICES);
    for (size_t v = 0; v < p->head->V; v++) {
        a->label[p->at[v]] = scan_label_of(p->head->region[v]);
        a->hairy[p->at[v]] = p->head->hair ? p->head->hair[v] : 0;
    }
    return 0;
}

/* The figure needs the built-in head's arrays. */
static int plain_check_head(const struct head *h, struct error *err)
{
    if (!h->has_landmarks || h->nshape < SCAN_IDENTITIES || !h->region
        || !head_has_arkit(h))
        return error_set(err, EX_DATAERR, "head without %s (expected the "
                         "built-in head, or one of spid-head --from)",
                         !h->has_landmarks ? "landmarks" : !h->region
                             ? "regions" : "the scans' shapes");
    return 0;
}

struct scan_assets *scan_plain_open(const char *traits, const struct head *h,
                                    struct error *err)
{
    struct scan_assets *a = calloc(1, sizeof *a);

    if (!a)
        return error_null(err, EX_OSERR, "out of memory for a figure");
    struct arena *memory = &a->memory;

    noise_lattice_fill();
    a->plain = arena_take(memory, 1, sizeof *a->plain);
    if (arena_check(memory, "a figure", err)
        || traits_load(&a->traits, traits, err) || plain_check_head(h, err)
        || plain_lay_out(a->plain, h, memory, err)
        || plain_make_face(&a->face, a->plain, memory, err)
        || near_init(&a->body.near, a->face.neutral, FACE_NECK_END,
                     memory, err)
        || plain_make_labels(a, err) || plain_make_looks(a, err)
        || sky_measure(a, err)) {
        scan_close(a);
        return NULL;
    }
    return a;
}
