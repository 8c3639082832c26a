/* Options that several programs have, with one wording and one parser. */
#ifndef SPID_CMD_OPTIONS_H
#define SPID_CMD_OPTIONS_H

#include "cmd/cli.h"
#include "lib/head/head.h"

struct model;

/* Rows of an option table. */
#define OPTION_HEAD(path)                                                     \
    {"head", 0, CLI_STRING, (path), 0, 0, "FILE",                             \
     "head model (default head.safetensors beside the model)", NULL}
#define OPTION_PRECISION(type, where)                                         \
    {"precision", 0, CLI_CALL, (type), 0, 0, "TYPE",                          \
     "f32, fast or bf16 inside the " where " (default fast)", option_precision}
#define OPTION_PRECISION_DEFAULT NN_FAST
/* The same where a refiner runs. */
#define OPTION_PRECISION_REFINE(type, where)                                  \
    {"precision", 0, CLI_CALL, (type), 0, 0, "TYPE",                          \
     "f32, fast, bf16 or int8 inside the " where " (default fast)",           \
     option_precision_refine}
/* track: a struct track_options; its crop or window, and that it is given. */
#define OPTION_CROP(track, help)                                              \
    {"crop", 0, CLI_CALL, (track), 0, 0, "X,Y,SIZE", help, option_crop}
#define OPTION_WINDOW(track, help)                                            \
    {"window", 0, CLI_CALL, (track), 0, 0, "X,Y,SIZE", help, option_window}

/* Their parsers: dest is an enum nn_type, a struct track_options. */
int option_precision(const char *value, void *dest, struct error *err);
int option_precision_refine(const char *value, void *dest, struct error *err);
int option_crop(const char *value, void *dest, struct error *err);
int option_window(const char *value, void *dest, struct error *err);

/* Load the head of --head, or when that was not given (NULL) the one that
 * cli_find_model finds. */
int option_head_load(struct head *h, const char *path, struct error *err);
/* Open the model of -m, or the one that cli_find_model finds. */
int option_model_open(struct model *m, struct error *err);

#endif
