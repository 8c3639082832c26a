/* spid-pack: any records from standard array files, JSON or other streams. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "cmd/cli.h"
#include "cmd/options.h"
#include "cmd/take.h"
#include "formats/arrayview.h"
#include "formats/npy.h"
#include "formats/recordfile.h"
#include "formats/recordjson.h"
#include "formats/safetensors.h"
#include "lib/base/cpu.h"
#include "lib/base/file.h"
#include "formats/gaus_ply.h"
#include "lib/stream/records.h"
#include "lib/stream/stream.h"

static const char *type, *ply_path, *take_path, *head_path, *relative_path;
static struct gaus_ply_options ply;
static bool stack, raw;
static double fps;             /* 0: not given */
static long first_frame;

static const struct cli_option options[] = {
    OPTION_STRING("type", 't', &type, "TYPE",
                  "type of the record made from plain arrays"),
    OPTION_FLAG("stack", 's', &stack,
                "the arrays' first axis is time: one record each"),
    OPTION_INT("frame", 0, &first_frame, 0, 1e15, "N",
               "number of the first such record (default 0)"),
    OPTION_FLOAT("fps", 0, &fps, 1e-3, 1e6, "N",
                 "frames a second, for times not given (default 25) and "
                 "timecodes"),
    OPTION_FLAG("raw", 0, &raw, "do not put a CONF record in front"),
    OPTION_OUTPUT("ply", 0, &ply_path, "FILE",
                  "a Gaussian scene as a GAUS record, as SOURCE.ply does"),
    OPTION_OUTPUT("arkit", 0, &take_path, "FILE",
                  "a take of Live Link Face (CSV) as MOTN records"),
    OPTION_STRING("relative", 0, &relative_path, "FILE",
                  "its movements, from this identity's own motion"),
    OPTION_HEAD(&head_path),
    OPTION_CALL("eye", 0, &ply, "X,Y,Z", gaus_ply_parse_eye,
                "where its spherical harmonics are seen from"),
    OPTION_FLAG("flat", 0, &ply.flat,
                "drop spherical harmonics above degree 0"),
    OPTION_FLAG("model-space", 0, &ply.model_space,
                "the PLY has y up: do not turn it"),
    { 0 }
};

static const struct cli_usage usage = {
    "spid-pack", "[OPTION ...] SOURCE ...",
    "make a stream from JSON, npy and safetensors files, or streams\n\n"
    "SOURCE is a stream, a .json or .ply file, a directory or .safetensors\n"
    "file of spid-dump, or plain arrays: NAME=FILE.npy, NAME.npy,\n"
    "FILE.safetensors.",
    options
};

/* What packed records are not asked to say: who made them, and units. */
#define CONF_TEXT "{\"producer\":\"spid-pack " SPID_VERSION "\"," \
    "\"units\":\"metres times 5\"}"

/* Plain arrays from npy and safetensors files, kept until the end. */
struct plain {
    struct array like;         /* of one record: without the stacked axis */
    size_t rows;               /* 1 unless stacked */
    void *data;                /* owned */
};

struct pack {
    struct stream_writer *out;
    uint64_t records;
    struct plain plain[STREAM_MAX_ARRAYS];
    int plains;
};

/* For times that nobody gives. */
static double pack_frame_rate(void)
{
    return fps > 0 ? fps : 25;
}

/* The sink of every source: records go out as they come. */
static int pack_put_record(const struct record *rec, void *context,
                           struct error *err)
{
    struct pack *p = context;

    if (p->records++ == 0 && !raw && !record_is(rec, RECORD_CONF) &&
        conf_text_write(p->out, CONF_TEXT, err))
        return -1;
    progress("record", p->records, 0, NULL);
    double begun = stats_begin();
    int rc = stream_copy(p->out, rec, err);
    stats_end("write", begun);
    return rc;
}

/* ---- plain arrays ------------------------------------------------------- */

/* Keep data (owned from here on) of ndim dims under name. */
static int pack_keep_plain(struct pack *p, const char *name, enum dtype dtype,
                           int ndim, const size_t *dims, void *data,
                           struct error *err)
{
    struct plain *a = &p->plain[p->plains];
    size_t n = strlen(name);

    if (p->plains == STREAM_MAX_ARRAYS)
        return error_set(err, EX_DATAERR, "more than %d arrays",
                         STREAM_MAX_ARRAYS);
    a->data = data;
    p->plains++;               /* main's exit frees it from now on */
    if (n == 0 || n >= STREAM_NAME)
        return error_set(err, EX_DATAERR, "array name '%s' (expected 1 to %d "
                         "letters)", name, STREAM_NAME - 1);
    if (stack && ndim == 0)
        return error_set(err, EX_DATAERR, "%s is a single number (expected "
                         "a first axis to take apart, see --stack)", name);
    a->rows = stack ? dims[0] : 1;
    if (stack && a->rows != p->plain[0].rows)
        return error_set(err, EX_DATAERR, "%s has %zu rows (expected %zu as "
                         "%s)", name, a->rows, p->plain[0].rows,
                         p->plain[0].like.name);
    dims += stack;
    ndim -= stack;
    if (ndim > 4)
        return error_set(err, EX_DATAERR, "%s has %d dimensions (expected at "
                         "most 4)", name, ndim);
    a->like = array_make(name, dtype, NULL, ndim, ndim > 0 ? dims[0] : 0,
                         ndim > 1 ? dims[1] : 0, ndim > 2 ? dims[2] : 0,
                         ndim > 3 ? dims[3] : 0);
    return 0;
}

/* NAME=FILE.npy, or FILE.npy whose name is the array's. */
static int pack_add_npy(struct pack *p, const char *source, struct error *err)
{
    const char *path = strchr(source, '='), *base;
    char name[256];
    struct npy a;

    path = path ? path + 1 : source;
    base = strrchr(path, '/');
    base = base ? base + 1 : path;
    if (path != source)
        snprintf(name, sizeof name, "%.*s", (int)(path - source - 1), source);
    else
        snprintf(name, sizeof name, "%.*s", (int)strlen(base) - 4, base);
    if (npy_load(&a, path, err))
        return -1;
    return pack_keep_plain(p, name, a.dtype, a.ndim, a.dim, a.data, err)
                    ? error_prefix(err, "%s", path) : 0;
}

/* Keep a tensor of a file as an array of its name. */
static int pack_add_tensor(struct pack *p, const struct st_tensor *t,
                           struct error *err)
{
    const struct array_view v = array_view_tensor(t);
    enum dtype dtype;
    void *data = array_view_to_stream(&dtype, &v, t->data, err);

    return data ? pack_keep_plain(p, t->name, dtype, t->ndim, t->dim, data, err)
                : error_prefix(err, "tensor '%s'", t->name);
}

/* A dump's records, or plain arrays. */
static int pack_add_safetensors(struct pack *p, const char *path,
                                struct error *err)
{
    struct safetensors *st = st_open(path, err);
    bool dumped = st && st_meta(st, "spid.records");
    int rc = st ? 0 : -1;

    for (size_t i = 0; rc == 0 && !dumped && i < st_count(st); i++)
        if ((rc = pack_add_tensor(p, st_at(st, i), err)))
            error_prefix(err, "%s", path);
    st_close(st);
    return dumped ? recordfile_read_st(path, pack_put_record, p, err) : rc;
}

/* The records of the plain arrays: one, or one per row. */
static int pack_put_plain(struct pack *p, struct error *err)
{
    struct record rec = { .count = p->plains };
    size_t rows = p->plains ? p->plain[0].rows : 0;

    if (p->plains == 0)
        return 0;
    if (!type || strlen(type) < 3 || strlen(type) > 4)
        return error_set(err, EX_USAGE, "--type=%s: not a record type "
                         "(expected four letters, such as MOTN)",
                         type ? type : "");
    for (int i = 0; i < 4; i++)
        rec.type[i] = *type ? *type++ : ' ';
    for (size_t row = 0; row < rows; row++) {
        rec.frame = (uint64_t)first_frame + row;
        rec.time = (double)rec.frame / pack_frame_rate();
        for (int i = 0; i < p->plains; i++) {
            const struct plain *a = &p->plain[i];

            rec.array[i] = a->like;
            rec.array[i].data = (const char *)a->data +
                                row * array_bytes(&a->like);
        }
        if (pack_put_record(&rec, p, err))
            return -1;
    }
    return 0;
}

/* ---- sources ------------------------------------------------------------ */

/* By the name's ending. */
static int pack_add_source(struct pack *p, const char *source,
                           struct error *err)
{
    struct stat st;

    if (file_ends(source, ".npy"))
        return pack_add_npy(p, source, err);
    if (file_ends(source, ".safetensors"))
        return pack_add_safetensors(p, source, err);
    if (file_ends(source, ".ply"))
        return gaus_ply_read(source, &ply, pack_put_record, p, err);
    if (file_ends(source, ".json") || file_ends(source, ".jsonl"))
        return recordjson_read(source, pack_frame_rate(), stream_limit(),
                               pack_put_record, p, err);
    if (stat(source, &st) == 0 && S_ISDIR(st.st_mode))
        return recordfile_read_npy(source, pack_put_record, p, err);
    return stream_load(source, pack_put_record, p, err);
}

int main(int argc, char **argv)
{
    struct pack p = { 0 };
    struct error err = { 0 };
    int rc = 0, first = cli_parse(&usage, argc, argv);

    if (first == argc && !ply_path && !take_path)
        die(EX_USAGE, "nothing to pack (expected SOURCE ..., see --help)");
    cpu_keep_denormals();
    p.out = cli_create_stream(cli.output);
    if (ply_path)
        rc = gaus_ply_read(ply_path, &ply, pack_put_record, &p, &err);
    if (take_path && rc == 0) {
        rc = take_pack(p.out, take_path, fps, head_path, relative_path, &err);
        p.records++;            /* it has a CONF of its own */
    }
    for (int i = first; i < argc && rc == 0; i++)
        rc = pack_add_source(&p, argv[i], &err);
    if (rc == 0)
        rc = pack_put_plain(&p, &err);
    progress_end();
    for (int i = 0; i < p.plains; i++)
        free(p.plain[i].data);
    if (rc)
        cli_abandon_stream(p.out, &err);
    if (stream_finish(p.out, &err))
        die_error(&err);
    stats_write();
    return 0;
}
