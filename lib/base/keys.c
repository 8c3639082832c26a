/* Settings by their table, from JSON and into it (keys.h). */
#include "lib/base/keys.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#define NAME 120                /* characters of a key with its object's */

static void key_set(void *out, const struct key *k, double x)
{
    void *at = (char *)out + k->at;

    if (k->kind == KEY_BOOL)
        *(bool *)at = x != 0;
    else if (k->min == k->max || k->kind > KEY_BOOL)
        return;
    else if (k->kind == KEY_SIZE)
        *(size_t *)at = (size_t)x;
    else if (k->kind == KEY_INT)
        *(int64_t *)at = (int64_t)x;
    else if (k->kind == KEY_DOUBLE)
        *(double *)at = x;
    else
        *(float *)at = (float)x;
}

void keys_set_normal(void *out, const struct key *keys, size_t n)
{
    for (size_t i = 0; i < n; i++)
        key_set(out, &keys[i], keys[i].normal);
}

/* ---- reading ------------------------------------------------------------- */

static int key_read_number(void *out, const struct key *k, const cJSON *v,
                           struct error *err)
{
    const bool whole = k->kind == KEY_SIZE || k->kind == KEY_INT;
    const double x = v->valuedouble;
    char found[40] = "not a number";

    if (cJSON_IsNumber(v)) {
        if (x >= k->min && x <= k->max && (!whole || x == floor(x))) {
            key_set(out, k, x);
            return 0;
        }
        snprintf(found, sizeof found, "%g", x);
    }
    return error_set(err, EX_CONFIG, "%s: %s (expected %s%g to %g)", k->name,
                     found, whole ? "a whole number, " : "", k->min, k->max);
}

static int key_read_text(char *out, const struct key *k, const cJSON *v,
                         struct error *err)
{
    if (!cJSON_IsString(v) || strlen(v->valuestring) >= (size_t)k->max)
        return error_set(err, EX_CONFIG, "%s: no name (expected a string under "
                         "%g characters)", k->name, k->max);
    strcpy(out, v->valuestring);
    return 0;
}

static int key_read_word(unsigned *out, const struct key *k, const cJSON *v,
                         struct error *err)
{
    const char *found = cJSON_IsString(v) ? v->valuestring : "";
    char all[200];
    size_t n = 0;

    for (unsigned i = 0; k->words[i]; i++) {
        if (!strcmp(found, k->words[i])) {
            *out = i;
            return 0;
        }
        if (n < sizeof all)
            n += (size_t)snprintf(all + n, sizeof all - n, "%s\"%s\"",
                                  !i ? "" : k->words[i + 1] ? ", " : " or ",
                                  k->words[i]);
    }
    return error_set(err, EX_CONFIG, "%s is \"%.60s\" (expected %s)", k->name,
                     found, all);
}

static int key_read(void *out, const struct key *k, const cJSON *v,
                    struct error *err)
{
    void *at = (char *)out + k->at;

    switch (k->kind) {
    case KEY_BOOL:
        if (!cJSON_IsBool(v))
            return error_set(err, EX_CONFIG, "%s: expected true or false",
                             k->name);
        key_set(out, k, cJSON_IsTrue(v));
        return 0;
    case KEY_TEXT:
        return key_read_text(at, k, v, err);
    case KEY_WORD:
        return key_read_word(at, k, v, err);
    case KEY_JSON:
        if (!cJSON_IsObject(v))
            return error_set(err, EX_CONFIG, "%s: expected an object",
                             k->name);
        free(*(char **)at);
        *(char **)at = cJSON_PrintUnformatted(v);
        return 0;
    default:
        return key_read_number(out, k, v, err);
    }
}

/* The key of that name, or NULL; *part: keys in an object of that name. */
static const struct key *key_find(bool *part, const struct key *keys, size_t n,
                                  const char *name)
{
    const size_t length = strlen(name);

    *part = false;
    for (size_t i = 0; i < n; i++) {
        if (!strcmp(keys[i].name, name))
            return &keys[i];
        *part |= !strncmp(keys[i].name, name, length)
                 && keys[i].name[length] == '.';
    }
    return NULL;
}

/* Those of an object whose keys follow prefix. */
static int keys_read_object(void *out, const struct key *keys, size_t n,
                            const cJSON *object, const char *prefix,
                            bool known, struct error *err)
{
    const cJSON *v;

    cJSON_ArrayForEach(v, object) {
        char name[NAME];
        bool part;

        snprintf(name, sizeof name, "%s%s%s", prefix, *prefix ? "." : "",
                 v->string);
        const struct key *k = key_find(&part, keys, n, name);

        if (k ? key_read(out, k, v, err)
              : part && cJSON_IsObject(v)
              ? keys_read_object(out, keys, n, v, name, known, err) : 0)
            return -1;
        if (!k && !(part && cJSON_IsObject(v)) && known)
            return error_set(err, EX_CONFIG, "%s: unknown key", name);
    }
    return 0;
}

int keys_read(void *out, const struct key *keys, size_t n, const cJSON *root,
              bool known, struct error *err)
{
    return keys_read_object(out, keys, n, root, "", known, err);
}

/* ---- printing ------------------------------------------------------------ */

static cJSON *key_value(const struct key *k, const void *in)
{
    const void *at = (const char *)in + k->at;

    if (k->kind == KEY_BOOL)
        return cJSON_CreateBool(*(const bool *)at);
    if (k->kind == KEY_TEXT)
        return cJSON_CreateString(at);
    if (k->kind == KEY_WORD)
        return cJSON_CreateString(k->words[*(const unsigned *)at]);
    return cJSON_CreateNumber(k->min == k->max ? k->min
                              : k->kind == KEY_SIZE
                                    ? (double)*(const size_t *)at
                              : k->kind == KEY_INT
                                    ? (double)*(const int64_t *)at
                              : k->kind == KEY_DOUBLE
                                    ? *(const double *)at
                                    : (double)*(const float *)at);
}

void keys_print(cJSON *root, const struct key *keys, size_t n, const void *in)
{
    for (size_t i = 0; i < n; i++) {
        const char *dot = strchr(keys[i].name, '.');
        cJSON *object = root;

        if (dot) {
            char name[NAME];

            snprintf(name, sizeof name, "%.*s", (int)(dot - keys[i].name),
                     keys[i].name);
            object = cJSON_GetObjectItem(root, name);
            object = object ? object : cJSON_AddObjectToObject(root, name);
        }
        cJSON_AddItemToObject(object, dot ? dot + 1 : keys[i].name,
                              key_value(&keys[i], in));
    }
}
