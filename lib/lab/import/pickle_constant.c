/* The opcodes that push a constant: numbers and strings, binary and as lines
 * of text. */
#include <stdlib.h>
#include <string.h>

#include "lib/lab/import/pickle_machine.h"

/* Text or bytes that lie elsewhere; p NULL: an error was set already. */
static int pickle_push_text(struct pickle_machine *m, enum pickle_kind kind,
                            const void *p, size_t n)
{
    struct pickle_value *v = p ? pickle_make(m, kind) : NULL;

    if (!v)
        return -1;
    v->u.s.p = p;
    v->u.s.n = n;
    return pickle_push(m, v);
}

static int pickle_push_int(struct pickle_machine *m, enum pickle_kind kind,
                           int64_t i)
{
    struct pickle_value *v = pickle_make(m, kind);

    if (v)
        v->u.i = i;
    return pickle_push(m, v);
}

static int pickle_push_float(struct pickle_machine *m, double f)
{
    struct pickle_value *v = pickle_make(m, PICKLE_FLOAT);

    if (v)
        v->u.f = f;
    return pickle_push(m, v);
}

int pickle_op_constant(struct pickle_machine *m)
{
    return pickle_push_int(m, m->kind, (int64_t)m->n);
}

int pickle_op_int_line(struct pickle_machine *m)
{
    char line[PICKLE_LINE], *end;
    long long i;

    if (pickle_number_line(m, line))
        return -1;
    if (m->op[0] == 'I' && (!strcmp(line, "00") || !strcmp(line, "01")))
        return pickle_push_int(m, PICKLE_BOOL, line[1] == '1');
    i = strtoll(line, &end, 10);
    if (end == line || (*end && strcmp(end, "L")))
        return pickle_fail(m, "not a number");
    if (end - line > 18)        /* may have been cut */
        return pickle_push_text(m, PICKLE_LONG, "", 0);
    return pickle_push_int(m, PICKLE_INT, i);
}

int pickle_op_int(struct pickle_machine *m)
{
    uint64_t i;

    if (pickle_number(m, m->n, &i))
        return -1;
    return pickle_push_int(m, PICKLE_INT, m->n == 4 ? (int32_t)(uint32_t)i
                                                    : (int64_t)i);
}

int pickle_op_long(struct pickle_machine *m)
{
    const unsigned char *p;
    uint64_t bytes, i = 0;

    if (pickle_number(m, m->n, &bytes) || !(p = pickle_bytes(m, bytes)))
        return -1;
    if (bytes > 8)
        return pickle_push_text(m, PICKLE_LONG, p, (size_t)bytes);
    for (size_t k = 0; k < bytes; k++)
        i |= (uint64_t)p[k] << (8 * k);
    if (bytes && bytes < 8 && p[bytes - 1] & 0x80)
        i |= ~(uint64_t)0 << (8 * bytes);
    return pickle_push_int(m, PICKLE_INT, (int64_t)i);
}

int pickle_op_float_line(struct pickle_machine *m)
{
    char line[PICKLE_LINE], *end;
    double f;

    if (pickle_number_line(m, line))
        return -1;
    f = strtod(line, &end);
    if (end == line || *end)
        return pickle_fail(m, "not a number");
    return pickle_push_float(m, f);
}

int pickle_op_float(struct pickle_machine *m)
{
    const unsigned char *p = pickle_bytes(m, m->n);
    uint64_t bits = 0;
    double f;

    if (!p)
        return -1;
    for (size_t i = 0; i < m->n; i++)
        bits = bits << 8 | p[i];
    memcpy(&f, &bits, sizeof f);
    return pickle_push_float(m, f);
}

int pickle_op_string(struct pickle_machine *m)
{
    uint64_t bytes;

    if (pickle_number(m, m->n, &bytes))
        return -1;
    return pickle_push_text(m, m->kind, pickle_bytes(m, bytes), (size_t)bytes);
}

/* The number that n <= 8 hexadecimal digits at p are; -1 when they are not. */
static long pickle_hex_number(const char *p, const char *end, size_t n)
{
    char digits[9] = "";

    if ((size_t)(end - p) < n)
        return -1;
    memcpy(digits, p, n);
    return strspn(digits, "0123456789abcdefABCDEF") == n
               ? strtol(digits, NULL, 16) : -1;
}

/* Code point c as UTF-8; returns its bytes. */
static size_t pickle_put_utf8(char *out, unsigned long c)
{
    size_t n = c < 0x80 ? 1 : c < 0x800 ? 2 : c < 0x10000 ? 3 : 4;

    if (n == 1)
        out[0] = (char)c;
    for (size_t i = n - 1; n > 1 && i > 0; i--) {
        out[i] = (char)(0x80 | (c & 63));
        c >>= 6;
    }
    if (n > 1)
        out[0] = (char)((0xf00 >> n & 0xff) | c);
    return n;
}

int pickle_op_text_line(struct pickle_machine *m)
{
    struct pickle_text line;
    const char *p, *end;
    char *out;
    size_t n = 0;

    if (pickle_line(m, &line) || !(out = pickle_alloc_string(m, 2 * line.n)))
        return -1;
    for (p = line.p, end = p + line.n; p < end;) {
        size_t digits = *p != '\\' || end - p < 2 ? 0 : p[1] == 'u' ? 4
                     : p[1] == 'U' ? 8 : 0;
        long c = digits ? pickle_hex_number(p + 2, end, digits)
                        : (long)(unsigned char)*p;

        if (c < 0 || c > 0x10ffff)
            return pickle_fail(m, "a bad escape at %zu",
                               (size_t)(p - line.p));
        n += pickle_put_utf8(out + n, (unsigned long)c);
        p += digits ? digits + 2 : 1;
    }
    return pickle_push_text(m, m->kind, out, n);
}

/* One character of a Python 2 string literal; *p moves behind it. */
static int pickle_unescape(const char **p, const char *end)
{
    static const char names[] = "\\'\"abfnrtv";
    static const char values[] = "\\'\"\a\b\f\n\r\t\v";
    const char *q = *p;
    int c = (unsigned char)*q++;

    if (c == '\\' && q < end) {
        const char *named = *q ? strchr(names, *q) : NULL;

        if (named) {
            c = values[named - names];
            q++;
        } else if (*q == 'x' && pickle_hex_number(q + 1, end, 2) >= 0) {
            c = (int)pickle_hex_number(q + 1, end, 2);
            q += 3;
        }
    }
    *p = q;
    return c;
}

int pickle_op_string_line(struct pickle_machine *m)
{
    struct pickle_text line;
    char *out;
    size_t n = 0;

    if (pickle_line(m, &line))
        return -1;
    if (line.n < 2 || (line.p[0] != '\'' && line.p[0] != '"') ||
        line.p[line.n - 1] != line.p[0])
        return pickle_fail(m, "the string has no quotes");
    out = pickle_alloc_string(m, line.n);
    if (!out)
        return -1;
    for (const char *p = line.p + 1, *end = line.p + line.n - 1; p < end;)
        out[n++] = (char)pickle_unescape(&p, end);
    return pickle_push_text(m, m->kind, out, n);
}
