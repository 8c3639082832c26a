/* Plain videos as operands: which clips they name, and their records, made
 * once for each clip in a folder that spid-train reads. */
#ifndef SPID_CMD_LAB_CLIPS_H
#define SPID_CMD_LAB_CLIPS_H

#include <stddef.h>

#include "cmd/cli.h"
#include "lib/base/names.h"
#include "lib/nn/nn.h"
#include "lib/lab/data/clip.h"

/* Rows of an option table. */
#define OPTION_CLIP_FRAMES(n)                                                 \
    OPTION_INT("frames", 0, n, 1, 1000, "N",                                  \
               "frames kept of a clip, spread over it (default 24)")
#define CLIPS_FRAMES 24             /* defaults: frames kept of a clip, */
#define CLIPS_MIN_FRAMES 8          /* and how many good ones it needs */
#define CLIPS_MIN_FACE 64           /* pixels of a face crop's side */

#define CLIPS_MAX 3000              /* characters of a name */

/* Append what an operand names: a video, all that is in a folder (each a clip;
 * a folder of pictures is one, too), or with "@FILE" the file's lines.  A
 * failure ends the program. */
void clips_add(struct names *c, const char *operand);

/* How records are made. */
struct clips_job {
    const char *folder;             /* of the records; made, too */
    const char *head_path;          /* as in option_head_load */
    size_t part, parts;             /* clips part, part + parts, ... */
    size_t size;                    /* of the pictures; 0: the model's */
    enum nn_type precision;
    struct clip_options opt;        /* frames, least, min_face */
};

/* Records of every clip of the part that has none yet, by the encoders of -m:
 * folder/NAME.spid, or NAME.bad with the reason, and a line of
 * folder/clips.tsv for each.  How many clips have records then, of *all. */
size_t clips_prepare(const struct names *c, const struct clips_job *job,
                     size_t *all);

/* The streams that the operands, ended by NULL, stand for: themselves, and
 * where there are plain clips among them (lists, folders without records,
 * files that are no streams), job->folder, with their records made.  data has
 * room for them all; returns how many. */
size_t clips_gather(const char **data, char **operand,
                    const struct clips_job *job);

#endif
