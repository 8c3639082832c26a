/* One block handed out to pointers of several types: each at 64 bytes, zeroed,
 * apart from the others; those of the backward only when training. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/slices.h"
#include "tests/check.h"

#define COUNT 4

struct parts {
    float *value, *gradient, *block;
    uint8_t *byte;
    uint32_t *number;
};

static int slices_make(struct parts *p, bool train)
{
    const struct slice slices[COUNT] = {
        {&p->value, 33, false}, {&p->byte, 100 / 4, false},
        {&p->gradient, 7, true}, {&p->number, 16, false}
    };
    struct error err = {0};

    return slices_allocate(&p->block, slices, COUNT, train, &err);
}

static bool slices_are_apart(const struct parts *p)
{
    return (uintptr_t)p->value % 64 == 0 && (uintptr_t)p->byte % 64 == 0 &&
           (uintptr_t)p->number % 64 == 0 &&
           p->byte >= (const uint8_t *)(p->value + 33) &&
           (const uint8_t *)p->number >= p->byte + 100;
}

int main(void)
{
    struct parts p = {0};
    size_t sum = 0;

    check_that("for inference", slices_make(&p, false) == 0);
    check_that("  each at 64 bytes and apart", slices_are_apart(&p));
    check_that("  no gradients", p.gradient == NULL);
    memset(p.byte, 255, 100);
    p.number[15] = 7;
    check_that("for training, in the same pointers", slices_make(&p, true) == 0);
    check_that("  each at 64 bytes and apart", slices_are_apart(&p));
    check_that("  gradients between them",
               (uint8_t *)p.gradient >= p.byte + 100 &&
               (uint8_t *)(p.gradient + 7) <= (uint8_t *)p.number);
    for (size_t i = 0; i < 100; i++)
        sum += p.byte[i];
    check_that("  zeroed", sum == 0 && p.number[15] == 0);
    free(p.block);
    return check_status();
}
