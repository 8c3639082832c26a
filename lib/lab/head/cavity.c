/* The mouth's sheet behind the teeth: sections along the middle, each with a
 * width and a height of its sides, joined by straight lines. */
#include "lib/lab/head/cavity.h"

#include <math.h>
#include <string.h>

#include "lib/avatar/branch.h"
#include "lib/lab/head/crowns.h"

#define OPENING 18.0f   /* mm: radius of a wide mouth's opening, and more for
                         * what its walls give back */
#define MIDDLE 0.72f    /* of u: tongue or palate, beyond it the cheeks */
#define CHEEK 27.0f     /* mm from the middle to a cheek */
#define CHEEK_Z -20.0f  /* mm: about so far behind the lips cheeks begin */
#define CHEEK_DIM 0.6f  /* of the light is lost beside the tongue, */
#define SIDE_DIM 0.5f   /* on its sides, */
#define WALL_DIM 0.3f   /* where the palate comes down, */
#define FURROW_DIM 0.1f        /* and along the tongue's middle, */
#define FURROW 1.8f     /* mm: its standard deviation */
#define BEHIND 7.0f     /* mm that all stays behind the teeth's front */
#define DROP 14.0f      /* mm that a jaw takes the tongue's back down */
#define OVERLAP 0.7f    /* standard deviation over the spacing */
#define FLAT 1.6f       /* mm: standard deviation across the sheet */

enum cavity_tissue { PALATE, THROAT, TONGUE };

/* A section: its middle, the jaw's share, where the palate or tongue ends at
 * the side and how far up it is there; mm. */
struct cavity_section {
    float y, z, share, half, side;
    enum cavity_tissue tissue;
};

static const struct cavity_section cavity_sections[] = {
    {8, -9, 0, 17, -3, PALATE}, {17, -17, 0, 18, -8, PALATE},
    {20, -34, 0, 19, -8, PALATE}, {8, -58, 0.15f, 18, -3, THROAT},
    {-3, -64, 0.55f, 18, 0, THROAT}, {1.7f, -56, 1, 20, -1, TONGUE},
    {3.2f, -46, 1, 20, -2.5f, TONGUE}, {3.4f, -36, 1, 19, -5, TONGUE},
    {2.8f, -27, 1, 17, -5, TONGUE}, {0.6f, -18.5f, 1, 15, -5, TONGUE},
    {-2, -13.5f, 1, 12.5f, -4, TONGUE}, {-4.9f, -10.4f, 1, 8.5f, -2, TONGUE},
    {-8, -11, 1, 9, -1, TONGUE}, {-13, -15, 1, 14, -1, THROAT}
};
#define SECTIONS (sizeof cavity_sections / sizeof *cavity_sections)

static const float cavity_colors[][3] = {
    [PALATE] = {0.72f, 0.46f, 0.43f}, [THROAT] = {0.46f, 0.20f, 0.19f},
    [TONGUE] = {0.80f, 0.47f, 0.45f}
};
static const float cavity_cheek[3] = {0.56f, 0.28f, 0.27f};

float cavity_light(float depth)
{
    const float d = fmaxf(depth, 0) / OPENING;

    return powf(1 + d * d, -1 / 2.2f);
}

/* What of the light is left at x of a section of which half is 1: a tongue is
 * round, with a furrow along its middle. */
static float cavity_across(float x, const struct cavity_section *s)
{
    const float side = x * x * x * x, mm = x * s->half / FURROW;

    if (s->tissue != TONGUE)
        return 1 - WALL_DIM * side;
    return (1 - SIDE_DIM * side) * (1 - FURROW_DIM * expf(-0.5f * mm * mm));
}

/* Section s at u. */
static void cavity_section_at(struct cavity_place *p,
                              const struct cavity_section *s, float u)
{
    const float in = fminf(fabsf(u) / MIDDLE, 1);
    const float cheek = fmaxf(fabsf(u) - MIDDLE, 0) / (1 - MIDDLE);
    const float x = in * (s->half + cheek * (CHEEK - s->half));
    const float *own = cavity_colors[s->tissue];

    p->at[0] = copysignf(x, u);
    p->at[1] = s->y + in * in * in * s->side;
    p->at[2] = fminf(s->z + 0.5f * cheek * (CHEEK_Z - s->z),
                     -CROWNS_ARCH * x * x - BEHIND);
    p->share = s->share + cheek * (0.5f - s->share);
    const float light = cavity_light(-p->at[2]) * cavity_across(in, s) *
                        (1 - CHEEK_DIM * cheek);
    for (int k = 0; k < 3; k++)
        p->color[k] = light * (own[k] + cheek * (cavity_cheek[k] - own[k]));
}

void cavity_place(struct cavity_place *p, float u, float v)
{
    const float at = fminf(fmaxf(v, 0), 1) * (float)(SECTIONS - 1);
    const size_t k = (size_t)fminf(at, (float)(SECTIONS - 2));
    const float w = at - (float)k;
    struct cavity_place next;

    cavity_section_at(p, &cavity_sections[k], u);
    cavity_section_at(&next, &cavity_sections[k + 1], u);
    for (int c = 0; c < 3; c++) {
        p->at[c] += w * (next.at[c] - p->at[c]);
        p->color[c] += w * (next.color[c] - p->color[c]);
    }
    p->share += w * (next.share - p->share);
}

void cavity_cover(float scale[3], float quat[4], float u, float v, float du,
                  float dv)
{
    struct cavity_place left, right, up, down;

    cavity_place(&left, fmaxf(u - du, -1), v);
    cavity_place(&right, fminf(u + du, 1), v);
    cavity_place(&up, u, v - dv);
    cavity_place(&down, u, v + dv);
    const float dy = up.at[1] - down.at[1], dz = up.at[2] - down.at[2];
    const float open = DROP * fabsf(up.share - down.share);
    const float turn = 0.5f * atan2f(dz, dy);

    scale[0] = 0.5f * OVERLAP * (right.at[0] - left.at[0]);
    scale[1] = 0.5f * OVERLAP * (hypotf(dy, dz) + open);
    scale[2] = FLAT + 0.25f * open;
    memcpy(quat, (float[4]){cosf(turn), sinf(turn), 0, 0}, 4 * sizeof *quat);
}
