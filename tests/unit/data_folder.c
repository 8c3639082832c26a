/* Folders of streams by any name: blanks, the letters of patterns, a path of
 * more than a thousand bytes; in order of names, looked up anew. */
#include <string.h>
#include <sys/stat.h>

#include "lib/lab/data/data.h"
#include "tests/check.h"
#include "tests/folder.h"
#include "tests/unit/train_toy.h"

#define S 64

/* Copy of a stream at to/name. */
static void data_copy(const char *to, const char *name, const char *from)
{
    char *path, *command;

    if (asprintf(&path, "%s/%s", to, name) < 0 ||
        asprintf(&command, "cp '%s' '%s'", from, path) < 0 || system(command))
        exit(1);
    free(path);
    free(command);
}

/* A folder in the test's, of a path with so many bytes at least. */
static char *data_make_folder(const char *name, size_t bytes)
{
    char *path;

    if (asprintf(&path, "%s/%s", folder_at(""), name) < 0 || mkdir(path, 0777))
        exit(1);
    while (strlen(path) < bytes) {
        char *deeper;

        if (asprintf(&deeper, "%s/%0*d", path, 200, 0) < 0 ||
            mkdir(deeper, 0777))
            exit(1);
        free(path);
        path = deeper;
    }
    return path;
}

/* People that one pass over a folder of two streams, a text and a hidden file
 * gives; -1 if it fails. */
static int data_people(char *path, const char *stream)
{
    const char *names[1] = {path};
    struct error err = {0};
    int n = 0, rc;

    data_copy(path, "a.spid", stream);
    data_copy(path, "b.spid", stream);
    data_copy(path, "c.txt", stream);
    data_copy(path, ".d.spid", stream);
    struct data_reader *r = data_open(names, 1, 0, &err);
    if (!r) {
        printf("%s\n", err.text);
        free(path);
        return -1;
    }
    data_once(r);
    for (;;) {
        struct data_person p = {0};

        rc = data_next(r, &p, &err);
        if (rc)
            break;
        n++;
        data_person_release(&p);
    }
    data_close(r);
    free(path);
    return rc < 0 ? -1 : n;
}

int main(void)
{
    struct head h;

    folder_make();
    const char *stream = folder_at("p.txt");
    toy_head(&h, 8);
    toy_stream(stream, &h, 1, 2, S);
    head_release(&h);
    expect("a folder", data_people(data_make_folder("plain", 0), stream), 2,
           0);
    expect("a name with what patterns are made of",
           data_people(data_make_folder("[abc] * {d,e}? ~ x", 0), stream),
           2, 0);
    expect("a path of 1,500 bytes",
           data_people(data_make_folder("deep", 1500), stream), 2, 0);
    return folder_remove() || check_status();
}
