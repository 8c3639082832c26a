/* Lids of the scans that close.
 *
 * ICT-FaceKit's eyeBlink moves everybody's lids by the same lengths: at weight
 * 1 the mean face keeps a gap of a millimetre, and eyes that are opened wider
 * (1.4 mm a deviation) as much more.  Here weight 1 means closed for everyone:
 * a correction on top of the shape brings the lid margins together, the upper
 * one four fifths of the way, and lays them on the eyeball as the mean face's
 * lie; everything near them (lashes, tear line) goes with them.  It is linear
 * in the person's own gap and distances. */
#ifndef SPID_LAB_HEAD_SCAN_LIDS_H
#define SPID_LAB_HEAD_SCAN_LIDS_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/arena.h"

enum { SCAN_LID_LINE = 24 };    /* vertices of a lid's margin, corners too */

/* A margin: its vertices from the inner corner, where each meets the opposite
 * one (segment and fraction), how blinking moves them at weight 1, by how much
 * they are to overlap, and how far out along `away` of the eyeball's centre
 * they are to lie when closed. */
struct scan_lid_line {
    int n;
    int32_t v[SCAN_LID_LINE];
    int meet[SCAN_LID_LINE];
    float part[SCAN_LID_LINE], over[SCAN_LID_LINE], out[SCAN_LID_LINE];
    float move[SCAN_LID_LINE][3], away[SCAN_LID_LINE][3];
};

/* A vertex that follows a margin: by weight times the correction at its place
 * there, up along the eyeball and away from it. */
struct scan_lid_part {
    int32_t v;
    int line, at;               /* line: 2 side + lower */
    float part, weight;
    float up[3], away[3];
};

struct scan_lids {
    struct scan_lid_line line[4];
    const float *neutral;       /* borrowed */
    double unit;
    struct scan_lid_part *p;
    size_t n;
};

/* From the neutral face and the shapes eyeBlink_L and eyeBlink_R, all
 * (SCAN_VERTS,3), in our world; unit is what a metre measures in them (1, or 5
 * for head units).  neutral is borrowed. */
int scan_lids_init(struct scan_lids *l, const float *neutral,
                   const float *blink_left, const float *blink_right,
                   double unit, struct arena *memory, struct error *err);

/* x (SCAN_VERTS,3) += the correction of a blink of weights left and right (0
 * to 1) of the person whose face without expression is `folded`.  To be added
 * wherever the two blink shapes are. */
void scan_lids_add(float *x, const struct scan_lids *l, const float *folded,
                   float left, float right);

/* Along the left eye's lid margins from the inner corner to the outer: 23
 * vertices of the upper, 24 of the lower. */
enum { SCAN_LID_UPPER = 23, SCAN_LID_LOWER = 24 };
extern const int32_t scan_lid_upper[SCAN_LID_UPPER];
extern const int32_t scan_lid_lower[SCAN_LID_LOWER];

#endif
