/* What the parts of the PLY reader and writer share. */
#ifndef SPID_FORMATS_PLY_PARTS_H
#define SPID_FORMATS_PLY_PARTS_H

#include "formats/ply.h"
#include "formats/ply_table.h"

/* x y z, nx ny nz, f_dc 3, opacity (logit), scale 3 (logarithm), rot 4. */
enum { FIELDS = 17, PLY_REST = 45 };

/* One Gaussian as logit opacity, log scale and degree-0 harmonics. */
void ply_row_pack(float out[FIELDS], const struct gaussians *g, size_t i,
                  bool turn);
/* EX_DATAERR when one is not finite. */
int ply_check_field(const float row[FIELDS], const char *path, size_t i,
                    struct error *err);

/* Gaussian i from its fields, turned to y up if need be. */
void ply_scene_set(struct splats *s, size_t i, const double v[FIELDS]);
/* Everything of it finite, and its nrest higher harmonics. */
int ply_scene_check(const struct splats *s, size_t i, int nrest,
                    const char *path, struct error *err);
/* Where f_rest_0.. stand in rows of e; returns how many, -1: an odd number. */
int ply_find_rest(int rest[PLY_REST], const struct ply_table *t,
                  const struct ply_element *e, struct error *err);

/* ---- SuperSplat's compressed form (ply_packed.c) ------------------------ */

bool ply_is_packed(const struct ply_table *t);
/* All of it into *s, whose `turned` is set. */
int ply_read_packed(struct splats *s, struct ply_table *t,
                    struct error *err);

#endif
