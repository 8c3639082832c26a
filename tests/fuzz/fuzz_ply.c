/* libFuzzer target: Gaussian scenes as PLY, read, lit and looked over. */
#include "formats/ply.h"
#include "tests/fuzz/memory_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* What ply_lint says goes nowhere. */
static void ply_ignore(void *context, const char *text)
{
    (void)context;
    (void)text;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const float eye[3] = { 0, 0, 2 };
    struct ply_scene s;
    struct error err;
    char path[40];
    const int fd = memory_file(path, data, size);

    if (fd < 0)
        return 0;
    if (ply_read(&s, path, true, &err) == 0)
        ply_shade(&s, eye);
    ply_release(&s);
    ply_lint(path, ply_ignore, NULL, &err);
    close(fd);
    return 0;
}
