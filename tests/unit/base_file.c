/* Text files read whole: what is there to the byte, up to the size allowed and
 * not beyond it; a read that fails is an error, not an empty text. */
#include <string.h>
#include <sys/resource.h>
#include <sysexits.h>

#include "lib/base/file.h"
#include "tests/check.h"
#include "tests/folder.h"

static void file_write(const char *path, size_t n, const char *last)
{
    FILE *f = fopen(path, "wb");

    for (size_t i = 0; i + 1 < n; i++)
        putc('a' + (int)(i % 26), f);
    if (n)
        fwrite(last, 1, 1, f);
    fclose(f);
}

/* Whether a file of n bytes comes back when `max` are allowed. */
static bool file_returns(const char *path, size_t n, size_t max)
{
    struct error err = {0};

    file_write(path, n, ".");
    char *text = file_read_text(path, max, &err);
    bool ok = text && strlen(text) == n && (n == 0 || text[n - 1] == '.') &&
              (n < 2 || text[n - 2] == 'a' + (int)((n - 2) % 26));

    free(text);
    return ok;
}

/* Whether it is refused with this code and a message with this in it. */
static bool file_fails(const char *path, size_t max, int code,
                       const char *message)
{
    struct error err = {0};
    char *text = file_read_text(path, max, &err);

    free(text);
    return !text && err.code == code && strstr(err.text, message) &&
           strncmp(err.text, path, strlen(path)) == 0;
}

/* Whether a file of n bytes is not mapped, with this code and message, while
 * there is no memory for more. */
static bool file_unmapped(const char *path, size_t n, int code,
                          const char *message)
{
    struct rlimit before, none;
    struct error err = {0};
    size_t bytes;

    file_write(path, n, ".");
    getrlimit(RLIMIT_AS, &before);
    none = (struct rlimit){0, before.rlim_max};
    setrlimit(RLIMIT_AS, &none);
    const bool failed = !file_map(&bytes, path, &err);

    setrlimit(RLIMIT_AS, &before);
    return failed && err.code == code && strstr(err.text, message);
}

int main(void)
{
    const size_t sizes[] = {0, 1, 2, 4095, 4096, 4097, 12288, 100001};
    bool all = true, exact = true, refused = true;

    folder_make();
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        all = all && file_returns(folder_at("text"), sizes[i], 1 << 20);
        exact = exact && file_returns(folder_at("text"), sizes[i], sizes[i]);
        refused = refused && (sizes[i] == 0 ||
                              file_fails(folder_at("text"), sizes[i] - 1, EX_DATAERR,
                                         "more than"));
    }
    check_that("texts of any size", all);
    check_that("  as large as is allowed", exact);
    check_that("  and none larger", refused);
    file_write(folder_at("text"), 7, "");
    check_that("bytes are no text", file_fails(folder_at("text"), 99, EX_DATAERR,
                                               "not a text file"));
    check_that("no such file", file_fails(folder_at("none"), 99, EX_NOINPUT, "No such"));
    check_that("a read that fails", file_fails(folder, 99, EX_IOERR,
                                               "cannot be read"));
    check_that("an empty file is not mapped",
               file_unmapped(folder_at("text"), 0, EX_DATAERR, ": empty"));
    check_that("nor one without memory: the system's reason is said",
               file_unmapped(folder_at("text"), 9, EX_OSERR, "memory"));
    return folder_remove() || check_status();
}
