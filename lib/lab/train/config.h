/* The configuration of a training run: JSON, unknown keys refused. */
#ifndef SPID_LAB_TRAIN_CONFIG_H
#define SPID_LAB_TRAIN_CONFIG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/lab/data/data.h"
#include "lib/lab/train/motion_loss.h"

#define TRAIN_PATH 400
#define TRAIN_NAMES 64

enum train_stage {
    STAGE_SHAPE, STAGE_MOTION, STAGE_LIGHT, STAGE_CONFIDENCE, STAGE_MATTE,
    STAGE_AVATAR, STAGE_ALL, STAGE_COUNT
};

struct train_config {
    enum train_stage stage;     /* by its name */
    int64_t seed, steps;
    int64_t batch, micro;       /* items of a step; of one pass (batch norm
                                 * sees these): micro divides batch */
    double rate, rate_end;      /* Adam's, falling by a half cosine */
    int64_t warmup;             /* steps in which it rises */
    double clip, average;       /* gradient norm; averaging of the weights */
    bool running_norm;          /* the encoders' batch norm stays at its
                                 * running statistics: no noise from the batch
                                 * in the last, small steps */
    int64_t pool;               /* people in memory */
    double people_per_step;     /* new ones read */
    int64_t image;              /* side of the splatted picture */
    int64_t targets;            /* driven frames for each source */
    struct data_augment augment;
    struct motion_weights geometry;
    double anchor_start, anchor_end; /* factor on the geometric terms ... */
    int64_t anchor_steps;       /* ... over this many steps (lambda_3) */
    double coarse, refined;     /* L1 of the two pictures (lambda_1) */
    double face;                /* factor of the face crop's terms */
    double perceptual;          /* L_perc of the face crop (lambda_2) */
    char perceptual_file[TRAIN_PATH]; /* SqueezeNet's weights for it; "": a
                                 * Laplacian pyramid's L1 */
    double alignment;           /* L_lmk of what was drawn (lambda_4) ... */
    char alignment_file[TRAIN_PATH]; /* ... by this network; "": only the
                                 * head's own landmarks count */
    double adversarial;         /* what a patch discriminator of the face
                                 * makes of the final picture; 0: there is
                                 * none */
    int64_t adversarial_from;   /* the step at which it begins */
    double adversarial_rate;    /* its own Adam's */
    double adversarial_penalty; /* its gradient penalty, gamma of R1 */
    double silhouette;          /* alpha against the mask */
    double mouth;               /* L1 and half of L_perc between open lips */
    double square;              /* mean square of the two pictures: what PSNR
                                 * measures */
    bool smooth;                /* squares instead of |x| in pictures, and no
                                 * cut-offs in the renderer: for comparing
                                 * gradients with differences */
    int64_t log_every, sheet_every, checkpoint_every;
    int64_t validation_every, validation_people;
    char freeze[TRAIN_NAMES];   /* tensors whose names begin so stay as they
                                 * are; "" for none */
    char learn[TRAIN_NAMES];    /* only tensors whose names begin so are
                                 * learned; "" for all */
    char *model;                /* JSON of the model's configuration */
};

/* Fill c from text (path names it in messages).  Errors are EX_CONFIG and
 * name the key, what was found and what was expected. */
int train_config_parse(struct train_config *c, const char *text,
                       const char *path, struct error *err);
/* The same from a file.  EX_NOINPUT, too. */
int train_config_load(struct train_config *c, const char *path,
                      struct error *err);
/* Free what it holds; zeroed then. */
void train_config_release(struct train_config *c);

/* The string at model.OBJECT.net of the configuration, or `normal`, in out. */
const char *train_config_net(char *out, size_t size,
                             const struct train_config *c, const char *object,
                             const char *normal);

/* As the configuration writes it. */
const char *train_stage_name(enum train_stage stage);

/* Adam's rate at a step. */
double train_rate(const struct train_config *c, uint64_t step);
/* lambda_3 at a step. */
double train_anchor(const struct train_config *c, uint64_t step);

#endif
