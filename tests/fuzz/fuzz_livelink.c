/* libFuzzer target: takes of Live Link Face, CSV. */
#include <math.h>

#include "formats/livelink.h"
#include "tests/fuzz/memory_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* Rows that a file of this size can lead to: a minute at eight of a frame, of
 * at most 120 a second, for each of its rows. */
#define ROWS_PER_BYTE 60000

/* 1 when time does not go on, or never ends. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct livelink_frame f;
    struct livelink *l;
    struct error err;
    double last = -1;
    size_t rows = 0, unknown;
    char path[40];
    int bad = 0;
    const int fd = memory_file(path, data, size);

    if (fd < 0)
        return 0;
    l = livelink_open(path, 0, &err);
    while (l && livelink_read(l, &f, &err) == 1) {
        bad |= !(f.time > last) || !isfinite(f.value[LIVELINK_HEAD]);
        last = f.time;
        if (++rows > ROWS_PER_BYTE * size) {
            bad = 1;
            break;
        }
    }
    if (l)
        (void)livelink_unknown(l, &unknown);
    livelink_close(l);
    close(fd);
    return bad;
}
