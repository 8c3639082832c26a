/* A head file with FLAME's arrays and random numbers, for golden cases that
 * come without the head itself. */
#include "tests/golden/flame_file.h"

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/lab/convert/convert.h"
#include "tests/folder.h"

/* ---- pickling ----------------------------------------------------------- */

static void flame_put(FILE *f, const void *p, size_t n)
{
    fwrite(p, 1, n, f);
}

static void put_word(FILE *f, const char *s)
{
    fprintf(f, "U%c%s", (int)strlen(s), s);
}

static void put_int(FILE *f, size_t v)
{
    int32_t i = (int32_t)v;

    fputc('J', f);
    flame_put(f, &i, sizeof i);
}

/* numpy's array of n elements of `size` bytes, type "f8" and the like. */
static void put_array(FILE *f, const char *type, const void *data,
                      size_t size, const size_t *dim, int ndim)
{
    static const char state[] = "K\0K\1\x87R(K\3U\1<NNNJ\xff\xff\xff\xff"
                                "J\xff\xff\xff\xffK\0tb\x89T";
    size_t n = 1;
    uint32_t bytes;

    fputs("cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\n(", f);
    put_int(f, 0);
    fputc('t', f);
    put_word(f, "b");
    flame_put(f, "\x87R(K\1(", 6);
    for (int i = 0; i < ndim; i++) {
        put_int(f, dim[i]);
        n *= dim[i];
    }
    fputs("tcnumpy\ndtype\n", f);
    put_word(f, type);
    flame_put(f, state, sizeof state - 1);
    bytes = (uint32_t)(n * size);
    flame_put(f, &bytes, 4);
    flame_put(f, data, n * size);
    fputs("tb", f);
}

/* Floats as float64, as chumpy's array or plain. */
static void put_floats(FILE *f, const char *name, const float *x,
                       const size_t *dim, int ndim, bool chumpy)
{
    size_t n = 1;
    double *d;

    for (int i = 0; i < ndim; i++)
        n *= dim[i];
    d = malloc((n + 1) * sizeof *d);
    for (size_t i = 0; i < n; i++)
        d[i] = x[i];
    put_word(f, name);
    if (chumpy) {
        fputs("cchumpy.ch\nCh\n)\x81}", f);
        put_word(f, "x");
    }
    put_array(f, "f8", d, sizeof *d, dim, ndim);
    if (chumpy)
        fputs("sb", f);
    free(d);
}

/* (rows,V) as scipy's compressed columns. */
static void put_sparse(FILE *f, const char *name, const float *x, size_t rows,
                       size_t V)
{
    double *data = malloc(rows * V * sizeof *data);
    int32_t *at = malloc(rows * V * sizeof *at);
    int32_t *starts = malloc((V + 1) * sizeof *starts);
    size_t n = 0, columns = V + 1;

    for (size_t v = 0; v < V; v++) {
        starts[v] = (int32_t)n;
        for (size_t j = 0; j < rows; j++)
            if (x[j * V + v] != 0) {
                at[n] = (int32_t)j;
                data[n++] = x[j * V + v];
            }
    }
    starts[V] = (int32_t)n;
    put_word(f, name);
    fputs("cscipy.sparse.csc\ncsc_matrix\n)\x81}(", f);
    put_word(f, "_shape");
    put_int(f, rows);
    put_int(f, V);
    fputs("\x86", f);
    put_word(f, "data");
    put_array(f, "f8", data, sizeof *data, &n, 1);
    put_word(f, "indices");
    put_array(f, "i4", at, sizeof *at, &n, 1);
    put_word(f, "indptr");
    put_array(f, "i4", starts, sizeof *starts, &columns, 1);
    fputs("ub", f);
    free(data);
    free(at);
    free(starts);
}

/* Every landmark on a corner of the first face: the case has no others. */
static void put_landmarks(FILE *f)
{
    const size_t one[2] = {1, HEAD_LANDMARKS}, all[3] = {1, HEAD_LANDMARKS, 3};
    int64_t face[HEAD_LANDMARKS] = {0};
    float bary[3 * HEAD_LANDMARKS] = {0};

    for (int i = 0; i < HEAD_LANDMARKS; i++)
        bary[3 * i + i % 3] = 1;
    put_word(f, "full_lmk_faces_idx");
    put_array(f, "i8", face, sizeof *face, one, 2);
    put_floats(f, "full_lmk_bary_coords", bary, all, 3, false);
}

static int write_pickle(const char *path, const struct head_arrays *a)
{
    const size_t verts[2] = {a->V, 3}, faces[2] = {a->F, 3};
    const size_t shape[3] = {a->V, 3, a->nshape + a->nexp};
    const size_t pose[3] = {a->V, 3, HEAD_POSE_DIRS};
    const size_t skin[2] = {a->V, HEAD_JOINTS}, tree[2] = {2, HEAD_JOINTS};
    uint32_t kin[2 * HEAD_JOINTS];
    FILE *f = fopen(path, "wb");

    if (!f)
        return -1;
    for (int j = 0; j < HEAD_JOINTS; j++) {
        kin[j] = (uint32_t)a->parents[j];
        kin[HEAD_JOINTS + j] = (uint32_t)j;
    }
    flame_put(f, "\x80\2}(", 4);
    put_floats(f, "v_template", a->v_template, verts, 2, true);
    put_word(f, "f");
    put_array(f, "u4", a->f, sizeof *a->f, faces, 2);
    put_floats(f, "shapedirs", a->shapedirs, shape, 3, true);
    put_floats(f, "posedirs", a->posedirs, pose, 3, false);
    put_sparse(f, "J_regressor", a->J_regressor, HEAD_JOINTS, a->V);
    put_floats(f, "weights", a->weights, skin, 2, false);
    put_word(f, "kintree_table");
    put_array(f, "u4", kin, sizeof *kin, tree, 2);
    put_landmarks(f);
    put_floats(f, "l_eyelid", a->l_eyelid, verts, 2, false);
    put_floats(f, "r_eyelid", a->r_eyelid, verts, 2, false);
    put_word(f, "bs_style");
    put_word(f, "lbs");
    fputs("u.", f);
    return fclose(f);
}

/* ---- importing ---------------------------------------------------------- */

/* FLAME's units are metres, times 5; the case has neither. */
static void set_scale(struct convert *c, float scale)
{
    char text[24];

    snprintf(text, sizeof text, "%g", (double)scale);
    for (size_t i = 0; i < c->nmeta; i += 2)
        if (!strcmp(c->meta[i], "scale")) {
            free(c->meta[i + 1]);
            c->meta[i + 1] = strdup(text);
        }
}

static int import_pickle(const char *in, const char *out, float scale,
                         struct error *err)
{
    const struct convert_options with = {.eyelids = in};
    struct convert c = {0};
    struct tensorfile *f = tensorfile_open(in, err);
    int rc = -1;

    if (!f)
        return -1;
    if (!convert_as(&c, f, "flame", &with, err)) {
        set_scale(&c, scale);
        rc = c.wrong ? error_set(err, EX_DATAERR, "%zu tensors are wrong, "
                                 "%s", c.wrong, c.problem[0].text)
                     : convert_save(&c, out, err);
    }
    convert_release(&c);
    tensorfile_close(f);
    return rc;
}

int flame_file_import(struct head *h, const struct head_arrays *a,
                      struct error *err)
{
    int rc = -1;

    strcpy(folder, "/tmp/spid-test-XXXXXX");    /* a new one each time */
    folder_make();
    const char *in = folder_at("flame.pkl"), *out = folder_at("flame.head");

    if (write_pickle(in, a))
        error_set(err, EX_CANTCREAT, "%s: cannot write", in);
    else if (!import_pickle(in, out, a->scale, err))
        rc = head_load(h, out, err);
    folder_remove();
    return rc;
}
