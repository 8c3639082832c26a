/* What comes between: a hand, a microphone, loose strands.  Rounded bars in
 * the picture plane, lit as if they were round. */
#include "lib/lab/people/lens.h"

#include <math.h>

#include "lib/lab/people/vec.h"

struct bar {
    float a[2], b[2], r;            /* pixels */
    float color[3];
};

/* Light on a surface turned to n. */
static void occlude_lit(float o[3], const struct shade_env *e, const float n[3])
{
    for (int k = 0; k < 3; k++) {
        o[k] = 0;
        for (int i = 0; i < 3; i++)
            o[k] += n[i] * n[i] * e->cube[2 * i + (n[i] < 0 ? 0 : 1)][k];
        for (int l = 0; l < SHADE_LIGHTS; l++)
            o[k] += e->light[l].rgb[k]
                    * fmaxf(dot3(n, e->light[l].dir), 0) * 0.8f;
    }
}

/* A capsule between two points of the picture, in the light of env. */
static void occlude_draw_bar(struct stage *s, const struct bar *b,
                             const struct shade_env *env)
{
    int n = s->size;
    int x0 = (int)(fminf(b->a[0], b->b[0]) - b->r) - 1;
    int x1 = (int)(fmaxf(b->a[0], b->b[0]) + b->r) + 1;
    int y0 = (int)(fminf(b->a[1], b->b[1]) - b->r) - 1;
    int y1 = (int)(fmaxf(b->a[1], b->b[1]) + b->r) + 1;
    float e[2] = { b->b[0] - b->a[0], b->b[1] - b->a[1] };
    float l2 = e[0] * e[0] + e[1] * e[1] + 1e-6f;

    for (int y = y0 < 0 ? 0 : y0; y <= y1 && y < n; y++)
        for (int x = x0 < 0 ? 0 : x0; x <= x1 && x < n; x++) {
            float d[2] = { (float)x + 0.5f - b->a[0],
                           (float)y + 0.5f - b->a[1] };
            float t = clampf((d[0] * e[0] + d[1] * e[1]) / l2, 0, 1);
            d[0] -= e[0] * t;
            d[1] -= e[1] * t;
            float dist = hypotf(d[0], d[1]), c[3];
            float alpha = clampf(b->r - dist + 0.5f, 0, 1);
            if (alpha <= 0)
                continue;
            float v = clampf(dist / b->r, 0, 1);
            float m[3] = { d[0] / b->r, d[1] / b->r, -sqrtf(1 - v * v) };
            size_t at = (size_t)y * (size_t)n + (size_t)x;
            occlude_lit(c, env, m);
            for (int k = 0; k < 3; k++)
                s->light[3 * at + (size_t)k]
                    = lerpf(s->light[3 * at + (size_t)k], c[k] * b->color[k],
                            alpha);
            s->cover[at] *= 1 - alpha;
            if (alpha > 0.02f)
                s->label[at] = LABEL_OCCLUDER;
        }
}

/* Four fingers and a thumb on the cheek or the chin. */
static void occlude_draw_hand(struct stage *s, const struct persona *p, float u,
                              float phase)
{
    float side = p->yaw > 0 ? 1 : -1, sway = sinf(phase);
    float cx = s->lmk[57][0] + side * u * (0.75f + 0.2f * sway);
    float cy = s->lmk[57][1] + u * (0.45f + 0.2f * sway);

    for (int i = 0; i < 6; i++) {
        float f = (float)i - 1.5f, tip = i < 4 ? 1 : 0;
        struct bar b = {
            .a = { cx + side * u * (0.35f + 0.05f * f),
                   cy + u * (0.55f + 0.17f * f) },
            .b = { cx - side * u * (0.45f - 0.06f * f * f) * tip,
                   cy + u * (0.20f * f - 0.12f) * tip + (1 - tip) * 0.9f * u },
            .r = u * (i < 4 ? 0.085f : 0.30f)
        };
        for (int k = 0; k < 3; k++)
            b.color[k] = p->skin.base[k] * (k == 0 ? 0.96f : 0.86f);
        occlude_draw_bar(s, &b, &p->env);
    }
}

/* A stick and a ball before the chin. */
static void occlude_draw_microphone(struct stage *s, const struct persona *p,
                                    float u, float phase)
{
    float side = p->yaw > 0 ? 1 : -1;
    float x = s->lmk[57][0] + side * u * (0.15f + 0.1f * sinf(phase));
    float y = s->lmk[57][1] + u * (0.55f + 0.08f * sinf(1.7f * phase));
    struct bar stick = { .a = { x, y },
                         .b = { x + side * u * 1.0f, y + u * 3.0f },
                         .r = 0.11f * u, .color = { .03f, .03f, .035f } };
    struct bar ball = { .a = { x, y }, .b = { x + 1, y + 1 }, .r = 0.24f * u,
                        .color = { .10f, .10f, .11f } };

    occlude_draw_bar(s, &stick, &p->env);
    occlude_draw_bar(s, &ball, &p->env);
}

/* Five locks across the brow. */
static void occlude_draw_strands(struct stage *s, const struct persona *p,
                                 float u, float phase)
{
    for (int i = 0; i < 5; i++) {
        float x = s->lmk[27][0] + u * (0.15f * (float)i - 0.5f), y;
        y = s->lmk[27][1] - u * 1.1f;
        for (int j = 0; j < 7; j++) {
            float t = (float)j / 7;
            float nx = x + u * (0.05f + 0.05f * sinf(phase + (float)i + 4 * t));
            struct bar b = { .a = { x, y }, .b = { nx, y + 0.24f * u },
                             .r = u * 0.013f };
            copy3(b.color, p->hair.color);
            occlude_draw_bar(s, &b, &p->env);
            x = nx;
            y += 0.24f * u;
        }
    }
}

void occluder_draw(struct stage *s, const struct persona *p, double time)
{
    float u = hypotf(s->lmk[45][0] - s->lmk[36][0],
                     s->lmk[45][1] - s->lmk[36][1]);
    float phase = (float)(time * 1.3) + p->skin.shift[0];

    u = fmaxf(u, 0.08f * (float)s->size);
    switch (p->lens.occluder) {
    case OCCLUDER_HAND: occlude_draw_hand(s, p, u, phase); break;
    case OCCLUDER_MICROPHONE: occlude_draw_microphone(s, p, u, phase); break;
    case OCCLUDER_STRANDS: occlude_draw_strands(s, p, u, phase); break;
    case OCCLUDER_NONE: break;
    }
}
