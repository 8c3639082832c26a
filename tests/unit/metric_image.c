/* SSIM against its definition written out pixel by pixel, and the gradients
 * of SSIM and MS-SSIM against central differences. */
#include <math.h>
#include <stdlib.h>

#include "lib/base/random.h"
#include "lib/lab/eval/filter.h"
#include "lib/lab/eval/image.h"
#include "tests/check.h"

static double image_window(int i, int j)
{
    double sum = 0, g[11];

    for (int k = 0; k < 11; k++)
        sum += g[k] = exp(-(k - 5) * (k - 5) / 4.5);
    return g[i] * g[j] / (sum * sum);
}

static double ssim_at(const float *a, const float *b, size_t W, size_t y,
                      size_t x)
{
    double ma = 0, mb = 0, va = 0, vb = 0, vab = 0;

    for (int i = 0; i < 11; i++)
        for (int j = 0; j < 11; j++) {
            ma += image_window(i, j) * a[(y + i) * W + x + j];
            mb += image_window(i, j) * b[(y + i) * W + x + j];
        }
    for (int i = 0; i < 11; i++)
        for (int j = 0; j < 11; j++) {
            double da = a[(y + i) * W + x + j] - ma;
            double db = b[(y + i) * W + x + j] - mb;
            va += image_window(i, j) * da * da;
            vb += image_window(i, j) * db * db;
            vab += image_window(i, j) * da * db;
        }
    return (2 * ma * mb + 1e-4) / (ma * ma + mb * mb + 1e-4) *
           (2 * vab + 9e-4) / (va + vb + 9e-4);
}

static void image_test_fill(float *x, size_t n, const char *name)
{
    struct random r;

    random_init(&r, 5, name);
    for (size_t i = 0; i < n; i++)
        x[i] = (float)random_uniform(&r);
}

static void check_plain(void)
{
    enum { H = 19, W = 23 };
    float a[3 * H * W], b[3 * H * W];
    double map[3 * (H - 10) * (W - 10)], worst = 0, mean = 0;
    struct metric_ssim s;

    image_test_fill(a, 3 * H * W, "a");
    image_test_fill(b, 3 * H * W, "b");
    if (metric_ssim(&s, map, NULL, a, b, 3, H, W, NULL))
        exit(1);
    for (size_t c = 0, i = 0; c < 3; c++)
        for (size_t y = 0; y < H - 10; y++)
            for (size_t x = 0; x < W - 10; x++, i++) {
                double want = ssim_at(a + c * H * W, b + c * H * W, W, y, x);
                worst = fmax(worst, fabs(map[i] - want));
                mean += want / (3 * (H - 10) * (W - 10));
            }
    expect("ssim map, worst pixel", worst, 0, 1e-12);
    expect("ssim mean", s.mean, mean, 1e-12);
    metric_ssim(&s, NULL, NULL, a, a, 3, H, W, NULL);
    expect("ssim of a picture with itself", s.mean, 1, 1e-12);
}

/* Central differences at a few pixels, in steps exact in float. */
static void check_gradient(const char *what, int multi, size_t H, size_t W)
{
    size_t n = 3 * H * W;
    float *a = malloc(n * sizeof *a), *b = malloc(n * sizeof *b);
    double *db = malloc(n * sizeof *db), e = 1.0 / 1024, worst = 0, big = 0;
    struct metric_ssim s;
    struct metric_msssim m;

    image_test_fill(a, n, "a");
    image_test_fill(b, n, "n");
    for (size_t i = 0; i < n; i++)
        b[i] = roundf((0.7f * a[i] + 0.3f * b[i]) * 65536) / 65536;
    if (multi ? metric_msssim(&m, db, a, b, 3, H, W, NULL)
              : metric_ssim(&s, NULL, db, a, b, 3, H, W, NULL))
        exit(1);
    for (size_t i = 0; i < n; i++)
        big = fmax(big, fabs(db[i]));
    for (size_t i = 3; i < n; i += n / 7) {
        float keep = b[i];
        double f[2];
        for (int k = 0; k < 2; k++) {
            b[i] = keep + (float)(k ? e : -e);
            if (multi)
                metric_msssim(&m, NULL, a, b, 3, H, W, NULL);
            else
                metric_ssim(&s, NULL, NULL, a, b, 3, H, W, NULL);
            f[k] = multi ? m.mean : s.mean;
        }
        b[i] = keep;
        worst = fmax(worst, fabs((f[1] - f[0]) / (2 * e) - db[i]));
    }
    expect(what, worst / big, 0, 1e-4);
    free(a);
    free(b);
    free(db);
}

int main(void)
{
    float a[4] = {0, 0.5f, 1, 0.25f}, b[4] = {0, 0.25f, 1, 0.5f};
    struct metric_ssim s;
    double sum = 0;

    for (int k = 0; k < METRIC_WINDOW; k++)
        sum += metric_taps[k];
    expect("sum of the taps", sum, 1, 1e-15);
    expect("l1", metric_l1(a, b, 4), 0.125, 0);
    expect("mse", metric_mse(a, b, 4), 0.03125, 0);
    expect("psnr", metric_psnr(0.01), 20, 1e-12);
    expect("psnr of equal pictures is infinite", isinf(metric_psnr(0)), 1, 0);
    expect("flicker", metric_flicker(a, a, a, b, 4), 0.125, 0);
    expect("side under 11 refused",
           metric_ssim(&s, NULL, NULL, a, b, 1, 2, 2, NULL), -1, 0);
    check_plain();
    check_gradient("ssim gradient, relative error", 0, 31, 29);
    check_gradient("ms-ssim gradient, relative error", 1, 163, 178);
    return check_status();
}
