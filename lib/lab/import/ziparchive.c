/* The directory is read and checked whole before the first entry is. */
#include "lib/lab/import/ziparchive.h"

#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>
#include <zip.h>

/* Bytes of the fixed parts of the format. */
enum { LOCAL = 30, CENTRAL = 46, TAIL = 22 };

struct entry {
    const char *name;           /* libzip's, valid until it is closed */
    uint64_t size, packed;
};

struct ziparchive {
    zip_t *zip;
    struct entry *entry;
    size_t count;
};

/* ---- opening ------------------------------------------------------------ */

/* What is stored as it is or deflated, not encrypted, and no bomb: a few
 * bytes that claim to be many. */
static int ziparchive_check_entry(struct entry *e, zip_t *zip, size_t i,
                                  struct error *err)
{
    const uint64_t want = ZIP_STAT_NAME | ZIP_STAT_SIZE | ZIP_STAT_COMP_SIZE |
                          ZIP_STAT_COMP_METHOD | ZIP_STAT_ENCRYPTION_METHOD;

    zip_stat_t st;

    if (zip_stat_index(zip, i, 0, &st) || (st.valid & want) != want)
        return error_set(err, EX_DATAERR, "entry %zu: %s", i,
                         zip_strerror(zip));
    if (st.encryption_method != ZIP_EM_NONE)
        return error_set(err, EX_DATAERR, "%s: is encrypted", st.name);
    if (st.comp_method != ZIP_CM_STORE && st.comp_method != ZIP_CM_DEFLATE)
        return error_set(err, EX_DATAERR, "%s: compression method %d "
                         "(expected stored or deflated)", st.name,
                         st.comp_method);
    if (st.comp_method == ZIP_CM_STORE && st.size != st.comp_size)
        return error_set(err, EX_DATAERR, "%s: stored, %llu bytes as %llu",
                         st.name, (unsigned long long)st.size,
                         (unsigned long long)st.comp_size);
    if (st.size > ZIP_SMALL && st.size / ZIP_MAX_RATIO > st.comp_size)
        return error_set(err, EX_DATAERR, "%s: %llu bytes from %llu (expected "
                         "at most %d times as many)", st.name,
                         (unsigned long long)st.size,
                         (unsigned long long)st.comp_size, ZIP_MAX_RATIO);
    e->name = st.name;
    e->size = st.size;
    e->packed = st.comp_size;
    return 0;
}

/* Entries that lie behind each other need at least this much; where they do
 * not fit, some share bytes. */
static int ziparchive_check_room(const struct ziparchive *z, uint64_t bytes,
                                 struct error *err)
{
    unsigned __int128 need = TAIL;

    for (size_t i = 0; i < z->count; i++)
        need += (unsigned __int128)z->entry[i].packed + LOCAL + CENTRAL +
                2 * strlen(z->entry[i].name);
    if (need > bytes)
        return error_set(err, EX_DATAERR, "entries of at least %llu bytes in "
                         "a file of %llu: they overlap, or the sizes lie",
                         (unsigned long long)need,
                         (unsigned long long)bytes);
    return 0;
}

/* All entries, checked. */
static int ziparchive_read_directory(struct ziparchive *z, const char *path,
                                     struct error *err)
{
    zip_int64_t n = zip_get_num_entries(z->zip, 0);
    struct stat st;

    if (n < 0 || n > ZIP_MAX_ENTRIES)
        return error_set(err, EX_DATAERR, "%lld entries (expected at most "
                         "%d)", (long long)n, ZIP_MAX_ENTRIES);
    z->entry = calloc((size_t)n + 1, sizeof *z->entry);
    if (!z->entry)
        return error_set(err, EX_OSERR, "out of memory");
    for (z->count = 0; z->count < (size_t)n; z->count++)
        if (ziparchive_check_entry(&z->entry[z->count], z->zip, z->count, err))
            return -1;
    if (stat(path, &st))
        return error_set(err, EX_NOINPUT, "cannot be read");
    return ziparchive_check_room(z, (uint64_t)st.st_size, err);
}

struct ziparchive *ziparchive_open(const char *path, struct error *err)
{
    struct ziparchive *z = calloc(1, sizeof *z);

    zip_error_t why;
    int code = 0;

    if (!z)
        return error_null(err, EX_OSERR, "out of memory");
    /* the check for consistency refuses names that stand twice */
    z->zip = zip_open(path, ZIP_RDONLY | ZIP_CHECKCONS, &code);
    if (!z->zip) {
        zip_error_init_with_code(&why, code);
        error_set(err, EX_DATAERR, "not a sound zip archive: %s",
                  zip_error_strerror(&why));
        zip_error_fini(&why);
        free(z);
        return NULL;
    }
    if (ziparchive_read_directory(z, path, err)) {
        ziparchive_close(z);
        return NULL;
    }
    return z;
}

void ziparchive_close(struct ziparchive *z)
{
    if (!z)
        return;
    zip_discard(z->zip);
    free(z->entry);
    free(z);
}

/* ---- entries ------------------------------------------------------------ */

size_t ziparchive_count(const struct ziparchive *z)
{
    return z->count;
}

const char *ziparchive_name(const struct ziparchive *z, size_t i)
{
    return z->entry[i].name;
}

size_t ziparchive_size(const struct ziparchive *z, size_t i)
{
    return (size_t)z->entry[i].size;
}

size_t ziparchive_find(const struct ziparchive *z, const char *name)
{
    const zip_int64_t i = zip_name_locate(z->zip, name, 0);

    return i < 0 ? SIZE_MAX : (size_t)i;
}

/* Up to `bytes` bytes; -1 when the archive is damaged. */
static zip_int64_t ziparchive_read_some(void *out, zip_file_t *f,
                                        uint64_t bytes)
{
    uint64_t done = 0;

    zip_int64_t n = 0;

    while (done < bytes &&
           (n = zip_fread(f, (char *)out + done, bytes - done)) > 0)
        done += (uint64_t)n;
    return n < 0 ? -1 : (zip_int64_t)done;
}

static zip_file_t *ziparchive_open_entry(struct ziparchive *z, size_t i,
                                         struct error *err)
{
    zip_file_t *f = zip_fopen_index(z->zip, i, 0);

    if (!f)
        error_set(err, EX_DATAERR, "%s: %s", z->entry[i].name,
                  zip_strerror(z->zip));
    return f;
}

int ziparchive_peek(void *out, size_t bytes, size_t *have,
                    struct ziparchive *z, size_t i, struct error *err)
{
    zip_file_t *f = ziparchive_open_entry(z, i, err);
    zip_int64_t n = f ? ziparchive_read_some(out, f, bytes) : -1;

    if (n < 0 && f)
        error_set(err, EX_DATAERR, "%s: %s", z->entry[i].name,
                  zip_file_strerror(f));
    if (f)
        zip_fclose(f);
    *have = n < 0 ? 0 : (size_t)n;
    return n < 0 ? -1 : 0;
}

int ziparchive_read(void *out, struct ziparchive *z, size_t i,
                    struct error *err)
{
    const struct entry *e = &z->entry[i];

    zip_file_t *f = ziparchive_open_entry(z, i, err);
    zip_int64_t done, end = 0;
    char more;
    int rc = 0;

    if (!f)
        return -1;
    done = ziparchive_read_some(out, f, e->size);
    if (done >= 0)              /* reading on to the end checks the sum */
        end = zip_fread(f, &more, 1);
    if (done < 0 || end < 0)
        rc = error_set(err, EX_DATAERR, "%s: %s", e->name,
                       zip_file_strerror(f));
    else if (end || (uint64_t)done != e->size)
        rc = error_set(err, EX_DATAERR, "%s: has %s bytes than the %llu that "
                       "the directory says", e->name, end ? "more" : "fewer",
                       (unsigned long long)e->size);
    zip_fclose(f);
    return rc;
}
