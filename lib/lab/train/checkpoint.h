/* The state of a run on disk: weights, Adam's moments, average, step.  What a
 * step draws depends on seed and step alone, so this is everything. */
#ifndef SPID_LAB_TRAIN_CHECKPOINT_H
#define SPID_LAB_TRAIN_CHECKPOINT_H

#include <stdint.h>

#include "lib/base/error.h"
#include "lib/nn/params.h"
#include "lib/lab/train/adam.h"
#include "lib/lab/train/config.h"

/* Tensors that learn together, and their Adam; ps NULL: there are none. */
struct checkpoint_part {
    struct params *ps;
    struct adam *adam;
};

/* A run between two steps. */
struct checkpoint {
    struct checkpoint_part model, opponent;     /* see task.h */
    uint64_t step;              /* the next one to do */
    uint64_t skipped;
    char fingerprint[17];
};

/* Hex digest of what a checkpoint must share with a run: stage, seed, batch,
 * micro, pool, people_per_step and every tensor's name, shape and freeze, those
 * of the opponent (or NULL) too. */
void checkpoint_fingerprint(char text[17], const struct train_config *c,
                            const struct params *ps,
                            const struct params *opponent);

/* Write PATH beside its final name, then rename: a failure or a kill at any
 * moment leaves the last one. */
int checkpoint_save(const char *path, const struct checkpoint *c,
                    struct error *err);

/* 1 when read: both parts, step and skipped are set; 0 when PATH does not
 * exist; -1 on a damaged file or one whose fingerprint is not c's. */
int checkpoint_load(const char *path, struct checkpoint *c,
                    struct error *err);

/* A model file to start from. */
struct checkpoint_source {
    const char *path, *prefix, *from;
};

/* "FILE", "FILE:PREFIX" or "FILE:PREFIX=FROM"; *s keeps a copy for good, as
 * options are kept. */
int checkpoint_source_parse(struct checkpoint_source *s, const char *text,
                            struct error *err);

/* Fill tensors of ps from a model file: those whose name starts with prefix
 * must all be there, under names that start with `from` instead. */
int checkpoint_import(struct params *ps, const struct checkpoint_source *s,
                      struct error *err);

/* Several model files' tensors in one file of ST_F16; the metadata key "spid"
 * (may be NULL) is written.  A later file's tensor replaces an earlier one of
 * the same name. */
int checkpoint_join(const char *path, const char *const *parts, size_t count,
                    const char *spid, struct error *err);

#endif
