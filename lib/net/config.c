/* The configuration's JSON, read with ranges and printed in one order. */
#include "lib/net/config.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/file.h"

void avatar_config_paper(struct avatar_config *c)
{
    *c = (struct avatar_config){
        .size = 512, .plane = 296, .mouth = 32, .channels = 32,
        .feature = 256,
        .motion_net = "mobilenetv3_small_100",
        .shape_net = "tf_mobilenetv3_large_minimal_100",
        .backbone = {.type = BACKBONE_DINOV2, .features = 256, .size = 296,
                     .width = 16, .embed = 768, .depth = 12, .heads = 12,
                     .patch = 14, .image = 518},
        .init_width = 64, .static_width = 128, .dynamic_width = 256,
        .dynamic_hidden = 128, .vertex_width = 256, .mouth_width = 128,
        .has_refiner = true,
        .refiner = {.type = REFINER_STYLE_UNET, .channels = 32, .width = 32,
                    .multiplier = 1, .size = 512}
    };
}

void avatar_config_gagavatar(struct avatar_config *c)
{
    avatar_config_paper(c);
    c->system = SYSTEM_GAGAVATAR;
    c->public_quirks = true;
}

const char *avatar_config_refiner(const struct avatar_config *c)
{
    return c->system == SYSTEM_GAGAVATAR ? "upsampler." : "refine.";
}

void avatar_config_shipped(struct avatar_config *c)
{
    avatar_config_paper(c);
    snprintf(c->motion_net, sizeof c->motion_net, "mobilenetv3_small_150");
    snprintf(c->shape_net, sizeof c->shape_net, "mobilenetv3_small_100");
    c->feature = 32;
    c->backbone.type = BACKBONE_SMALL;
    c->backbone.features = 32;
    c->backbone.size = c->plane;
    c->init_width = 0;
    c->static_width = 32;
    c->dynamic_width = 64;
    c->dynamic_hidden = 32;
    c->vertex_width = 16;
    c->mouth = 64;
    c->mouth_width = 32;
    c->rgb_skip = true;
    c->refiner.type = REFINER_NARROW;
    c->refiner.turn = true;
}

/* ---- reading ----------------------------------------------------------- */

/* obj.key as a whole number between lo and hi; unchanged when absent. */
static int config_take_size(size_t *out, const cJSON *obj, const char *key,
                            size_t lo, size_t hi, struct error *err)
{
    const cJSON *v = obj ? cJSON_GetObjectItem(obj, key) : NULL;

    if (!v)
        return 0;
    double d = v->valuedouble;
    if (!cJSON_IsNumber(v) || d != floor(d) || d < (double)lo ||
        d > (double)hi) {
        char *text = cJSON_PrintUnformatted(v);
        error_set(err, EX_CONFIG, "configuration: %s is %.60s (expected a "
                  "whole number from %zu to %zu)", key, text ? text : "?", lo,
                  hi);
        cJSON_free(text);
        return -1;
    }
    *out = (size_t)d;
    return 0;
}

/* obj.key as a truth value; unchanged when absent. */
static int config_take_bool(bool *out, const cJSON *obj, const char *key,
                            struct error *err)
{
    const cJSON *v = cJSON_GetObjectItem(obj, key);

    if (v && !cJSON_IsBool(v))
        return error_set(err, EX_CONFIG, "configuration: %s is not a truth "
                         "value (expected true or false)", key);
    if (v)
        *out = cJSON_IsTrue(v);
    return 0;
}

/* obj.key as a string; unchanged when absent. */
static int config_take_text(char *out, size_t room, const cJSON *obj,
                            const char *key, struct error *err)
{
    const cJSON *v = obj ? cJSON_GetObjectItem(obj, key) : NULL;

    if (!v)
        return 0;
    if (!cJSON_IsString(v) || strlen(v->valuestring) >= room)
        return error_set(err, EX_CONFIG, "configuration: %s is no name "
                         "(expected a string under %zu characters)", key,
                         room);
    snprintf(out, room, "%s", v->valuestring);
    return 0;
}

/* The object "backbone". */
static int config_take_backbone(struct avatar_config *c, const cJSON *root,
                                struct error *err)
{
    const cJSON *b = cJSON_GetObjectItem(root, "backbone");
    struct backbone_config *k = &c->backbone;
    char type[16] = "dinov2";

    if (config_take_text(type, sizeof type, b, "type", err))
        return -1;
    if (strcmp(type, "small") && strcmp(type, "dinov2"))
        return error_set(err, EX_CONFIG, "configuration: backbone type is "
                         "\"%s\" (expected \"small\" or \"dinov2\")", type);
    k->type = type[0] == 's' ? BACKBONE_SMALL : BACKBONE_DINOV2;
    if (config_take_size(&k->width, b, "width", 1, 1024, err) ||
        config_take_size(&k->embed, b, "embed", 1, 4096, err) ||
        config_take_size(&k->depth, b, "depth", 4, 64, err) ||
        config_take_size(&k->heads, b, "heads", 1, 64, err) ||
        config_take_size(&k->patch, b, "patch", 1, 64, err) ||
        config_take_size(&k->image, b, "image", 14, 4096, err))
        return -1;
    k->features = c->feature;
    k->size = c->plane;
    return 0;
}

/* The object "refiner"; without one the model has none. */
static int config_take_refiner(struct avatar_config *c, const cJSON *root,
                               struct error *err)
{
    const cJSON *r = cJSON_GetObjectItem(root, "refiner");
    char type[16] = "narrow";

    c->has_refiner = cJSON_IsObject(r);
    if (!c->has_refiner)
        return 0;
    const cJSON *m = cJSON_GetObjectItem(r, "multiplier");
    if (config_take_text(type, sizeof type, r, "type", err) ||
        config_take_size(&c->refiner.width, r, "width", 1, 1024, err) ||
        config_take_bool(&c->refiner.turn, r, "turn", err) ||
        config_take_bool(&c->refiner.photo, r, "photo", err))
        return -1;
    if (strcmp(type, "narrow") && strcmp(type, "style_unet"))
        return error_set(err, EX_CONFIG, "configuration: refiner type is "
                         "\"%s\" (expected \"narrow\" or \"style_unet\")",
                         type);
    if (m && (!cJSON_IsNumber(m) || !(m->valuedouble > 0) ||
              m->valuedouble > 16))
        return error_set(err, EX_CONFIG, "configuration: refiner multiplier "
                         "is no number in (0,16]");
    c->refiner.type = type[0] == 'n' ? REFINER_NARROW : REFINER_STYLE_UNET;
    if (c->refiner.photo && c->refiner.type != REFINER_NARROW)
        return error_set(err, EX_CONFIG, "configuration: refiner photo is "
                         "true (expected false: only a narrow one has it)");
    c->refiner.channels = c->channels;
    c->refiner.size = c->size;
    c->refiner.multiplier = m ? (float)m->valuedouble : 1;
    return 0;
}

/* "system". */
static int config_take_system(struct avatar_config *c, const cJSON *root,
                              struct error *err)
{
    char word[16] = "spid";

    if (config_take_text(word, sizeof word, root, "system", err))
        return -1;
    if (strcmp(word, "spid") && strcmp(word, "gagavatar"))
        return error_set(err, EX_CONFIG, "configuration: system is \"%s\" "
                         "(expected \"spid\" or \"gagavatar\")", word);
    c->system = word[0] == 's' ? SYSTEM_SPID : SYSTEM_GAGAVATAR;
    return 0;
}

/* Every key. */
static int config_take_all(struct avatar_config *c, const cJSON *root,
                           struct error *err)
{
    const cJSON *dynamic = cJSON_GetObjectItem(root, "dynamic");
    size_t version = 1, focal = 12;

    if (config_take_size(&version, root, "version", 1, 1, err) ||
        config_take_size(&focal, root, "focal", 12, 12, err) ||
        config_take_system(c, root, err) ||
        config_take_size(&c->size, root, "size", 16, 4096, err) ||
        config_take_size(&c->plane, root, "plane", 2, 2048, err) ||
        config_take_size(&c->mouth, root, "mouth", 2, 512, err) ||
        config_take_size(&c->channels, root, "channels", 3, 32, err) ||
        config_take_size(&c->feature, root, "feature", 1, 4096, err) ||
        config_take_text(c->head_hash, sizeof c->head_hash, root, "head_hash",
                         err) ||
        config_take_text(c->motion_net, sizeof c->motion_net,
                         cJSON_GetObjectItem(root, "motion"), "net", err) ||
        config_take_text(c->shape_net, sizeof c->shape_net,
                         cJSON_GetObjectItem(root, "shape"), "net", err) ||
        config_take_size(&c->init_width, cJSON_GetObjectItem(root, "init"),
                         "width", 0, 1024, err) ||
        config_take_size(&c->static_width, cJSON_GetObjectItem(root, "static"),
                         "width", 1, 1024, err) ||
        config_take_size(&c->dynamic_width, dynamic, "width", 1, 4096, err) ||
        config_take_size(&c->dynamic_hidden, dynamic, "head", 1, 4096, err) ||
        config_take_size(&c->vertex_width, dynamic, "vertex", 1, 4096, err) ||
        config_take_size(&c->mouth_width,
                         cJSON_GetObjectItem(root, "mouth_decoder"), "width",
                         1, 1024, err) ||
        config_take_bool(&c->rgb_skip, root, "rgb_skip", err) ||
        config_take_bool(&c->public_quirks, root, "public_quirks", err))
        return -1;
    return config_take_backbone(c, root, err) ||
                   config_take_refiner(c, root, err)
               ? -1
               : 0;
}

int avatar_config_parse(struct avatar_config *c, const char *json,
                        struct error *err)
{
    const char *stop = NULL;
    cJSON *root = cJSON_ParseWithOpts(json, &stop, 1);
    int rc = -1;

    avatar_config_paper(c);
    if (!cJSON_IsObject(root))
        error_set(err, EX_CONFIG, "configuration: not a JSON object near "
                  "\"%.20s\"", stop ? stop : json);
    else
        rc = config_take_all(c, root, err);
    cJSON_Delete(root);
    return rc;
}

int avatar_config_load(struct avatar_config *c, const char *path,
                       struct error *err)
{
    char *text = file_read_text(path, 1 << 20, err);
    int rc = -1;

    if (!text)
        return -1;
    cJSON *root = cJSON_Parse(text);
    const cJSON *model = cJSON_GetObjectItem(root, "model");
    char *json = model ? cJSON_PrintUnformatted(model) : NULL;
    rc = avatar_config_parse(c, json ? json : text, err);
    if (rc)
        error_prefix(err, "%s", path);
    cJSON_free(json);
    cJSON_Delete(root);
    free(text);
    return rc;
}

/* ---- writing ----------------------------------------------------------- */

/* A new object under key. */
static cJSON *config_object(cJSON *root, const char *key)
{
    return cJSON_AddObjectToObject(root, key);
}

/* A whole number under key. */
static void config_put(cJSON *obj, const char *key, size_t value)
{
    cJSON_AddNumberToObject(obj, key, (double)value);
}

/* The object "backbone". */
static void config_put_backbone(cJSON *root, const struct backbone_config *k)
{
    cJSON *b = config_object(root, "backbone");

    if (k->type == BACKBONE_SMALL) {
        cJSON_AddStringToObject(b, "type", "small");
        config_put(b, "width", k->width);
        return;
    }
    cJSON_AddStringToObject(b, "type", "dinov2");
    config_put(b, "embed", k->embed);
    config_put(b, "depth", k->depth);
    config_put(b, "heads", k->heads);
    config_put(b, "patch", k->patch);
    config_put(b, "image", k->image);
}

/* The object "refiner", or null. */
static void config_put_refiner(cJSON *root, const struct avatar_config *c)
{
    if (!c->has_refiner) {
        cJSON_AddNullToObject(root, "refiner");
        return;
    }
    cJSON *r = config_object(root, "refiner");
    if (c->refiner.type == REFINER_NARROW) {
        cJSON_AddStringToObject(r, "type", "narrow");
        config_put(r, "width", c->refiner.width);
        cJSON_AddBoolToObject(r, "turn", c->refiner.turn);
        if (c->refiner.photo)
            cJSON_AddBoolToObject(r, "photo", true);
    } else {
        cJSON_AddStringToObject(r, "type", "style_unet");
        cJSON_AddNumberToObject(r, "multiplier",
                                (double)c->refiner.multiplier);
    }
}

char *avatar_config_print(const struct avatar_config *c)
{
    cJSON *root = cJSON_CreateObject();

    config_put(root, "version", 1);
    if (c->system == SYSTEM_GAGAVATAR)
        cJSON_AddStringToObject(root, "system", "gagavatar");
    config_put(root, "size", c->size);
    config_put(root, "focal", 12);
    config_put(root, "plane", c->plane);
    config_put(root, "mouth", c->mouth);
    config_put(root, "channels", c->channels);
    config_put(root, "feature", c->feature);
    cJSON_AddStringToObject(root, "head_hash", c->head_hash);
    cJSON_AddStringToObject(config_object(root, "motion"), "net",
                            c->motion_net);
    cJSON_AddStringToObject(config_object(root, "shape"), "net", c->shape_net);
    config_put_backbone(root, &c->backbone);
    config_put(config_object(root, "init"), "width", c->init_width);
    config_put(config_object(root, "static"), "width", c->static_width);
    cJSON *d = config_object(root, "dynamic");
    config_put(d, "width", c->dynamic_width);
    config_put(d, "head", c->dynamic_hidden);
    config_put(d, "vertex", c->vertex_width);
    config_put(config_object(root, "mouth_decoder"), "width", c->mouth_width);
    cJSON_AddBoolToObject(root, "rgb_skip", c->rgb_skip);
    cJSON_AddBoolToObject(root, "public_quirks", c->public_quirks);
    config_put_refiner(root, c);
    char *text = cJSON_PrintUnformatted(root);
    cJSON_Delete(root);
    return text;
}
