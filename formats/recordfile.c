/* Records to array files, with an index from which recordload.c makes them
 * again. */
#include "formats/recordfile.h"

#include <cjson/cJSON.h>
#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>
#include <unistd.h>

#include "formats/npy.h"
#include "formats/outfile.h"
#include "formats/safetensors.h"
#include "lib/base/arena.h"
#include "lib/base/list.h"

#define INDEX_KEY "spid.records"
#define PATH_ROOM 4096

static const enum st_dtype to_st[] = { ST_U8, ST_I32, ST_F16, ST_F32, ST_F64 };

/* One npy file being written: the latest of its type and name. */
struct column {
    char type[5];
    struct array like;         /* name, dtype and shape of a row */
    struct npy_writer *w;
    char file[160];
    int number;                /* how often the shape has changed */
    size_t rows;
};

struct recordfile {
    struct arena memory;       /* of names and copies */
    const char *path;
    bool npy, made;            /* made: the folder is new, ours */
    cJSON *index;
    uint64_t records;
    struct st_tensor *tensor;  /* safetensors: copies of all arrays */
    size_t tensors, room;
    struct column *column;     /* npy */
    size_t columns, column_room;
};

/* Of either kind; nothing is written yet. */
static struct recordfile *recordfile_create(const char *path, bool npy,
                                            struct error *err)
{
    struct recordfile *w = calloc(1, sizeof *w);

    if (w) {
        w->path = arena_text(&w->memory, path);
        w->npy = npy;
        w->index = cJSON_CreateArray();
    }
    if (!w || !w->path || !w->index) {
        recordfile_abandon(w);
        return error_null(err, EX_OSERR, "out of memory");
    }
    return w;
}

struct recordfile *recordfile_create_st(const char *path, struct error *err)
{
    return recordfile_create(path, false, err);
}

struct recordfile *recordfile_create_npy(const char *dir, struct error *err)
{
    const bool made = mkdir(dir, 0777) == 0;
    struct recordfile *w;
    struct stat st;

    if (!made && errno != EEXIST)
        return error_null(err, EX_CANTCREAT, "%s: cannot create: %s", dir,
                          strerror(errno));
    if (stat(dir, &st) || !S_ISDIR(st.st_mode))
        return error_null(err, EX_CANTCREAT, "%s: not a directory", dir);
    w = recordfile_create(dir, true, err);
    if (w)
        w->made = made;
    else if (made)
        rmdir(dir);
    return w;
}

void recordfile_abandon(struct recordfile *w)
{
    if (!w)
        return;
    for (size_t i = 0; i < w->columns; i++)
        npy_abandon(w->column[i].w);
    if (w->made)
        rmdir(w->path);         /* stays when something is in it */
    free(w->tensor);
    free(w->column);
    cJSON_Delete(w->index);
    arena_release(&w->memory);
    free(w);
}

/* A copy of the array, named RECORD.TYPE.NAME. */
static int recordfile_add_tensor(struct recordfile *w, const struct record *rec,
                                 const struct array *a, struct error *err)
{
    size_t bytes = array_bytes(a);
    struct st_tensor *t;
    void *data = arena_take(&w->memory, bytes, 1);
    char name[STREAM_NAME + 40];

    snprintf(name, sizeof name, "%06llu.%s.%s",
             (unsigned long long)w->records, rec->type, a->name);
    const char *own = arena_text(&w->memory, name);

    t = data && own ? list_add(&w->tensor, &w->tensors, &w->room, sizeof *t,
                               err) : NULL;
    if (!t)
        return error_set(err, EX_OSERR, "out of memory (%zu tensors so far; "
                         "see --frames)", w->tensors);
    *t = (struct st_tensor){ .name = own, .dtype = to_st[a->dtype],
                             .ndim = a->ndim, .count = array_count(a),
                             .data = memcpy(data, a->data, bytes) };
    for (int k = 0; k < a->ndim; k++)
        t->dim[k] = a->dim[k];
    return 0;
}

/* ---- npy directories: writing ------------------------------------------ */

/* Letters that are safe in a file name; others become %XX. */
static void recordfile_put_safe(char *out, size_t size, const char *text)
{
    size_t n = strlen(out);

    for (; *text && n + 4 < size; text++) {
        unsigned char c = (unsigned char)*text;

        n += (size_t)snprintf(out + n, size - n,
                              isalnum(c) || c == '_' || c == '-' ? "%c"
                                                                 : "%%%02X",
                              c);
    }
}

/* May be stacked on each other. */
static bool recordfile_same_row(const struct array *a, const struct array *b)
{
    return a->dtype == b->dtype && a->ndim == b->ndim &&
           memcmp(a->dim, b->dim, sizeof a->dim) == 0;
}

/* The next npy file of this array. */
static int recordfile_open_column(struct recordfile *w, struct column *c,
                                  const struct array *a, struct error *err)
{
    char path[PATH_ROOM];
    size_t n;

    c->like = *a;
    c->rows = 0;
    c->file[0] = '\0';
    recordfile_put_safe(c->file, sizeof c->file, c->type);
    strcat(c->file, ".");
    recordfile_put_safe(c->file, sizeof c->file - 24, a->name);
    n = strlen(c->file);
    if (c->number)
        snprintf(c->file + n, sizeof c->file - n, ".%d.npy", c->number);
    else
        snprintf(c->file + n, sizeof c->file - n, ".npy");
    snprintf(path, sizeof path, "%s/%s", w->path, c->file);
    c->w = npy_create(path, a->dtype, a->ndim, a->dim, err);
    return c->w ? 0 : -1;
}

/* The open file for this array, newly made when there is none. */
static struct column *recordfile_find_column(struct recordfile *w,
                                             const struct record *rec,
                                             const struct array *a,
                                             struct error *err)
{
    struct column *c = w->column;

    while (c < w->column + w->columns &&
           (strcmp(c->type, rec->type) || strcmp(c->like.name, a->name)))
        c++;
    if (c == w->column + w->columns) {
        c = list_add(&w->column, &w->columns, &w->column_room, sizeof *c, err);
        if (!c)
            return NULL;
        strcpy(c->type, rec->type);
        return recordfile_open_column(w, c, a, err) ? NULL : c;
    }
    if (recordfile_same_row(&c->like, a))
        return c;
    struct npy_writer *full = c->w;

    c->w = NULL;
    c->number++;
    return npy_finish(full, err) || recordfile_open_column(w, c, a, err) ? NULL
                                                                         : c;
}

/* Append to the array's column and note where it went. */
static int recordfile_add_row(struct recordfile *w, cJSON *arrays,
                              const struct record *rec, const struct array *a,
                              struct error *err)
{
    struct column *c = recordfile_find_column(w, rec, a, err);
    cJSON *place;

    if (!c || npy_append(c->w, a->data, err))
        return -1;
    place = cJSON_AddArrayToObject(arrays, a->name);
    if (!place)
        return error_set(err, EX_OSERR, "out of memory");
    cJSON_AddItemToArray(place, cJSON_CreateString(c->file));
    cJSON_AddItemToArray(place, cJSON_CreateNumber((double)c->rows++));
    return 0;
}

/* ---- both --------------------------------------------------------------- */

/* The record's row of the index, then its arrays. */
int recordfile_add(struct recordfile *w, const struct record *rec,
                   struct error *err)
{
    cJSON *row = cJSON_CreateObject(), *arrays;
    char time[40], frame[24];

    if (!row)
        return error_set(err, EX_OSERR, "out of memory");
    cJSON_AddItemToArray(w->index, row);
    cJSON_AddStringToObject(row, "type", rec->type);
    snprintf(frame, sizeof frame, "%llu", (unsigned long long)rec->frame);
    snprintf(time, sizeof time, "%.17g", rec->time);
    cJSON_AddRawToObject(row, "frame", frame);
    cJSON_AddRawToObject(row, "time", time);
    arrays = w->npy ? cJSON_AddObjectToObject(row, "arrays")
                    : cJSON_AddArrayToObject(row, "arrays");
    for (int i = 0; i < rec->count; i++) {
        const struct array *a = &rec->array[i];

        if (!w->npy)
            cJSON_AddItemToArray(arrays, cJSON_CreateString(a->name));
        if (w->npy ? recordfile_add_row(w, arrays, rec, a, err)
                   : recordfile_add_tensor(w, rec, a, err))
            return -1;
    }
    w->records++;
    return 0;
}

/* Close the columns and write the index. */
static int recordfile_finish_npy(struct recordfile *w, struct error *err)
{
    char path[PATH_ROOM], *text;
    struct outfile out;

    for (size_t i = 0; i < w->columns; i++) {
        struct npy_writer *open = w->column[i].w;

        w->column[i].w = NULL;
        if (npy_finish(open, err))
            return -1;
    }
    snprintf(path, sizeof path, "%s/records.json", w->path);
    text = cJSON_PrintUnformatted(w->index);
    if (!text)
        return error_set(err, EX_OSERR, "out of memory");
    int rc = outfile_open(&out, path, err);
    if (rc == 0) {
        fprintf(out.file, "%s\n", text);
        rc = outfile_close(&out, err);
    }
    cJSON_free(text);
    return rc;
}

int recordfile_finish(struct recordfile *w, struct error *err)
{
    char *text = NULL;
    int rc;

    if (w->npy) {
        rc = recordfile_finish_npy(w, err);
    } else if ((text = cJSON_PrintUnformatted(w->index))) {
        const char *meta[] = { INDEX_KEY, text, NULL };

        rc = st_save(w->path, w->tensor, w->tensors, meta, err);
    } else {
        rc = error_set(err, EX_OSERR, "out of memory");
    }
    cJSON_free(text);
    recordfile_abandon(w);
    return rc;
}
