/* libFuzzer target: glTF, its Gaussians, its posed mesh and what is said of
 * it.  What is not in the binary form is taken as the JSON of a file whose
 * other bytes are zeros, so that it is JSON that changes and not its length. */
#include <stdlib.h>
#include <string.h>

#include "formats/glb.h"
#include "formats/splats.h"
#include "tests/fuzz/memory_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* Of seed/fuzz_glb/head.glb. */
#define HEAD_VERTICES 12
#define HEAD_FACES 10

/* Bytes of the binary part behind such JSON. */
#define BINARY_BYTES 8192
#define MAX_JSON 65536

/* JSON as a whole file in out, or the bytes as they are. */
static size_t glb_wrap(uint8_t *out, const uint8_t *data, size_t size)
{
    const uint32_t room = (uint32_t)(size + 3) & ~3u;
    const uint32_t head[5] = { 0x46546c67, 2, 28 + room + BINARY_BYTES, room,
                               0x4e4f534a };
    const uint32_t binary[2] = { BINARY_BYTES, 0x004e4942 };

    if (size >= 4 && !memcmp(data, "glTF", 4)) {
        memcpy(out, data, size);
        return size;
    }
    memcpy(out, head, sizeof head);
    memset(out + sizeof head, ' ', room);
    memcpy(out + sizeof head, data, size);
    memcpy(out + sizeof head + room, binary, sizeof binary);
    memset(out + sizeof head + room + sizeof binary, 0, BINARY_BYTES);
    return head[2];
}

/* What glb_lint says goes nowhere. */
static void glb_ignore(void *context, const char *text)
{
    (void)context;
    (void)text;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    float verts[3 * HEAD_VERTICES];
    int32_t faces[3 * HEAD_FACES];
    struct splats s;
    struct error err;
    volatile float sum = 0;
    char path[40];
    static uint8_t whole[28 + MAX_JSON + BINARY_BYTES];
    int fd;

    if (size == 0 || size > MAX_JSON)
        return 0;
    fd = memory_file(path, whole, glb_wrap(whole, data, size));
    if (fd < 0)
        return 0;
    if (glb_read_splats(&s, 1, path, &err) == 0)
        for (size_t i = 0; i < s.n; i++)
            sum += s.mean[3 * i] + s.color[3 * i + 2] + s.quat[4 * i + 3];
    splats_release(&s);
    glb_lint(path, glb_ignore, NULL, &err);
    glb_read_posed(verts, faces, HEAD_VERTICES, HEAD_FACES, path, &err);
    (void)sum;              /* every number has been read */
    close(fd);
    return 0;
}
