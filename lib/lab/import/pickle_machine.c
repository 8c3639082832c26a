/* Values, the stack and the memo of a machine, with their limits. */
#include "lib/lab/import/pickle_machine.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/list.h"

#define BLOCK ((size_t)64 << 10)

/* ---- memory ------------------------------------------------------------- */

int pickle_fail(struct pickle_machine *m, const char *format, ...)
{
    char text[400];
    va_list args;

    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    return error_set(m->err, EX_DATAERR, "byte %zu: %s: %s", m->op_at, m->op,
                     text);
}

void pickle_refuse(struct pickle_machine *m, const char *format, ...)
{
    char text[400];
    va_list args;

    if (m->p->refused.text[0])
        return;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    error_set(&m->p->refused, EX_DATAERR, "byte %zu: %s: %s", m->op_at, m->op,
              text);
}

void *pickle_alloc(struct pickle_machine *m, size_t bytes)
{
    struct pickle_arena *a = &m->p->arena;

    bytes = (bytes + 15) / 16 * 16;
    if (bytes > a->left) {
        size_t size = bytes > BLOCK / 4 ? bytes : BLOCK;

        if (size > PICKLE_MAX_MEMORY - a->used)
            return pickle_null(m, "more than %zu MB of objects",
                               PICKLE_MAX_MEMORY >> 20);
        a->block = arena_take(&a->memory, size, 1);
        if (arena_check(&a->memory, "a pickle", m->err))
            return NULL;
        a->used += size;
        a->left = size;
    }
    a->left -= bytes;
    return a->block + a->left;
}

char *pickle_alloc_string(struct pickle_machine *m, size_t bytes)
{
    struct arena *memory = &m->p->arena.memory;
    char *string;

    m->strings += bytes;
    if (m->strings > 4 * m->size)
        return pickle_null(m, "more text than the file has");
    if (bytes <= BLOCK / 4)
        return pickle_alloc(m, bytes + 1);
    string = arena_take(memory, bytes + 1, 1);
    return arena_check(memory, "a string", m->err) ? NULL : string;
}

void pickle_free(struct pickle *p)
{
    if (p)
        arena_release(&p->arena.memory);
    free(p);
}

struct pickle_value *pickle_make(struct pickle_machine *m,
                                 enum pickle_kind kind)
{
    struct pickle_value *v = pickle_alloc(m, sizeof *v);

    if (v) {
        v->kind = kind;
        v->at = m->op_at;
    }
    return v;
}

int pickle_reserve(struct pickle_machine *m, struct pickle_list *l, size_t n)
{
    struct pickle_value **item;
    size_t room = 2 * l->room > l->n + n ? 2 * l->room : l->n + n;

    if (l->n + n <= l->room)
        return 0;
    item = pickle_alloc(m, room * sizeof *item);
    if (!item)
        return -1;
    if (l->n)
        memcpy(item, l->item, l->n * sizeof *item);
    l->item = item;
    l->room = room;
    return 0;
}

int pickle_append(struct pickle_machine *m, struct pickle_list *l,
                  struct pickle_value *v)
{
    if (pickle_reserve(m, l, 1))
        return -1;
    l->item[l->n++] = v;
    return 0;
}

/* ---- reading ------------------------------------------------------------ */

const unsigned char *pickle_bytes(struct pickle_machine *m, uint64_t n)
{
    const unsigned char *p = m->data + m->at;

    if (n > m->size - m->at)
        return pickle_null(m, "%llu bytes where %zu are left",
                           (unsigned long long)n, m->size - m->at);
    m->at += (size_t)n;
    return p;
}

int pickle_number(struct pickle_machine *m, size_t n, uint64_t *out)
{
    const unsigned char *p = pickle_bytes(m, n);

    *out = 0;
    for (size_t i = 0; p && i < n; i++)
        *out |= (uint64_t)p[i] << (8 * i);
    return p ? 0 : -1;
}

int pickle_line(struct pickle_machine *m, struct pickle_text *line)
{
    const unsigned char *p = m->data + m->at;
    const unsigned char *end = memchr(p, '\n', m->size - m->at);

    if (!end)
        return pickle_fail(m, "the line has no end");
    line->p = (const char *)p;
    line->n = (size_t)(end - p);
    m->at += line->n + 1;
    /* A text mode that wrote CR and LF did so from the first line on. */
    if (!m->lines++)
        m->crlf = line->n && line->p[line->n - 1] == '\r';
    if (m->crlf && line->n && line->p[line->n - 1] == '\r')
        line->n--;
    return 0;
}

int pickle_number_line(struct pickle_machine *m, char out[PICKLE_LINE])
{
    struct pickle_text line;

    if (pickle_line(m, &line))
        return -1;
    if (line.n >= PICKLE_LINE || memchr(line.p, 0, line.n))
        return pickle_fail(m, "not a number");
    memcpy(out, line.p, line.n);
    out[line.n] = 0;
    return 0;
}

/* ---- stack and memo ----------------------------------------------------- */

/* v may be NULL: a mark. */
static int pickle_stack_push(struct pickle_machine *m, struct pickle_value *v)
{
    struct pickle_value **s;

    if (m->top >= PICKLE_MAX_ITEMS)
        return pickle_fail(m, "more than %zu values on the stack",
                           PICKLE_MAX_ITEMS);
    s = list_add(&m->stack, &m->top, &m->room, sizeof *s, m->err);
    if (!s)
        return -1;
    *s = v;
    return 0;
}

int pickle_push(struct pickle_machine *m, struct pickle_value *v)
{
    return v ? pickle_stack_push(m, v) : -1;
}

int pickle_push_mark(struct pickle_machine *m)
{
    return pickle_stack_push(m, NULL);
}

struct pickle_value *pickle_top(struct pickle_machine *m)
{
    if (m->top && m->stack[m->top - 1])
        return m->stack[m->top - 1];
    return pickle_null(m, "the stack is empty");
}

struct pickle_value *pickle_pop(struct pickle_machine *m)
{
    struct pickle_value *v = pickle_top(m);

    if (v)
        m->top--;
    return v;
}

size_t pickle_marked(struct pickle_machine *m)
{
    size_t i = m->top;

    while (i && m->stack[i - 1])
        i--;
    if (!i)
        pickle_fail(m, "no mark on the stack");
    return i;
}

int pickle_move(struct pickle_machine *m, struct pickle_list *l, size_t from)
{
    size_t n = m->top - from;

    if (pickle_reserve(m, l, n))
        return -1;
    if (n)
        memcpy(l->item + l->n, m->stack + from, n * sizeof *l->item);
    l->n += n;
    m->top = from - 1;
    return 0;
}

/* Room for entry i. */
static int pickle_memo_grow(struct pickle_machine *m, uint64_t i)
{
    size_t room = m->memo_room ? 2 * m->memo_room : 256;
    struct pickle_value **memo;

    while (room <= i)
        room *= 2;
    memo = realloc(m->memo, room * sizeof *memo);
    if (!memo)
        return error_set(m->err, EX_OSERR, "out of memory");
    memset(memo + m->memo_room, 0, (room - m->memo_room) * sizeof *memo);
    m->memo = memo;
    m->memo_room = room;
    return 0;
}

int pickle_memo_put(struct pickle_machine *m, uint64_t i)
{
    struct pickle_value *v = pickle_top(m);

    if (!v)
        return -1;
    if (i >= PICKLE_MAX_ITEMS)
        return pickle_fail(m, "memo entry %llu (expected at most %zu)",
                           (unsigned long long)i, PICKLE_MAX_ITEMS - 1);
    if (i >= m->memo_room && pickle_memo_grow(m, i))
        return -1;
    if (!m->memo[i])
        m->memoized++;
    m->memo[i] = v;
    return 0;
}

int pickle_memo_get(struct pickle_machine *m, uint64_t i)
{
    if (i >= m->memo_room || !m->memo[i])
        return pickle_fail(m, "memo entry %llu is empty",
                           (unsigned long long)i);
    return pickle_stack_push(m, m->memo[i]);
}

/* ---- looking at values -------------------------------------------------- */

bool pickle_text_is(struct pickle_text s, const char *word)
{
    return s.n == strlen(word) && !memcmp(s.p, word, s.n);
}

bool pickle_text_begins(struct pickle_text s, const char *word)
{
    size_t n = strlen(word);

    return s.n >= n && !memcmp(s.p, word, n) && (s.n == n || s.p[n] == '.');
}

bool pickle_is(const struct pickle_value *text, const char *word)
{
    return (text->kind == PICKLE_BYTES || text->kind == PICKLE_TEXT) &&
           pickle_text_is(text->u.s, word);
}

struct pickle_value *pickle_get(const struct pickle_value *dict,
                                const char *key)
{
    const struct pickle_list *l = &dict->u.list;

    if (dict->kind != PICKLE_DICT || l->n > 2 * PICKLE_MAX_KEYS)
        return NULL;
    for (size_t i = l->n; i >= 2; i -= 2)
        if (pickle_is(l->item[i - 2], key))
            return l->item[i - 1];
    return NULL;
}

const char *pickle_kind_name(const struct pickle_value *v)
{
    static const char *const names[] = {
        [PICKLE_NONE] = "None", [PICKLE_BOOL] = "bool", [PICKLE_INT] = "int",
        [PICKLE_FLOAT] = "float", [PICKLE_LONG] = "long int",
        [PICKLE_BYTES] = "string", [PICKLE_TEXT] = "text",
        [PICKLE_LIST] = "list", [PICKLE_TUPLE] = "tuple",
        [PICKLE_SET] = "set", [PICKLE_DICT] = "dict",
        [PICKLE_NAME] = "name", [PICKLE_DTYPE] = "dtype",
        [PICKLE_STORAGE] = "storage", [PICKLE_ARRAY] = "array",
        [PICKLE_OBJECT] = "object",
    };

    return v ? names[v->kind] : "nothing";
}

/* At most 60 bytes of a name, printable, at out. */
static size_t pickle_printable(char *out, struct pickle_text s)
{
    size_t k = 0;

    for (; k < s.n && k < 60; k++)
        out[k] = s.p[k] > 32 && s.p[k] < 127 ? s.p[k] : '?';
    out[k] = 0;
    return k;
}

void pickle_full_name(char out[PICKLE_FULL_NAME], const struct pickle_name *n)
{
    char module[64], name[64];

    pickle_printable(module, n->module);
    pickle_printable(name, n->name);
    snprintf(out, PICKLE_FULL_NAME, "%s%s%s", module, *module ? "." : "",
             name);
}
