/* Options that several programs have, with one wording and one parser. */
#ifndef SPID_CMD_OPTIONS_H
#define SPID_CMD_OPTIONS_H

#include "cmd/cli.h"
#include "lib/head/head.h"
#include "lib/nn/nn.h"

struct animation_options;
struct model;
struct prepare;
struct track_faces;

/* Rows of an option table. */
#define OPTION_HEAD(path)                                                     \
    OPTION_STRING("head", 0, path, "FILE",                                    \
                  "head model (default head.safetensors beside the model)")
#define OPTION_PRECISION(type, where)                                         \
    OPTION_CALL("precision", 0, type, "TYPE", option_precision,               \
                "f32, fast or bf16 inside the " where " (default fast)")
#define OPTION_PRECISION_DEFAULT NN_FAST
/* The same where a refiner runs. */
#define OPTION_PRECISION_REFINE(type, where)                                  \
    OPTION_CALL("precision", 0, type, "TYPE", option_precision_refine,        \
                "f32, fast, bf16 or int8 inside the " where " (default fast)")
/* track: a struct track_options; its crop or window, and that it is given. */
#define OPTION_CROP(track, help)                                              \
    OPTION_CALL("crop", 0, track, "X,Y,SIZE", option_crop, help)
/* number: a struct track_options' face. */
#define OPTION_FACE(name, number, whose)                                      \
    OPTION_INT(name, 0, number, 1, TRACK_FACES, "N",                          \
               "which face of " whose ", the largest is 1")
#define OPTION_WINDOW(track, help)                                            \
    OPTION_CALL("window", 0, track, "X,Y,SIZE", option_window, help)
/* neutral: a struct neutral. */
#define OPTION_NEUTRAL(neutral)                                               \
    OPTION_CALL("neutral", 0, neutral, "FRAME", neutral_parse,                \
                "first, auto or a number: the driver's frame at rest "        \
                "(default first)")
/* flag: a struct track_options' no_tta. */
#define OPTION_NO_TTA(flag)                                                   \
    OPTION_FLAG("no-tta", 0, flag,                                            \
                "no test-time augmentation of the encoder: faster, less "     \
                "exact")
/* light: a struct target_light. */
#define OPTION_LIGHT(light)                                                   \
    OPTION_CALL("light", 0, light, "LIGHT", target_light_parse,               \
                "AZIMUTH,ELEVATION[,STRENGTH][,#RRGGBB], a panorama, driver "  \
                "or source (default)")
/* Rows of what spid animate and spid live both do; o: a struct
 * animation_options. */
#define OPTIONS_ANIMATION(o)                                                  \
    OPTION_FLAG("star", 's', &(o).animate.pipeline.star,                      \
                "SpiD*: draw three channels, no refiner"),                    \
    OPTION_STRING("mask", 0, &(o).mask, "FILE",                               \
                  "matte of the source: white where the person is"),          \
    OPTION_CROP(&models.track, "the source's face, middle and side"),         \
    OPTION_FACE("face", &models.track.face, "the source"),                    \
    OPTION_FACE("driver-face", &(o).track.face, "the driver"),                \
    OPTION_NO_TTA(&(o).track.no_tta),                                         \
    OPTION_LIGHT(&(o).light),                                                 \
    OPTION_FLOAT("fps", 0, &(o).source.rate, 0.001, 100000, "RATE",           \
                 "frames a second of what has no times (default 25)"),        \
    OPTION_PRECISION_REFINE(&(o).animate.pipeline.precision, "networks"),     \
    OPTION_HEAD(&(o).head)

/* Their parsers: dest is an enum nn_type, a struct track_options. */
int option_precision(const char *value, void *dest, struct error *err);
/* The same with int8, for what runs a refiner. */
int option_precision_refine(const char *value, void *dest, struct error *err);
/* Once all options are known: int8 where the processor has none is NN_FAST,
 * and a warning says so. */
void option_precision_settle(enum nn_type *type);
/* dest: a struct track_options, whose crop is set and marked as given. */
int option_crop(const char *value, void *dest, struct error *err);
/* The same for its portrait window. */
int option_window(const char *value, void *dest, struct error *err);

/* *bits = bit k for each word k (of `names`, until NULL) in `value`, which may
 * have commas. */
int option_words(unsigned *bits, const char *value, const char *const *names,
                 struct error *err);

/* Load the head of --head, or when that was not given (NULL) the one that
 * cli_find_model finds. */
int option_head_load(struct head *h, const char *path, struct error *err);
/* Open the model of -m, or the one that cli_find_model finds. */
int option_model_open(struct model *m, struct error *err);

/* Open the model of -m and the head for animations, with as many workers as -j
 * says; dies when they cannot be. */
void option_animation_load(struct prepare *models,
                           struct animation_options *opt);
/* What is to be said of a finished output: its size, and that the driver's
 * sound is not in it. */
struct animation;
void option_animation_done(const struct animation *a);
/* Say that pictures go without the sound of a clip that is not there. */
struct framesink;
void option_sound_tell(const struct framesink *s);
/* Say what is to be said of a source's picture. */
struct source_notes;
void option_source_tell(const char *name, const struct source_notes *n);
/* Say where the faces of an input are, when there are several, and which was
 * taken; `option` takes another. */
void option_faces_tell(const char *name, const struct track_faces *faces,
                       const char *option);
/* The same of a clip that was looked through for its first face, and what its
 * frames before that get. */
struct driver;
void option_driver_tell(const char *name, const struct driver *d,
                        const char *option);
/* Say how many pictures of a clip are damaged. */
struct framesource;
void option_damage_tell(const char *name, const struct framesource *in);
/* Say that a driver's face was lost, or found again, in this frame. */
struct track_result;
void option_track_tell(const char *name, uint64_t frame,
                       const struct track_result *r);

#endif
