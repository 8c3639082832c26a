/* Relative motion: the neutral frame becomes the source, the source's own
 * frames stay what they are, a movement is as large relative to the head, and
 * a closed lid is closed. */
#include <math.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/base/rotation.h"
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

/* Expression 0 and the jaw of a driver who goes from neutral to driver, done
 * by a source who smiles by 0.8 more than neutral and has opened the jaw. */
static void smile_twice(double *smile, double *jaw, double driver, bool arkit)
{
    struct motion source = {.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}, .t = {0, 0, 12}};
    struct motion neutral = source, m;
    struct relative r;

    neutral.exp[0] = 0.1f;
    source.exp[0] = 0.9f;
    source.pose.jaw[0] = 0.15f;
    relative_init(&r, &source, &neutral, NEXP, arkit);
    m = neutral;
    m.exp[0] = (float)driver;
    m.pose.jaw[0] = 0.45f * (float)driver;
    relative_apply(&m, &r);
    *smile = (double)m.exp[0];
    *jaw = (double)m.pose.jaw[0];
}

/* Who smiles already does not smile twice; weights of other heads just add. */
static void check_most(void)
{
    double smile, jaw, less;

    smile_twice(&less, &jaw, 0.5, true);
    smile_twice(&smile, &jaw, 1.0, true);
    expect("a smile on a smile", smile, 0.9 + 0.9 * 0.3 / 1.1, 1e-6);
    check_that("half of it is less", less > 0.95 && less < smile - 0.05);
    check_range("an open jaw on an open one, radians", jaw, 0.45, 0.531);
    smile_twice(&smile, &jaw, 0, true);
    expect("less of a smile is as much less", smile, 0.8, 1e-6);
    smile_twice(&smile, &jaw, 1.0, false);
    expect("weights that are not ARKit's add", smile, 1.8, 1e-6);
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

        relative_init(&r, &source, &neutral, NEXP, trial % 2);
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

        relative_init(&r, &neutral, &neutral, NEXP, trial % 2);
        m = driver;
        relative_apply(&m, &r);
        same = fmax(same, motion_distance(&m, &driver));
    }
    check_most();
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
