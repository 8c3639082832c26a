/* The run's JSON by a table of keys, each with its range and default; the
 * learning rate and lambda_3 over the steps. */
#include "lib/lab/train/config.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/file.h"

enum kind { KIND_INT, KIND_DOUBLE, KIND_FLOAT, KIND_BOOL };

/* A key, where its number goes, its range and what it is when not given. */
struct key {
    const char *name;
    enum kind kind;
    size_t offset;
    double min, max, normal;
};

#define AT(field) offsetof(struct train_config, field)
#define TERM(t) (AT(geometry.term) + (t) * sizeof(float))

static const struct key keys[] = {
    {"seed", KIND_INT, AT(seed), 0, 9e15, 1},
    {"steps", KIND_INT, AT(steps), 0, 1e9, 1000},
    {"batch", KIND_INT, AT(batch), 1, 4096, 8},
    {"micro", KIND_INT, AT(micro), 0, 4096, 0},
    {"rate", KIND_DOUBLE, AT(rate), 0, 10, 1e-4},
    {"rate_end", KIND_DOUBLE, AT(rate_end), -1, 10, -1},
    {"warmup", KIND_INT, AT(warmup), 0, 1e9, 0},
    {"clip", KIND_DOUBLE, AT(clip), 0, 1e9, 0},
    {"average", KIND_DOUBLE, AT(average), 0, 0.999999, 0.999},
    {"running_norm", KIND_BOOL, AT(running_norm), 0, 1, 0},
    {"pool", KIND_INT, AT(pool), 1, 1e6, 64},
    {"people_per_step", KIND_DOUBLE, AT(people_per_step), 0, 1e3, 0.1},
    {"image", KIND_INT, AT(image), 32, 4096, 512},
    {"targets", KIND_INT, AT(targets), 1, 64, 1},
    {"augment.jitter", KIND_FLOAT, AT(augment.jitter), 0, 4, 1},
    {"augment.colour", KIND_FLOAT, AT(augment.colour), 0, 2, 1},
    {"augment.background", KIND_FLOAT, AT(augment.background), 0, 1, 0.5},
    {"augment.roll", KIND_FLOAT, AT(augment.roll), 0, 90, 0},
    {"loss.vertex", KIND_FLOAT, TERM(TERM_VERTEX), 0, 1e6, 100},
    {"loss.rotation", KIND_FLOAT, TERM(TERM_ROTATION), 0, 1e6, 10},
    {"loss.translation", KIND_FLOAT, TERM(TERM_TRANSLATION), 0, 1e6, 5},
    {"loss.eye", KIND_FLOAT, TERM(TERM_EYE), 0, 1e6, 10},
    {"loss.landmark", KIND_FLOAT, TERM(TERM_LANDMARK), 0, 1e6, 1},
    {"loss.exp", KIND_FLOAT, TERM(TERM_EXP), 0, 1e6, 0},
    {"loss.jaw", KIND_FLOAT, TERM(TERM_JAW), 0, 1e6, 0},
    {"loss.lid", KIND_FLOAT, TERM(TERM_LID), 0, 1e6, 0},
    {"loss.mesh", KIND_FLOAT, TERM(TERM_MESH), 0, 1e6, 0},
    {"loss.feature", KIND_FLOAT, TERM(TERM_FEATURE), 0, 1e6, 0},
    {"loss.change", KIND_FLOAT, TERM(TERM_CHANGE), 0, 1e6, 0},
    {"loss.huber", KIND_FLOAT, AT(geometry.huber), 0, 1e6, 0},
    {"loss.square_landmarks", KIND_BOOL, AT(geometry.square_landmarks), 0, 1,
     1},
    {"loss.anchor_start", KIND_DOUBLE, AT(anchor_start), 0, 1e3, 1},
    {"loss.anchor_end", KIND_DOUBLE, AT(anchor_end), 0, 1e3, 1},
    {"loss.anchor_steps", KIND_INT, AT(anchor_steps), 0, 1e9, 0},
    {"loss.coarse", KIND_DOUBLE, AT(coarse), 0, 1e6, 1},
    {"loss.refined", KIND_DOUBLE, AT(refined), 0, 1e6, 1},
    {"loss.face", KIND_DOUBLE, AT(face), 0, 1e6, 1},
    {"loss.perceptual", KIND_DOUBLE, AT(perceptual), 0, 1e6, 1},
    {"loss.alignment", KIND_DOUBLE, AT(alignment), 0, 1e6, 1},
    {"loss.adversarial", KIND_DOUBLE, AT(adversarial), 0, 1e6, 0},
    {"loss.adversarial_from", KIND_INT, AT(adversarial_from), 0, 1e9, 0},
    {"loss.adversarial_rate", KIND_DOUBLE, AT(adversarial_rate), 0, 10, 2e-4},
    {"loss.adversarial_penalty", KIND_DOUBLE, AT(adversarial_penalty), 0, 1e6,
     1},
    {"loss.silhouette", KIND_DOUBLE, AT(silhouette), 0, 1e6, 0},
    {"loss.mouth", KIND_DOUBLE, AT(mouth), 0, 1e6, 0},
    {"loss.square", KIND_DOUBLE, AT(square), 0, 1e6, 0},
    {"loss.smooth", KIND_BOOL, AT(smooth), 0, 1, 0},
    {"log_every", KIND_INT, AT(log_every), 1, 1e9, 10},
    {"sheet_every", KIND_INT, AT(sheet_every), 0, 1e9, 0},
    {"checkpoint_every", KIND_INT, AT(checkpoint_every), 1, 1e9, 500},
    {"validation_every", KIND_INT, AT(validation_every), 0, 1e9, 0},
    {"validation_people", KIND_INT, AT(validation_people), 1, 1e6, 16},
};

static const char *const stages[STAGE_COUNT] = {
    "shape", "motion", "light", "sure", "matte", "avatar", "all"
};

const char *train_stage_name(enum train_stage stage)
{
    return stages[stage];
}

/* x into the field of a key, as its kind. */
static void config_store(struct train_config *c, const struct key *k, double x)
{
    char *at = (char *)c + k->offset;

    if (k->kind == KIND_INT)
        *(int64_t *)(void *)at = (int64_t)x;
    else if (k->kind == KIND_DOUBLE)
        *(double *)(void *)at = x;
    else if (k->kind == KIND_FLOAT)
        *(float *)(void *)at = (float)x;
    else
        *(bool *)(void *)at = x != 0;
}

/* A key of the table. */
static int config_set_number(struct train_config *c, const char *name,
                             const cJSON *value, struct error *err)
{
    const struct key *k = NULL;
    double x;

    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++)
        if (!strcmp(keys[i].name, name))
            k = &keys[i];
    if (!k)
        return error_set(err, EX_CONFIG, "%s: unknown key (see "
                         "spid-train(1) for the keys there are)", name);
    if (k->kind == KIND_BOOL) {
        if (!cJSON_IsBool(value))
            return error_set(err, EX_CONFIG, "%s: expected true or false",
                             name);
        config_store(c, k, cJSON_IsTrue(value));
        return 0;
    }
    if (!cJSON_IsNumber(value))
        return error_set(err, EX_CONFIG, "%s: not a number (expected %g to "
                         "%g)", name, k->min, k->max);
    x = value->valuedouble;
    if (!(x >= k->min && x <= k->max) ||
        (k->kind == KIND_INT && x != floor(x)))
        return error_set(err, EX_CONFIG, "%s: %g (expected %s%g to %g)", name,
                         x, k->kind == KIND_INT ? "a whole number, " : "",
                         k->min, k->max);
    config_store(c, k, x);
    return 0;
}

/* The stage by its name. */
static int config_set_stage(struct train_config *c, const cJSON *value,
                            struct error *err)
{
    for (int i = 0; cJSON_IsString(value) && i < STAGE_COUNT; i++)
        if (!strcmp(value->valuestring, stages[i])) {
            c->stage = (enum train_stage)i;
            return 0;
        }
    return error_set(err, EX_CONFIG, "stage: %s (expected shape, motion, "
                     "sure, matte, avatar or all)",
                     cJSON_IsString(value) ? value->valuestring
                                           : "not a string");
}

/* The beginning of names: "freeze" or "learn", in room for 64. */
static int config_set_names(char *out, const char *name, const cJSON *value,
                            struct error *err)
{
    const char *s = cJSON_GetStringValue(value);

    if (!s || strlen(s) >= 64)
        return error_set(err, EX_CONFIG, "%s: expected the beginning of "
                         "tensors' names", name);
    strcpy(out, s);
    return 0;
}

/* The file of a network's weights. */
static int config_set_file(char out[TRAIN_PATH], const char *name,
                           const cJSON *value, struct error *err)
{
    const char *s = cJSON_GetStringValue(value);

    if (!s || strlen(s) >= TRAIN_PATH)
        return error_set(err, EX_CONFIG, "%s: expected the name of a file",
                         name);
    strcpy(out, s);
    return 0;
}

/* Every key of an object, its name behind prefix. */
static int config_set_object(struct train_config *c, const cJSON *object,
                             const char *prefix, struct error *err)
{
    const cJSON *item;

    cJSON_ArrayForEach(item, object) {
        char name[120];

        snprintf(name, sizeof name, "%s%s%s", prefix, *prefix ? "." : "",
                 item->string);
        if (!strcmp(name, "stage")) {
            if (config_set_stage(c, item, err))
                return -1;
        } else if (!strcmp(name, "freeze") || !strcmp(name, "learn")) {
            if (config_set_names(*name == 'f' ? c->freeze : c->learn, name,
                                 item, err))
                return -1;
        } else if (!strcmp(name, "perceptual")) {
            if (config_set_file(c->perceptual_file, name, item, err))
                return -1;
        } else if (!strcmp(name, "alignment")) {
            if (config_set_file(c->alignment_file, name, item, err))
                return -1;
        } else if (!strcmp(name, "model")) {
            if (!cJSON_IsObject(item))
                return error_set(err, EX_CONFIG, "model: expected an "
                                 "object");
            free(c->model);
            c->model = cJSON_PrintUnformatted(item);
        } else if (cJSON_IsObject(item) && (!strcmp(name, "loss") ||
                                            !strcmp(name, "augment"))) {
            if (config_set_object(c, item, name, err))
                return -1;
        } else if (config_set_number(c, name, item, err)) {
            return -1;
        }
    }
    return 0;
}

/* What keys demand of each other; defaults that follow from others. */
static int config_check(struct train_config *c, struct error *err)
{
    if (!c->micro)
        c->micro = c->batch;
    if (c->batch % c->micro)
        return error_set(err, EX_CONFIG, "micro: %lld does not divide batch "
                         "%lld", (long long)c->micro, (long long)c->batch);
    if (c->rate_end < 0)
        c->rate_end = c->rate;
    if (c->stage >= STAGE_AVATAR && c->image % 32)
        return error_set(err, EX_CONFIG, "image: %lld (expected a multiple "
                         "of 32)", (long long)c->image);
    return 0;
}

int train_config_parse(struct train_config *c, const char *text,
                       const char *path, struct error *err)
{
    const char *end = NULL;
    cJSON *json = cJSON_ParseWithOpts(text, &end, 1);
    int rc = -1;

    memset(c, 0, sizeof *c);
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++)
        config_store(c, &keys[i], keys[i].normal);
    if (!json)
        error_set(err, EX_CONFIG, "not JSON at byte %ld",
                  (long)(end ? end - text : 0));
    else if (!cJSON_IsObject(json))
        error_set(err, EX_CONFIG, "expected a JSON object");
    else if (!cJSON_GetObjectItem(json, "stage"))
        error_set(err, EX_CONFIG, "stage: missing (expected shape, motion, "
                  "avatar or all)");
    else if (!config_set_object(c, json, "", err) && !config_check(c, err))
        rc = 0;
    cJSON_Delete(json);
    if (rc) {
        train_config_release(c);
        error_prefix(err, "%s", path);
    }
    return rc;
}

int train_config_load(struct train_config *c, const char *path,
                      struct error *err)
{
    char *text = file_read_text(path, 1 << 20, err);
    int rc = -1;

    memset(c, 0, sizeof *c);
    if (text)
        rc = train_config_parse(c, text, path, err);
    free(text);
    return rc;
}

void train_config_release(struct train_config *c)
{
    free(c->model);
    c->model = NULL;
}

const char *train_config_net(char *out, size_t size,
                             const struct train_config *c, const char *object,
                             const char *normal)
{
    cJSON *json = c->model ? cJSON_Parse(c->model) : NULL;
    const cJSON *part = json ? cJSON_GetObjectItem(json, object) : NULL;
    const cJSON *net = part ? cJSON_GetObjectItem(part, "net") : NULL;

    snprintf(out, size, "%s",
             cJSON_IsString(net) ? net->valuestring : normal);
    cJSON_Delete(json);
    return out;
}

double train_rate(const struct train_config *c, uint64_t step)
{
    double warm = (double)c->warmup, s = (double)step;
    double span = fmax(1, (double)c->steps - warm);
    double t = fmin(1, fmax(0, (s - warm) / span));
    double rate = c->rate_end + (c->rate - c->rate_end) * 0.5 *
                                    (1 + cos(3.14159265358979 * t));

    return s < warm ? rate * (s + 1) / warm : rate;
}

double train_anchor(const struct train_config *c, uint64_t step)
{
    double t = c->anchor_steps > 0
                   ? fmin(1, (double)step / (double)c->anchor_steps)
                   : 1;

    return c->anchor_start + (c->anchor_end - c->anchor_start) * t;
}
