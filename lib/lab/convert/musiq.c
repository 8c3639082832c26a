/* MUSIQ's checkpoints as the PyTorch port pyiqa has them: convolutions'
 * standardised weights are made once, queries, keys and values are one layer. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "lib/lab/convert/table.h"
#include "lib/lab/eval/musiq.h"

/* Each output's weights w (n) less their mean, over their deviation. */
static void musiq_standardise(float *out, const double *w, size_t n)
{
    double mean = 0, square = 0;

    for (size_t k = 0; k < n; k++)
        mean += w[k] / (double)n;
    for (size_t k = 0; k < n; k++)
        square += (w[k] - mean) * (w[k] - mean);
    const double deviation = sqrt(square / (double)(n - 1)) + 1e-5;

    for (size_t k = 0; k < n; k++)
        out[k] = (float)((w[k] - mean) / deviation);
}

/* Tensor `to` = the `parts` of `from` one behind the other, standardised or as
 * they are. */
static int musiq_take(struct convert *c, const char *prefix,
                      const struct param *to, const char *const *from,
                      size_t parts, bool standard, struct error *err)
{
    size_t dim[5], index[3], part = to->count / parts;
    struct arena room = {0};
    float *out;

    memcpy(dim, to->dim, sizeof dim);
    dim[0] /= parts;
    for (size_t i = 0; i < parts; i++) {
        index[i] = convert_find(c, 0, prefix, from[i], to->ndim, dim, false);
        if (index[i] == SIZE_MAX)
            return 0;
    }
    out = convert_add(c, to->name, ST_F32, to->ndim, to->dim, err);
    for (size_t i = 0; out && i < parts; i++) {
        const size_t n = standard ? part / dim[0] : 1;
        double *w = convert_numbers(c, 0, index[i], &room, err);

        for (size_t k = 0; w && k < part; k += n)
            if (standard)
                musiq_standardise(out + i * part + k, w + k, n);
            else
                out[i * part + k] = (float)w[k];
        out = w ? out : NULL;
    }
    arena_release(&room);
    return out ? 0 : -1;
}

/* "...attention.qkv.weight" from the three of query, key and value. */
static int musiq_take_heads(struct convert *c, const char *prefix,
                            const struct param *to, const char *at,
                            struct error *err)
{
    static const char *const part[3] = {"query", "key", "value"};
    char name[3][160];
    const char *from[3];

    for (int i = 0; i < 3; i++) {
        snprintf(name[i], sizeof name[i], "%.*s%s%s", (int)(at - to->name),
                 to->name, part[i], at + strlen("qkv"));
        from[i] = name[i];
    }
    return musiq_take(c, prefix, to, from, 3, false, err);
}

int convert_musiq(struct convert *c, struct error *err)
{
    char prefix[TENSORFILE_NAME];
    struct musiq net;
    int rc = 0;

    musiq_declare(&net);
    convert_prefix(prefix, c, 0, "conv_root.weight");
    for (size_t i = 0; !rc && i < net.ps.count; i++) {
        const struct param *p = &net.ps.tensor[i];
        const char *from = p->name, *heads = strstr(from, "qkv.");

        rc = heads ? musiq_take_heads(c, prefix, p, heads, err)
                   : musiq_take(c, prefix, p, &from, 1, p->ndim == 4, err);
    }
    musiq_release(&net);
    return rc;
}
