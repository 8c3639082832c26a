/* Both margins of a lid as lines over the ball, where they meet, and how
 * what is near them follows. */
#include "lib/lab/head/scan_lids.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "lib/base/vec3.h"
#include "lib/lab/head/scan.h"

const int32_t scan_lid_upper[SCAN_LID_UPPER] = {
    3742, 3743, 3744, 3745, 3746, 3747, 3748, 3749, 3750, 3751, 4130, 3752,
    4190, 4162, 3754, 3755, 3756, 3757, 3758, 4133, 3759, 3760, 3721 };
const int32_t scan_lid_lower[SCAN_LID_LOWER] = {
    3742, 3741, 3740, 3739, 3738, 3737, 3736, 3735, 3734, 3733, 3732, 3731,
    3730, 3729, 3728, 3727, 3726, 3725, 3724, 3723, 3722, 3832, 4434, 3721 };

#define UPPER_SHARE 0.8f        /* of the gap that the upper lid closes */
#define OVERLAP 0.0003          /* metres, in the middle of the eye */
#define CLEAR 0.0003            /* further out than the mean face's, upper */
#define NEAR 0.010              /* how far from a margin skin follows at all */
#define UPPER_FALL 0.0055       /* and its fall-off, upper and lower lid */
#define LOWER_FALL 0.0040

/* The vertex of the right half that mirrors v. */
static int32_t lid_mirror_of(const float *p, int32_t v)
{
    float min = INFINITY;
    int32_t best = v;

    for (int32_t u = 0; u < SCAN_FACE; u++) {
        float d = fabsf(p[3 * u] + p[3 * v]) +
                  fabsf(p[3 * u + 1] - p[3 * v + 1]) +
                  fabsf(p[3 * u + 2] - p[3 * v + 2]);

        if (d < min) {
            min = d;
            best = u;
        }
    }
    return best;
}

/* Distance in the file's x and y at weight 1 along a line, for meeting. */
static float lid_closed_x(const float *p, const float *blink, int32_t v)
{
    return fabsf(p[3 * v] + blink[3 * v]);
}

/* Where each vertex of a meets b: the segment of b that has its x when both
 * are closed. */
static void lid_find_contacts(struct scan_lid_line *a,
                              const struct scan_lid_line *b, const float *p,
                              const float *blink)
{
    for (int i = 0; i < a->n; i++) {
        float x = lid_closed_x(p, blink, a->v[i]);
        int j = 0;

        while (j + 2 < b->n && lid_closed_x(p, blink, b->v[j + 1]) < x)
            j++;
        float x0 = lid_closed_x(p, blink, b->v[j]);
        float x1 = lid_closed_x(p, blink, b->v[j + 1]);
        float f = x1 > x0 ? (x - x0) / (x1 - x0) : 0;

        a->meet[i] = j;
        a->part[i] = f < 0 ? 0 : f > 1 ? 1 : f;
        memcpy(a->move[i], blink + 3 * a->v[i], sizeof a->move[i]);
    }
}

/* Where the vertices of a line are to lie when closed: as far out as the
 * neutral face's, the upper lid's a little more, because on its straight way
 * it cuts the ball's corner. */
static void lid_find_distances(struct scan_lid_line *a, const float *p,
                               int side, int lower, double unit)
{
    float centre[3];
    double eye[3];

    scan_eye(eye, side);
    for (int c = 0; c < 3; c++)
        centre[c] = (float)(unit * eye[c]);
    for (int i = 0; i < a->n; i++) {
        float d[3];

        sub3(d, p + 3 * a->v[i], centre);
        for (int c = 0; c < 3; c++)
            d[c] += a->move[i][c];
        a->out[i] = length3(d);
        for (int c = 0; c < 3; c++)
            a->away[i][c] = d[c] / a->out[i];
        if (!lower)
            a->out[i] += (float)(unit * CLEAR * sin(M_PI * i / (a->n - 1)));
    }
}

/* The four lid margins, and where they go in a blink. */
static void lid_make_lines(struct scan_lids *l, const float *p,
                           const float *const blink[2], double unit)
{
    for (int k = 0; k < 4; k++) {
        struct scan_lid_line *a = &l->line[k];
        const int32_t *from = k % 2 ? scan_lid_lower : scan_lid_upper;

        a->n = k % 2 ? SCAN_LID_LOWER : SCAN_LID_UPPER;
        for (int i = 0; i < a->n; i++) {
            a->v[i] = k < 2 ? from[i] : lid_mirror_of(p, from[i]);
            a->over[i] = (float)(unit * OVERLAP *
                                 sin(M_PI * i / (a->n - 1)));
        }
    }
    for (int k = 0; k < 4; k++)
        lid_find_contacts(&l->line[k], &l->line[k ^ 1], p, blink[k / 2]);
    for (int k = 0; k < 4; k++)
        lid_find_distances(&l->line[k], p, k / 2, k % 2, unit);
}

/* ---- what follows ------------------------------------------------------- */

/* The place of line a nearest to q; returns the distance. */
static float lid_nearest_place(int *at, float *part,
                               const struct scan_lid_line *a, const float *p,
                               const float q[3])
{
    float best = INFINITY;

    for (int i = 0; i + 1 < a->n; i++) {
        const float *x = p + 3 * a->v[i], *y = p + 3 * a->v[i + 1];
        float xy = 0, xq = 0, d[3];

        for (int c = 0; c < 3; c++) {
            xy += (y[c] - x[c]) * (y[c] - x[c]);
            xq += (y[c] - x[c]) * (q[c] - x[c]);
        }
        float f = xy > 0 ? xq / xy : 0;
        f = f < 0 ? 0 : f > 1 ? 1 : f;
        for (int c = 0; c < 3; c++)
            d[c] = x[c] + f * (y[c] - x[c]) - q[c];
        if (length3(d) < best) {
            best = length3(d);
            *at = i;
            *part = f;
        }
    }
    return best;
}

/* How vertex v follows the margins of its side; weight 0: not at all. */
static struct scan_lid_part lid_follow(const struct scan_lids *l,
                                       const float *p,
                                       const float *const blink[2], double unit,
                                       int32_t v)
{
    const float *q = p + 3 * v;
    struct scan_lid_part o = {.v = v};
    int side = q[0] < 0, at = 0;
    float d = INFINITY, part = 0, away[3], margin[3];
    double eye[3];

    for (int lower = 0; lower < 2; lower++) {
        float far = lid_nearest_place(&at, &part, &l->line[2 * side + lower], p,
                                      q);

        if (far < d) {
            d = far;
            o.line = 2 * side + lower;
            o.at = at;
            o.part = part;
        }
    }
    if (d > NEAR * unit)
        return o;
    scan_eye(eye, side);
    const int32_t *on = l->line[o.line].v + o.at;
    for (int c = 0; c < 3; c++) {
        away[c] = q[c] - (float)(unit * eye[c]);
        margin[c] = p[3 * on[0] + c] + o.part * (p[3 * on[1] + c] -
                    p[3 * on[0] + c]) - (float)(unit * eye[c]);
    }
    double fall = d / unit / (o.line % 2 ? LOWER_FALL : UPPER_FALL);
    bool inside = length3(away) < length3(margin) - 1e-4 * unit;
    o.weight = inside || v >= SCAN_LASHES ? 1 : (float)exp(-fall * fall);
    for (int c = 0; c < 3; c++)     /* where the blink has brought it */
        away[c] += blink[side][3 * v + c];
    float back = away[2] > 0 ? -away[1] / away[2] : 0;
    o.up[1] = 1;
    o.up[2] = fmaxf(-1, fminf(1, back));
    for (int c = 0; c < 3; c++)
        o.away[c] = away[c] / length3(away);
    return o;
}

int scan_lids_init(struct scan_lids *l, const float *neutral,
                   const float *blink_left, const float *blink_right,
                   double unit, struct arena *memory, struct error *err)
{
    const float *const blink[2] = {blink_left, blink_right};

    *l = (struct scan_lids){.neutral = neutral, .unit = unit,
                            .p = arena_take(memory, SCAN_VERTS, sizeof *l->p)};
    if (arena_check(memory, "the scans' lids", err))
        return -1;
    lid_make_lines(l, neutral, blink, unit);
    for (int32_t v = 0; v < SCAN_VERTS; v++) {
        /* gums, teeth and eyeballs have no part in it */
        if (v >= SCAN_ORBIT_END && v < SCAN_EYE_END)
            continue;
        l->p[l->n] = lid_follow(l, neutral, blink, unit, v);
        l->n += l->p[l->n].weight > 1e-3f;
    }
    return 0;
}

/* out (SCAN_LID_LINE) = how far the vertices of line k are to go away from the
 * ball, which has moved by `shift` and grown. */
static void lid_lay_line(float *out, const struct scan_lids *l, int k,
                         const float *folded, const double shift[3],
                         double grow)
{
    const struct scan_lid_line *a = &l->line[k];
    double eye[3];

    scan_eye(eye, k / 2);
    for (int i = 0; i < a->n; i++) {
        double far = a->out[i] + grow * SCAN_EYE_RADIUS * l->unit;

        for (int c = 0; c < 3; c++)
            far -= a->away[i][c] * (folded[3 * a->v[i] + c] + a->move[i][c] -
                                    l->unit * eye[c] - shift[c]);
        out[i] = (float)far;
    }
}

/* Height of vertex i of line a, closed and laid on the ball. */
static float lid_height(const struct scan_lid_line *a, int i, const float *out,
                        const float *folded)
{
    return folded[3 * a->v[i] + 1] + a->move[i][1] + out[i] * a->away[i][1];
}

/* up (SCAN_LID_LINE) = how far each vertex of line k is to rise along the
 * ball; out (4,SCAN_LID_LINE) from lid_lay_line. */
static void lid_close_line(float *up, const struct scan_lids *l, int k,
                           const float (*out)[SCAN_LID_LINE],
                           const float *folded)
{
    const struct scan_lid_line *a = &l->line[k], *b = &l->line[k ^ 1];

    for (int i = 0; i < a->n; i++) {
        int j = a->meet[i];
        float y0 = lid_height(b, j, out[k ^ 1], folded);
        float y1 = lid_height(b, j + 1, out[k ^ 1], folded);
        float gap = lid_height(a, i, out[k], folded) -
                    (y0 + a->part[i] * (y1 - y0));

        /* of a lower lid the gap is upside down */
        up[i] = k % 2 ? (1 - UPPER_SHARE) * (a->over[i] - gap)
                      : -UPPER_SHARE * (gap + a->over[i]);
    }
}

void scan_lids_add(float *x, const struct scan_lids *l, const float *folded,
                   float left, float right)
{
    float up[4][SCAN_LID_LINE], out[4][SCAN_LID_LINE];

    if (left == 0 && right == 0)
        return;
    for (int k = 0; k < 4; k++) {
        double shift[3], grow;

        scan_eye_motion(shift, &grow, l->neutral, folded, l->unit, k / 2);
        lid_lay_line(out[k], l, k, folded, shift, grow);
    }
    for (int k = 0; k < 4; k++)
        lid_close_line(up[k], l, k, (const float(*)[SCAN_LID_LINE])out, folded);
    for (size_t i = 0; i < l->n; i++) {
        const struct scan_lid_part *o = &l->p[i];
        const float *u = up[o->line] + o->at, *a = out[o->line] + o->at;
        float w = o->weight * (o->line < 2 ? left : right);
        float y = w * (u[0] + o->part * (u[1] - u[0]));
        float z = w * (a[0] + o->part * (a[1] - a[0]));

        for (int c = 0; c < 3; c++)
            x[3 * o->v + c] += y * o->up[c] + z * o->away[c];
    }
}
