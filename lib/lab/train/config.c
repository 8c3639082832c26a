/* The run's JSON by a table of keys, each with its range and default; the
 * learning rate and lambda_3 over the steps. */
#include "lib/lab/train/config.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/file.h"
#include "lib/base/keys.h"

#define AT(field) offsetof(struct train_config, field)
#define TERM(t) (AT(geometry.term) + (t) * sizeof(float))

static const char *const stages[STAGE_COUNT + 1] = {
    "shape", "motion", "light", "sure", "matte", "avatar", "all", NULL
};

static const struct key keys[] = {
    {"seed", KEY_INT, AT(seed), 0, 9e15, 1, NULL},
    {"steps", KEY_INT, AT(steps), 0, 1e9, 1000, NULL},
    {"batch", KEY_INT, AT(batch), 1, 4096, 8, NULL},
    {"micro", KEY_INT, AT(micro), 0, 4096, 0, NULL},
    {"rate", KEY_DOUBLE, AT(rate), 0, 10, 1e-4, NULL},
    {"rate_end", KEY_DOUBLE, AT(rate_end), -1, 10, -1, NULL},
    {"warmup", KEY_INT, AT(warmup), 0, 1e9, 0, NULL},
    {"clip", KEY_DOUBLE, AT(clip), 0, 1e9, 0, NULL},
    {"average", KEY_DOUBLE, AT(average), 0, 0.999999, 0.999, NULL},
    {"running_norm", KEY_BOOL, AT(running_norm), 0, 1, 0, NULL},
    {"pool", KEY_INT, AT(pool), 1, 1e6, 64, NULL},
    {"people_per_step", KEY_DOUBLE, AT(people_per_step), 0, 1e3, 0.1, NULL},
    {"image", KEY_INT, AT(image), 32, 4096, 512, NULL},
    {"targets", KEY_INT, AT(targets), 1, 64, 1, NULL},
    {"augment.jitter", KEY_FLOAT, AT(augment.jitter), 0, 4, 1, NULL},
    {"augment.colour", KEY_FLOAT, AT(augment.colour), 0, 2, 1, NULL},
    {"augment.background", KEY_FLOAT, AT(augment.background), 0, 1, 0.5, NULL},
    {"augment.roll", KEY_FLOAT, AT(augment.roll), 0, 90, 0, NULL},
    {"loss.vertex", KEY_FLOAT, TERM(TERM_VERTEX), 0, 1e6, 100, NULL},
    {"loss.rotation", KEY_FLOAT, TERM(TERM_ROTATION), 0, 1e6, 10, NULL},
    {"loss.translation", KEY_FLOAT, TERM(TERM_TRANSLATION), 0, 1e6, 5, NULL},
    {"loss.eye", KEY_FLOAT, TERM(TERM_EYE), 0, 1e6, 10, NULL},
    {"loss.landmark", KEY_FLOAT, TERM(TERM_LANDMARK), 0, 1e6, 1, NULL},
    {"loss.exp", KEY_FLOAT, TERM(TERM_EXP), 0, 1e6, 0, NULL},
    {"loss.jaw", KEY_FLOAT, TERM(TERM_JAW), 0, 1e6, 0, NULL},
    {"loss.lid", KEY_FLOAT, TERM(TERM_LID), 0, 1e6, 0, NULL},
    {"loss.mesh", KEY_FLOAT, TERM(TERM_MESH), 0, 1e6, 0, NULL},
    {"loss.feature", KEY_FLOAT, TERM(TERM_FEATURE), 0, 1e6, 0, NULL},
    {"loss.change", KEY_FLOAT, TERM(TERM_CHANGE), 0, 1e6, 0, NULL},
    {"loss.huber", KEY_FLOAT, AT(geometry.huber), 0, 1e6, 0, NULL},
    {"loss.square_landmarks", KEY_BOOL, AT(geometry.square_landmarks), 0, 1,
     1, NULL},
    {"loss.anchor_start", KEY_DOUBLE, AT(anchor_start), 0, 1e3, 1, NULL},
    {"loss.anchor_end", KEY_DOUBLE, AT(anchor_end), 0, 1e3, 1, NULL},
    {"loss.anchor_steps", KEY_INT, AT(anchor_steps), 0, 1e9, 0, NULL},
    {"loss.coarse", KEY_DOUBLE, AT(coarse), 0, 1e6, 1, NULL},
    {"loss.refined", KEY_DOUBLE, AT(refined), 0, 1e6, 1, NULL},
    {"loss.face", KEY_DOUBLE, AT(face), 0, 1e6, 1, NULL},
    {"loss.perceptual", KEY_DOUBLE, AT(perceptual), 0, 1e6, 1, NULL},
    {"loss.alignment", KEY_DOUBLE, AT(alignment), 0, 1e6, 1, NULL},
    {"loss.adversarial", KEY_DOUBLE, AT(adversarial), 0, 1e6, 0, NULL},
    {"loss.adversarial_from", KEY_INT, AT(adversarial_from), 0, 1e9, 0, NULL},
    {"loss.adversarial_rate", KEY_DOUBLE, AT(adversarial_rate), 0, 10, 2e-4,
     NULL},
    {"loss.adversarial_penalty", KEY_DOUBLE, AT(adversarial_penalty), 0, 1e6,
     1, NULL},
    {"loss.silhouette", KEY_DOUBLE, AT(silhouette), 0, 1e6, 0, NULL},
    {"loss.mouth", KEY_DOUBLE, AT(mouth), 0, 1e6, 0, NULL},
    {"loss.square", KEY_DOUBLE, AT(square), 0, 1e6, 0, NULL},
    {"loss.smooth", KEY_BOOL, AT(smooth), 0, 1, 0, NULL},
    {"log_every", KEY_INT, AT(log_every), 1, 1e9, 10, NULL},
    {"sheet_every", KEY_INT, AT(sheet_every), 0, 1e9, 0, NULL},
    {"checkpoint_every", KEY_INT, AT(checkpoint_every), 1, 1e9, 500, NULL},
    {"validation_every", KEY_INT, AT(validation_every), 0, 1e9, 0, NULL},
    {"validation_people", KEY_INT, AT(validation_people), 1, 1e6, 16, NULL},
    {"stage", KEY_WORD, AT(stage), 0, 0, 0, stages},
    {"freeze", KEY_TEXT, AT(freeze), 0, TRAIN_NAMES, 0, NULL},
    {"learn", KEY_TEXT, AT(learn), 0, TRAIN_NAMES, 0, NULL},
    {"perceptual", KEY_TEXT, AT(perceptual_file), 0, TRAIN_PATH, 0, NULL},
    {"alignment", KEY_TEXT, AT(alignment_file), 0, TRAIN_PATH, 0, NULL},
    {"model", KEY_JSON, AT(model), 0, 0, 0, NULL},
};
enum { KEYS = sizeof keys / sizeof *keys };

const char *train_stage_name(enum train_stage stage)
{
    return stages[stage];
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
    keys_set_normal(c, keys, KEYS);
    if (!json)
        error_set(err, EX_CONFIG, "not JSON at byte %ld",
                  (long)(end ? end - text : 0));
    else if (!cJSON_IsObject(json))
        error_set(err, EX_CONFIG, "expected a JSON object");
    else if (!cJSON_GetObjectItem(json, "stage"))
        error_set(err, EX_CONFIG, "stage: missing (expected shape, motion, "
                  "light, sure, matte, avatar or all)");
    else if (!keys_read(c, keys, KEYS, json, true, err))
        rc = config_check(c, err);
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
                                    (1 + cos(M_PI * t));

    return s < warm ? rate * (s + 1) / warm : rate;
}

double train_anchor(const struct train_config *c, uint64_t step)
{
    double t = c->anchor_steps > 0
                   ? fmin(1, (double)step / (double)c->anchor_steps)
                   : 1;

    return c->anchor_start + (c->anchor_end - c->anchor_start) * t;
}
