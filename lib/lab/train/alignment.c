/* Landmarks of heat maps, how far they lie apart, and the gradient. */
#include "lib/lab/train/alignment.h"

#include <string.h>
#include <sysexits.h>

#include "lib/base/resample.h"

#define RADIUS 3                  /* pixels around a map's largest value */

int alignment_open(struct alignment *a, const char *path, size_t side,
                   struct error *err)
{
    const struct nn_options opt = {NN_FROZEN, NN_F32};
    struct safetensors *st = st_open(path, err);
    size_t stacks, width, n = side / 4;
    int rc = -1;

    memset(a, 0, sizeof *a);
    params_init(&a->ps);
    nn_plan_init(&a->plan, opt);
    if (side % FAN_MULTIPLE) {
        error_set(err, EX_DATAERR, "face alignment on %zu pixels (expected a "
                  "multiple of %d)", side, FAN_MULTIPLE);
        goto out;
    }
    if (!st || fan_size(&stacks, &width, st, err))
        goto out;
    tape_init(&a->net, &a->ps, 3, true);
    a->heat = fan_declare(&a->net, stacks, width);
    if (params_allocate(&a->ps, err) || params_load(&a->ps, st, "", err) ||
        tape_plan(&a->net, 1, side, side, opt, err))
        goto out;
    a->side = side;
    a->crop = nn_plan_floats(&a->plan, side * side * 3);
    a->dcrop = nn_plan_floats(&a->plan, side * side * 3);
    a->grid = nn_plan_floats(&a->plan, side * side * 2);
    a->dheat = nn_plan_floats(&a->plan, n * n * FAN_LANDMARKS);
    rc = nn_plan_finish(&a->plan, err);
out:
    st_close(st);
    if (rc)
        alignment_release(a);
    return rc;
}

void alignment_release(struct alignment *a)
{
    tape_release(&a->net);
    nn_plan_release(&a->plan);
    params_release(&a->ps);
    memset(a, 0, sizeof *a);
}

/* The pixels around the largest value of map k, rows y0 <= y < y1. */
struct alignment_reach { size_t x0, x1, y0, y1; };

/* The window of landmark k's heat map about its highest value. */
static struct alignment_reach alignment_peak(const float *heat, size_t n,
                                             size_t k)
{
    size_t at = 0;

    for (size_t i = 1; i < n * n; i++)
        if (heat[i * FAN_LANDMARKS + k] > heat[at * FAN_LANDMARKS + k])
            at = i;
    size_t x = at % n, y = at / n;
    return (struct alignment_reach){
        x > RADIUS ? x - RADIUS : 0, x + RADIUS + 1 < n ? x + RADIUS + 1 : n,
        y > RADIUS ? y - RADIUS : 0, y + RADIUS + 1 < n ? y + RADIUS + 1 : n
    };
}

/* The centre of mass of map k; its mass, 0 when nothing is positive. */
static double alignment_centre(double at[2], const float *heat, size_t n,
                               size_t k)
{
    struct alignment_reach r = alignment_peak(heat, n, k);
    double mass = 0, sum[2] = {0};

    for (size_t y = r.y0; y < r.y1; y++)
        for (size_t x = r.x0; x < r.x1; x++) {
            double v = (double)heat[(y * n + x) * FAN_LANDMARKS + k];

            if (v <= 0)
                continue;
            mass += v;
            sum[0] += v * (double)x;
            sum[1] += v * (double)y;
        }
    for (int i = 0; i < 2 && mass > 0; i++)
        at[i] = sum[i] / mass;
    return mass;
}

/* d is the gradient of a centre at `at`; in the forward pass this was
 * at = sum v x / mass. */
static void alignment_centre_backward(float *dheat, const float *heat,
                                      const double d[2], const double at[2],
                                      double mass, size_t n, size_t k)
{
    struct alignment_reach r = alignment_peak(heat, n, k);

    for (size_t y = r.y0; y < r.y1; y++)
        for (size_t x = r.x0; x < r.x1; x++) {
            size_t i = (y * n + x) * FAN_LANDMARKS + k;

            if (heat[i] > 0)
                dheat[i] = (float)((d[0] * ((double)x - at[0]) +
                                    d[1] * ((double)y - at[1])) / mass);
        }
}

/* The heat maps of square q of a picture (H,W,3). */
static const float *alignment_look(struct alignment *a, const float *rgb,
                                   size_t H, size_t W, struct square q)
{
    const double w = (double)W, h = (double)H;
    const float theta[6] = {
        (float)(q.size / w), 0, (float)(2 * q.x / w - 1),
        0, (float)(q.size / h), (float)(2 * q.y / h - 1)
    };

    affine_grid(a->grid, theta, 1, a->side, a->side, false);
    grid_sample(a->crop, rgb, a->grid, 1, H, W, 3, a->side * a->side, false,
                RESAMPLE_ZEROS);
    tape_forward(NULL, a->crop, &a->net);
    return tape_map(NULL, &a->net, a->heat);
}

void alignment_target(struct alignment *a, const float *rgb, size_t H,
                      size_t W, struct square q)
{
    const float *heat = alignment_look(a, rgb, H, W, q);

    for (size_t k = 0; k < FAN_LANDMARKS; k++)
        a->seen[k] = alignment_centre(a->target[k], heat, a->side / 4, k) > 0;
}

double alignment_loss(float *drgb, const float *rgb, size_t H, size_t W,
                      struct square q, double weight, struct alignment *a)
{
    size_t n = a->side / 4;
    double unit = weight / ((double)(n * n) * FAN_LANDMARKS), sum = 0;
    const float *heat = alignment_look(a, rgb, H, W, q);

    memset(a->dheat, 0, n * n * FAN_LANDMARKS * sizeof *a->dheat);
    for (size_t k = 0; k < FAN_LANDMARKS; k++) {
        double at[2], d[2], mass = alignment_centre(at, heat, n, k);

        if (!a->seen[k] || mass <= 0)
            continue;
        for (int i = 0; i < 2; i++) {
            d[i] = 2 * unit * (at[i] - a->target[k][i]);
            sum += 0.5 * d[i] * (at[i] - a->target[k][i]);
        }
        alignment_centre_backward(a->dheat, heat, d, at, mass, n, k);
    }
    tape_backward(a->dcrop, &(struct tape_seed){a->heat, a->dheat}, 1, &a->net);
    grid_sample_backward(drgb, NULL, a->dcrop, rgb, a->grid, 1, H, W, 3,
                         a->side * a->side, false, RESAMPLE_ZEROS);
    return sum;
}
