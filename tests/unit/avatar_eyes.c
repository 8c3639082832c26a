/* Eyes that the source has shut, on the shipped head: found by how far the lids
 * have come down; their eyeballs are not what the photograph shows there but
 * dark in the middle, brown about it and white beyond, or, where the other eye
 * is open, of its colours; lids that are closed stretch no further. */
#include <stdlib.h>
#include <string.h>

#include "lib/avatar/eyes.h"
#include "lib/base/densify.h"
#include "tests/check.h"

#define HEAD_NAME "examples/model/head.safetensors"
#define PHOTO 0.5f              /* what the photograph shows everywhere */

/* One head, and what stands for a photograph of it. */
struct eyes {
    struct head h;
    struct densify d;
    float *posed, *rgb, *pixel, *trust, *white;
    size_t D;
};

static void eyes_open(struct eyes *e)
{
    static float white[3] = {1, 1, 1};
    struct error err = {0};

    memset(e, 0, sizeof *e);
    REQUIRE(head_load(&e->h, HEAD_NAME, &err) == 0 &&
            densify_init(&e->d, e->h.f, e->h.F, e->h.V, &err) == 0, "%s",
            err.text);
    e->D = e->d.V + e->d.E;
    e->posed = malloc((3 * e->h.V + 8 * e->D) * sizeof *e->posed);
    REQUIRE(e->posed, "memory");
    e->rgb = e->posed + 3 * e->h.V;
    e->pixel = e->rgb + 3 * e->D;
    e->trust = e->pixel + 4 * e->D;
    e->white = white;
    for (size_t k = 0; k < e->D; k++) {
        e->trust[k] = 1;
        for (int c = 0; c < 4; c++)
            e->pixel[4 * k + c] = c < 3 ? PHOTO : 1;
    }
}

static void eyes_release(struct eyes *e)
{
    free(e->posed);
    densify_release(&e->d);
    head_release(&e->h);
}

/* shut (2) of lids that are down by so much of their way. */
static void eyes_shut(float shut[2], struct eyes *e, float left, float right)
{
    for (size_t i = 0; i < 3 * e->h.V; i++)
        e->posed[i] = e->h.v_template[i] + left * e->h.l_eyelid[i] +
                      right * e->h.r_eyelid[i];
    eyes_find_shut(shut, e->posed, e->h.v_template, &e->h);
}

/* Paint, and the mean of red and of blue over eyeball vertices of one side
 * that lie so many head units off the middle of the eye's front. */
static void eyes_paint(double mean[2], struct eyes *e,
                       const float s[2], bool left, double low, double high)
{
    const struct eyes_photo by = {e->pixel, e->trust, e->white};
    float *tmp = malloc(e->D * sizeof *tmp);
    const float *front = NULL;
    double n = 0;

    REQUIRE(tmp, "memory");
    for (size_t i = 0; i < 3 * e->D; i++)
        e->rgb[i] = PHOTO;
    eyes_paint_balls(e->rgb, s, &by, &e->h.avatar, tmp);
    free(tmp);
    mean[0] = mean[1] = 0;
    for (int pass = 0; pass < 2; pass++)
        for (size_t v = 0; v < e->h.V; v++) {
            const float *x = e->h.v_template + 3 * v;

            if (e->h.region[v] != REGION_EYEBALL || (x[0] > 0) != left)
                continue;
            if (pass == 0) {
                front = front && front[2] > x[2] ? front : x;
                continue;
            }
            const double off = hypot(x[0] - front[0], x[1] - front[1]);
            if (off < low || off > high || x[2] < front[2] - 0.05f)
                continue;
            mean[0] += e->rgb[3 * v];
            mean[1] += e->rgb[3 * v + 2];
            n++;
        }
    mean[0] /= n;
    mean[1] /= n;
}

static void test_found(struct eyes *e)
{
    float s[2];

    eyes_shut(s, e, 0.5f, 0.5f);
    check("half down is open", fmax(s[0], s[1]), 0);
    eyes_shut(s, e, 0.95f, 0.1f);
    check_that("a wink: the left one alone", s[0] == 1 && s[1] == 0);
    eyes_shut(s, e, 1, 1);
    check_that("all the way down is shut", s[0] == 1 && s[1] == 1);
}

static void test_colours(struct eyes *e)
{
    const float both[2] = {1, 1}, left[2] = {1, 0}, none[2] = {0, 0};
    double pupil[2], iris[2], white[2];

    for (int k = 0; k < 2; k++) {
        eyes_paint(pupil, e, both, k, 0, 0.005);
        eyes_paint(iris, e, both, k, 0.014, 0.024);
        eyes_paint(white, e, both, k, 0.036, 0.06);
        check("the pupil is dark", pupil[0], 0.1);
        check_that("the iris is brown, the white is white",
                   iris[0] > iris[1] + 0.1 && iris[0] < 0.5 &&
                   white[0] > 0.75 && white[1] > 0.7);
    }
    eyes_paint(iris, e, left, true, 0.014, 0.024);
    expect("a winking eye has the other one's iris", iris[0], PHOTO, 0.02);
    eyes_paint(pupil, e, left, true, 0, 0.005);
    check("and a pupil", pupil[0], 0.1);
    eyes_paint(pupil, e, left, false, 0, 0.005);
    expect("which keeps its own", pupil[0], PHOTO, 0);
    eyes_paint(pupil, e, none, true, 0, 0.005);
    expect("as do open ones", pupil[0], PHOTO, 0);
}

static void test_hidden(struct eyes *e)
{
    const float left[2] = {1, 0};
    double off = 0, stretched = 0;

    for (size_t k = 0; k < e->D; k++)
        e->rgb[k] = 1;
    eyes_hide(e->rgb, left, &e->h.avatar);
    for (size_t v = 0; v < e->h.V; v++) {
        const bool ball = e->h.region[v] == REGION_EYEBALL &&
                          e->h.v_template[3 * v] > 0;

        off = fmax(off, fabs((double)e->rgb[v] - !ball));
    }
    check("nothing is seen of a shut eyeball, all of the rest", off, 0);
    for (size_t k = 0; k < e->D; k++) {
        e->rgb[k] = 1;
        e->h.avatar.stretch[k] = 3;
    }
    eyes_stretch(e->rgb, left, &e->h.avatar);
    for (size_t v = 0; v < e->h.V; v++)
        stretched = fmax(stretched,
                         fabs((double)e->rgb[v] -
                              (e->h.v_template[3 * v] > 0 ? 1 : 3)));
    check("what is closed does not stretch again", stretched, 0);
}

int main(void)
{
    struct eyes e;

    eyes_open(&e);
    test_found(&e);
    test_colours(&e);
    test_hidden(&e);
    eyes_release(&e);
    return check_status();
}
