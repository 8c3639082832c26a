/* E_beta: MobileNetV3-large minimal on the face crop, 960 -> 300 (Eq. beta).
 * Tensors: "<prefix>encoder.*" (as in timm), "<prefix>shape.{weight,bias}". */
#ifndef SPID_NET_SHAPE_ENCODER_H
#define SPID_NET_SHAPE_ENCODER_H

#include "lib/net/mobilenet.h"
#include "lib/nn/graph.h"
#include "lib/nn/plan.h"

#define SHAPE_ENCODER_SIZE 224
#define SHAPE_ENCODER_OUT 300

struct shape_encoder {
    struct mobilenet net;
    struct params *ps;
    struct dense head;
    size_t batch;
    struct nn_plan plan;
    float *pooled, *dpooled;      /* (B,features) */
};

/* Declare E_beta on the MobileNet of this name (mobilenet_init). */
int shape_encoder_init(struct shape_encoder *s, struct params *ps,
                       const char *prefix, const char *variant,
                       struct error *err);
/* For `batch` face crops. */
int shape_encoder_plan(struct shape_encoder *s, size_t batch,
                       struct nn_options opt, struct error *err);
/* Free what _init and _plan allocated; zeroed then. */
void shape_encoder_release(struct shape_encoder *s);

/* beta (B,300); rgb (B,224,224,3) in [0,1]. */
void shape_encoder_forward(float *beta, const float *rgb,
                           struct shape_encoder *s);
/* drgb (B,224,224,3), or NULL, from dbeta (B,300). */
void shape_encoder_backward(float *drgb, const float *dbeta,
                            struct shape_encoder *s);

/* The same as a graph of one crop: "picture" (1,224,224,3) in [0,1] to "shape"
 * (1,300). */
void shape_encoder_graph(struct graph *g, const struct shape_encoder *s);

#endif
