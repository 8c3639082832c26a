/* E_m: MobileNetV3 on the face crop and six linear heads (Eqs. rot to eye).
 * Tensors: "<prefix>encoder.*" (timm's names) and
 * "<prefix>{rot,trans,exp,jaw,lid,eye}.{weight,bias}"; the head that says how
 * sure it is (confidence_head.h) only where motion_encoder_add_confidence
 * declares it. */
#ifndef SPID_NET_MOTION_ENCODER_H
#define SPID_NET_MOTION_ENCODER_H

#include "lib/net/mobilenet.h"
#include "lib/net/confidence_head.h"
#include "lib/nn/graph.h"
#include "lib/nn/plan.h"

#define MOTION_ENCODER_SIZE 224

/* Where each head lies in a row of the output. */
enum motion_out {
    MOTION_ROT = 0,     /* 6: two rows of R before Gram-Schmidt */
    MOTION_TRANS = 6,   /* 3: relative to the crop (motion_code.h) */
    MOTION_EXP = 9,     /* 100 */
    MOTION_JAW = 109,   /* 3: axis-angle */
    MOTION_LID = 112,   /* 2: after the sigmoid, 0 open .. 1 closed */
    MOTION_EYE = 114,   /* 6: two axis-angles, left and right */
    MOTION_OUT = 120
};

struct motion_encoder {
    struct mobilenet net;
    struct mobilenet second;      /* of two crops the second one's, so that
                                   * each has a thread; NN_INFER only */
    bool apart;                   /* planned so */
    struct params *ps;
    char prefix[32];              /* of its tensors */
    struct dense head[6];
    struct dense confidence;      /* confidence_head.h; zeroed: none */
    bool has_rest;                /* motion_encoder_add_rest was called */
    size_t rest;                  /* tensor index in ps */
    size_t batch;
    bool quick;                   /* NN_FAST was asked for, NN_BF16 planned */
    struct nn_plan plan;
    float *pooled, *dpooled;      /* (B,features) */
    float *out, *dout;            /* (B,120) */
};

/* Declare E_m on the MobileNet of this name (mobilenet_init). */
int motion_encoder_init(struct motion_encoder *m, struct params *ps,
                        const char *prefix, const char *variant,
                        struct error *err);
/* Declare the confidence head, after motion_encoder_init. */
void motion_encoder_add_confidence(struct motion_encoder *m,
                                   const char *prefix);
/* Declare "<prefix>rest" (2,120): what E_m says of calm faces, least and most,
 * as people's faces differ and E_m errs.  After motion_encoder_init. */
void motion_encoder_add_rest(struct motion_encoder *m, const char *prefix);
/* It; NULL where the model does not have it. */
const float *motion_encoder_rest(const struct motion_encoder *m);
/* After params_randomise, which gives the heads a tenth of the usual weights:
 * the biases of a frontal face in the middle of its crop (rotation
 * (1,0,0, 0,-1,0), translation (0,0,7), lids 0.12). */
void motion_encoder_init_weights(struct motion_encoder *m);
/* For `batch` face crops. */
int motion_encoder_plan(struct motion_encoder *m, size_t batch,
                        struct nn_options opt, struct error *err);
/* Free what _init and _plan allocated; zeroed then. */
void motion_encoder_release(struct motion_encoder *m);

/* out (B,120), see enum motion_out; rgb (B,224,224,3) in [0,1]. */
void motion_encoder_forward(float *out, const float *rgb,
                            struct motion_encoder *m);
/* The same of crop n of two alone: out (120), rgb (224,224,3).  Only where the
 * plan is for two crops and NN_INFER. */
void motion_encoder_forward_one(float *out, const float *rgb, size_t n,
                                struct motion_encoder *m);
/* How sure the last forward was of crop n's face, 0 to 1; 1 without a sure
 * head. */
float motion_encoder_confidence(const struct motion_encoder *m, size_t n);
/* drgb (B,224,224,3), or NULL, from dout (B,120) as in enum motion_out. */
void motion_encoder_backward(float *drgb, const float *dout,
                             struct motion_encoder *m);

/* The same as a graph of one crop: "picture" (1,224,224,3) in [0,1] to "code"
 * (1,120), as enum motion_out has it, and "sure" (1,1) where there is that
 * head. */
void motion_encoder_graph(struct graph *g, const struct motion_encoder *m);

#endif
