/* What the unit tests share: comparisons that print a line each and count what
 * fails, and the exit status that follows.  A value that is not a number fails
 * every comparison. */
#ifndef SPID_TESTS_CHECK_H
#define SPID_TESTS_CHECK_H

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

#include "lib/base/error.h"

static int check_failures;         /* of this program so far */

/* Count one outcome and end its line. */
static inline void check_count(bool ok)
{
    puts(ok ? "ok" : "FAILED");
    check_failures += !ok;
}

/* ok holds. */
static inline void check_that(const char *what, bool ok)
{
    printf("%-60s ", what);
    check_count(ok);
}

/* ok holds; err, when it is set, says what happened. */
static inline void check_error(const char *what, bool ok,
                               const struct error *err)
{
    printf("%-60s %s%s", what, err->code ? err->text : "",
           err->code ? ": " : "");
    check_count(ok);
}

/* An error or a count is at most limit. */
static inline void check(const char *what, double value, double limit)
{
    printf("%-58s %.2e  limit %.0e  ", what, value, limit);
    check_count(value <= limit);
}

/* got is within tolerance of want. */
static inline void expect(const char *what, double got, double want,
                          double tolerance)
{
    printf("%-52s %.10g, expected %.10g +- %.1e  ", what, got, want,
           tolerance);
    check_count(fabs(got - want) <= tolerance);
}

/* value lies between low and high. */
static inline void check_range(const char *what, double value, double low,
                               double high)
{
    printf("%-46s %12.6g, expected %g to %g  ", what, value, low, high);
    check_count(value >= low && value <= high);
}

/* For loops: nothing is printed unless ok is false; then file, line and the
 * text (a format and its values). */
#define CHECK(ok, ...)                                                \
    do {                                                              \
        if (!(ok)) {                                                  \
            printf("%s:%d: ", __FILE__, __LINE__);                    \
            printf(__VA_ARGS__);                                      \
            printf("  ");                                             \
            check_count(false);                                       \
        }                                                             \
    } while (0)

/* The same where nothing after it makes sense: ends the program. */
#define REQUIRE(ok, ...)                                              \
    do {                                                              \
        if (!(ok)) {                                                  \
            CHECK(false, __VA_ARGS__);                                \
            exit(1);                                                  \
        }                                                             \
    } while (0)

/* main's return value. */
static inline int check_status(void)
{
    return check_failures != 0;
}

#endif
