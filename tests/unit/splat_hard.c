/* Hard cases: finite, near the truth under the same rules, never a stall; and
 * bad input refused with array and index. */
#include "lib/base/cpu.h"
#include "lib/base/random.h"
#include "tests/unit/splat_scene.h"

enum { SIZE = 96, N = 2000 };

/* What makes rasterisers slow or wrong. */
enum hard {
    HARD_NEEDLES, HARD_ZERO_SCALE, HARD_OPACITY, HARD_NEAR, HARD_STACK,
    HARD_QUATERNIONS, HARD_HUGE, HARD_TIES, HARD_COUNT
};

/* In words, for rows of a table. */
static const char *hard_name(enum hard kind)
{
    static const char *const name[] = {
        "needles 1:10000", "zero scales", "opacity 0 and 1",
        "near plane and behind", "10^4 on one pixel", "quaternions 1e-3..1e3",
        "scales up to 1000", "all at one depth"};

    return name[kind];
}

/* Gaussian i of a hard scene. */
static void harden_one(struct testscene *t, enum hard kind, size_t i,
                       struct random *r)
{
    float *m = (float *)t->g.mean + 3 * i, *s = (float *)t->g.scale + 3 * i;
    float *q = (float *)t->g.quat + 4 * i, *o = (float *)t->g.opacity + i;
    double f;

    switch (kind) {
    case HARD_NEEDLES:
        s[0] = 0.5f;
        s[1] = s[2] = 5e-5f;
        break;
    case HARD_ZERO_SCALE:
        for (uint32_t k = 0; k <= i % 3; k++)
            s[k] = 0;
        break;
    case HARD_OPACITY:
        *o = (float)(i & 1);
        break;
    case HARD_NEAR:                        /* camera z = 12 - about m[2] */
        m[2] = 12 + (float)random_range(r, -0.5, 0.5);
        break;
    case HARD_STACK:
        m[0] = m[1] = 0;
        break;
    case HARD_QUATERNIONS:
        f = exp(random_range(r, log(1e-3), log(1e3)));
        for (int k = 0; k < 4; k++)
            q[k] *= (float)f;
        break;
    case HARD_HUGE:
        f = exp(random_range(r, log(1e-2), log(1e3)));
        for (int k = 0; k < 3; k++)
            s[k] = (float)f;
        break;
    default:
        m[2] = 0;
        break;
    }
}

/* Turn an ordinary scene into a hard one, in place. */
static void harden(struct testscene *t, enum hard kind, uint64_t seed)
{
    static const float front[12] = {1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 12};
    struct random r;

    random_init(&r, seed, "testscene hard");
    memcpy(t->cam, front, sizeof front);
    for (size_t i = 0; i < t->g.n; i++)
        harden_one(t, kind, i, &r);
}

/* Share of pixels that may be off by a Gaussian's last 1e-2: a cut-off decided
 * the other way. */
static void hard_case(enum hard kind)
{
    struct testscene t;
    struct reference truth;
    struct splat s = {0};
    struct splat_options o = splat_defaults(SIZE, SIZE, 3);
    struct error err = {0};
    size_t P = SIZE * SIZE, odd = 0;
    float *image = scene_grab(P * 3, sizeof *image);
    double *want = scene_grab(P * 3, sizeof *want), worst = 0;
    bool finite = true;

    small_scene(&t, N, 31);
    harden(&t, kind, 5);
    struct splat_camera cam = splat_camera_square(t.cam, SIZE, 12);
    double begun = cpu_seconds();

    if (splat_init(&s, &o, &err) || splat_load(&s, &t.g, &err) ||
        splat_draw(&s, &(struct splat_pictures){.image = image}, &cam, NULL,
                   NULL, &err))
        CHECK(0, "%s", err.text);
    double taken = cpu_seconds() - begun;

    if (reference_init(&truth, &t.g, &cam, SIZE, SIZE, 3, SPLAT_GSPLAT, 0,
                       &err) ||
        reference_forward(want, NULL, NULL, NULL, &truth, &err))
        CHECK(0, "%s", err.text);
    for (size_t i = 0; i < P * 3; i++) {
        double e = fabs(image[i] - want[i]);

        finite = finite && isfinite(image[i]);
        worst = fmax(worst, e);
        odd += e > 1e-3;
    }
    printf("%-24s worst %.1e, %zu of %zu values over 1e-3, %.1f ms\n",
           hard_name(kind), worst, odd, P * 3, taken * 1e3);
    CHECK(finite, "not finite");
    CHECK(worst <= 2e-2 && odd <= P * 3 / 100, "far from the truth");
    CHECK(taken < 5, "stalls");
    splat_release(&s);
    reference_release(&truth);
    testscene_release(&t);
    free(image);
    free(want);
}

/* Put value into one array; loading must fail and name it. */
static void hard_refuses(int array, size_t index, float value, const char *text)
{
    struct testscene t;
    struct splat s = {0};
    struct splat_options o = splat_defaults(8, 8, 3);
    struct error err = {0};

    small_scene(&t, 40, 3);
    const float *part[] = {t.g.mean, t.g.scale, t.g.quat, t.g.opacity,
                           t.g.color};

    ((float *)part[array])[index] = value;
    if (splat_init(&s, &o, &err))
        CHECK(0, "%s", err.text);
    CHECK(splat_load(&s, &t.g, &err) && strstr(err.text, text),
          "'%s' (expected %s)", err.text, text);
    splat_release(&s);
    testscene_release(&t);
}

static void refuses_options(int width, int channels)
{
    struct splat s;
    struct splat_options o = splat_defaults(width, 8, channels);
    struct error err = {0};

    CHECK(splat_init(&s, &o, &err) && err.text[0], "size %d, %d channels",
          width, channels);
}

int main(void)
{
    for (int k = 0; k < HARD_COUNT; k++)
        hard_case((enum hard)k);
    hard_refuses(0, 17, NAN, "mean[17]");
    hard_refuses(1, 3, -1, "scale[3]");
    hard_refuses(1, 5, INFINITY, "scale[5]");
    hard_refuses(2, 2, NAN, "quat[2]");
    hard_refuses(3, 39, 1.5f, "opacity[39]");
    hard_refuses(4, 100, NAN, "color[100]");
    refuses_options(0, 3);
    refuses_options(100000, 3);
    refuses_options(8, 0);
    refuses_options(8, 33);
    return check_status();
}
