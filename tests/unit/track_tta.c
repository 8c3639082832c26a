/* E_m's mirror image, looked at again only where a face has changed. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "formats/image.h"
#include "lib/animate/prepare.h"
#include "lib/base/crop.h"
#include "lib/track/tta.h"
#include "tests/check.h"

#define MODEL_NAME "examples/model/model.safetensors"
#define HEAD_NAME "examples/model/head.safetensors"
#define PHOTO "examples/photo.jpg"

enum { N = CROP_NET, CROP = 3 * N * N };

static float rgb[CROP], other[CROP];

static double tta_apart(const float *a, const float *b)
{
    double max = 0;

    for (int k = 0; k < MOTION_OUT; k++)
        max = fmax(max, fabs((double)a[k] - (double)b[k]));
    return max;
}

/* rgb: the middle of the photograph, whatever it shows. */
static void tta_cut(void)
{
    struct image im;
    struct error err = {0};

    REQUIRE(!image_read(&im, PHOTO, &err), "%s", err.text);
    const size_t top = (im.height - N) / 2, left = (im.width - N) / 2;
    for (size_t y = 0; y < N; y++)
        for (size_t i = 0; i < 3 * N; i++)
            rgb[3 * N * y + i] =
                im.rgb[3 * (im.width * (top + y) + left) + i] / 255.0f;
    image_release(&im);
}

int main(void)
{
    static struct prepare models = {.precision = NN_FAST};
    struct error err = {0};
    struct motion_mirror shared = {0};
    struct motion_tta t, next;
    float both[MOTION_OUT], out[MOTION_OUT], alone[MOTION_OUT];

    REQUIRE(!prepare_open(&models, MODEL_NAME, HEAD_NAME, &err) &&
            !motion_tta_init(&t, &models.nets.motion, 1, &models.head, true,
                             &shared, false, &err), "%s", err.text);
    const struct head none = {0};       /* in which no mirror is found */
    REQUIRE(!motion_tta_init(&next, &models.nets.motion, 1, &none, true,
                             &shared, false, &err), "%s", err.text);
    check_that("who comes next has the mirror that was found",
               next.across.known && !memcmp(next.across.from, t.across.from,
                                            sizeof t.across.from));
    motion_tta_release(&next);
    tta_cut();
    motion_tta_follow(both, &t, rgb);
    check_that("the first picture's mirror image is looked at", t.looked);
    motion_encoder_forward_one(alone, rgb, 0, t.net);
    check_that("and says something else", tta_apart(both, alone) > 1e-3);
    motion_tta_follow(out, &t, rgb);
    check_that("the same picture's is not", !t.looked);
    check("and what it said stays", tta_apart(out, both), 1e-6);
    check("how sure: of the picture alone",
          fabs((double)(motion_tta_confidence(&t) -
                        motion_encoder_confidence(t.net, 0))), 0);
    tta_mirror_picture(other, rgb, N);
    for (int i = 0; i < CROP; i++)
        other[i] = 1 - other[i];
    motion_tta_follow(out, &t, other);
    check_that("another picture's is", t.looked);
    motion_tta_forward(both, &t, other);
    check("and both are averaged", tta_apart(out, both), 1e-5);
    motion_tta_release(&t);
    prepare_release(&models);
    return check_failures != 0;
}
