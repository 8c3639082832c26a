/* What people of the scans do over time: eyes are open in most pictures, half
 * shut in few, and shut often enough to learn from; who frowns narrows the
 * eyes, and the jaw drops behind closed lips now and then. */
#include <stdio.h>

#include "lib/base/random.h"
#include "lib/lab/people/scan_act.h"

enum { PEOPLE = 400, TIMES = 10 };

static int failures;

static void act_check(int ok, const char *what)
{
    printf("%s: %s\n", ok ? "ok" : "FAILED", what);
    failures += !ok;
}

/* Mean squint of faces that do (1) and do not (0) frown. */
struct squint {
    double sum[2];
    int n[2];
};

static void squint_add(struct squint *s, const float *w)
{
    const float down = w[ARKIT_BROW_DOWN_L];
    const int frowns = down > 0.5f;

    if (down > 0.05f && !frowns)
        return;
    s->sum[frowns] += (double)w[ARKIT_EYE_SQUINT_L];
    s->n[frowns]++;
}

int main(void)
{
    static const struct act_model calm = {.kinds = 1, .share = {1}};
    static struct traits traits;
    struct act_look look = {.traits = &traits, .lively = 1, .turn = 0.4f,
                            .talk = 0.4f};
    struct squint squint = {{0}, {0}};
    int open = 0, half = 0, shut = 0, closed = 0, dropped = 0;

    if (traits_load(&traits, NULL, NULL))
        return 1;
    for (int i = 0; i < PEOPLE; i++) {
        look.key = random_mix((uint64_t)i + 1);
        for (int t = 0; t < TIMES; t++) {
            struct act a;

            act_at(&a, &calm, &look, 7.3 * t, NULL);
            const float *w = a.weight;
            const float lid = 0.5f * (w[ARKIT_EYE_BLINK_L]
                                      + w[ARKIT_EYE_BLINK_R]);
            open += lid < 0.3f;
            half += lid > 0.25f && lid < 0.75f;
            shut += lid >= 0.75f;
            squint_add(&squint, w);
            const float jaw = w[ARKIT_JAW_OPENED];
            dropped += jaw > 0.3f;
            closed += jaw > 0.3f && w[ARKIT_MOUTH_CLOSE] > 0.9f * jaw;
        }
    }
    const double n = PEOPLE * TIMES;

    printf("eyes: open %.1f %%, half shut %.1f %%, shut %.1f %%\n",
           100 * open / n, 100 * half / n, 100 * shut / n);
    act_check(open > 0.78 * n, "eyes are open in most pictures");
    act_check(half < 0.12 * n, "eyes are seldom half shut");
    act_check(shut > 0.05 * n, "eyes are shut now and then");
    printf("jaw open %.1f %%, with closed lips %.1f %%\n", 100 * dropped / n,
           100 * closed / n);
    act_check(closed > 0.02 * n && closed < 0.15 * n,
              "lips stay closed over an open jaw now and then");
    printf("squint: %.2f, frowning %.2f\n", squint.sum[0] / squint.n[0],
           squint.sum[1] / squint.n[1]);
    act_check(squint.sum[1] / squint.n[1] > squint.sum[0] / squint.n[0] + 0.2,
              "who frowns narrows the eyes");
    return failures != 0;
}
