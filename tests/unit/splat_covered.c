/* Covered pixels packed and put back: the same picture, for any pattern of
 * runs; another number of pixels is refused and nothing is read or written
 * beyond the buffers (the sanitizers see to that). */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/splat/covered.h"

#define PIXELS 300
#define BYTES 10

static int failures;

static void check(int ok, const char *what, size_t n)
{
    if (!ok)
        printf("%zu pixels: %s\n", n, what), failures++;
}

/* A picture of n pixels in runs of about so many. */
static void make(uint8_t *image, float *alpha, size_t n, double run)
{
    struct random r;
    int on = 0;

    random_init(&r, n, "covered");
    memset(image, 0, n * BYTES);
    for (size_t i = 0; i < n; i++) {
        if (random_uniform(&r) * run < 1)
            on = !on;
        alpha[i] = on ? 0.5f : i % 2 ? -0.0f : 0.0f;
        for (size_t k = 0; on && k < BYTES; k++)
            image[i * BYTES + k] = (uint8_t)(1 + (i + k) % 255);
    }
}

static void round_trip(size_t n, double run)
{
    uint8_t *image = malloc(n * BYTES + 1), *back = malloc(n * BYTES + 1);
    uint8_t *packed = malloc(n * BYTES + 1);
    float *alpha = malloc(n * sizeof *alpha + 1);
    size_t want = 0, count;

    make(image, alpha, n, run);
    memset(back, 0xee, n * BYTES);
    for (size_t i = 0; i < n; i++)
        want += alpha[i] != 0;
    count = covered_pack(packed, image, alpha, n, BYTES);
    check(count == want, "another number of pixels", n);
    check(covered_unpack(back, packed, count, alpha, n, BYTES) == 0 &&
              memcmp(image, back, n * BYTES) == 0,
          "another picture", n);
    check(covered_unpack(back, packed, count + 1, alpha, n, BYTES) == -1,
          "a pixel too many is taken", n);
    if (count)
        check(covered_unpack(back, packed, count - 1, alpha, n, BYTES) == -1,
              "a pixel too few is taken", n);
    free(image);
    free(back);
    free(packed);
    free(alpha);
}

int main(void)
{
    for (size_t n = 0; n <= PIXELS; n++)
        for (double run = 1; run < 200; run *= 3)
            round_trip(n, run);
    return failures != 0;
}
