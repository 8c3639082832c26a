/* The configuration as a table of keys. */
#include "lib/net/config.h"

#include <stdio.h>
#include <stdlib.h>
#include <sysexits.h>

#include "lib/base/file.h"
#include "lib/base/keys.h"

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
        .transformer_layers = 10, .transformer_heads = 16,
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

void avatar_config_lam(struct avatar_config *c)
{
    avatar_config_paper(c);
    c->system = SYSTEM_LAM;
    c->channels = 3;
    c->feature = 1024;
    c->backbone = (struct backbone_config){
        .type = BACKBONE_DINOV2, .features = c->feature, .size = c->plane,
        .width = 16, .embed = 1024, .depth = 24, .heads = 16, .patch = 14,
        .image = 504, .registers = 4};
    c->dynamic_width = 1024;
    c->dynamic_hidden = 512;
    c->has_refiner = false;
}

unsigned avatar_config_without(const struct avatar_config *c)
{
    return c->without ? 1u << (c->without - 1) : 0;
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

/* ---- as JSON ------------------------------------------------------------- */

#define AT(field) offsetof(struct avatar_config, field)
#define SIZE(name, field, min, max)                                           \
    {name, KEY_SIZE, AT(field), min, max, 0, NULL}
#define FLAG(name, field) {name, KEY_BOOL, AT(field), 0, 1, 0, NULL}
#define TEXT(name, field)                                                     \
    {name, KEY_TEXT, AT(field), 0, sizeof ((struct avatar_config *)0)->field, \
     0, NULL}
#define WORD(name, field, words) {name, KEY_WORD, AT(field), 0, 0, 0, words}

static const char *const systems[] = {
    [SYSTEM_SPID] = "spid", [SYSTEM_GAGAVATAR] = "gagavatar",
    [SYSTEM_LAM] = "lam", NULL
};
static const char *const backbones[] = {
    [BACKBONE_SMALL] = "small", [BACKBONE_DINOV2] = "dinov2", NULL
};
static const char *const refiners[] = {
    [REFINER_NARROW] = "narrow", [REFINER_STYLE_UNET] = "style_unet", NULL
};
const char *const avatar_config_parts[] = {
    "nothing", "dynamic", "static", "mouth", "interp", "deform", "neck", NULL
};

static const struct key keys[] = {
    {"version", KEY_SIZE, 0, 1, 1, 0, NULL},
    WORD("system", system, systems),
    SIZE("size", size, 16, 4096),
    {"focal", KEY_SIZE, 0, 12, 12, 0, NULL},
    SIZE("plane", plane, 2, 2048),
    SIZE("mouth", mouth, 2, 512),
    SIZE("channels", channels, 3, 32),
    SIZE("feature", feature, 1, 4096),
    TEXT("head_hash", head_hash),
    TEXT("motion.net", motion_net),
    TEXT("shape.net", shape_net),
    WORD("backbone.type", backbone.type, backbones),
    SIZE("backbone.width", backbone.width, 1, 1024),
    SIZE("backbone.embed", backbone.embed, 1, 4096),
    SIZE("backbone.depth", backbone.depth, 4, 64),
    SIZE("backbone.heads", backbone.heads, 1, 64),
    SIZE("backbone.patch", backbone.patch, 1, 64),
    SIZE("backbone.image", backbone.image, 14, 4096),
    SIZE("backbone.registers", backbone.registers, 0, 64),
    SIZE("init.width", init_width, 0, 1024),
    SIZE("static.width", static_width, 1, 1024),
    SIZE("dynamic.width", dynamic_width, 1, 4096),
    SIZE("dynamic.head", dynamic_hidden, 1, 4096),
    SIZE("dynamic.vertex", vertex_width, 1, 4096),
    SIZE("mouth_decoder.width", mouth_width, 1, 1024),
    SIZE("transformer.layers", transformer_layers, 1, 64),
    SIZE("transformer.heads", transformer_heads, 1, 64),
    FLAG("rgb_skip", rgb_skip),
    FLAG("public_quirks", public_quirks),
    WORD("without", without, avatar_config_parts),
    WORD("refiner.type", refiner.type, refiners),
    SIZE("refiner.width", refiner.width, 1, 1024),
    FLAG("refiner.turn", refiner.turn),
    FLAG("refiner.photo", refiner.photo),
    {"refiner.multiplier", KEY_FLOAT, AT(refiner.multiplier), 1e-3, 16, 0,
     NULL},
};
enum { KEYS = sizeof keys / sizeof *keys };

/* What keys demand of each other, and sizes that follow from others. */
static int config_check(struct avatar_config *c, struct error *err)
{
    if (c->refiner.photo && c->refiner.type != REFINER_NARROW)
        return error_set(err, EX_CONFIG, "refiner.photo: true (expected false: "
                         "only a narrow one has it)");
    if (c->backbone.registers && c->system != SYSTEM_LAM)
        return error_set(err, EX_CONFIG, "backbone.registers: %zu (expected 0: "
                         "only \"lam\" has any)", c->backbone.registers);
    c->backbone.features = c->feature;
    c->backbone.size = c->plane;
    c->refiner.channels = c->channels;
    c->refiner.size = c->size;
    return 0;
}

int avatar_config_parse(struct avatar_config *c, const char *json,
                        struct error *err)
{
    const char *stop = NULL;
    cJSON *root = cJSON_ParseWithOpts(json, &stop, 1);
    int rc = -1;

    avatar_config_paper(c);
    c->refiner.type = REFINER_NARROW;
    c->has_refiner = cJSON_IsObject(cJSON_GetObjectItem(root, "refiner"));
    if (!cJSON_IsObject(root))
        error_set(err, EX_CONFIG, "not a JSON object near \"%.20s\"",
                  stop ? stop : json);
    else if (!keys_read(c, keys, KEYS, root, false, err))
        rc = config_check(c, err);
    cJSON_Delete(root);
    return rc ? error_prefix(err, "configuration") : 0;
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

char *avatar_config_print(const struct avatar_config *c)
{
    cJSON *root = cJSON_CreateObject();

    keys_print(root, keys, KEYS, c);
    if (!c->has_refiner)
        cJSON_ReplaceItemInObject(root, "refiner", cJSON_CreateNull());
    char *text = cJSON_PrintUnformatted(root);
    cJSON_Delete(root);
    return text;
}
