/* Further pictures of a person whose first picture is known: from picture files
 * and clips, checked to show the same person, joined with the first one to one
 * identity.  The first stays the one whose pixels are looked up; the others say
 * what it does not show. */
#ifndef SPID_TRACK_VIEWS_H
#define SPID_TRACK_VIEWS_H

#include <stdbool.h>
#include <stddef.h>

#include "formats/image.h"
#include "lib/base/error.h"
#include "lib/head/person.h"
#include "lib/track/source.h"

struct views {
    const struct source *first;         /* borrowed */
    const struct head *head;            /* borrowed, like */
    struct encoders *nets;
    struct identity mean;               /* the mean head */
    struct track_options opt;
    struct image image[PERSON_MORE];
    struct source source[PERSON_MORE];
    size_t n;
};

/* The least likeness of one person's faces: on validation people 0 of 13 pairs of
 * photographs and 8 % of scans' are under it, and 70 and 88 % of strangers'
 * (tests/bench/alike.sh). */
#define VIEWS_SIMILAR (-0.8)

/* What became of a file. */
struct views_report {
    size_t taken;               /* pictures of it */
    bool stranger;              /* it shows another person and is left out */
    double likeness;            /* of the last face to the first */
    struct track_faces faces;   /* in that picture */
};

/* None yet.  first: after source_find; opt's size and finest are used alone.
 * EX_OSERR. */
int views_init(struct views *v, const struct source *first,
               const struct head *head, struct encoders *nets,
               const struct track_options *opt, struct error *err);
/* Free what it holds; zeroed then. */
void views_release(struct views *v);

/* Of a picture, or, of a clip or a folder of pictures, those frames in which the
 * head is turned another way than in every picture before.  A file that shows
 * another person than the first picture is left out, which *r says.  -1 when it
 * cannot be read, shows no face, or there are PERSON_MORE already; *err names
 * it. */
int views_add(struct views *v, struct views_report *r, const char *path,
              struct error *err);

/* All of them and the first, each cut out of its picture: shape and face at rest
 * are the means by how sure E_m is of each, and the mean shape, once every
 * picture's outline has changed it, once more.  The pictures move to
 * first->person.more.  mask: of the first, or NULL.  Instead of source_cut_out;
 * on an error first is released. */
int views_join(struct views *v, struct source *first, const struct image *im,
               const struct image *mask, struct error *err);

#endif
