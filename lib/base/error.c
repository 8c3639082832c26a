/* Errors as values: a sysexits code and one line of text that callers
 * prefix. */
#include "lib/base/error.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

int error_set(struct error *e, int code, const char *format, ...)
{
    va_list ap;

    if (e) {
        e->code = code;
        va_start(ap, format);
        vsnprintf(e->text, sizeof e->text, format, ap);
        va_end(ap);
    }
    return -1;
}

int error_prefix(struct error *e, const char *format, ...)
{
    char joined[sizeof e->text];
    size_t used, left;
    va_list ap;
    int n;

    if (!e)
        return -1;
    va_start(ap, format);
    n = vsnprintf(joined, sizeof joined, format, ap);
    va_end(ap);
    used = n < 0 ? 0 : (size_t)n;
    if (used > sizeof joined - 3)
        used = sizeof joined - 3;
    memcpy(joined + used, ": ", 2);
    used += 2;
    left = strlen(e->text);
    if (left > sizeof joined - 1 - used)
        left = sizeof joined - 1 - used;
    memcpy(joined + used, e->text, left);
    joined[used + left] = '\0';
    memcpy(e->text, joined, used + left + 1);
    return -1;
}
