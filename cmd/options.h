/* Options that several programs have, with one wording and one parser. */
#ifndef SPID_CMD_OPTIONS_H
#define SPID_CMD_OPTIONS_H

#include "cmd/cli.h"
#include "lib/head/head.h"

struct model;

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
#define OPTION_WINDOW(track, help)                                            \
    OPTION_CALL("window", 0, track, "X,Y,SIZE", option_window, help)
/* bits: unsigned of enum avatar_without. */
#define OPTION_WITHOUT(bits)                                                  \
    OPTION_CALL("without", 0, bits, "PART", option_without,                   \
                "leave out dynamic, static, mouth, interp, deform or neck "   \
                "(commas)")
/* flag: a struct track_options' no_tta; --once is an older name. */
#define OPTION_NO_TTA(flag)                                                   \
    OPTION_FLAG("no-tta", 0, flag,                                            \
                "no test-time augmentation of the encoder: faster, less "     \
                "exact"),                                                     \
    OPTION_FLAG("once", 0, flag, "the same as --no-tta")

/* Their parsers: dest is an enum nn_type, a struct track_options. */
int option_precision(const char *value, void *dest, struct error *err);
int option_precision_refine(const char *value, void *dest, struct error *err);
int option_crop(const char *value, void *dest, struct error *err);
int option_window(const char *value, void *dest, struct error *err);
int option_without(const char *value, void *dest, struct error *err);

/* Load the head of --head, or when that was not given (NULL) the one that
 * cli_find_model finds. */
int option_head_load(struct head *h, const char *path, struct error *err);
/* Open the model of -m, or the one that cli_find_model finds. */
int option_model_open(struct model *m, struct error *err);

#endif
