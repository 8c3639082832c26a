/* What the readers of heads and models use of cJSON, by the browser's own
 * parser. */
#include <cjson/cJSON.h>
#include <emscripten.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* A node at the end of parent's children (NULL: the root), for json_parse
 * alone; text and name are from malloc, or NULL. */
EMSCRIPTEN_KEEPALIVE
cJSON *json_node(cJSON *parent, int type, double number, char *text,
                 char *name)
{
    cJSON *j = calloc(1, sizeof *j);

    if (!j)
        abort();
    *j = (cJSON){.prev = j, .type = type, .valuestring = text,
                 .valuedouble = number, .string = name};
    if (!parent)
        return j;
    if (!parent->child) {
        parent->child = j;
        return j;
    }
    j->prev = parent->child->prev;      /* the last one */
    j->prev->next = j;
    parent->child->prev = j;
    return j;
}

/* n bytes of text as nodes; NULL where they are no JSON. */
EM_JS(cJSON *, json_parse, (const char *text, size_t n), {
    const copy = (s) => {
        const bytes = lengthBytesUTF8(s) + 1, at = _malloc(bytes);
        stringToUTF8(s, at, bytes);
        return at;
    };
    const kinds = { "boolean": (v) => v ? 2 : 1, "number": () => 8, "string": () => 16,
                    "object": (v) => v === null ? 4 : Array.isArray(v) ? 32 : 64 };
    const add = (parent, v, name) => {
        const at = _json_node(parent, kinds[typeof v](v), typeof v === "number" ? v : 0,
                              typeof v === "string" ? copy(v) : 0,
                              name === undefined ? 0 : copy(name));
        if (Array.isArray(v)) v.forEach((x) => add(at, x));
        else if (v && typeof v === "object") Object.entries(v).forEach(([k, x]) => add(at, x, k));
        return at;
    };
    try {
        return add(0, JSON.parse(UTF8ToString(text, n)));
    } catch (e) {
        return 0;
    }
})

cJSON *cJSON_ParseWithLength(const char *text, size_t n)
{
    return json_parse(text, n);
}

cJSON *cJSON_ParseWithOpts(const char *text, const char **end, cJSON_bool whole)
{
    (void)whole;                /* JSON.parse takes nothing after it */
    *end = text;
    return json_parse(text, strlen(text));
}

void cJSON_Delete(cJSON *j)
{
    while (j) {
        cJSON *next = j->next;

        cJSON_Delete(j->child);
        free(j->valuestring);
        free(j->string);
        free(j);
        j = next;
    }
}

int cJSON_GetArraySize(const cJSON *j)
{
    int n = 0;

    for (j = j ? j->child : NULL; j; j = j->next)
        n++;
    return n;
}

static cJSON *json_item(const cJSON *j, const char *name,
                        int (*compare)(const char *, const char *))
{
    for (j = j ? j->child : NULL; j; j = j->next)
        if (j->string && compare(j->string, name) == 0)
            return (cJSON *)j;
    return NULL;
}

cJSON *cJSON_GetObjectItem(const cJSON *j, const char *name)
{
    return json_item(j, name, strcasecmp);
}

cJSON *cJSON_GetObjectItemCaseSensitive(const cJSON *j, const char *name)
{
    return json_item(j, name, strcmp);
}

static cJSON_bool json_is(const cJSON *j, int types)
{
    return j && j->type & types;
}

cJSON_bool cJSON_IsTrue(const cJSON *j) { return json_is(j, cJSON_True); }
cJSON_bool cJSON_IsBool(const cJSON *j) { return json_is(j, cJSON_True | cJSON_False); }
cJSON_bool cJSON_IsNumber(const cJSON *j) { return json_is(j, cJSON_Number); }
cJSON_bool cJSON_IsString(const cJSON *j) { return json_is(j, cJSON_String); }
cJSON_bool cJSON_IsArray(const cJSON *j) { return json_is(j, cJSON_Array); }
cJSON_bool cJSON_IsObject(const cJSON *j) { return json_is(j, cJSON_Object); }
