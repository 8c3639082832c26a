/* Relative motion: the neutral frame becomes the source, the source's own
 * frames stay what they are, a movement is as large relative to the head, and
 * a closed lid is closed. */
#include <math.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/base/rotation.h"
#include "lib/track/calm.h"
#include "lib/track/relative.h"
#include "tests/check.h"

enum { NEXP = 20 };

static void motion_draw(struct motion *m, struct random *r)
{
    float turn[3];

    memset(m, 0, sizeof *m);
    for (int i = 0; i < 3; i++)
        turn[i] = 0.3f * (float)random_normal(r);
    rotation_exp(m->R, turn);
    for (int i = 0; i < NEXP; i++)
        m->exp[i] = (float)random_normal(r);
    for (int i = 0; i < 2; i++)
        m->t[i] = 0.3f * (float)random_normal(r);
    m->t[2] = 12 + (float)random_normal(r);
    for (int i = 0; i < 3; i++)
        m->pose.jaw[i] = 0.1f * (float)random_normal(r);
    for (int i = 0; i < 6; i++)
        m->pose.eye[i] = 0.1f * (float)random_normal(r);
    m->pose.lid[0] = 0.1f;
    m->pose.lid[1] = 0.2f;
    m->pose.exp = m->exp;
}

static double motion_distance(const struct motion *a, const struct motion *b)
{
    double d = rotation_distance(a->R, b->R);

    for (int i = 0; i < NEXP; i++)
        d = fmax(d, fabs((double)a->exp[i] - (double)b->exp[i]));
    for (int i = 0; i < 3; i++) {
        d = fmax(d, fabs((double)a->t[i] - (double)b->t[i]));
        d = fmax(d, fabs((double)a->pose.jaw[i] - (double)b->pose.jaw[i]));
    }
    for (int i = 0; i < 6; i++)
        d = fmax(d, fabs((double)a->pose.eye[i] - (double)b->pose.eye[i]));
    for (int i = 0; i < 2; i++)
        d = fmax(d, fabs((double)a->pose.lid[i] - (double)b->pose.lid[i]));
    return d;
}

/* Calm faces smile by -0.1 to 0.2, open the jaw by 0.03 and close lids by 0.1
 * at most. */
static void calm_range(float rest[2 * MOTION_OUT])
{
    for (int i = 0; i < MOTION_OUT; i++) {
        rest[i] = -0.1f;
        rest[MOTION_OUT + i] = i < MOTION_JAW ? 0.2f : i < MOTION_LID ? 0.03f
                                                                   : 0.1f;
    }
}

/* A source that smiles by source, moved by a driver whose neutral frame smiles
 * by neutral and who then smiles by driver: the smile that comes out. */
static double smile_of(double source, double neutral, double driver)
{
    struct motion s = {.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}, .t = {0, 0, 12}};
    struct motion n = s, m = s;
    float rest[2 * MOTION_OUT];
    const struct calm calm = {rest, NEXP, {0}};
    struct relative r;

    calm_range(rest);
    s.exp[0] = (float)source;
    n.exp[0] = (float)neutral;
    m.exp[0] = (float)driver;
    calm_face(&s, &calm);
    calm_face(&n, &calm);
    relative_init(&r, &s, &n, NEXP);
    relative_apply(&m, &r);
    return (double)m.exp[0];
}

/* A photograph's grin is not the person's, nor is a driver's first one. */
static void check_calm(void)
{
    struct motion m = {.pose = {.jaw = {0.2f}, .lid = {0.9f, 0.05f}}};
    float rest[2 * MOTION_OUT];
    struct calm calm = {rest, NEXP, {0}};

    expect("a calm driver calms a grin", smile_of(0.9, 0.1, 0.1), 0.2, 1e-6);
    expect("and back", smile_of(0.9, 0.1, 0.9), 1.0, 1e-6);
    expect("a grin first, then calm: no pout", smile_of(0.1, 0.9, 0.2), 0.1,
           1e-6);
    expect("a grin first is one", smile_of(0.1, 0.9, 0.9), 0.8, 1e-6);
    expect("calm faces keep what is their own", smile_of(0.15, 0.05, 0.55),
           0.65, 1e-6);
    calm_range(rest);
    calm_face(&m, &calm);
    expect("jaws rest nearly shut", (double)m.pose.jaw[0], 0.03, 1e-6);
    expect("eyes nearly open", (double)m.pose.lid[0], 0.1, 1e-6);
    expect("as they are", (double)m.pose.lid[1], 0.05, 1e-6);
    m.exp[0] = 0.9f;
    calm.rest = NULL;
    calm_face(&m, &calm);
    expect("whose encoder does not say, as it is", (double)m.exp[0], 0.9,
           1e-6);
}

/* Lips that the jaw (0.03 at most) parts by 0.6, and lip 1 (-0.1 to 0.2) by
 * 0.8 of what lips of calm faces part: how far m's are apart at rest. */
static double lips_at_rest(double jaw, double lip, double *smile)
{
    struct motion m = {.exp = {(float)*smile, (float)lip},
                       .pose = {.jaw = {(float)jaw}}};
    float rest[2 * MOTION_OUT];
    struct calm calm = {rest, NEXP, {0}};

    calm_range(rest);
    calm.parts[MOTION_JAW] = 0.6f;
    calm.parts[MOTION_EXP + 1] = 0.8f;
    calm_face(&m, &calm);
    *smile = (double)m.exp[0];
    return 0.6 * ((double)m.pose.jaw[0] + 0.035) / 0.065 +
           0.8 * ((double)m.exp[1] - 0.05) / 0.15;
}

/* A mouth open beyond what calm faces do says nothing of how it rests. */
static void check_lips(void)
{
    double smile = 0.15;

    expect("lips within the range stay as they are, apart",
           lips_at_rest(-0.035, 0.2, &smile), 0.8, 1e-5);
    expect("or pressed", lips_at_rest(-0.035, -0.1, &smile), -0.8, 1e-5);
    expect("half way out of it they are half believed, apart",
           lips_at_rest(-0.035, 0.05 + 0.15 * 1.5 / 0.8, &smile), 0.4, 1e-5);
    expect("a mouth that speaks rests shut", lips_at_rest(0.2, 0.3, &smile), 0,
           1e-5);
    expect("and what parts no lips stays", smile, 0.15, 1e-6);
}

int main(void)
{
    double rest = 0, same = 0, way = 0, closed = 0;
    struct motion source, neutral, driver, m;
    struct relative r;
    struct random random;

    random_init(&random, 11, "relative");
    for (int trial = 0; trial < 100; trial++) {
        motion_draw(&source, &random);
        motion_draw(&neutral, &random);
        motion_draw(&driver, &random);

        relative_init(&r, &source, &neutral, NEXP);
        m = neutral;
        relative_apply(&m, &r);
        rest = fmax(rest, motion_distance(&m, &source));
        m = driver;
        m.pose.lid[0] = 1;
        relative_apply(&m, &r);
        closed = fmax(closed, fabs((double)m.pose.lid[0] - 1));
        /* a head's width in the picture goes with 1 / z */
        double went = ((double)driver.t[0] / (double)driver.t[2] -
                       (double)neutral.t[0] / (double)neutral.t[2]) *
                      (double)neutral.t[2];
        double goes = ((double)m.t[0] / (double)m.t[2] -
                       (double)source.t[0] / (double)source.t[2]) *
                      (double)source.t[2];
        way = fmax(way, fabs(went - goes));

        relative_init(&r, &neutral, &neutral, NEXP);
        m = driver;
        relative_apply(&m, &r);
        same = fmax(same, motion_distance(&m, &driver));
    }
    check_calm();
    check_lips();
    check("the neutral frame is the source", rest, 1e-5);
    check("a driver with the source's own rest is unchanged", same, 1e-5);
    check("moves by as many head widths", way, 1e-5);
    check("a closed lid is closed", closed, 1e-6);
    motion_draw(&m, &random);
    memset(&driver, 0, sizeof driver);
    driver.R[0] = 1;
    driver.R[4] = driver.R[8] = -1;
    check("rest is without tension", relative_tension(&driver, NEXP), 1e-9);
    check_that("others are not", relative_tension(&m, NEXP) > 1);
    return check_status();
}
