/* People of the scans as drawn: their lips touch at rest whatever the identity,
 * identities keep their spread, most cameras are good, and a poor one is poor
 * in all. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "lib/base/random.h"
#include "lib/lab/people/scan_person.h"

enum { PEOPLE = 600 };
#define ONE (3 * (size_t)FACE_VERTICES)

static int failures;

static void person_check(int ok, const char *what)
{
    printf("%s: %s\n", ok ? "ok" : "FAILED", what);
    failures += !ok;
}

/* A face whose lips' edges, the only vertices that count, each identity moves
 * its own way. */
static int face_make(struct scan_face *f, struct arena *memory)
{
    struct random r;

    f->neutral = arena_take(memory, ONE, sizeof *f->neutral);
    f->identity = arena_take(memory, ONE * SCAN_IDENTITIES,
                             sizeof *f->identity);
    if (arena_check(memory, "a face", NULL))
        return -1;
    random_init(&r, 1, "lips");
    for (int k = 61; k < 68; k++) {
        f->landmark[k] = 10 * k;
        f->neutral[30 * k + 1] = k < 64 ? 0.004f : 0;
        for (size_t i = 0; i < SCAN_IDENTITIES; i++)
            f->identity[i * ONE + (size_t)(30 * k) + 1]
                = 0.001f * (float)random_normal(&r);
    }
    return 0;
}

/* Height of landmark k of a person. */
static double lip_height(const struct scan_face *f, const float *beta, int k)
{
    const size_t at = 3 * (size_t)f->landmark[k] + 1;
    double y = (double)f->neutral[at];

    for (size_t i = 0; i < SCAN_IDENTITIES; i++)
        y += (double)(beta[i] * f->identity[i * ONE + at]);
    return y;
}

/* Sums over people. */
struct drawn {
    double ajar;                /* largest gap of lips, or overlap */
    double square;              /* of identities */
    int sharp, poor, noisy;     /* cameras; poor ones with noise */
};

static void drawn_add(struct drawn *d, const struct scan_person *p,
                      const struct scan_face *f)
{
    double middle = lip_height(f, p->beta, 62) - lip_height(f, p->beta, 66);
    double side = 0.5 * (lip_height(f, p->beta, 61) - lip_height(f, p->beta, 67)
                         + lip_height(f, p->beta, 63)
                         - lip_height(f, p->beta, 65));
    const struct scan_camera *c = &p->camera;

    d->ajar = fmax(d->ajar, fmax(fabs(middle - 0.0005), fabs(side - 0.0005)));
    for (int k = 0; k < SCAN_IDENTITIES; k++)
        d->square += (double)(p->beta[k] * p->beta[k]) / SCAN_IDENTITIES;
    d->sharp += c->blur <= 0.5f && c->low > 0.7f && c->noise < 0.01f
                && (!c->codec || c->codec < 28) && (!c->jpeg || c->jpeg > 70);
    if (c->low < 0.5f) {
        d->poor++;
        d->noisy += !c->codec || c->codec > 24;
    }
}

int main(void)
{
    static struct scan_assets a;
    struct scan_person p;
    struct drawn d = {0};

    if (face_make(&a.face, &a.memory) || traits_load(&a.traits, NULL, NULL))
        return 1;
    for (uint64_t i = 0; i < PEOPLE; i++) {
        scan_person_draw(&p, &a, 3, i, 1);
        drawn_add(&d, &p, &a.face);
    }
    printf("lips within %.2g of touching, identities' rms %.2f, %.0f %% of "
           "cameras sharp, %d poor, %d of them in their codec\n", d.ajar,
           sqrt(d.square / PEOPLE), 100.0 * d.sharp / PEOPLE, d.poor, d.noisy);
    person_check(d.ajar < 0.00051, "lips touch at rest");
    person_check(fabs(sqrt(d.square / PEOPLE) - 1) < 0.1,
                 "identities keep their spread");
    person_check(d.sharp > 0.5 * PEOPLE, "most cameras are good");
    person_check(d.poor > 0.03 * PEOPLE && d.noisy == d.poor,
                 "a poor camera is poor in all");
    scan_person_draw(&p, &a, 3, 7, 0);
    person_check(p.camera.blur == 0 && p.camera.noise == 0
                 && p.camera.low == 1 && !p.camera.codec && !p.camera.jpeg
                 && p.camera.balance[0] == 1, "no effects, no faults");
    arena_release(&a.memory);
    return failures != 0;
}
