/* SuperSplat's compressed PLY: chunks of 256 Gaussians, each with the ranges of
 * its places, logarithms of scales and colours, and four words for each of
 * them: 11, 10 and 11 bits of x, y, z; the largest number of the quaternion in
 * 2 bits and the others in 10 each; 11, 10, 11 of the scales; 8 each of
 * colour and opacity.  Higher harmonics, where there are any, are bytes.  The
 * form is that of PlayCanvas's engine and of its splat-transform. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/outfile.h"
#include "formats/ply_parts.h"

enum { CHUNK = 256, RANGES = 18, WORDS = 4 };

static const char *const range_name[RANGES] = {
    "min_x", "min_y", "min_z", "max_x", "max_y", "max_z",
    "min_scale_x", "min_scale_y", "min_scale_z",
    "max_scale_x", "max_scale_y", "max_scale_z",
    "min_r", "min_g", "min_b", "max_r", "max_g", "max_b"};
static const char *const word_name[WORDS] = {
    "packed_position", "packed_rotation", "packed_scale", "packed_color"};

/* ---- reading ------------------------------------------------------------ */

bool ply_is_packed(const struct ply_table *t)
{
    const struct ply_element *v = ply_table_find(t, "vertex");

    return v && ply_table_find(t, "chunk") && ply_element_find(v, word_name[0]);
}

/* Where the named properties stand in rows of e; `max` of them must. */
static int packed_find(int *at, const struct ply_table *t,
                       const struct ply_element *e, const char *const *name,
                       int n, int max, struct error *err)
{
    for (int k = 0; k < n; k++) {
        const struct ply_property *p = ply_element_find(e, name[k]);

        at[k] = p ? (int)(p - e->property) : -1;
        if (!p && k < max)
            return ply_table_fail(t, err, "compressed, without %s of each %s",
                                  name[k], e->name);
    }
    return 0;
}

/* Ranges (chunks, RANGES); colours reach from 0 to 1 where none is given. */
static double *packed_read_ranges(struct ply_table *t,
                                  const struct ply_element *chunk,
                                  struct error *err)
{
    double row[PLY_PROPERTIES], *out;
    int at[RANGES];

    if (packed_find(at, t, chunk, range_name, RANGES, 12, err)
        || ply_table_skip_to(t, chunk, err))
        return NULL;
    out = malloc(chunk->n * RANGES * sizeof *out + 1);
    if (!out)
        error_set(err, EX_OSERR, "%s: out of memory", t->path);
    for (size_t i = 0; out && i < chunk->n; i++) {
        if (ply_table_row(row, t, chunk, i, err)) {
            free(out);
            return NULL;
        }
        for (int k = 0; k < RANGES; k++)
            out[RANGES * i + (size_t)k] = at[k] >= 0 ? row[at[k]] : k >= 15;
    }
    return out;
}

/* `bits` bits of a word from `shift` on, as 0 to 1. */
static double packed_part(uint32_t word, int shift, int bits)
{
    const uint32_t max = (1u << bits) - 1;

    return (double)(word >> shift & max) / max;
}

/* Place p from 0 to 1 of the range of number k, whose ends are 3 apart. */
static double packed_place(const double *range, int k, double p)
{
    return range[k] * (1 - p) + range[k + 3] * p;
}

/* The quaternion: three numbers from -1/sqrt(2) to 1/sqrt(2), and what is left
 * to one. */
static void packed_rotation(double q[4], uint32_t word)
{
    const int largest = (int)(word >> 30);
    double rest = 1;
    int shift = 20;

    for (int k = 0; k < 4; k++)
        if (k != largest) {
            q[k] = (packed_part(word, shift, 10) - 0.5) * M_SQRT2;
            rest -= q[k] * q[k];
            shift -= 10;
        }
    q[largest] = sqrt(fmax(rest, 0));
}

/* A Gaussian's fields from its words and its chunk's ranges. */
static void packed_unpack(double v[FIELDS], const uint32_t word[WORDS],
                          const double *range)
{
    static const int shift[3] = {21, 11, 0}, bits[3] = {11, 10, 11};

    memset(v, 0, FIELDS * sizeof *v);
    for (int k = 0; k < 3; k++) {
        v[k] = packed_place(range, k, packed_part(word[0], shift[k], bits[k]));
        v[10 + k] = packed_place(range + 6, k,
                                 packed_part(word[2], shift[k], bits[k]));
        v[6 + k] = (packed_place(range + 12, k,
                                 packed_part(word[3], 24 - 8 * k, 8)) - 0.5)
                   / GAUSSIAN_SH0;
    }
    v[9] = -log(1 / packed_part(word[3], 0, 8) - 1);
    packed_rotation(v + 13, word[1]);
}

/* The vertices. */
static int packed_read_vertices(struct splats *s, struct ply_table *t,
                                const struct ply_element *vertex,
                                const double *ranges, struct error *err)
{
    double row[PLY_PROPERTIES], v[FIELDS];
    uint32_t word[WORDS];
    int at[WORDS];

    if (packed_find(at, t, vertex, word_name, WORDS, WORDS, err))
        return -1;
    for (int k = 0; k < WORDS; k++)
        if (vertex->property[at[k]].type != PLY_U32)
            return ply_table_fail(t, err, "%s is not of type uint",
                                  word_name[k]);
    for (size_t i = 0; i < vertex->n; i++) {
        if (ply_table_row(row, t, vertex, i, err))
            return -1;
        for (int k = 0; k < WORDS; k++) {
            if (!(row[at[k]] >= 0 && row[at[k]] <= UINT32_MAX))
                return ply_table_fail(t, err, "vertex %zu: %s is not 32 bits",
                                      i, word_name[k]);
            word[k] = (uint32_t)row[at[k]];
        }
        packed_unpack(v, word, ranges + i / CHUNK * RANGES);
        ply_scene_set(s, i, v);
        if (ply_scene_check(s, i, 0, t->path, err))
            return -1;
    }
    return 0;
}

/* Higher harmonics as bytes, from -4 to 4. */
static int packed_read_rest(struct splats *s, struct ply_table *t,
                            const struct ply_element *sh, const int *at,
                            int nrest, struct error *err)
{
    double row[PLY_PROPERTIES];

    for (size_t i = 0; i < s->n; i++) {
        if (ply_table_row(row, t, sh, i, err))
            return -1;
        for (int k = 0; k < nrest; k++) {
            const double b = row[at[k]];
            const double p = b <= 0 ? 0 : b >= 255 ? 1 : (b + 0.5) / 256;

            s->rest[(size_t)nrest * i + (size_t)k] = (float)((p - 0.5) * 8);
        }
    }
    return 0;
}

int ply_read_packed(struct splats *s, struct ply_table *t,
                    struct error *err)
{
    const struct ply_element *chunk = ply_table_find(t, "chunk");
    const struct ply_element *vertex = ply_table_find(t, "vertex");
    const struct ply_element *sh = ply_table_find(t, "sh");
    int at[PLY_REST], nrest = sh ? ply_find_rest(at, t, sh, err) : 0;
    double *ranges;
    int rc;

    if (nrest < 0)
        return -1;
    if (vertex != chunk + 1 || (sh && sh != vertex + 1)
        || chunk->n != vertex->n / CHUNK + (vertex->n % CHUNK != 0)
        || (sh && sh->n != vertex->n))
        return ply_table_fail(t, err, "compressed, with %zu chunks for %zu "
                              "vertices (expected one for 256, then these, "
                              "then their sh)", chunk->n, vertex->n);
    ranges = packed_read_ranges(t, chunk, err);
    rc = ranges && !splats_allocate(s, vertex->n, nrest, t->path, err)
                 && !packed_read_vertices(s, t, vertex, ranges, err)
                 && (!nrest || !packed_read_rest(s, t, sh, at, nrest, err))
             ? 0 : -1;
    free(ranges);
    return rc;
}

/* ---- writing ------------------------------------------------------------ */

/* A Gaussian to write, in an order where neighbours share a chunk. */
struct packed_row {
    uint32_t place;             /* on the Morton curve */
    uint32_t index;
    float field[FIELDS];        /* colours from 0 to 1, opacity too */
};

static int packed_by_place(const void *a, const void *b)
{
    const struct packed_row *p = a, *q = b;

    if (p->place != q->place)
        return p->place < q->place ? -1 : 1;
    return (p->index > q->index) - (p->index < q->index);
}

/* Minimum and maximum of field k. */
static void packed_range(float *min, float *max,
                         const struct packed_row *row, size_t n, int k)
{
    *min = *max = n ? row[0].field[k] : 0;
    for (size_t i = 1; i < n; i++) {
        *min = fminf(*min, row[i].field[k]);
        *max = fmaxf(*max, row[i].field[k]);
    }
}

/* v between low and high in `bits` bits. */
static uint32_t packed_bits(float v, float low, float high, int bits)
{
    const double max = (1u << bits) - 1;
    const double p = high > low ? ((double)v - (double)low)
                                  / ((double)high - (double)low) : 0;

    return (uint32_t)floor(fmin(fmax(p, 0), 1) * max + 0.5);
}

/* Order along a curve through the box of all places, 10 bits a side. */
static void packed_sort(struct packed_row *row, size_t n)
{
    float low[3], high[3];

    for (int k = 0; k < 3; k++)
        packed_range(&low[k], &high[k], row, n, k);
    for (size_t i = 0; i < n; i++)
        for (int k = 0; k < 3; k++) {
            const uint32_t p = packed_bits(row[i].field[k], low[k], high[k],
                                           10);

            for (int b = 0; b < 10; b++)
                row[i].place |= (p >> b & 1) << (3 * b + k);
        }
    qsort(row, n, sizeof *row, packed_by_place);
}

/* 2 bits say which number is the largest; the others in 10 bits each. */
static uint32_t packed_quaternion(const float q[4])
{
    uint32_t word;
    int largest = 0;

    for (int k = 1; k < 4; k++)
        if (fabsf(q[k]) > fabsf(q[largest]))
            largest = k;
    word = (uint32_t)largest;
    for (int k = 0; k < 4; k++)
        if (k != largest)
            word = word << 10
                   | packed_bits(q[largest] < 0 ? -q[k] : q[k],
                                 -(float)M_SQRT1_2, (float)M_SQRT1_2, 10);
    return word;
}

/* Three fields from `first` on, 11, 10 and 11 bits of their ranges. */
static uint32_t packed_three(const float *field, const float *range)
{
    return packed_bits(field[0], range[0], range[3], 11) << 21
           | packed_bits(field[1], range[1], range[4], 10) << 11
           | packed_bits(field[2], range[2], range[5], 11);
}

/* The ranges of a chunk of n Gaussians. */
static void packed_chunk(float range[RANGES], const struct packed_row *row,
                         size_t n)
{
    static const int first[3] = {0, 10, 6};     /* place, scale, colour */

    for (int part = 0; part < 3; part++)
        for (int k = 0; k < 3; k++)
            packed_range(&range[6 * part + k], &range[6 * part + 3 + k], row,
                         n, first[part] + k);
}

static void packed_words(uint32_t word[WORDS], const struct packed_row *row,
                         const float range[RANGES])
{
    const float *f = row->field;

    word[0] = packed_three(f, range);
    word[1] = packed_quaternion(f + 13);
    word[2] = packed_three(f + 10, range + 6);
    /* renderers stop at 0.99, and the logit of 1 is no number */
    word[3] = packed_bits(fminf(f[9], 254 / 255.f), 0, 1, 8);
    for (int k = 0; k < 3; k++)
        word[3] |= packed_bits(f[6 + k], range[12 + k], range[15 + k], 8)
                   << (24 - 8 * k);
}

/* The header for n Gaussians. */
static void packed_write_header(FILE *f, size_t n)
{
    fprintf(f, "ply\nformat binary_little_endian 1.0\n"
            "comment SpiD toolkit: coarse colours, degree 0\n"
            "element chunk %zu\n", n / CHUNK + (n % CHUNK != 0));
    for (int k = 0; k < RANGES; k++)
        fprintf(f, "property float %s\n", range_name[k]);
    fprintf(f, "element vertex %zu\n", n);
    for (int k = 0; k < WORDS; k++)
        fprintf(f, "property uint %s\n", word_name[k]);
    fputs("end_header\n", f);
}

/* All chunks, then all words. */
static void packed_write_rows(FILE *f, const struct packed_row *row, size_t n)
{
    for (int pass = 0; pass < 2; pass++)
        for (size_t i = 0; i < n; i += CHUNK) {
            const size_t here = n - i < CHUNK ? n - i : CHUNK;
            float range[RANGES];
            uint32_t word[WORDS];

            packed_chunk(range, row + i, here);
            if (pass == 0)
                fwrite(range, sizeof range, 1, f);
            for (size_t k = 0; pass == 1 && k < here; k++) {
                packed_words(word, row + i + k, range);
                fwrite(word, sizeof word, 1, f);
            }
        }
}

int ply_write_packed(const char *path, const struct gaussians *g, bool turn,
                     struct error *err)
{
    struct packed_row *row = calloc(g->n + 1, sizeof *row);
    struct outfile out;
    int rc = -1;

    if (!row)
        return error_set(err, EX_OSERR, "out of memory for %zu Gaussians",
                         g->n);
    for (size_t i = 0; i < g->n; i++) {
        row[i].index = (uint32_t)i;
        ply_row_pack(row[i].field, g, i, turn);
        if (ply_check_field(row[i].field, path, i, err))
            goto out;
        row[i].field[9] = g->opacity[i];
        for (int k = 6; k < 9; k++)
            row[i].field[k] = (float)(0.5 + GAUSSIAN_SH0 *
                                            (double)row[i].field[k]);
    }
    packed_sort(row, g->n);
    if (outfile_open(&out, path, err))
        goto out;
    packed_write_header(out.file, g->n);
    packed_write_rows(out.file, row, g->n);
    rc = outfile_close(&out, err);
out:
    free(row);
    return rc;
}
