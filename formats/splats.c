/* One block for all arrays of a file's Gaussians. */
#include "formats/splats.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

int splats_allocate(struct splats *s, size_t n, int nrest, const char *path,
                    struct error *err)
{
    float *p = malloc((n * (14 + (size_t)nrest) + 1) * sizeof *p);

    if (!p)
        return error_set(err, EX_OSERR, "%s: out of memory for %zu Gaussians",
                         path, n);
    s->n = n;
    s->degree = nrest == 45 ? 3 : nrest == 24 ? 2 : nrest == 9;
    s->mean = p;
    s->scale = p + 3 * n;
    s->quat = p + 6 * n;
    s->opacity = p + 10 * n;
    s->color = p + 11 * n;
    s->rest = nrest ? p + 14 * n : NULL;
    return 0;
}

void splats_release(struct splats *s)
{
    free(s->mean);
    memset(s, 0, sizeof *s);
}

struct gaussians splats_set(const struct splats *s)
{
    return (struct gaussians){.n = s->n, .channels = 3, .mean = s->mean,
                              .scale = s->scale, .quat = s->quat,
                              .opacity = s->opacity, .color = s->color};
}
