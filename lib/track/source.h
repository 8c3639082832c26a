/* The source picture of an identity: its face found, cropped to the portrait
 * window, its matte, shape and own motion (Phase A up to beta). */
#ifndef SPID_TRACK_SOURCE_H
#define SPID_TRACK_SOURCE_H


#include "formats/image.h"
#include "lib/base/error.h"
#include "lib/head/person.h"
#include "lib/track/encoders.h"
#include "lib/track/track.h"

enum source_matte {
    SOURCE_ALPHA,               /* the file's own alpha */
    SOURCE_MASK,                /* a mask file */
    SOURCE_NETWORK,             /* the model's matte network */
    SOURCE_HEAD                 /* the head's outline and the colours */
};

/* What whoever gave a picture should hear of it. */
struct source_notes {
    struct track_faces faces;   /* in it, as it stands upright */
    size_t outside;             /* of the face's landmarks, past its edges */
    int rotated;                /* quarter turns clockwise that it was given to
                                 * stand upright, 0 to 3 */
    enum source_matte how;      /* the matte's origin */
    bool damaged;               /* see struct image */
};

struct source {
    struct person person;       /* picture of the portrait window, matte,
                                 * shape and motion; no hashes */
    struct square window;       /* in the picture */
    size_t size, finest;        /* pixels along it that the networks see, and
                                 * that are kept at most */
    struct source_notes notes;
    struct extent inside;       /* the window's pixels that show it */
    float confidence;           /* of E_m that it shows a face, 0 to 1 */
    double crop_s, motion_s, shape_s, matte_s, detect_s;
};

/* Pixels along a window that pictures of `drawn` pixels show: twice as many, for a
 * head that comes closer, PERSON_MAX at most. */
size_t source_finest(size_t drawn);

/* From a picture with the head it is for; `opt` may fix crop and window.  A picture
 * that is found to lie on its side or upside down is turned upright, with its mask,
 * when the model says how sure it is of a face.  EX_DATAERR with what was tried when
 * there is no face. */
int source_make(struct source *s, struct image *im, const struct head *head,
                struct encoders *nets, const struct track_options *opt,
                struct error *err);
/* Its first half: face, motion, shape and window.  mask: NULL or of the same size;
 * its red channel counts. */
int source_find(struct source *s, struct image *im, struct image *mask,
                const struct head *head, struct encoders *nets,
                const struct track_options *opt, struct error *err);
/* Its second half: the matte, what is behind the person, and the shape whose
 * outline the matte's is (outline.h).  Does not use the encoders of motion and
 * shape, which another thread may use meanwhile. */
int source_cut_out(struct source *s, const struct image *im,
                   const struct image *mask, const struct head *head,
                   struct encoders *nets, struct error *err);
/* Free what it holds; zeroed then. */
void source_release(struct source *s);
/* Move the person out of s; the caller releases it (person_release) and sets
 * source.pose.exp of the copy to its own exp. */
struct person source_move_person(struct source *s);

/* In words, for messages. */
const char *source_matte_name(enum source_matte how);

#endif
