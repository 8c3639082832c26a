/* spid-dump: what a stream holds, as text, JSON or standard array files. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cmd/cli.h"
#include "formats/outfile.h"
#include "formats/ply.h"
#include "formats/recordfile.h"
#include "formats/recordjson.h"
#include "lib/base/cpu.h"
#include "lib/splat/scene.h"
#include "lib/stream/schema.h"
#include "lib/stream/stats.h"
#include "lib/stream/stream.h"

struct range {
    uint64_t first, end;       /* half open */
};

static bool check, json, values;
static const char *tensor_path, *npy_dir, *ply_path, *only;
static struct range frames = { 0, UINT64_MAX };

/* "A:B", "A:", ":B" or "A". */
static int dump_parse_frames(const char *value, void *dest, struct error *err)
{
    struct range *r = dest;
    char none[] = " ";
    char *end = (char *)(uintptr_t)value;

    *r = (struct range){ 0, UINT64_MAX };
    if (*value >= '0' && *value <= '9') {
        r->first = strtoull(value, &end, 10);
        r->end = r->first + 1;
    }
    if (*end == ':') {
        r->end = UINT64_MAX;
        value = end + 1;
        end++;
        if (*value >= '0' && *value <= '9')
            r->end = strtoull(value, &end, 10);
    } else if (end == value) {
        end = none;
    }
    if (*end || r->end <= r->first)
        return error_set(err, EX_USAGE, "not a range of frames (expected "
                         "FIRST:END, the frames from FIRST up to END - 1)");
    return 0;
}

static const struct cli_option options[] = {
    OPTION_FLAG("check", 'c', &check,
                "only validate: structure, checksums, shapes, numbers"),
    OPTION_FLAG("json", 0, &json, "one JSON object per record and line"),
    OPTION_FLAG("values", 0, &values,
                "with --json: every element, for spid-pack"),
    OPTION_STRING("safetensors", 0, &tensor_path, "FILE",
                  "write all arrays to one safetensors file"),
    OPTION_STRING("npy", 0, &npy_dir, "DIR",
                  "write all arrays to npy files, frames stacked"),
    OPTION_OUTPUT("ply", 0, &ply_path, "FILE",
                  "write the Gaussians as of the last record chosen"),
    OPTION_CALL("frames", 0, &frames, "A:B", dump_parse_frames,
                "only frames A to B - 1"),
    OPTION_STRING("only", 0, &only, "TYPE",
                  "only records of this type, or of several: MOTN,MESH"),
    { 0 }
};

static const struct cli_usage usage = {
    "spid-dump", "[OPTION ...] [STREAM]",
    "show or convert what a stream holds", options
};

/* What has gone by. */
struct tally {
    uint64_t records, bytes, first, last;
};

struct outputs {
    struct outfile text;
    struct recordfile *st, *npy;
    struct scene scene;        /* for --ply */
};

/* Everything that is asked for besides standard output. */
static int dump_open_outputs(struct outputs *out, struct error *err)
{
    if (tensor_path && !(out->st = recordfile_create_st(tensor_path, err)))
        return -1;
    if (npy_dir && !(out->npy = recordfile_create_npy(npy_dir, err)))
        return -1;
    return outfile_open_text(&out->text, cli.output, err);
}

/* Nothing is left of what was not completed. */
static void dump_abandon_outputs(struct outputs *out)
{
    recordfile_abandon(out->st);
    recordfile_abandon(out->npy);
    outfile_abandon(&out->text);
    scene_release(&out->scene);
}

/* By frame and type. */
static bool dump_is_wanted(const struct record *rec)
{
    const char *p = only;

    if (rec->frame < frames.first || rec->frame >= frames.end)
        return false;
    for (; p && *p; p += strcspn(p, ","), p += *p == ',')
        if (strncmp(p, rec->type, strcspn(p, ",")) == 0 &&
            strcspn(p, ",") == strcspn(rec->type, " "))
            return true;
    return !only;
}

/* A `json` array as it is, unprintable bytes as '.'. */
static void dump_print_text(FILE *f, const struct array *a)
{
    const unsigned char *s = a->data;

    fputs("    ", f);
    for (size_t i = 0; i < array_count(a); i++)
        putc(s[i] < ' ' || s[i] == 127 ? '.' : s[i], f);
    putc('\n', f);
}

/* Name, dtype, shape, smallest, mean and largest value. */
static void dump_print_array(FILE *f, const struct array *a)
{
    char shape[80] = "";
    struct array_stats s;
    int n = 0;

    for (int k = 0; k < a->ndim; k++)
        n += snprintf(shape + n, sizeof shape - (size_t)n, "%s%zu",
                      k ? "," : "", a->dim[k]);
    n = fprintf(f, "  %-8s %s[%s]", a->name, dtype_name(a->dtype), shape);
    fprintf(f, "%*s", n < 28 ? 28 - n : 1, "");
    array_stats(&s, a);
    if (array_count(a) > s.nonfinite)
        fprintf(f, "min %-12.6g mean %-12.6g max %.6g", s.min, s.mean,
                s.max);
    if (s.nonfinite)
        fprintf(f, " %zu not finite", s.nonfinite);
    putc('\n', f);
    if (a->dtype == DTYPE_U8 && strcmp(a->name, "json") == 0)
        dump_print_text(f, a);
}

/* A line of its own, then one for each array. */
static void dump_print_record(FILE *f, const struct record *rec)
{
    fprintf(f, "%s frame %llu, %.6g s: %d array%s, %zu bytes\n", rec->type,
            (unsigned long long)rec->frame, rec->time, rec->count,
            plural(rec->count), rec->payload_bytes);
    for (int i = 0; i < rec->count; i++)
        dump_print_array(f, &rec->array[i]);
}

/* The lines that are this program. */
static int dump_record(struct outputs *out, const struct record *rec,
                       struct error *err)
{
    if (check)
        return schema_check(rec, err) || record_check_finite(rec, err) ? -1
                                                                       : 0;
    FILE *text = out->text.file;

    if (ply_path && scene_apply(&out->scene, rec, err) < 0)
        return -1;
    if (json)
        recordjson_write(text, rec, values);
    else if (!out->st && !out->npy && !ply_path)
        dump_print_record(text, rec);
    if (ferror(text) || fflush(text))
        return outfile_error(&out->text, err);
    if (out->st && recordfile_add(out->st, rec, err))
        return -1;
    return out->npy ? recordfile_add(out->npy, rec, err) : 0;
}

/* For the line that --check prints. */
static void dump_count_record(struct tally *t, const struct record *rec)
{
    if (t->records == 0 || rec->frame < t->first)
        t->first = rec->frame;
    if (t->records == 0 || rec->frame > t->last)
        t->last = rec->frame;
    t->records++;
    t->bytes += 64 + rec->payload_bytes;
}

/* Every record; the result of the last stream_read. */
static int dump_stream(struct stream_reader *in, struct outputs *out,
                       struct tally *tally, struct error *err)
{
    struct record rec;
    double begun;
    int rc;

    for (;;) {
        begun = stats_begin();
        rc = stream_read(in, &rec, err);
        stats_end("read", begun);
        if (rc <= 0)
            break;
        if (!dump_is_wanted(&rec))
            continue;
        begun = stats_begin();
        rc = dump_record(out, &rec, err);
        stats_end(check ? "check" : "write", begun);
        if (rc) {
            if (err->code == EX_DATAERR)
                stream_blame(in, &rec, err);
            return -1;
        }
        dump_count_record(tally, &rec);
        if (!check)
            progress("record", tally->records, 0, NULL);
    }
    progress_end();
    return rc;
}

/* Complete all files. */
static int dump_finish_outputs(struct outputs *out, struct error *err)
{
    struct recordfile *st = out->st, *npy = out->npy;

    out->st = NULL;
    if (st && recordfile_finish(st, err))
        return -1;
    out->npy = NULL;
    if (npy && recordfile_finish(npy, err))
        return -1;
    if (ply_path && !out->scene.mean)
        return error_set(err, EX_DATAERR, "no Gaussians for --ply (expected "
                         "a GAUS record)");
    if (ply_path && ply_write(ply_path, &out->scene.g, true, err))
        return -1;
    return outfile_close(&out->text, err);
}

int main(int argc, char **argv)
{
    struct outputs out = { 0 };
    struct tally tally = { 0 };
    struct error err = { 0 };
    struct stream_reader *in;
    int rc, first = cli_parse(&usage, argc, argv);
    const char *input = cli_stream_operand(first, argc, argv);

    if (values && !json)
        die(EX_USAGE, "--values needs --json");
    cpu_keep_denormals();
    in = stream_open(input, NULL, &err);
    if (!in)
        die_error(&err);
    rc = dump_open_outputs(&out, &err);
    if (rc == 0)
        rc = dump_stream(in, &out, &tally, &err);
    if (check && rc == 0 && !cli.quiet)
        fprintf(out.text.file, "%s: %llu record%s, frames %llu to %llu, %llu "
                "bytes: ok\n", stream_name(in),
                (unsigned long long)tally.records, plural(tally.records),
                (unsigned long long)tally.first,
                (unsigned long long)tally.last,
                (unsigned long long)tally.bytes + 64);
    /* even of a damaged stream what was read is kept */
    if ((rc == 0 || tally.records) &&
        dump_finish_outputs(&out, rc == 0 ? &err : NULL))
        rc = -1;
    dump_abandon_outputs(&out);
    stream_close(in);
    if (rc < 0)
        die_error(&err);
    stats_write();
    return 0;
}
