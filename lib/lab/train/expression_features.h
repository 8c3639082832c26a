/* What an expression does to a face, in seven lengths of its 68 landmarks:
 * where E_m's error is spread over fifty coefficients, these say what is seen
 * of it. */
#ifndef SPID_LAB_TRAIN_EXPRESSION_FEATURES_H
#define SPID_LAB_TRAIN_EXPRESSION_FEATURES_H

enum expression_feature {
    EXPRESSION_MOUTH_OPEN,      /* between the lips */
    EXPRESSION_MOUTH_WIDTH,     /* between the mouth's corners */
    EXPRESSION_SMILE,           /* the corners above the lips' middle */
    EXPRESSION_EYE_RIGHT,       /* between the lids */
    EXPRESSION_EYE_LEFT,
    EXPRESSION_BROW_RIGHT,      /* the brow above the eye's corners */
    EXPRESSION_BROW_LEFT,
    EXPRESSION_FEATURES
};

/* The lengths f (7), head units, of landmarks x (68,3) of a posed head
 * (y up; the camera plays no part). */
void expression_features(float f[EXPRESSION_FEATURES], const float *x);
/* dx (68,3) += gradient of df (7). */
void expression_features_backward(float *dx, const float *df, const float *x);

#endif
