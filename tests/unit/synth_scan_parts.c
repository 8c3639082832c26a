/* What people of the scans are built from, on small inputs: meshes and
 * bindings from text, panoramas, the nearest points of a grid, harmonics
 * against sums over the sphere, visibility moments, triangles, and the camera
 * that stands in for a nearer one. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

#include "formats/panorama.h"
#include "lib/lab/people/wavefront.h"
#include "lib/base/random.h"
#include "lib/lab/people/codec.h"
#include "lib/lab/people/scan_light.h"
#include "lib/lab/people/scan_near.h"
#include "lib/lab/people/tri.h"
#include "lib/base/vec3.h"

static int failures;
static struct arena memory;

static void parts_check(int ok, const char *what)
{
    printf("%s: %s\n", ok ? "ok" : "FAILED", what);
    failures += !ok;
}

static const char *file_of(const char *name, const void *data, size_t size)
{
    static char path[256];
    FILE *f;

    snprintf(path, sizeof path, "/tmp/spid-scan-%ld-%s", (long)getpid(),
             name);
    f = fopen(path, "wb");
    if (!f || fwrite(data, 1, size, f) != size || fclose(f))
        parts_check(0, "a file could be written");
    return path;
}

/* ---- text ---------------------------------------------------------------- */

static int obj_fails(const char *text, const char *word)
{
    struct wavefront m;
    struct error err = {0};
    const char *path = file_of("a.obj", text, strlen(text));
    int rc = wavefront_read(&m, path, NULL, &memory, &err);

    unlink(path);
    return rc && err.code == EX_DATAERR && strstr(err.text, path)
           && strstr(err.text, word);
}

static void check_obj(void)
{
    static const char good[] = "# a quad\nv 0 0 0\nv 1 0 0\nv 1 1 0\n"
        "v 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\ng body\nf 1/1 2/2 3/3 "
        "4/4\ng other\nf 1/1 2/2 3/3\n";
    struct wavefront m;
    struct error err = {0};
    const char *path = file_of("a.obj", good, sizeof good - 1);

    parts_check(!wavefront_read(&m, path, "body", &memory, &err) && m.nv == 4
                    && m.nf == 2 && m.f[3] == 0 && m.f[4] == 2 && m.f[5] == 3
                    && m.ft[4] == 2 && m.vt[5] == 1,
                "a quad is two triangles, of its group alone");
    unlink(path);
    parts_check(obj_fails("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "corner"),
                "a corner out of range is named");
    parts_check(obj_fails("v 0 0 nan\nf 1 1 1\n", "line 1"),
                "a number that is none is named by its line");
    parts_check(obj_fails("v 0 0 0\nf 1 1\n", "line 2"),
                "a face of two corners");
    parts_check(obj_fails("v 0 0 0\n", "no faces"), "a mesh without faces");
    parts_check(wavefront_read(&m, "/nonexistent/a.obj", NULL, &memory, &err)
                && err.code == EX_NOINPUT, "a missing mesh");
}

static void check_mhclo(void)
{
    static const char good[] = "name x\nx_scale 0 1 2.0\ny_scale 0 2 2.0\n"
        "z_scale 0 3 1.0\nverts 0\n2\n 0 1 2 0.5 0.25 0.25 1 1 1\n"
        "delete_verts\n0 - 2 4\n";
    static const float base[15] = {0, 0, 0, 4, 0, 0, 0, 2, 0, 0, 0, 3, 9, 9,
                                   9};
    struct mhclo m;
    struct error err = {0};
    float out[6];
    const char *path = file_of("a.mhclo", good, sizeof good - 1);

    parts_check(!mhclo_read(&m, path, 5, 2, &memory, &err), "a binding is read");
    mhclo_place(out, &m, base);
    /* vertex 0 on base vertex 2; vertex 1 by weights, offset scaled by axis:
     * 4 / 2, 2 / 2, 3 / 1 */
    parts_check(out[0] == 0 && out[1] == 2 && out[2] == 0 && out[3] == 3
                    && out[4] == 1.5f && out[5] == 3,
                "a binding places its vertices");
    parts_check(m.hidden[0] && m.hidden[1] && m.hidden[2] && !m.hidden[3]
                && m.hidden[4], "covered vertices are known");
    parts_check(mhclo_read(&m, path, 5, 3, &memory, &err)
                    && strstr(err.text, "expected 3"),
                "a binding of another count is refused");
    parts_check(mhclo_read(&m, path, 1, 2, &memory, &err) && err.code == EX_DATAERR,
                "a binding to another base is refused");
    unlink(path);
}

/* ---- light --------------------------------------------------------------- */

enum { PW = 128, PH = 64 };

/* A panorama as a PFM file (rows from the bottom). */
static const char *write_pfm(const float *rgb, int w, int h, size_t cut)
{
    char head[64];
    int n = snprintf(head, sizeof head, "PF\n%d %d\n-1.0\n", w, h);
    size_t size = (size_t)n + 12 * (size_t)(w * h);
    char *all = malloc(size);
    const char *path;

    memcpy(all, head, (size_t)n);
    memcpy(all + n, rgb, size - (size_t)n);
    path = file_of("p.pfm", all, size - cut);
    free(all);
    return path;
}

static int panorama_fails(const float *rgb, int w, int h, size_t cut,
                          const char *word)
{
    struct panorama p;
    struct error err = {0};
    const char *path = write_pfm(rgb, w, h, cut);
    int rc = panorama_read(&p, path, &err);

    unlink(path);
    if (!rc)
        panorama_release(&p);
    if (!rc || !strstr(err.text, word))
        printf("  said: %s\n", err.text);
    return rc && strstr(err.text, path) && strstr(err.text, word);
}

static void check_panorama(void)
{
    static float rgb[3 * PW * PH];

    for (int i = 0; i < 3 * PW * PH; i++)
        rgb[i] = 1;
    parts_check(panorama_fails(rgb, PW / 2, PH, 0, "64 x 64"),
                "a square picture");
    parts_check(panorama_fails(rgb, PW, PH, 4000, "cut"), "a cut panorama");
    rgb[3 * 700 + 1] = NAN;
    parts_check(panorama_fails(rgb, PW, PH, 0, "nan"), "a panorama with a NaN");
    rgb[3 * 700 + 1] = -1;
    parts_check(panorama_fails(rgb, PW, PH, 0, "-1"), "negative light");
    memset(rgb, 0, sizeof rgb);
    parts_check(panorama_fails(rgb, PW, PH, 0, "black"), "a black panorama");
}

/* A soft sky without lamps: irradiance by harmonics against the sum over all
 * directions, at several turns. */
static void check_light(void)
{
    static float rgb[3 * PW * PH];
    struct light_map m;
    struct error err = {0};
    double worst = 0;

    for (int i = 0; i < PW * PH; i++) {
        float th = 3.14159265f * ((float)(i / PW) + 0.5f) / PH;
        float ph = 6.2831853f * (((float)(i % PW) + 0.5f) / PW - 0.5f);
        rgb[3 * i] = 1 + 0.4f * cosf(th);
        rgb[3 * i + 1] = 1 + 0.4f * sinf(th) * sinf(ph);
        rgb[3 * i + 2] = 1 - 0.4f * sinf(th) * cosf(ph);
    }
    /* rows from the bottom: the file's first row is the nadir */
    static float up[3 * PW * PH];
    for (int y = 0; y < PH; y++)
        memcpy(up + 3 * PW * y, rgb + 3 * PW * (PH - 1 - y),
               3 * PW * sizeof *up);
    const char *path = write_pfm(up, PW, PH, 0);
    parts_check(!light_map_load(&m, path, &memory, &err), "a panorama becomes a light");
    unlink(path);
    parts_check(m.nlamp == 0, "a soft sky has no lamps");
    for (int turn = 0; turn < 4; turn++) {
        struct light l;
        static const float one[3] = {1, 1, 1};
        light_init(&l, &m, 0.8f * (float)turn, one);
        for (int k = 0; k < 6; k++) {
            float n[3] = {sinf((float)k), cosf(2.0f * (float)k),
                          0.3f * (float)k - 1};
            double sum[3] = {0, 0, 0}, all = 0;
            unit3(n);
            for (int i = 0; i < 20000; i++) {
                float y = 1 - 2 * ((float)i + 0.5f) / 20000;
                float r = sqrtf(1 - y * y), t = 2.39996323f * (float)i;
                float d[3] = {r * cosf(t), y, r * sinf(t)}, c[3];
                float w = dot3(d, n);
                if (w <= 0)
                    continue;
                light_mirror(c, &l, d, 0);
                for (int j = 0; j < 3; j++)
                    sum[j] += (double)(w * c[j]);
                all += (double)w;
            }
            double lum[2] = {0, 0};
            for (int j = 0; j < 3; j++) {
                double g = j == 0 ? 0.30 : j == 1 ? 0.59 : 0.11;
                lum[0] += g * sum[j] / all;
                lum[1] += g * (double)harmonic2_diffuse(&l.sky[j], n);
            }
            worst = fmax(worst, fabs(lum[0] - lum[1]));
        }
    }
    printf("light: irradiance by harmonics %.2g off (limit 0.01)\n", worst);
    parts_check(worst < 0.01, "harmonics and mirror agree at every turn");
}

/* A turned function is the function at turned directions. */
static void check_turn(void)
{
    struct harmonic2 h = {0.7f, {0.2f, -0.5f, 0.3f},
                          {0.4f, -0.1f, -0.3f, 0.25f, -0.35f, 0.15f}}, o;
    float w[3] = {0.4f, -1.1f, 0.7f}, r[9], worst = 0;

    rodrigues33(r, w);
    harmonic2_turn(&o, &h, r);
    for (int k = 0; k < 20; k++) {
        float n[3] = {sinf(1.7f * (float)k), cosf((float)k), 0.5f}, m[3];
        unit3(n);
        rot3(m, r, n);
        worst = fmaxf(worst, fabsf(harmonic2_diffuse(&h, n)
                                   - harmonic2_diffuse(&o, m)));
    }
    printf("harmonics: turning is %.2g off (limit 1e-5)\n", (double)worst);
    parts_check(worst < 1e-5f, "turning harmonics");
}

/* ---- geometry ------------------------------------------------------------ */

static void check_near(void)
{
    enum { N = 700 };
    static float p[3 * N];
    struct near_tree g;
    struct random r;
    struct error err = {0};
    int same = 1;

    random_init(&r, 3, "points");
    for (int i = 0; i < 3 * N; i++)
        p[i] = (float)random_range(&r, -1, 1);
    if (near_init(&g, p, N, &memory, &err)) {
        parts_check(0, err.text);
        return;
    }
    for (int k = 0; k < 200; k++) {
        float x[3] = {(float)random_range(&r, -1, 1),
                      (float)random_range(&r, -1, 1),
                      (float)random_range(&r, -1, 1)};
        int32_t at[3], best[3] = {-1, -1, -1};
        float d2[3] = {9, 9, 9}, got[3];
        for (int i = 0; i < N; i++) {
            float d[3], l;
            sub3(d, p + 3 * i, x);
            l = dot3(d, d);
            for (int j = 0; j < 3; j++)
                if (l < d2[j]) {
                    for (int m = 2; m > j; m--) {
                        d2[m] = d2[m - 1];
                        best[m] = best[m - 1];
                    }
                    d2[j] = l;
                    best[j] = i;
                    break;
                }
        }
        same &= near_find(at, got, &g, x, NULL, 3, 10) == 3
                && !memcmp(at, best, sizeof at);
    }
    parts_check(same, "the three nearest points are those of a plain search");
}

/* Two triangles of a quad: every sample inside is covered once. */
static void check_tri(void)
{
    enum { N = 24 };
    struct raster_vertex v[4] = {{3.3f, 2.1f, 1}, {20.7f, 4.9f, 2},
                                 {18.2f, 21.4f, 1}, {5.1f, 19.8f, 3}};
    int count[N * N] = {0}, twice = 0, total = 0;
    float worst = 0;

    for (int k = 0; k < 2; k++) {
        struct tri t;
        int x0, x1;
        if (!tri_setup(&t, &v[0], &v[1 + k], &v[2 + k], N, N))
            continue;
        for (int y = t.y0; y <= t.y1; y++)
            for (int x = tri_row(&t, y, N, &x0, &x1) ? x0 : N;
                 x < N && x <= x1; x++) {
                float dx = (float)x + 0.5f - t.ox, dy = (float)y + 0.5f
                           - t.oy;
                float b1 = t.w[0] * dx + t.w[1] * dy;
                float b2 = t.w[2] * dx + t.w[3] * dy;
                float px = v[0].x + b1 * (v[1 + k].x - v[0].x)
                           + b2 * (v[2 + k].x - v[0].x);
                worst = fmaxf(worst, fabsf(px - (float)x - 0.5f));
                twice += count[y * N + x]++;
                total++;
            }
    }
    parts_check(!twice && total > 250 && total < 300,
                "samples of a quad are covered once");
    parts_check(worst < 1e-4f, "weights of the corners give the sample");
    parts_check(!tri_setup(&(struct tri){0}, &v[0], &v[0], &v[1], N, N),
                "a triangle without area is not drawn");
}

/* ---- codec --------------------------------------------------------------- */

static void check_codec(void)
{
    enum { N = 48 };
    static uint8_t rgb[3 * N * N], in[3 * N * N];
    static float scratch[3 * N * N];
    double error[2] = {0, 0};

    for (int i = 0; i < 3 * N * N; i++)
        in[i] = (uint8_t)(128 + 60 * sin(0.3 * (i / 3 % N))
                          + 40 * cos(0.17 * (i / 3 / N)) + i % 3 * 8);
    for (int k = 0; k < 2; k++) {
        memcpy(rgb, in, sizeof rgb);
        codec_damage(rgb, scratch, N, k ? 38 : 18);
        for (int i = 0; i < 3 * N * N; i++)
            error[k] += pow((double)rgb[i] - in[i], 2) / (3 * N * N);
    }
    printf("codec: mean square error %.2f at 18, %.1f at 38\n", error[0],
           error[1]);
    parts_check(error[0] < 12 && error[1] > 4 * error[0] && error[1] < 900,
                "a coarser quantiser loses more");
}

int main(void)
{
    check_obj();
    check_mhclo();
    check_panorama();
    check_light();
    check_turn();
    check_near();
    check_tri();
    check_codec();
    arena_release(&memory);
    return failures != 0;
}
