/* The head of a stream: who made it, in which units, camera and window. */
#include "lib/track/conf.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/camera.h"
#include "lib/stream/records.h"

#define CONF_SIZE 512   /* pixels of a portrait window that no model sets */

/* An array of two numbers. */
static cJSON *conf_pair(double a, double b)
{
    const double v[2] = {a, b};

    return cJSON_CreateDoubleArray(v, 2);
}

/* The record's JSON, or NULL; the caller frees. */
static char *conf_print(const struct conf *c)
{
    cJSON *j = cJSON_CreateObject(), *camera;
    char *text;

    cJSON_AddStringToObject(j, "producer", c->producer);
    cJSON_AddStringToObject(j, "version", SPID_VERSION);
    cJSON_AddStringToObject(j, "units", "head");
    cJSON_AddNumberToObject(j, "scale", c->head->scale);
    camera = cJSON_AddObjectToObject(j, "camera");
    cJSON_AddNumberToObject(camera, "size", (double)(
                            c->size ? c->size
                            : c->model ? c->model->config.size : CONF_SIZE));
    cJSON_AddNumberToObject(camera, "focal", CAMERA_FOCAL);
    if (c->fps_num > 0)
        cJSON_AddItemToObject(j, "fps", conf_pair(c->fps_num, c->fps_den));
    else if (c->rate > 0)
        cJSON_AddNumberToObject(j, "fps", c->rate);
    if (c->sound) {
        cJSON *sound = cJSON_AddObjectToObject(j, "sound");

        cJSON_AddStringToObject(sound, "clip", c->sound);
        cJSON_AddNumberToObject(sound, "start", c->sound_start);
    }
    if (c->width)
        cJSON_AddItemToObject(j, "picture",
                              conf_pair((double)c->width, (double)c->height));
    if (c->window) {
        const double q[3] = {c->window->x, c->window->y, c->window->size};
        cJSON_AddItemToObject(j, "window", cJSON_CreateDoubleArray(q, 3));
    }
    if (c->seed)
        cJSON_AddNumberToObject(j, "seed", (double)*c->seed);
    cJSON_AddStringToObject(j, "head_hash", c->head->hash);
    if (c->model)
        cJSON_AddStringToObject(j, "model_hash", c->model->hash);
    text = cJSON_PrintUnformatted(j);
    cJSON_Delete(j);
    return text;
}

int conf_write(struct stream_writer *w, const struct conf *c,
               struct error *err)
{
    char *text = conf_print(c);
    int rc;

    if (!text)
        return error_set(err, EX_OSERR, "no memory for CONF");
    rc = conf_text_write(w, text, err);
    free(text);
    return rc;
}

int square_parse(const char *value, void *dest, struct error *err)
{
    struct square *q = dest;
    char rest;

    if (sscanf(value, "%lf,%lf,%lf%c", &q->x, &q->y, &q->size, &rest) == 3
        && fabs(q->x) <= 1e6 && fabs(q->y) <= 1e6 && q->size >= 1
        && q->size <= 1e5)
        return 0;
    return error_set(err, EX_USAGE, "not a square (expected X,Y,SIZE: centre "
                     "and side in pixels, side 1 to 100000)");
}
