/* Models on another head than the one they were trained with. */
#ifndef SPID_LAB_CONVERT_HEADED_H
#define SPID_LAB_CONVERT_HEADED_H

#include <stdbool.h>

#include "lib/lab/convert/convert.h"
#include "lib/head/head.h"
#include "lib/lab/head/map.h"
#include "lib/net/model.h"

/* A model file and, where its head is to change, both heads. */
struct headed {
    struct model model;
    struct avatar_config config;    /* the model's, with the new head */
    struct head from, to;
    bool moves;                     /* the heads are two */
    struct head_map map;            /* then */
};

/* to NULL: the model's head stays.  from may be NULL when to is the model's
 * own.  After a failure headed_release, too. */
int headed_open(struct headed *h, const char *model, const char *from,
                const char *to, struct error *err);
/* Free what it holds; zeroed then. */
void headed_release(struct headed *h);

/* Add both encoders, with the map multiplied into their last layers. */
int headed_encoders(struct convert *c, const struct headed *h,
                    struct error *err);
/* The metadata that make the output a model. */
void headed_describe(struct convert *c, const struct avatar_config *config);

#endif
