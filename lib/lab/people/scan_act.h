/* What faces do: expressions, speech, looks and turns as functions of time,
 * drawn from what was seen on photographs and clips. */
#ifndef SPID_LAB_PEOPLE_SCAN_ACT_H
#define SPID_LAB_PEOPLE_SCAN_ACT_H

#include <stdint.h>

#include "lib/base/error.h"
#include "lib/head/arkit.h"
#include "lib/lab/people/traits.h"

#define ACT_KINDS 24            /* of the mixture */

/* A mixture of Gaussians over ARKit's weights. */
struct act_model {
    int kinds;
    float share[ACT_KINDS];     /* cumulative, last 1 */
    float mean[ACT_KINDS][ARKIT_COUNT], spread[ACT_KINDS][ARKIT_COUNT];
};

/* Fit to DIR/labels/photos.safetensors and clips.safetensors; pictures of
 * `real/` are left out. */
int act_model_fit(struct act_model *m, const char *dir, struct error *err);

/* How a person acts: fixed for a clip. */
struct act_look {
    const struct traits *traits;        /* borrowed */
    uint64_t key;
    float lively;               /* size of motions */
    float yaw, pitch, roll;     /* rest pose, radians */
    float turn;                 /* widest yaw, radians */
    float lean;                 /* one-sidedness of smiles, -1..1 */
    float talk;                 /* share of time spent speaking */
};

struct act {
    float weight[ARKIT_COUNT];
    float yaw, pitch, roll;
    float drift[3];             /* of the shoulders, -1..1 */
    float pupil;                /* -1 small .. 1 wide */
};

/* Where a head shall turn to instead of where it would, radians. */
struct synth_turn {
    float yaw, pitch, roll;
};

/* The person at `time` seconds; turn (NULL: as they move) the head's pose
 * instead of theirs. */
void act_at(struct act *a, const struct act_model *m,
            const struct act_look *look, double time,
            const struct synth_turn *turn);

#endif
