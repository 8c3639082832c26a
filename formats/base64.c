/* Base64: three bytes become four digits. */
#include "formats/base64.h"

void base64_write(FILE *f, const uint8_t *p, size_t n)
{
    static const char digit[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
                                "abcdefghijklmnopqrstuvwxyz0123456789+/";

    for (size_t i = 0; i < n; i += 3) {
        size_t left = n - i;
        unsigned v = (unsigned)p[i] << 16 |
                     (left > 1 ? (unsigned)p[i + 1] << 8 : 0) |
                     (left > 2 ? p[i + 2] : 0);

        putc(digit[v >> 18], f);
        putc(digit[v >> 12 & 63], f);
        putc(left > 1 ? digit[v >> 6 & 63] : '=', f);
        putc(left > 2 ? digit[v & 63] : '=', f);
    }
}
