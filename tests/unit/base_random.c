/* Random numbers depend on key and index only and have the right moments;
 * the processor level can be capped; workers flush denormals. */
#include "lib/base/random.h"

#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/cpu.h"
#include "lib/base/error.h"
#include "lib/base/parallel.h"
#include "tests/check.h"

/* SplitMix64 of Vigna's page, seed 0: its first outputs. */
static void test_mix(void)
{
    expect("first output of SplitMix64", random_mix(0) == 0xe220a8397b1dcdafu,
           1, 0);
    expect("second output",
           random_mix(0x9e3779b97f4a7c15u) == 0x6e789e6aa1b965f4u, 1, 0);
    expect("FNV-1a of \"a\"", random_name("a") == 0xaf63dc4c8601ec8cu, 1, 0);
    expect("FNV-1a of \"\"", random_name("") == 0xcbf29ce484222325u, 1, 0);
}

static void test_moments(void)
{
    enum { N = 1000000 };
    double m = 0, v = 0, k = 0, u = 0, w = 0;
    long low[7] = { 0 };
    struct random r;

    random_init(&r, 42, "moments");
    for (int i = 0; i < N; i++) {
        double x = random_normal(&r), y = random_uniform(&r);

        m += x;
        v += x * x;
        k += x * x * x * x;
        u += y;
        w = fmax(w, y);
        low[random_below(&r, 7)]++;
    }
    /* Five standard errors each. */
    expect("mean of normal", m / N, 0, 5e-3);
    expect("variance of normal", v / N, 1, 5 * sqrt(2.0 / N));
    expect("fourth moment of normal", k / N, 3, 5 * sqrt(96.0 / N));
    expect("mean of uniform", u / N, 0.5, 5 * sqrt(1.0 / 12 / N));
    expect("largest uniform is under 1", w < 1, 1, 0);
    for (int i = 0; i < 7; i++)
        expect("share of one of seven", (double)low[i] / N, 1.0 / 7, 2e-3);
}

static void test_keys(void)
{
    struct random a, b, c, d;
    double equal = 0, same = 0;

    random_init(&a, 1, "x");
    random_init(&b, 1, "x");
    random_init(&c, 2, "x");
    random_init(&d, 1, "y");
    for (int i = 0; i < 1000; i++) {
        uint64_t x = random_u64(&a);

        equal += x == random_u64(&b);
        same += x == random_u64(&c) || x == random_u64(&d);
    }
    expect("same key, same numbers", equal, 1000, 0);
    expect("other key, same number", same, 0, 0);
    random_init(&a, 1, "x");
    a.next = 500;
    b.next = 500;
    expect("any index at once", random_u64(&a) == random_u64(&b), 1, 0);
}

#define ITEMS 3000              /* enough that all threads have some */

/* parallel_for's: one more of ctx where the thread flushes denormals. */
static void count_flushed(void *ctx, size_t i)
{
    volatile float tiny = 1e-38f;

    (void)i;
    *(atomic_int *)ctx += tiny * 0.01f == 0;
}

static void test_cpu(void)
{
    volatile float tiny = 1e-38f;
    atomic_int flushed = 0;

    setenv("SPID_CPU", "baseline", 1);
    expect("level capped", cpu_level(), CPU_BASELINE, 0);
    expect("name is known", strlen(cpu_name()) > 0, 1, 0);
    cpu_flush_denormals();
    parallel_set_width(3);
    parallel_for(ITEMS, 1, count_flushed, &flushed);
#if defined(__x86_64__) || defined(__aarch64__)
    expect("items whose thread flushes denormals", flushed, ITEMS, 0);
#endif
    cpu_keep_denormals();
    expect("and kept again", tiny * 0.01f > 0, 1, 0);
    double t = cpu_seconds();
    expect("clock moves on", cpu_seconds() >= t, 1, 0);
}

static void test_error(void)
{
    struct error e = { 0 };
    char text[1000];

    memset(text, 'x', sizeof text - 1);
    text[sizeof text - 1] = '\0';
    error_set(&e, 65, "%s", text);
    expect("long text is cut", strlen(e.text), sizeof e.text - 1, 0);
    error_prefix(&e, "file %d", 7);
    expect("prefix goes in front", !strncmp(e.text, "file 7: xxx", 11), 1, 0);
    expect("within its room", strlen(e.text), sizeof e.text - 1, 0);
    error_prefix(&e, "%s", text);
    expect("long prefix is cut", strlen(e.text) < sizeof e.text, 1, 0);
    expect("no error to fill in", error_set(NULL, 1, "x"), -1, 0);
}

int main(void)
{
    test_mix();
    test_moments();
    test_cpu();
    test_error();
    test_keys();
    return check_status();
}
