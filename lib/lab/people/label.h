/* What a pixel of a synthetic picture shows: values of the stream's `label`. */
#ifndef SPID_LAB_PEOPLE_LABEL_H
#define SPID_LAB_PEOPLE_LABEL_H

enum synth_label {
    LABEL_NONE, LABEL_SKIN, LABEL_LIP, LABEL_EYE, LABEL_BROW, LABEL_HAIR,
    LABEL_MOUTH, LABEL_TEETH, LABEL_CLOTH, LABEL_GLASSES, LABEL_NECK,
    LABEL_EAR, LABEL_NOSE, LABEL_BEARD, LABEL_LASH, LABEL_OCCLUDER
};

#endif
