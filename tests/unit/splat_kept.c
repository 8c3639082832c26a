/* Pictures that are kept from frame to frame (opt.kept) are those that are
 * drawn anew, whatever comes, goes and stays bare. */
#include "tests/unit/splat_scene.h"

enum { SIZE = 200, N = 300, P = SIZE * SIZE, PLACES = SPLAT_PLACE_CHANNELS };

/* Everything that a frame of SpiD* has. */
struct kept_pictures {
    float image[3 * P], alpha[P];
    float place[PLACES * P], shaded[PLACES * P];
};

/* What a shader is told, where it belongs. */
static void kept_shade(void *ctx, float *color, float *alpha,
                       const float *place, int x, int y, int n)
{
    struct kept_pictures *p = ctx;
    const size_t at = (size_t)y * SIZE + (size_t)x;

    CHECK(n <= 16 && color == p->image + 3 * at && alpha == p->alpha + at,
          "row %d from %d on: others' pixels", y, x);
    memcpy(p->shaded + PLACES * at, place,
           PLACES * (size_t)n * sizeof *place);
}

static void kept_draw(struct splat *s, struct kept_pictures *p,
                      const struct splat_camera *cam)
{
    const struct splat_place_view view = {.A = {1, 0, 0, 1}};
    const struct splat_pictures out = {
        .image = p->image, .alpha = p->alpha, .place = p->place,
        .shade = kept_shade, .ctx = p};
    struct error err = {0};

    CHECK(splat_draw(s, &out, cam, &view, NULL, &err) == 0, "%s", err.text);
}

static void kept_open(struct splat *s, const struct testscene *t, bool kept,
                      int threads)
{
    struct splat_options o = splat_defaults(SIZE, SIZE, 3);
    struct error err = {0};

    o.place = true;
    o.kept = kept;
    o.threads = threads;
    CHECK(splat_init(s, &o, &err) == 0 && splat_load(s, &t->g, &err) == 0,
          "%s", err.text);
}

int main(void)
{
    struct kept_pictures *a = scene_grab(1, sizeof *a);
    struct kept_pictures *b = scene_grab(1, sizeof *b);
    static const float aside[6] = {0, 60, 100, 4000, 120, 80};
    struct splat kept, anew;
    struct testscene t;
    size_t clear = 0;

    small_scene(&t, N, 7);
    kept_open(&kept, &t, true, 2);
    kept_open(&anew, &t, false, 1);
    for (int i = 0; i < 6; i++) {
        struct splat_camera cam = splat_camera_square(t.cam, SIZE, 12);

        /* to the side, far out of the picture, and back */
        cam.cx += aside[i];
        kept_draw(&kept, a, &cam);
        memset(b, 0x55, sizeof *b);
        kept_draw(&anew, b, &cam);
        CHECK(!memcmp(a, b, sizeof *a), "frame %d is another", i);
        CHECK(!memcmp(a->place, a->shaded, sizeof a->place),
              "frame %d was shaded by other places", i);
    }
    for (size_t k = 0; k < P; k++)
        clear += a->alpha[k] == 0;
    CHECK(clear > P / 8 && clear < P, "%zu pixels are clear", clear);

    /* bare parts are left alone, and only in the same pictures */
    struct splat_camera cam = splat_camera_square(t.cam, SIZE, 12);
    size_t left = 0;

    cam.cx += 80;
    kept_draw(&kept, a, &cam);
    for (size_t k = 0; k < P; k++)
        a->alpha[k] = a->alpha[k] == 0 ? 7 : a->alpha[k];
    kept_draw(&kept, a, &cam);
    for (size_t k = 0; k < P; k++)
        left += a->alpha[k] == 7;
    CHECK(left > 0, "every part was written again");
    kept_draw(&kept, b, &cam);
    for (size_t k = 0; k < P; k++)
        CHECK(b->alpha[k] <= 1, "pixel %zu is not of this picture", k);

    splat_release(&kept);
    splat_release(&anew);
    testscene_release(&t);
    free(a);
    free(b);
    return check_status();
}
