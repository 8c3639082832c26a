/* The model's networks as ONNX files, each with named inputs and outputs of
 * fixed shapes (spid-export(1) has the table). */
#ifndef SPID_EXPORT_NETWORKS_H
#define SPID_EXPORT_NETWORKS_H

#include <stdbool.h>

#include "lib/avatar/avatar.h"
#include "lib/base/error.h"
#include "lib/net/model.h"
#include "lib/net/refiner.h"
#include "lib/nn/graph.h"
#include "lib/track/encoders.h"

enum network {
    NETWORK_MOTION, NETWORK_SHAPE, NETWORK_MATTE, NETWORK_BACKBONE,
    NETWORK_PLANE, NETWORK_STATIC, NETWORK_DYNAMIC, NETWORK_MOUTH,
    NETWORK_REFINER, NETWORK_COUNT
};

struct networks {
    struct encoders encoders;
    struct params avatar_ps, refiner_ps;
    struct avatar avatar;               /* declared, not planned */
    struct refiner refiner;             /* when has_refiner */
    bool has_refiner;
};

/* The weights of all networks of a model, which may be closed afterwards; head
 * is borrowed.  Errors name file, tensor, expected and found shape. */
int networks_open(struct networks *n, const struct model *m,
                  const struct head *head, struct error *err);
/* Free what it holds; zeroed then. */
void networks_release(struct networks *n);

/* "motion" and so on, which the files are called. */
const char *networks_name(enum network which);
/* Its graph, which borrows the weights; the caller releases it also after a
 * failure: -1 and *err where its layers have no ONNX form. */
int networks_graph(struct graph *g, const struct networks *n,
                   enum network which, struct error *err);

/* DIR/motion.onnx and so on, those that the model has; DIR is made where there
 * is none. */
int networks_write(const char *dir, const struct networks *n,
                   struct error *err);

#endif
