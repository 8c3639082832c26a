/* Quilting: what is wanted of a material is covered with that material's texture,
 * as lively as it is where it is typical, and with nothing else. */
#include <math.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/photo/quilt.h"
#include "tests/check.h"

enum { S = 128, P = S * S, STRIPED = 1, NOISY = 2, RARE = 3 };

static float from[P], out[P], again[P], scratch[QUILT_SCRATCH(S)];
static uint8_t is[P], want[P];

/* Stripes at the left, noise in the next but for a loud square, six pixels of
 * a third below; in the right half all three are wanted. */
static void quilt_pictures(void)
{
    struct random r;

    random_init(&r, 3, "quilt");
    for (size_t i = 0; i < P; i++) {
        const size_t x = i % S, y = i / S;
        const float noise = (float)random_range(&r, -1, 1);
        const bool loud = x >= 40 && x < 52 && y < 12;

        is[i] = want[i] = 0;
        if (y >= S - 6)
            is[i] = x < 6 ? RARE : 0;
        else if (x < 36)
            is[i] = STRIPED;
        else if (x < S / 2)
            is[i] = NOISY;
        from[i] = is[i] == STRIPED ? (x % 4 < 2 ? 0.5f : -0.5f)
                : is[i] == NOISY ? noise * (loud ? 10 : 1) : 9;
        if (x >= S / 2)
            want[i] = y < S / 3 ? STRIPED : y < 2 * S / 3 ? NOISY : RARE;
    }
}

static void quilt_all(float *to)
{
    const struct quilt q = {S, from, is, want, to};

    memset(to, 0, P * sizeof *to);
    for (uint8_t m = STRIPED; m <= RARE; m++)
        quilt_cover(&q, m, scratch);
}

int main(void)
{
    double stripes = 0, noise = 0, squares = 0, beside = 0;
    size_t count = 0, new = 0;

    quilt_pictures();
    quilt_all(out);
    for (size_t i = 0; i < P; i++) {
        const double v = (double)out[i];

        if (want[i] == STRIPED) {
            stripes = fmax(stripes, fabs(fabs(v) - 0.5));
        } else if (want[i] == NOISY) {
            noise = fmax(noise, fabs(v));
            squares += v * v;
            count++;
            new += v != 0;
        } else {
            beside = fmax(beside, fabs(v));
        }
    }
    check("stripes are stripes", stripes, 1e-3);
    check_that("all of the noise is covered", new == count);
    check_range("as lively as it is", squares / (double)count, 0.9 / 3, 1.1 / 3);
    check("without what is not typical", noise, 2 * sqrt(2));
    check("nothing elsewhere, nor of what is too little", beside, 0);
    quilt_all(again);
    check_that("the same once more", !memcmp(out, again, sizeof out));
    return check_status();
}
