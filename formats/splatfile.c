/* .splat files: 32 bytes a Gaussian, heaviest first. */
#include "formats/splatfile.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/outfile.h"
#include "lib/base/sort.h"

/* Keys of the Gaussians by opacity times volume, falling. */
static uint64_t *splatfile_by_weight(const struct gaussians *g)
{
    uint64_t *order = malloc((g->n + 1) * sizeof *order);

    for (size_t i = 0; order && i < g->n; i++) {
        const float *s = g->scale + 3 * i;

        order[i] = sort_key(-g->opacity[i] * s[0] * s[1] * s[2], (uint32_t)i);
    }
    if (order)
        sort_keys(order, g->n);
    return order;
}

/* Rounded and clamped to 0 .. 255. */
static uint8_t splatfile_splat_byte(float x)
{
    return (uint8_t)lrintf(fminf(fmaxf(x, 0), 255));
}

int splatfile_write(const char *path, const struct gaussians *g,
                    struct error *err)
{
    struct outfile out;
    uint64_t *order = splatfile_by_weight(g);

    if (!order)
        return error_set(err, EX_OSERR, "%s: out of memory", path);
    if (outfile_open(&out, path, err)) {
        free(order);
        return -1;
    }
    for (size_t k = 0; k < g->n; k++) {
        size_t i = (uint32_t)order[k];
        const float *m = g->mean + 3 * i, *q = g->quat + 4 * i;
        const float *s = g->scale + 3 * i;
        const float rotated[4] = {-q[3], -q[2], q[1], q[0]};
        float norm = sqrtf(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] +
                           q[3] * q[3]);
        float f[6] = {-m[0], -m[1], m[2], s[0], s[1], s[2]};
        uint8_t b[8];

        for (size_t j = 0; j < 3; j++)
            b[j] = splatfile_splat_byte(255 * gaussians_channel(g, i, j));
        b[3] = splatfile_splat_byte(255 * g->opacity[i]);
        for (int j = 0; j < 4; j++)
            b[4 + j] = splatfile_splat_byte(128 + 128 * rotated[j] /
                                                      fmaxf(norm, 1e-12f));
        fwrite(f, sizeof f, 1, out.file);
        fwrite(b, sizeof b, 1, out.file);
    }
    free(order);
    return outfile_close(&out, err);
}

/* ---- reading ------------------------------------------------------------ */

enum { RECORD = 32 };

/* One record into its place. */
static int splatfile_record_unpack(struct splats *s, size_t i,
                                   const uint8_t *record)
{
    float f[6], q[4], *quat = s->quat + 4 * i;

    memcpy(f, record, sizeof f);
    for (int j = 0; j < 6; j++)
        if (!isfinite(f[j]))
            return -1;
    for (size_t j = 0; j < 3; j++) {
        s->mean[3 * i + j] = j == 2 ? f[j] : -f[j];
        s->scale[3 * i + j] = f[3 + j];
        s->color[3 * i + j] = (float)record[24 + j] / 255;
    }
    s->opacity[i] = (float)record[27] / 255;
    for (int j = 0; j < 4; j++)
        q[j] = ((float)record[28 + j] - 128) / 128;
    /* the turn about z undone: (w,x,y,z) = (z',y',-x',-w') */
    quat[0] = q[3];
    quat[1] = q[2];
    quat[2] = -q[1];
    quat[3] = -q[0];
    return 0;
}

int splatfile_read(struct splats *s, const char *path, struct error *err)
{
    uint8_t record[RECORD];
    FILE *f = fopen(path, "rb");
    long size;
    int rc = -1;

    memset(s, 0, sizeof *s);
    if (!f)
        return error_set(err, EX_NOINPUT, "%s: %s", path, strerror(errno));
    if (fseek(f, 0, SEEK_END) || (size = ftell(f)) < 0 || size % RECORD)
        error_set(err, EX_DATAERR, "%s: not a .splat file (expected a "
                  "multiple of %d bytes)", path, RECORD);
    else
        rc = splats_allocate(s, (size_t)size / RECORD, 0, path, err);
    rewind(f);
    for (size_t i = 0; rc == 0 && i < s->n; i++)
        if (fread(record, RECORD, 1, f) != 1 ||
            splatfile_record_unpack(s, i, record))
            rc = error_set(err, EX_DATAERR, "%s: Gaussian %zu is cut short or "
                           "not finite", path, i);
    fclose(f);
    if (rc)
        splats_release(s);
    return rc;
}
