/* A guess of E_m's crop that is too small or too large leads to the same crop:
 * each pass may move it as far as a head moves in a frame. */
#include <math.h>

#include "formats/image.h"
#include "lib/animate/prepare.h"
#include "lib/track/pass.h"
#include "tests/check.h"

#define MODEL_NAME "examples/model/model.safetensors"
#define HEAD_NAME "examples/model/head.safetensors"
#define PHOTO "examples/photo.jpg"

int main(void)
{
    static struct prepare models = {.precision = NN_FAST};
    static struct track t;
    const struct track_options opt = {.size = 512, .still = true};
    const double guess[] = {0.55, 0.7, 1.4, 1.7};
    struct identity mean = {0};
    struct track_result r;
    struct image im;
    struct error err = {0};
    double off = 0;

    REQUIRE(!prepare_open(&models, MODEL_NAME, HEAD_NAME, &err) &&
            !head_fold(&mean, &models.head, NULL, 0, &err) &&
            !track_init(&t, &mean, &models.nets.motion, &opt, &err) &&
            !image_read(&im, PHOTO, &err), "%s", err.text);
    const struct frame f = {.rgb = im.rgb, .width = im.width,
                            .height = im.height};
    REQUIRE(track_start(&t, &r, &f, NULL, &err) == 1, "%s", err.text);
    const struct square right = t.crop;
    for (size_t i = 0; i < sizeof guess / sizeof *guess; i++) {
        track_settle(&t, &r, (struct square){right.x, right.y,
                                             guess[i] * right.size}, false);
        off = fmax(off, (hypot(t.crop.x - right.x, t.crop.y - right.y) +
                         fabs(t.crop.size - right.size)) / right.size);
    }
    check("crops from 0.55 to 1.7 of the right one's side, off by", off, 5e-3);
    image_release(&im);
    track_release(&t);
    identity_release(&mean);
    prepare_release(&models);
    return check_status();
}
