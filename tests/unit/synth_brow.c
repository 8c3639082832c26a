/* Brows of photographs: dark hair on skin of any colour is found where it
 * grows, on its own side, fair hair is left out, and people are drawn between
 * those that were seen. */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/lab/people/scan_skin.h"

enum { N = SKIN_SIZE, PEOPLE = 6, TOP = 24, LOW = 40 };

static int failures;
static struct arena memory;

static void brow_check(int ok, const char *what)
{
    printf("%s: %s\n", ok ? "ok" : "FAILED", what);
    failures += !ok;
}

/* Skin of log luminance `skin`, darker by `dark` in rows top to LOW of the part
 * of the square, on the side that is not mirrored only. */
static void paint_skin(float *log, float skin, float dark, int top)
{
    for (int y = 0; y < N; y++)
        for (int x = 0; x < N; x++) {
            bool hair = x >= BROW_X && x < BROW_X + BROW_W
                        && y >= BROW_Y + top && y < BROW_Y + LOW;

            for (int k = 0; k < 3; k++)
                log[3 * (y * N + x) + k] = skin - (hair ? dark : 0);
        }
}

/* Mean of rows y0 to y1 of a density. */
static double rows_mean(const float *v, int y0, int y1)
{
    double sum = 0;

    for (int i = y0 * BROW_W; i < y1 * BROW_W; i++)
        sum += (double)v[i];
    return sum / ((y1 - y0) * BROW_W);
}

static void check_add(float *log, const uint8_t *where)
{
    struct brow_fit t;
    struct error err = {0};

    if (brow_fit_init(&t, 2, &memory, &err)) {
        brow_check(0, err.text);
        return;
    }
    paint_skin(log, -2.5f, 1.2f, TOP);
    brow_fit_add(&t, 0, log, where);
    paint_skin(log, -0.7f, 0.2f, TOP);
    brow_fit_add(&t, 1, log, where);
    brow_check(t.seen[0] && !t.seen[1], "hair is seen on its own side");
    brow_check(!t.seen[2], "hair as fair as the skin is left out");
    brow_check(rows_mean(t.dense, TOP, LOW) > 0.95, "hair is dense");
    brow_check(rows_mean(t.dense, 0, TOP) < 0.01
               && rows_mean(t.dense, LOW, BROW_H) < 0.01, "skin is bare");
}

/* Rows of a painted brow that are more than half covered. */
static int painted_rows(const struct brow_model *m, uint8_t *brow, float z)
{
    float both[2][BROW_PARTS] = {{z}, {z}};
    int n = 0;

    brow_paint(brow, m, (const float (*)[BROW_PARTS])both);
    for (int y = 0; y < BROW_H; y++)
        n += brow[y * BROW_W + BROW_W / 2] > 127;
    return n;
}

static void check_parts(float *log, const uint8_t *where)
{
    static uint8_t brow[2 * BROW_W * BROW_H];
    struct brow_fit t;
    struct brow_model m = {.parts = 0};
    struct error err = {0};

    if (brow_fit_init(&t, PEOPLE, &memory, &err)) {
        brow_check(0, err.text);
        return;
    }
    for (size_t i = 0; i < PEOPLE; i++) {
        paint_skin(log, -1 - 0.3f * (float)i, 1, TOP + 2 * (int)i);
        brow_fit_add(&t, i, log, where);
    }
    if (brow_fit_finish(&m, &t, &memory, &err)) {
        brow_check(0, err.text);
    } else {
        int thin = painted_rows(&m, brow, -1.5f), mean = painted_rows(&m, brow, 0);
        int thick = painted_rows(&m, brow, 1.5f);

        brow_check(mean > 6 && mean < LOW - TOP, "the mean lies between");
        brow_check(abs(thick - thin) >= 5,
                   "thickness is the first component");
    }
}

static void check_density(void)
{
    static uint8_t brow[2 * BROW_W * BROW_H];

    memset(brow, 255, BROW_PLANE);
    float u = (BROW_X + 80.5f) / N, v = 1 - (BROW_Y + 30.5f) / N;
    brow_check(brow_density(brow, u, v) > 0.99f
               && brow_density(brow, 1 - u, v) < 0.01f,
               "either side has a brow of its own");
}

int main(void)
{
    float *log = malloc(3 * (size_t)N * N * sizeof *log);
    uint8_t *where = malloc((size_t)N * N);

    if (!log || !where)
        return 1;
    memset(where, 255, (size_t)N * N);
    check_add(log, where);
    check_parts(log, where);
    check_density();
    free(log);
    free(where);
    arena_release(&memory);
    return failures != 0;
}
