/* The network sees the portrait at its own size; what it says is brought to
 * the portrait's by matte_refine. */
#include "lib/photo/network_matte.h"

#include <stdlib.h>
#include <sysexits.h>

#include "formats/matte.h"
#include "lib/base/crop.h"

int network_matte(uint8_t *matte, bool *absurd, const uint8_t *rgb,
                  const uint8_t *head, const uint8_t *inside, size_t S,
                  struct matte_net *net, struct error *err)
{
    const size_t n = MATTE_SIDE, pixels = n * n;
    const double half = 0.5 * (double)S;
    uint8_t *small = malloc(3 * pixels);
    float *x = malloc(4 * pixels * sizeof *x), *coarse = x + 3 * pixels;
    int rc = -1;

    if (!small || !x ||
        crop_resize_u8(small, n, rgb, S, S, 3 * S, 3,
                       (struct square){half, half, (double)S})) {
        error_set(err, EX_OSERR, "no memory for the matte");
        goto out;
    }
    for (size_t i = 0; i < 3 * pixels; i++)
        x[i] = (float)small[i] / 255;
    matte_net_forward(coarse, x, net);
    for (size_t i = 0; i < pixels; i++)
        coarse[i] = (float)matte_net_alpha(coarse[i]);
    rc = matte_refine(matte, absurd, coarse, n, rgb, head, inside, S, err);
out:
    free(small);
    free(x);
    return rc;
}
