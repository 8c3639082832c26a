/* libFuzzer target: Gaussian scenes as PLY, read, lit and looked over. */
#include "formats/ply.h"
#include "tests/fuzz/memory_file.h"

/* What ply_lint says goes nowhere. */
static void ply_ignore(void *context, const char *text)
{
    (void)context;
    (void)text;
}

static int ply_read_all(const char *path)
{
    const float eye[3] = { 0, 0, 2 };
    struct splats s;
    struct error err;

    if (ply_read(&s, path, true, &err) == 0)
        ply_shade(&s, eye);
    splats_release(&s);
    ply_lint(path, ply_ignore, NULL, &err);
    return 0;
}

FUZZ_FILE(ply_read_all)
