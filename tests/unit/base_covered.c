/* The runs of covered pixels joined and put back: the same picture, for any
 * pattern; another number of pixels is refused and nothing is read or written
 * beyond the buffers (the sanitizers see to that).  Rows begin where counting
 * pixel by pixel says. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/base/covered.h"
#include "tests/check.h"

#define PIXELS 300
#define MAX 5000              /* runs that outgrow the first room */
#define BYTES 10

/* A picture of n pixels in runs of about so many. */
static void covered_make(uint8_t *image, float *alpha, size_t n, double run)
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

/* What the runs hold, joined. */
static size_t covered_join(uint8_t *packed, const struct covered *c)
{
    size_t at = 0;

    for (size_t i = 0; i < c->runs; i++) {
        memcpy(packed + at, c->run[i].iov_base, c->run[i].iov_len);
        at += c->run[i].iov_len;
    }
    return at / BYTES;
}

static void count_rows(const float *alpha, size_t n, size_t width)
{
    size_t start[MAX], before = 0, height = n / width;
    size_t all = covered_rows(start, alpha, height, width);

    for (size_t i = 0; i < height * width; i++) {
        if (i % width == 0)
            CHECK(start[i / width] == before,
                  "%zu pixels: a row begins elsewhere", n);
        before += alpha[i] != 0;
    }
    CHECK(all == before, "%zu pixels: rows of another number of pixels", n);
}

static void round_trip(struct covered *c, size_t n, double run)
{
    uint8_t *image = malloc(n * BYTES + 1), *back = malloc(n * BYTES + 1);
    uint8_t *packed = malloc(n * BYTES + 1);
    float *alpha = malloc(n * sizeof *alpha + 1);
    size_t want = 0, count;

    covered_make(image, alpha, n, run);
    memset(back, 0xee, n * BYTES);
    for (size_t i = 0; i < n; i++)
        want += alpha[i] != 0;
    CHECK(covered_find(c, image, alpha, n, BYTES) == 0,
          "%zu pixels: no memory", n);
    count = covered_join(packed, c);
    CHECK(count == want && c->pixels == want,
          "%zu pixels: another number of pixels", n);
    for (size_t width = 1; width <= n; width = 3 * width + 1)
        count_rows(alpha, n, width);
    CHECK(covered_unpack(back, packed, count, alpha, n, BYTES) == 0 &&
          memcmp(image, back, n * BYTES) == 0,
          "%zu pixels: another picture", n);
    CHECK(covered_unpack(back, packed, count + 1, alpha, n, BYTES) == -1,
          "%zu pixels: a pixel too many is taken", n);
    if (count)
        CHECK(covered_unpack(back, packed, count - 1, alpha, n, BYTES) == -1,
              "%zu pixels: a pixel too few is taken", n);
    free(image);
    free(back);
    free(packed);
    free(alpha);
}

int main(void)
{
    struct covered c = {0};

    for (size_t n = 0; n <= PIXELS; n++)
        for (double run = 1; run < 200; run *= 3)
            round_trip(&c, n, run);
    round_trip(&c, MAX, 1);
    covered_release(&c);
    return check_status();
}
