/* Where the neck begins: under the chin in front, at the mouth's height behind,
 * nowhere above that, and with the shoulders at the model's lower edge. */
#include <math.h>

#include "lib/head/head.h"
#include "tests/check.h"

#define HEAD_NAME "examples/model/head.safetensors"

/* The least and the most weight of the vertices between two heights and two
 * depths (m). */
static void neck_bounds(double out[2], const struct head_avatar *w,
                        const struct head *h, const double y[2],
                        const double z[2])
{
    out[0] = INFINITY;
    out[1] = -INFINITY;
    for (size_t v = 0; v < h->V; v++) {
        const float *x = h->v_template + 3 * v;
        const double up = (double)(x[1] / h->scale);
        const double ahead = (double)(x[2] / h->scale);

        if (up < y[0] || up > y[1] || ahead < z[0] || ahead > z[1])
            continue;
        out[0] = fmin(out[0], (double)w->neck[v]);
        out[1] = fmax(out[1], (double)w->neck[v]);
    }
}

int main(void)
{
    static const double whole[2] = {-1, 1}, back[2] = {-1, -0.03};
    struct error err = {0};
    struct head h = {0};
    double b[2];

    if (head_load(&h, HEAD_NAME, &err)) {
        check_error("the shipped head", false, &err);
        return check_status();
    }
    neck_bounds(b, &h.avatar, &h, (double[2]){-0.04, 1}, whole);
    check_that("above the mouth nothing stays", b[0] == 0 && b[1] == 0);
    neck_bounds(b, &h.avatar, &h, (double[2]){-0.08, -0.04}, (double[2]){0.03, 1});
    check_that("the face to the chin does not", b[0] == 0 && b[1] == 0);
    neck_bounds(b, &h.avatar, &h, (double[2]){-0.09, -0.085}, back);
    check_that("the nape as high as the chin does by a third and more",
               b[0] > 0.33 && b[1] <= 1);
    neck_bounds(b, &h.avatar, &h, (double[2]){-0.2, -0.16}, whole);
    check_that("the model's lower edge stays", b[0] > 0.95 && b[1] <= 1);
    head_release(&h);
    return check_status();
}
