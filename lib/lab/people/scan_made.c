/* Things modelled here: glasses, earrings, beards and cropped hair as layers
 * over the skin, and what stands between the person and the camera. */
#include <math.h>
#include <string.h>

#include "lib/lab/people/scan_figure.h"
#include "lib/base/vec3.h"

/* ---- tubes -------------------------------------------------------------- */

#define TUBE_SIDES 6

/* A tube through n points, closed on itself or not, into part p from corner c
 * and face i on. */
static void made_tube(struct figure *f, size_t c, size_t i,
                      float (*at)[3], int n, bool closed, float r)
{
    for (int k = 0; k < n; k++) {
        const float *a = at[k > 0 ? k - 1 : closed ? n - 1 : 0];
        const float *b = at[k < n - 1 ? k + 1 : closed ? 0 : n - 1];
        float t[3], u[3], v[3], up[3] = {0.1f, 0.2f, 1};
        sub3(t, b, a);
        unit3(t);
        cross3(u, up, t);
        unit3(u);
        cross3(v, t, u);
        for (int s = 0; s < TUBE_SIDES; s++) {
            float w = 2 * PI_F * (float)s / TUBE_SIDES;
            float *o = f->place + 3 * (c + (size_t)(k * TUBE_SIDES + s));
            mad3(o, at[k], u, r * cosf(w));
            mad3(o, o, v, r * sinf(w));
        }
    }
    for (int k = 0; k + !closed < n; k++)
        for (int s = 0; s < TUBE_SIDES; s++) {
            int32_t a = (int32_t)c + k * TUBE_SIDES;
            int32_t b = (int32_t)c + (k + 1) % n * TUBE_SIDES;
            int32_t q = (s + 1) % TUBE_SIDES;
            int32_t quad[6] = {a + s, b + s, a + q, a + q, b + s, b + q};
            memcpy(f->faces + 3 * i, quad, sizeof quad);
            i += 2;
        }
}

static size_t made_tube_corners(int n)
{
    return (size_t)n * TUBE_SIDES;
}

static size_t made_tube_faces(int n, bool closed)
{
    return (size_t)(closed ? n : n - 1) * TUBE_SIDES * 2;
}

/* Every corner of a part sees the sky as the vertex of the face nearest to
 * it does. */
static void made_bind_part(struct figure *f, const struct figure_part *p)
{
    for (size_t c = p->c0; c < p->c1; c++)
        near_bind(f->bind + 4 * c, f->weight + 4 * c,
                  &f->assets->body.near, f->place + 3 * c);
}

/* ---- glasses ------------------------------------------------------------ */

#define RIM 28

struct spectacles {
    float centre[2][3], half[2], r, square;
};

/* Where rims lie on this face: before the brows, on the nose. */
static void made_measure_glasses(struct spectacles *g, const struct figure *f)
{
    const int32_t *lmk = f->assets->face.landmark;
    uint64_t key = f->look.key >> 8;
    float front = 0;

    /* clear of the brows, resting on the nose */
    for (int k = 18; k < 26; k++)
        front = maxf(front, f->rest[3 * lmk[k] + 2]);
    float wide = fabsf(f->eye[0][0] - f->eye[1][0]);
    for (int e = 0; e < 2; e++) {
        g->centre[e][0] = f->eye[e][0] * 1.03f;
        g->centre[e][1] = f->eye[e][1] - 0.012f
                          - 0.02f * (float)(key & 15) / 15;
        g->centre[e][2] = front + 0.012f;
    }
    g->half[0] = wide * (0.37f + 0.06f * (float)(key >> 4 & 15) / 15);
    g->half[1] = g->half[0] * (0.62f + 0.3f * (float)(key >> 8 & 15) / 15);
    g->square = f->look.glasses == GLASSES_ROUND  ? 2
                : f->look.glasses == GLASSES_THIN ? 2.6f
                                                  : 4;
    g->r = f->look.glasses == GLASSES_THIN ? 0.0035f : 0.007f
                                            + 0.006f
                                              * (float)(key >> 12 & 15) / 15;
}

static void made_rim_point(float o[3], const struct spectacles *g, int e, int k)
{
    float t = 2 * PI_F * (float)k / RIM, c = cosf(t), s = sinf(t);
    float m = 2 / g->square;

    o[0] = g->centre[e][0] + g->half[0] * copysignf(powf(fabsf(c), m), c);
    o[1] = g->centre[e][1] + g->half[1] * copysignf(powf(fabsf(s), m), s);
    /* wrapped round the face a little */
    o[2] = g->centre[e][2] - 0.35f * o[0] * o[0];
}

/* The bridge's line, from one rim to the other and a little arched. */
static void made_bridge(float at[4][3], const struct spectacles *g)
{
    for (int k = 0; k < 4; k++) {
        float t = (float)k / 3, inner = g->centre[0][0] - g->half[0];
        at[k][0] = inner * (1 - 2 * t);
        at[k][1] = g->centre[0][1] + 0.3f * g->half[1]
                   + 0.012f * sinf(PI_F * t);
        at[k][2] = g->centre[0][2] + 0.004f;
    }
}

/* The line of temple e, from the rim outwards and back to the ear. */
static void made_temple(float at[5][3], const struct spectacles *g,
                        const struct figure *f, int e)
{
    const int32_t *lmk = f->assets->face.landmark;
    float side = e ? -1 : 1, *ear = f->rest + 3 * lmk[e ? 0 : 16];
    float outer = g->centre[e][0] + side * g->half[0];
    float wide = side * maxf(fabsf(ear[0]) + 0.02f, fabsf(outer));

    for (int k = 0; k < 5; k++) {
        float t = (float)k / 4;
        at[k][0] = lerpf(outer, wide, ramp(0, 0.4f, t));
        at[k][1] = g->centre[e][1] + 0.3f * g->half[1] - 0.02f * t
                   - 0.08f * ramp(0.8f, 1, t);
        at[k][2] = lerpf(g->centre[e][2] - 0.35f * outer * outer,
                         ear[2] - 0.25f, t);
    }
}

/* Rims, bridge and temples as tubes about the eyes. */
static int made_add_frame(struct figure *f, struct error *err)
{
    struct spectacles g;
    float at[RIM][3];
    size_t nc = 2 * made_tube_corners(RIM) + made_tube_corners(4) +
                2 * made_tube_corners(5);
    size_t nf = 2 * made_tube_faces(RIM, true) + made_tube_faces(4, false)
                + 2 * made_tube_faces(5, false);
    struct figure_part *p = figure_grow(f, nc, nf, STUFF_FRAME, RIDE_HEAD,
                                        LABEL_GLASSES, err);

    if (!p)
        return -1;
    made_measure_glasses(&g, f);
    copy3(p->tint, f->look.glass_color);
    size_t c = p->c0, i = p->f0;
    for (int e = 0; e < 2; e++) {
        for (int k = 0; k < RIM; k++)
            made_rim_point(at[k], &g, e, k);
        made_tube(f, c, i, at, RIM, true, g.r);
        c += made_tube_corners(RIM);
        i += made_tube_faces(RIM, true);
    }
    made_bridge(at, &g);
    made_tube(f, c, i, at, 4, false, g.r);
    c += made_tube_corners(4);
    i += made_tube_faces(4, false);
    for (int e = 0; e < 2; e++) {
        made_temple(at, &g, f, e);
        made_tube(f, c, i, at, 5, false, g.r * 0.9f);
        c += made_tube_corners(5);
        i += made_tube_faces(5, false);
    }
    made_bind_part(f, p);
    return 0;
}

/* A fan of faces in each rim. */
static int made_add_lenses(struct figure *f, struct error *err)
{
    struct spectacles g;
    struct figure_part *p = figure_grow(f, 2 * (RIM + 1), 2 * RIM,
                                        STUFF_GLASS, RIDE_HEAD,
                                        LABEL_GLASSES, err);

    if (!p)
        return -1;
    made_measure_glasses(&g, f);
    for (int e = 0; e < 2; e++) {
        size_t c = p->c0 + (size_t)(e * (RIM + 1));
        float *mid = f->place + 3 * (c + RIM);
        copy3(mid, g.centre[e]);
        mid[2] += 0.012f;
        for (int k = 0; k < RIM; k++) {
            int32_t tri[3] = {(int32_t)c + k, (int32_t)c + (k + 1) % RIM,
                              (int32_t)c + RIM};
            made_rim_point(f->place + 3 * (c + (size_t)k), &g, e, k);
            memcpy(f->faces + 3 * (p->f0 + (size_t)(e * RIM + k)), tri,
                   sizeof tri);
        }
    }
    made_bind_part(f, p);
    return 0;
}

/* ---- brows and layers of short hair ------------------------------------- */

enum fur { FUR_BROW, FUR_BEARD, FUR_HAIR };

#define LAYERS 4
#define FUR_MIN 0.02f           /* density of a face that has some */

/* How densely short hair grows on a corner: brows in their place, beard
 * below, cropped hair above. */
static float made_fur_density(const struct figure *f, size_t c, enum fur kind)
{
    const struct scan_assets *a = f->assets;
    const struct scan_person *l = &f->look;

    if (kind == FUR_HAIR)
        return a->hairy[f->bind[4 * c]] * ramp(0, 0.12f, l->buzz);
    int x = (int)(f->uv[2 * c] * SKIN_SIZE);
    int y = (int)((1 - f->uv[2 * c + 1]) * SKIN_SIZE);
    if (kind == FUR_BROW) {
        x = x >= SKIN_SIZE / 2 ? SKIN_SIZE - 1 - x : x;
        return x >= BROW_X && y >= BROW_Y && y < BROW_Y + BROW_H;
    }
    if (x < 0 || y < 0 || x >= SKIN_SIZE || y >= SKIN_SIZE
        || f->bind[4 * c] >= FACE_SKIN_END)
        return 0;
    float m = a->skin.beard[y * SKIN_SIZE + x] / 255.0f;
    /* a moustache is what grows above the mouth */
    float above = ramp(0.590f, 0.565f, (float)y / SKIN_SIZE)
                  * ramp(0.19f, 0.13f, fabsf((float)x / SKIN_SIZE - 0.5f));
    return m * lerpf(l->beard, l->moustache, above);
}

/* d = the density of fur at the corners of a face; whether it has some. */
static bool made_has_fur(float d[3], const struct figure *f,
                         const int32_t *face, enum fur kind)
{
    for (int k = 0; k < 3; k++)
        d[k] = made_fur_density(f, (size_t)face[k], kind);
    /* brows end where their picture does */
    return kind == FUR_BROW ? d[0] + d[1] + d[2] == 3
                            : maxf(maxf(d[0], d[1]), d[2]) > FUR_MIN;
}

/* Corner c of layer `layer` of so many: a copy of corner `from`, lifted off
 * the skin. */
static void made_lift_fur(struct figure *f, size_t c, size_t from, int layer,
                          int layers, float density, float length)
{
    const int32_t vertex = f->bind[4 * from];

    mad3(f->place + 3 * c, f->rest + 3 * vertex, f->normal + 3 * vertex,
         0.002f + length * (float)(layer + 1) / (float)layers
                  * clampf(2 * density, 0.1f, 1));
    memcpy(f->uv + 2 * c, f->uv + 2 * from, 2 * sizeof *f->uv);
    f->bind[4 * c] = vertex;
    f->weight[4 * c] = 1;
    f->extra[c] = (float)layer + 0.99f * clampf(density, 0, 1);
}

/* The faces of the scans' skin, but for brows of their scalp, too, whose
 * corners grow hair, lifted in layers.  u, v: as below, u of hair + 2; extra:
 * the layer plus its density. */
static int made_add_fur(struct figure *f, enum fur kind, float length,
                        const float color[3], struct error *err)
{
    static const uint8_t label[] = {LABEL_BROW, LABEL_BEARD, LABEL_HAIR};
    const bool brow = kind == FUR_BROW;
    const int layers = brow ? 1 : LAYERS;
    const size_t last = f->parts[!brow].f1;     /* skin, then scalp */
    size_t n = 0;
    float d[3];

    for (size_t i = 0; i < last; i++)
        n += made_has_fur(d, f, f->faces + 3 * i, kind) ? (size_t)layers : 0;
    struct figure_part *p = figure_grow(f, 3 * n, n,
                                        brow ? STUFF_BROW : STUFF_FUR,
                                        RIDE_SKIN, label[kind], err);
    if (!p)
        return -1;
    copy3(p->tint, color);
    size_t c = p->c0;
    for (size_t i = 0; i < last; i++) {
        const int32_t *v = f->faces + 3 * i;
        if (!made_has_fur(d, f, v, kind))
            continue;
        for (int l = 0; l < layers; l++)
            for (int k = 0; k < 3; k++, c++) {
                made_lift_fur(f, c, (size_t)v[k], l, layers, d[k], length);
                f->uv[2 * c] += kind == FUR_HAIR ? 2 : 0;
                f->faces[3 * p->f0 + c - p->c0] = (int32_t)c;
            }
    }
    return 0;
}

/* ---- rings -------------------------------------------------------------- */

#define RING 10

/* A ring through each lobe, the ear's lowest vertex. */
static int made_add_earrings(struct figure *f, struct error *err)
{
    struct figure_part *p = figure_grow(f, 2 * made_tube_corners(RING),
                                        2 * made_tube_faces(RING, true),
                                        STUFF_METAL, RIDE_HEAD, LABEL_EAR,
                                        err);
    const struct scan_face *s = &f->assets->face;
    uint64_t key = f->look.key >> 20;
    float r = 0.02f + 0.05f * (float)(key & 15) / 15;

    if (!p)
        return -1;
    copy3(p->tint, f->assets->traits.earring_linear[!(key & 16)]);
    for (int e = 0; e < 2; e++) {
        /* the lobe: the lowest vertex that is out at the side */
        float side = e ? -1 : 1, low = 9, at[RING][3], lobe[3] = {0, 0, 0};
        for (size_t i = 0; i < FACE_SKIN_END; i++)
            if (f->assets->label[i] == LABEL_EAR
                && side * s->neutral[3 * i] > 0.36f
                && f->rest[3 * i + 1] < low) {
                low = f->rest[3 * i + 1];
                copy3(lobe, f->rest + 3 * i);
            }
        for (int k = 0; k < RING; k++) {
            float t = 2 * PI_F * (float)k / RING;
            at[k][0] = lobe[0] + side * 0.004f;
            at[k][1] = lobe[1] + 0.012f - r + r * cosf(t);
            at[k][2] = lobe[2] + r * sinf(t);
        }
        made_tube(f, p->c0 + (size_t)e * made_tube_corners(RING),
                  p->f0 + (size_t)e * made_tube_faces(RING, true), at, RING,
                  true, 0.006f);
    }
    made_bind_part(f, p);
    return 0;
}

int figure_add_solids(struct figure *f, struct error *err)
{
    const struct scan_person *l = &f->look;

    if (l->glasses && made_add_frame(f, err))
        return -1;
    return l->earring ? made_add_earrings(f, err) : 0;
}

int figure_add_veils(struct figure *f, struct error *err)
{
    const struct scan_person *l = &f->look;

    if (made_add_fur(f, FUR_BROW, 0.002f, l->brow_color, err))
        return -1;
    if ((l->beard > 0 || l->moustache > 0)
        && made_add_fur(f, FUR_BEARD, 0.006f + 0.035f * l->beard_length
                                      * l->beard_length, l->brow_color,
                        err))
        return -1;
    if (l->hair < 0 && l->buzz > 0.12f
        && made_add_fur(f, FUR_HAIR, 0.004f + 0.05f * l->buzz * l->buzz,
                        l->hair_color, err))
        return -1;
    return l->glasses ? made_add_lenses(f, err) : 0;
}
