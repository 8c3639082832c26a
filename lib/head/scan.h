/* Where the scans' face lies in our world, and how its numbers are ours.
 *
 * ICT-FaceKit measures in centimetres, x to the subject's left, y up, z out of
 * the face, as we do; so the way from there is a scale and a shift, no turn:
 *     metres      = 0.01 cm + SCAN_SHIFT        (a head file's v_template)
 *     head units  = 5 metres = 0.05 cm + 5 SCAN_SHIFT
 * It puts the eyes where the sculpted head has them.  A head registered to the
 * scans has their identity weights as its shape coefficients 0 to 99 and their
 * expression weights as motion: lib/head/arkit.h. */
#ifndef SPID_HEAD_SCAN_H
#define SPID_HEAD_SCAN_H

#define SCAN_IDENTITIES 100
#define SCAN_SCALE 0.01                     /* metres in a centimetre */
#define SCAN_SHIFT_X 0.0                    /* metres */
#define SCAN_SHIFT_Y -0.011
#define SCAN_SHIFT_Z -0.013

#endif
