/* A frame turned in its plane: its truth projects to where its pixels go. */
#include <math.h>
#include <stdint.h>

#include "lib/base/random.h"
#include "lib/lab/data/data.h"
#include "lib/base/camera.h"
#include "tests/check.h"

enum { SIZE = 64, NET = 32 };

static uint8_t rgba[SIZE * SIZE * 4];

static struct data_frame make_frame(struct random *r)
{
    struct data_frame f = {
        .size = SIZE, .width = SIZE, .height = SIZE, .rgba = rgba,
        .motion = {.R = {1, 0, 0, 0, -1, 0, 0, 0, -1},
                   .t = {0.1f, -0.2f, 12}}
    };

    for (int i = 0; i < SIZE * SIZE * 4; i++)
        rgba[i] = (uint8_t)(255 * random_uniform(r));
    for (int i = 0; i < 68; i++)
        for (int k = 0; k < 2; k++)
            f.lmk[i][k] = (float)random_range(r, 20, 40);
    return f;
}

/* A point of the head, seen by the frame's camera. */
static void turn_project(float uv[2], const struct data_frame *f)
{
    const float x[3] = {0.3f, 0.5f, 0.4f};
    float cam[12];

    camera_make(cam, f->motion.R, f->motion.t);
    camera_project(uv, NULL, cam, SIZE, x, 1);
}

static void check_truth(const struct data_frame *f)
{
    const double angle = 0.3;
    struct data_frame t;
    float a[2], b[2];

    data_turn(&t, f, angle);
    turn_project(a, f);
    turn_project(b, &t);
    for (int i = 0; i < 2; i++)
        a[i] -= SIZE / 2;
    expect("a turned camera's x", (double)b[0], SIZE / 2
           + cos(angle) * (double)a[0] - sin(angle) * (double)a[1], 1e-4);
    expect("a turned camera's y", (double)b[1], SIZE / 2
           + sin(angle) * (double)a[0] + cos(angle) * (double)a[1], 1e-4);
    for (int i = 0; i < 2; i++)
        a[i] = f->lmk[7][i] - SIZE / 2;
    expect("a landmark goes the same way", (double)t.lmk[7][0], SIZE / 2
           + cos(angle) * (double)a[0] - sin(angle) * (double)a[1], 1e-4);
}

/* A quarter turn moves pixels onto pixels: (x, y) to (-y, x). */
static void check_pixels(const struct data_frame *f)
{
    static float plain[NET * NET * 3], rotated[NET * NET * 3];
    const struct square q = {SIZE / 2, SIZE / 2, NET};
    struct data_frame t;
    double worst = 0;

    data_turn(&t, f, M_PI / 2);
    expect("sampled", data_sample(plain, NET, f, q, NULL, NULL, NULL), 0, 0);
    expect("sampled", data_sample(rotated, NET, &t, q, NULL, NULL, NULL), 0, 0);
    for (int y = 0; y < NET; y++)
        for (int x = 0; x < NET; x++)
            for (int c = 0; c < 3; c++) {
                int to = x * NET + (NET - 1 - y);

                worst = fmax(worst, fabs((double)rotated[3 * to + c] -
                                         (double)plain[3 * (y * NET + x)
                                                       + c]));
            }
    expect("pixels of a quarter turn", worst, 0, 1e-5);
}

int main(void)
{
    struct random r;

    random_init(&r, 2, "turn");
    const struct data_frame f = make_frame(&r);

    check_truth(&f);
    check_pixels(&f);
    return check_status();
}
