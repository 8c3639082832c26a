/* What went wrong, as a value: lib/ and formats/ neither print nor exit. */
#ifndef SPID_BASE_ERROR_H
#define SPID_BASE_ERROR_H

#include <stddef.h>

/* The text is one line, lower case, no full stop: "what is wrong (what was
 * expected)", with the file, frame and field the callee knows in front.
 * code is one of sysexits.h; 0 means no error. */
struct error {
    int code;
    char text[480];
};

/* Store code and the formatted text in *e (e may be NULL).  Always returns -1,
 * so that a function can end in `return error_set(e, EX_DATAERR, ...)`. */
int error_set(struct error *e, int code, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* The same for functions that return a pointer: always NULL. */
#define error_null(...) (error_set(__VA_ARGS__), NULL)

/* Put "prefix: " before the text already in *e.  Always returns -1. */
int error_prefix(struct error *e, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

/* What a noun ends in after its number n. */
static inline const char *plural(unsigned long long n)
{
    return n == 1 ? "" : "s";
}

#endif
