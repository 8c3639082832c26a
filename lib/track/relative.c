/* Relative motion (relative.h): differences from the driver's neutral frame
 * added to the source's own motion. */
#include "lib/track/relative.h"

#include <math.h>
#include <string.h>

#include "lib/base/camera.h"
#include "lib/base/rotation.h"

/* How much a radian of looking away weighs beside a standard deviation of
 * expression. */
#define RELATIVE_POSE_WEIGHT 2.0
/* The same of a radian of the jaw, and of closing an eye. */
#define RELATIVE_JAW_WEIGHT 25.0
#define RELATIVE_LID_WEIGHT 4.0

void relative_init(struct relative *r, const struct motion *source,
                   const struct motion *neutral, size_t nexp)
{
    r->source = *source;
    r->neutral = *neutral;
    r->nexp = nexp;
    r->source.pose.exp = r->source.exp;
    r->neutral.pose.exp = r->neutral.exp;
}

/* R R_n^T R_s */
static void relative_rotate(float R[9], const float neutral[9],
                            const float source[9])
{
    double a[9], n[9], s[9], rotated[9], out[9];

    for (int i = 0; i < 9; i++) {
        a[i] = (double)R[i];
        n[i] = (double)neutral[i];
        s[i] = (double)source[i];
    }
    mat3_mul_nt_d(rotated, a, n);
    mat3_mul_d(out, rotated, s);
    for (int i = 0; i < 9; i++)
        R[i] = (float)out[i];
}

/* The direction the head is seen in moves by as many head widths. */
static void relative_move(float t[3], const float neutral[3],
                          const float source[3])
{
    float z = fmaxf(t[2], CAMERA_NEAR), zn = fmaxf(neutral[2], CAMERA_NEAR);
    float zs = fmaxf(source[2], CAMERA_NEAR), depth = zs * z / zn;

    for (int i = 0; i < 2; i++) {
        float way = (t[i] / z - neutral[i] / zn) * zn / zs;

        t[i] = (source[i] / zs + way) * depth;
    }
    t[2] = depth;
}

/* source + lid - neutral; what closes it closes the same share. */
static float relative_lid(float lid, float neutral, float source)
{
    float way = lid - neutral;

    if (way > 0 && neutral < 1)
        way *= fmaxf(1 - source, 0) / (1 - neutral);
    return fminf(fmaxf(source + way, 0), 1);
}

/* source + open - neutral; jaws that are shut shut no further, whatever the
 * neutral frame was, than source or driver themselves do. */
static float relative_open(float open, float neutral, float source)
{
    return fmaxf(source + open - neutral, fminf(fminf(source, open), 0));
}

void relative_apply(struct motion *m, const struct relative *r)
{
    const struct motion *s = &r->source, *n = &r->neutral;

    relative_rotate(m->R, n->R, s->R);
    relative_move(m->t, n->t, s->t);
    for (size_t i = 0; i < r->nexp; i++)
        m->exp[i] += s->exp[i] - n->exp[i];
    m->pose.jaw[0] = relative_open(m->pose.jaw[0], n->pose.jaw[0],
                                   s->pose.jaw[0]);
    for (int i = 1; i < 3; i++)
        m->pose.jaw[i] += s->pose.jaw[i] - n->pose.jaw[i];
    for (int i = 0; i < 6; i++)
        m->pose.eye[i] += s->pose.eye[i] - n->pose.eye[i];
    for (int i = 0; i < 2; i++)
        m->pose.lid[i] = relative_lid(m->pose.lid[i], n->pose.lid[i],
                                      s->pose.lid[i]);
    m->pose.exp = m->exp;
}

double relative_tension(const struct motion *m, size_t nexp)
{
    float frontal[12];
    double sum = 0;

    for (size_t i = 0; i < nexp; i++)
        sum += (double)m->exp[i] * (double)m->exp[i];
    for (int i = 0; i < 3; i++)
        sum += RELATIVE_JAW_WEIGHT * (double)m->pose.jaw[i] *
               (double)m->pose.jaw[i];
    for (int i = 0; i < 2; i++)
        sum += RELATIVE_LID_WEIGHT * (double)m->pose.lid[i] *
               (double)m->pose.lid[i];
    camera_frontal(frontal, 1);
    const float upright[9] = {frontal[0], frontal[1], frontal[2],
                              frontal[4], frontal[5], frontal[6],
                              frontal[8], frontal[9], frontal[10]};
    double away = rotation_distance(m->R, upright);
    return sum + RELATIVE_POSE_WEIGHT * away * away;
}
