/* Memory with one owner: zeroed, kept apart, said once when there is none. */
#include <stdint.h>
#include <stdlib.h>
#include <sysexits.h>

#include "lib/base/arena.h"
#include "lib/base/parallel.h"
#include "tests/check.h"

#define PIECES 1000

PARALLEL(take_part, i, struct arena *, a, int32_t **, piece)
{
    piece[i] = arena_take(a, 8, sizeof **piece);
    for (int k = 0; piece[i] && k < 8; k++)
        piece[i][k] += (int32_t)i;
}

/* Several threads take from one arena; nobody's piece is another's. */
static void test_pieces(void)
{
    static int32_t *piece[PIECES];
    struct arena a = {0};
    struct error err = {0};
    int same = 1;

    parallel_each(take_part, PIECES, 1, &a, piece);
    check_error("a piece for every thread", !arena_check(&a, "pieces", &err),
                &err);
    for (int32_t i = 0; i < PIECES; i++)
        for (int k = 0; k < 8; k++)
            same &= piece[i][k] == i;
    check_that("pieces are zero and nobody else's", same);
    check_that("nothing is a piece, too", arena_take(&a, 0, 4));
    arena_release(&a);
    check_that("what was released is as new", !a.last && !a.failed);
}

static void test_short(void)
{
    struct arena a = {0};
    struct error err = {0};

    check_that("more than there is", arena_take(&a, 4, 4) &&
               !arena_take(&a, SIZE_MAX / 2, 4) && arena_take(&a, 4, 4));
    check_that("is told of when asked, after later ones too",
               arena_check(&a, "a test", &err) && err.code == EX_OSERR);
    arena_release(&a);
    check_that("and no more once released", !arena_check(&a, "a test", &err));
}

static void test_keep(void)
{
    struct arena a = {0};
    struct error err = {0};
    void *p = malloc(4);

    check_that("what malloc gave is kept", arena_keep(&a, p, &err) == p);
    check_that("NULL is not told of twice",
               !arena_keep(&a, NULL, &err) && !err.code);
    arena_release(&a);
}

int main(void)
{
    test_pieces();
    test_short();
    test_keep();
    return check_failures != 0;
}
