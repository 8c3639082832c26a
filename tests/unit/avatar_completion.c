/* What the photograph does not show: colours of the head's hidden half from the
 * mirror image, without a seam, hair's from hair and a collar's from cloth
 * (completion.h, material.h), how far hair stands off (relief.h); the slope of what
 * is seen (tilt.h). */
#include <math.h>
#include <string.h>

#include "lib/avatar/completion.h"
#include "lib/avatar/dynamic_branch.h"
#include "lib/avatar/material.h"
#include "lib/avatar/relief.h"
#include "lib/avatar/tilt.h"
#include "lib/base/camera.h"
#include "lib/base/gaussians.h"
#include "tests/check.h"

/* ---- colours -------------------------------------------------------------- */

/* A strip of 2 by WIDE vertices, its left half seen. */
enum { WIDE = 24, V = 2 * WIDE, F = 2 * (WIDE - 1), MAX = 6 * V };

static int32_t faces[3 * F];
static float rgb[3 * MAX], scratch[COMPLETION_SCRATCH(MAX)];
static float trust[MATERIALS * MAX], chance[MATERIALS * MAX];
static size_t mirror[MAX];

static void completion_strip(struct densify *d)
{
    size_t across[V];
    struct error err = {0};

    for (int32_t x = 0; x + 1 < WIDE; x++) {
        const int32_t a = 2 * x;
        const int32_t f[6] = {a, a + 1, a + 2, a + 1, a + 3, a + 2};

        memcpy(faces + 6 * x, f, sizeof f);
    }
    for (size_t i = 0; i < V; i++)
        across[i] = 2 * (WIDE - 1 - i / 2) + i % 2;
    REQUIRE(densify_init(d, faces, F, V, &err) == 0, "%s", err.text);
    completion_mirror(mirror, across, d);
}

/* Where point i lies along the strip, and its colour in a light. */
static double completion_place(const struct densify *d, size_t i)
{
    size_t end[2];

    densify_ends(end, d, i);
    return 0.5 * (double)(end[0] / 2 + end[1] / 2);
}

static float completion_colour(double x, double light)
{
    const double in = fmin(x, WIDE - 1 - x);    /* the same from both ends */

    return (float)(light + 0.1 * sin(1.3 * in));
}

static void completion_mirrors(void)
{
    struct densify d;
    bool pairs = true;
    double kept = 0, step = 0, like = 0;

    completion_strip(&d);
    const size_t N = d.V + d.E;
    for (size_t i = 0; i < N; i++) {
        const double x = completion_place(&d, i);

        chance[i] = 1;                  /* skin all over */
        /* diagonals have none across */
        pairs = pairs && (mirror[i] == i || mirror[mirror[i]] == i);
        trust[i] = x <= WIDE / 2 ? 1 : 0;
        for (size_t c = 0; c < 3; c++)
            rgb[3 * i + c] = trust[i] > 0 ? completion_colour(x, 0.5) : 0.9f;
    }
    check_that("mirror images are pairs", pairs);
    completion_solve(rgb, trust, chance, mirror, &d, scratch);
    for (size_t i = 0; i < V; i++) {
        const double x = completion_place(&d, i);
        const double off = fabs(rgb[3 * i] - completion_colour(x, 0.5));

        if (trust[i] > 0)
            kept = fmax(kept, off);
        else
            like = fmax(like, off);
    }
    for (size_t i = 2; i < V; i++)
        step = fmax(step, fabs(rgb[3 * i] - rgb[3 * i - 6]));
    check("seen: the photograph's", kept, 0.01);
    check("not seen: the mirror image's", like, 0.05);
    check("no seam", step, 0.16);
    /* nothing known but one end */
    for (size_t i = 0; i < N; i++) {
        trust[i] = i < 2 ? 1 : 0;
        for (size_t c = 0; c < 3; c++)
            rgb[3 * i + c] = i < 2 ? 0.25f : 0.9f;
    }
    completion_solve(rgb, trust, chance, mirror, &d, scratch);
    check("from one end to the other", fabs(rgb[3 * (V - 1)] - 0.25), 1e-3);
    densify_release(&d);
}

/* A strip of three materials, of which two are seen at one place each, side by side:
 * each goes on by itself to its end, though the other is as near, and the third is
 * about as both are. */
static void completion_layers(void)
{
    static const float colour[MATERIALS] = {0.8f, 0.2f};
    struct densify d;
    double off[MATERIALS] = {0};

    completion_strip(&d);
    const size_t N = d.V + d.E;
    memset(trust, 0, sizeof trust);
    memset(chance, 0, sizeof chance);
    for (size_t i = 0; i < N; i++) {
        const double x = completion_place(&d, i);
        const size_t m = x < WIDE / 3 ? MATERIAL_SKIN
                       : x < 2 * WIDE / 3 ? MATERIAL_HAIR : MATERIAL_CLOTH;

        mirror[i] = i;
        chance[m * N + i] = 1;
        trust[m * N + i] = x == WIDE / 3 - 1 || x == WIDE / 3 ? 1 : 0;
        for (size_t c = 0; c < 3; c++)
            rgb[3 * i + c] = colour[m];
    }
    completion_solve(rgb, trust, chance, mirror, &d, scratch);
    for (size_t i = 0; i < N; i++)
        for (size_t m = 0; m < MATERIALS; m++)
            if (chance[m * N + i] > 0)
                off[m] = fmax(off[m], fabs(rgb[3 * i] - (m < MATERIAL_CLOTH
                                                         ? colour[m] : 0.5)));
    check("hair goes on from hair", off[MATERIAL_HAIR], 0.01);
    check("and skin from skin", off[MATERIAL_SKIN], 0.01);
    check("what is not seen is as all is", off[MATERIAL_CLOTH], 0.01);
    densify_release(&d);
}

/* ---- who wears hair and cloth where ----------------------------------------- */

/* 100 vertices of a brow, 100 of an ear and 100 behind it, which is not seen: half
 * of all people cover their ears, and then what is behind them; the other half wear
 * cloth there. */
static void material_ears(void)
{
    enum { PART = 100, ALL = 3 * PART };
    float hair[ALL * HEAD_STYLES] = {0}, cloth[ALL * HEAD_STYLES] = {0};
    float shares[HEAD_STYLES] = {0.5f, 0.5f}, one[HEAD_STYLES] = {1};
    float seen[ALL] = {0}, odds[MATERIALS * ALL], out[MATERIALS * ALL];
    const float *behind = out + ALL - 1;
    const struct head_avatar a = {.V = ALL, .hair = hair, .hair_share = shares,
                                  .cloth = cloth, .cloth_share = one};
    const struct densify d = {.V = ALL};
    float likelihood[HEAD_STYLES] = {0};
    struct material_share share = material_all(&a);

    for (size_t v = 0; v < ALL; v++) {
        hair[HEAD_STYLES * v + 1] = v < PART ? 0 : 0.9f;
        cloth[HEAD_STYLES * v] = v < 2 * PART ? 0 : 1;
        seen[v] = v < 2 * PART ? 1 : 0;
        odds[MATERIALS * v] = 1;
        odds[MATERIALS * v + 1] = odds[MATERIALS * v + 2] = 0;
    }
    material_expect(out, &share, &a, &d);
    expect("before: what all people have", behind[ALL], 0.45, 1e-6);
    share = material_find(likelihood, seen, odds, &a);
    material_expect(out, &share, &a, &d);
    check("a bare ear: no hair behind it", behind[ALL], 0.05);
    check_range("but cloth", behind[2 * ALL], 0.95, 1);
    for (size_t v = PART; v < 2 * PART; v++)
        odds[MATERIALS * v + MATERIAL_HAIR] = 1e4f;
    share = material_find(likelihood, seen, odds, &a);
    material_expect(out, &share, &a, &d);
    check_range("a covered one: hair behind it", behind[ALL], 0.8, 0.9);
    expect("shares are of all", share.hair[0] + share.hair[1], 1, 1e-5);
    expect("chances, too", behind[0] + behind[ALL] + behind[2 * ALL], 1, 1e-5);
    memset(seen, 0, sizeof seen);
    share = material_find(likelihood, seen, odds, &a);
    expect("nothing seen: as before", share.hair[1], 0.5, 1e-6);
    likelihood[1] = logf(3);
    share = material_find(likelihood, seen, odds, &a);
    expect("three times as likely beside the mesh", share.hair[1], 0.75, 1e-6);
    for (size_t v = 0; v < 2 * PART; v++)
        seen[v] = 1;
    for (size_t v = 0; v < ALL; v++)
        odds[MATERIALS * v + MATERIAL_HAIR] = 0;
    share = material_find(likelihood, seen, odds, &a);
    check("a bare ear says more", share.hair[1], 0.6);
}

/* A wall of 9 x 9 vertices, a head unit wide, that faces away from the camera behind
 * a mesh of depth 10 in the middle of the picture; the person is in its upper half.
 * Hair of the second style stands off half a unit, that of the first not at all. */
static void relief_wall(void)
{
    enum { SIDE = 9, ALL = SIDE * SIDE, N = 16 };
    static int32_t corners[6 * (SIDE - 1) * (SIDE - 1)];
    float verts[3 * ALL], normals[3 * ALL] = {0}, depth[N * N];
    float front[ALL] = {0}, relief[ALL], offset[3 * ALL], tmp[3 * ALL];
    float heights[ALL * HEAD_STYLES] = {0};
    uint8_t colours[3 * N * N] = {0}, matte[N * N] = {0};
    const struct head h = {.V = ALL};
    const struct head_avatar a = {.V = ALL, .relief = heights};
    const struct source_mesh mesh = {
        .head = &h, .weights = &a, .n = N, .verts = verts, .normals = normals,
        .depth = depth, .cam = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 11}};
    const struct material_share share = {.hair = {0.75f, 0.25f}};
    struct source_picture p = {0};
    struct densify d = {0};
    struct error err = {0};
    double low = 0, step = 0;

    for (size_t v = 0; v < ALL; v++) {
        verts[3 * v] = (float)(v % SIDE) / (SIDE - 1) - 0.5f;
        verts[3 * v + 1] = (float)(v / SIDE) / (SIDE - 1) - 0.5f;
        verts[3 * v + 2] = 0;
        normals[3 * v + 2] = 1;
        heights[HEAD_STYLES * v + 1] = 0.5f;
    }
    for (size_t i = 0; i < 2 * (SIDE - 1) * (SIDE - 1); i++) {
        const int32_t at = (int32_t)(i / 2 / (SIDE - 1) * SIDE + i / 2 % (SIDE - 1));
        const int32_t corner[2][3] = {{0, 1, SIDE}, {1, SIDE + 1, SIDE}};

        for (size_t k = 0; k < 3; k++)
            corners[3 * i + k] = at + corner[i % 2][k];
    }
    for (size_t i = 0; i < N * N; i++) {
        matte[i] = i < N * N / 2 ? 255 : 0;
        depth[i] = 10;
    }
    source_picture_init(&p, N, &err);
    source_picture_set(&p, colours, matte, NULL, false);
    densify_init(&d, corners, sizeof corners / sizeof *corners / 3, ALL, &err);

    relief_expect(relief, &share, &a);
    expect("what is expected of the styles", relief[ALL / 2], 0.125, 1e-6);
    front[0] = 0.5f;
    relief_limit(relief, front, &p, &mesh);
    expect("half behind what shows: half of it", relief[0], 0.0625, 1e-6);
    expect("behind the person: all of it", relief[SIDE], 0.125, 1e-6);
    for (size_t v = ALL - 2 * SIDE; v < ALL; v++)
        low = fmax(low, relief[v]);
    expect("beside the person: none", low, 0, 0);
    relief_drape(offset, tmp, relief, &mesh, &d);
    for (size_t v = 0; v < ALL; v++) {
        low = fmax(low, relief[v] > 0 ? 0 : fabs(offset[3 * v + 2]));
        if (v >= SIDE)
            step = fmax(step, fabs(offset[3 * v + 2] -
                                   offset[3 * (v - SIDE) + 2]));
    }
    expect("what has no hair stays", low, 0, 0);
    check("no step is left where hair ends", step, 0.1);
    check_range("and hair that stands off", offset[3 * SIDE + 2], 0.06, 0.125);
    densify_release(&d);
    source_picture_release(&p);
}

/* The same wall's outline: hair beside it speaks for the style that has some. */
static void relief_outline(void)
{
    enum { N = 16 };
    float verts[3] = {0}, normals[3] = {1, 0, 0}, depth[N * N];
    float heights[HEAD_STYLES] = {0, 0.5f}, likelihood[HEAD_STYLES];
    const struct material_colors colors[MATERIALS] = {{0}};     /* nothing known */
    uint8_t colours[3 * N * N] = {0}, matte[N * N] = {0};
    const struct head h = {.V = 1};
    const struct head_avatar a = {.V = 1, .relief = heights};
    const struct source_mesh mesh = {
        .head = &h, .weights = &a, .n = N, .verts = verts, .normals = normals,
        .depth = depth, .cam = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 11}};
    struct source_picture p = {0};
    struct error err = {0};

    for (size_t i = 0; i < N * N; i++)
        depth[i] = INFINITY;
    source_picture_init(&p, N, &err);
    source_picture_set(&p, colours, matte, NULL, false);
    relief_likelihood(likelihood, colors, &p, &mesh);
    expect("nobody there: no hair", 40 * (likelihood[0] - likelihood[1]),
           log(0.98 / 0.02), 1e-4);
    memset(matte, 255, sizeof matte);
    source_picture_set(&p, colours, matte, NULL, false);
    relief_likelihood(likelihood, colors, &p, &mesh);
    expect("somebody there: hair or something else",
           40 * (likelihood[1] - likelihood[0]), log(0.99 / 0.51), 1e-4);
    for (size_t i = 0; i < N * N; i++)
        depth[i] = 10;
    relief_likelihood(likelihood, colors, &p, &mesh);
    expect("before the mesh nothing is said", likelihood[1] - likelihood[0], 0, 0);
    source_picture_release(&p);
}

/* x (n) of A x = b, (n,n) symmetric and positive: elimination; both are used up. */
static void relief_eliminate(double *x, double *A, double *b, size_t n)
{
    for (size_t i = 0; i < n; i++)
        for (size_t j = i + 1; j < n; j++) {
            const double by = A[n * j + i] / A[n * i + i];

            for (size_t k = i; k < n; k++)
                A[n * j + k] -= by * A[n * i + k];
            b[j] -= by * b[i];
        }
    for (size_t i = n; i-- > 0;) {
        x[i] = b[i];
        for (size_t k = i + 1; k < n; k++)
            x[i] -= A[n * i + k] * x[k];
        x[i] /= A[n * i + i];
    }
}

/* A row of vertices a tenth apart that ends on the mesh's outline, in a picture with
 * 0.115 of hair beside it, with nobody there, or with a person who ends before it. */
static void relief_row(void)
{
    enum { ALL = 12, N = 16, RIM = ALL - 1 };
    static const int32_t strip[] = {0, 1, 2, 2, 3, 4, 4, 5, 6, 6, 7, 8, 8, 9, 10,
                                    10, 11, 9};
    float verts[3 * ALL] = {0}, normals[3 * ALL] = {0}, depth[N * N];
    float rim[ALL] = {0}, hair[ALL], relief[ALL], room[4 * ALL];
    double A[ALL * ALL] = {0}, b[ALL] = {0}, x[ALL], off = 0;
    const struct material_colors colors[MATERIALS] = {{0}};     /* nothing known */
    uint8_t colours[3 * N * N] = {0}, matte[N * N];
    int32_t region[ALL] = {0};
    const struct head h = {.V = ALL, .region = region};
    const struct source_mesh mesh = {
        .head = &h, .n = N, .verts = verts, .normals = normals, .depth = depth,
        .cam = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 11}};
    struct source_picture p = {0};
    struct densify d = {0};
    struct error err = {0};

    densify_init(&d, strip, sizeof strip / sizeof *strip / 3, ALL, &err);
    for (size_t v = 0; v < ALL; v++) {
        verts[3 * v] = 0.1f * ((float)v - RIM);
        normals[3 * v] = 1;
        relief[v] = 0.01f;
        hair[v] = v == 0 ? 0 : 1;
    }
    rim[RIM] = 1;
    for (size_t i = 0; i < N * N; i++) {
        matte[i] = i % N <= N / 2 ? 255 : 0;
        depth[i] = i % N < N / 2 ? 10 : INFINITY;
    }
    source_picture_init(&p, N, &err);
    source_picture_set(&p, colours, matte, NULL, false);
    relief_meet(relief, rim, hair, colors, &p, &mesh, &d, room);

    for (size_t v = 0; v < ALL; v++)
        A[ALL * v + v] = d.degree[v] * (1.1 + (v == RIM ? 10 : 0));
    for (size_t e = 0; e < d.E; e++) {
        const size_t i = (size_t)d.edge[2 * e], j = (size_t)d.edge[2 * e + 1];

        A[ALL * i + j] = A[ALL * j + i] = -1;
    }
    b[RIM] = d.degree[RIM] * 10 * (0.1125 - 0.01);      /* in parts of 0.0125 */
    relief_eliminate(x, A, b, ALL);
    for (size_t v = 1; v < ALL; v++)
        off = fmax(off, fabs(relief[v] - 0.01 - x[v]));
    check_range("the outline meets hair", relief[RIM], 0.105, 0.115);
    check_range("less of it further in", relief[RIM - 4], 0.02, 0.08);
    check("as elimination solves it", off, 0.002);
    expect("where none grows, none rises", relief[0], 0.01, 1e-6);
    memset(matte, 0, sizeof matte);
    source_picture_set(&p, colours, matte, NULL, false);
    relief_meet(relief, rim, hair, colors, &p, &mesh, &d, room);
    check("nobody there: none", relief[RIM], 0.01);

    /* a neck that reaches 0.115 beyond the person */
    for (size_t v = 0; v < ALL; v++) {
        relief[v] = hair[v] = 0;
        region[v] = REGION_NECK;
    }
    for (size_t i = 0; i < N * N; i++)
        matte[i] = i % N < N / 2 - 1 ? 255 : 0;
    source_picture_set(&p, colours, matte, NULL, false);
    relief_meet(relief, rim, hair, colors, &p, &mesh, &d, room);
    check_range("a neck is within the person", relief[RIM], -0.13, -0.11);
    check_range("less of it further in", relief[RIM - 4], -0.08, -0.02);
    memset(relief, 0, sizeof relief);
    region[RIM] = REGION_SKIN;
    relief_meet(relief, rim, hair, colors, &p, &mesh, &d, room);
    check("not so a face, which has a shape", fabsf(relief[RIM]), 0);
    densify_release(&d);
    source_picture_release(&p);
}

/* ---- a person's own colours ------------------------------------------------- */

/* log of a normal density but for a constant, by double: its brightness and
 * shares of red and green about `mean`, with the least variances. */
static double material_log_of(const float color[3], const float mean[3])
{
    static const double least[3] = {0.25, 0.02, 0.02};
    double f[2][3], sum = 0;

    for (int i = 0; i < 2; i++) {
        const float *c = i ? mean : color;
        const double all = (double)c[0] + (double)c[1] + (double)c[2] + 0.03;

        f[i][0] = log(all);
        for (int k = 1; k < 3; k++)
            f[i][k] = ((double)c[k - 1] + 0.01) / all;
    }
    for (int k = 0; k < 3; k++)
        sum -= pow((f[0][k] - f[1][k]) / least[k], 2) / 2;
    return sum;
}

/* People of 100 vertices of which half have hair in 9 of 10; this one's is a little
 * lighter than skin.  What is said of a third colour is said by normal densities
 * about the two; of a person without a picture nothing. */
static void material_colours(void)
{
    enum { N = 100 };
    static const float skin[3] = {0.5f, 0.4f, 0.3f}, fair[3] = {0.6f, 0.5f, 0.33f};
    static const float between[3] = {0.56f, 0.46f, 0.32f};
    static float pixel[4 * N], held[N], chances[MATERIALS * N];
    static float hair[HEAD_STYLES * N], cloth[HEAD_STYLES * N];
    float hair_share[HEAD_STYLES] = {1}, cloth_share[HEAD_STYLES] = {1};
    const struct head_avatar a = {.V = N, .hair = hair, .cloth = cloth,
                                  .hair_share = hair_share,
                                  .cloth_share = cloth_share};
    const struct white_point_colors seen = {.pixel = pixel};
    const struct densify d = {.V = N};
    struct material_colors colors[MATERIALS];
    float odds[MATERIALS];

    for (size_t v = 0; v < N; v++) {
        memcpy(pixel + 4 * v, v < N / 2 ? fair : skin, sizeof fair);
        hair[HEAD_STYLES * v] = v < N / 2 ? 0.9f : 0.1f;
    }
    material_learn(colors, chances, &seen, held, &a, &d);
    material_odds(odds, between, colors);
    expect("nothing seen, nothing said", odds[MATERIAL_HAIR], 1, 0);
    for (size_t v = 0; v < N; v++)
        held[v] = 1;
    material_learn(colors, chances, &seen, held, &a, &d);
    material_odds(odds, between, colors);
    expect("a colour by this person's hair and skin", log(odds[MATERIAL_HAIR]),
           material_log_of(between, fair) - material_log_of(between, skin),
           0.05);
    material_odds(odds, fair, colors);
    expect("the hair's own, of which a tenth may be skin", log(odds[MATERIAL_HAIR]),
           -material_log_of(fair, skin), 0.1);
    expect("cloth, of which none is seen", odds[MATERIAL_CLOTH], 1, 0);
}

/* ---- the photograph's edge ---------------------------------------------- */

static void picture_edge(void)
{
    static uint8_t colours[3 * 16], certain[16] = {0, 0, 0, 0, 0, 9, 9};
    struct source_picture p = {0};
    struct error err = {0};
    const float in[2] = {-0.25f, -0.25f}, above[2] = {-0.25f, -0.75f};
    const float out[2] = {1.5f, 0};

    REQUIRE(source_picture_init(&p, 4, &err) == 0, "%s", err.text);
    source_picture_set(&p, colours, NULL, certain, false);
    check_that("the photograph shows what it has",
               source_picture_contains(&p, in));
    check_that("beyond its edge there are guesses",
               !source_picture_contains(&p, above) &&
               !source_picture_contains(&p, out));
    source_picture_set(&p, colours, NULL, NULL, false);
    check_that("all is shown where nothing else is said",
               source_picture_contains(&p, above) &&
               source_picture_contains(&p, out));
    source_picture_release(&p);
}

/* ---- the slope of what is seen -------------------------------------------- */

enum { CELLS = 64, SIZE = 128 };

/* A picture with the person left of `edge` (0..1), and a mesh whose depth
 * rises to the right. */
static void tilt_scene(struct source_picture *p, struct source_mesh *m,
                       float slope, float edge)
{
    static uint8_t colours[3 * SIZE * SIZE], matte[SIZE * SIZE];
    static float depth[CELLS * CELLS];
    struct error err = {0};

    for (size_t i = 0; i < SIZE * SIZE; i++)
        matte[i] = (float)(i % SIZE) < edge * SIZE ? 255 : 0;
    REQUIRE(source_picture_init(p, SIZE, &err) == 0, "%s", err.text);
    source_picture_set(p, colours, matte, NULL, false);
    memset(m, 0, sizeof *m);
    m->n = CELLS;
    m->depth = depth;
    m->cam[0] = 1;
    m->cam[5] = m->cam[10] = -1;
    m->cam[11] = 12;
    for (size_t k = 0; k < CELLS * CELLS; k++)
        depth[k] = 12 + slope * source_mesh_spacing(m, CELLS) *
                            (float)(k % CELLS);
}

static void tilt_slopes(void)
{
    struct source_picture p = {0};
    struct source_mesh m;
    struct tilt t = {0};
    struct error err = {0};
    const float uv[6] = {0.25f, 0.5f, 0.5f, 0.5f, 0.5f, 0.5f};
    const float neck[3] = {0, 0, 1};
    float tilt[6];

    tilt_scene(&p, &m, 0.75f, 0.5f);
    REQUIRE(tilt_init(&t, CELLS, &err) == 0, "%s", err.text);
    tilt_find(&t, &p, &m);
    tilt_sample(tilt, &t, uv, neck, 3);
    expect("slope to the right", tilt[0], 0.75, 1e-3);
    expect("none down", tilt[1], 0, 1e-3);
    check_range("the person's outline is steep", tilt[2], 2, 4);
    check_that("the shoulders' does not count", tilt[4] == 0);
    tilt_release(&t);
    source_picture_release(&p);
}

/* Points of the mesh that the photograph trusts, that it sees from behind and
 * that it sees at their edges: before a flat map they are as steep as the mesh
 * is, and a frame from their own side believes it where nobody is no more. */
static void tilt_hidden(void)
{
    float held[3] = {1}, seen[3] = {1, 0, 0};
    float facing[3] = {1, -0.5f, 0}, tilt[6] = {0.5f, 0.5f};
    float normals[9] = {0, 0, 1, sqrtf(0.75f), 0, -0.5f, 0, 1, 0};
    const float neck[3] = {0, 0, 1}, toward[2] = {0.6f, 0};
    const struct dynamic_branch b = {.held = held, .seen = seen,
                                     .facing = facing, .normals = normals};
    const struct source_mesh m = {.cam = {1, 0, 0, 0, 0, -1, 0, 0,
                                          0, 0, -1, 12}};

    dynamic_branch_tilt(tilt, neck, 3, &m, &b);
    check_range("trusted: less than what was seen", tilt[0], 0.05, 0.45);
    expect("hidden: the mesh's own slope", tilt[2], 4 * sqrt(0.75), 1e-5);
    expect("hidden: across it", tilt[3], 0, 1e-6);
    check_that("hidden: from its side the photograph has no say",
               gaussian_visible(gaussian_more(tilt + 2, toward)) == 0);
    check_that("the shoulders' does not count",
               tilt[4] == 0 && tilt[5] == 0);
}

int main(void)
{
    tilt_hidden();
    completion_mirrors();
    completion_layers();
    material_ears();
    material_colours();
    relief_wall();
    relief_outline();
    relief_row();
    picture_edge();
    tilt_slopes();
    return check_status();
}
