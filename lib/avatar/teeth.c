/* The template's mouth laid into a person's. */
#include "lib/avatar/teeth.h"

#include <math.h>

#include "lib/avatar/branch.h"
#include "lib/base/drive.h"

#define HALF 22.0f      /* mm: half the width of the scans' inner lips */

/* Rows of a grid of K by K: the upper teeth's, and of those their crowns'. */
static size_t teeth_upper_rows(size_t K)
{
    return 5 * K / 16;
}

static size_t teeth_crown_rows(size_t K)
{
    return (7 * teeth_upper_rows(K) + 9) / 10;
}

/* Cell k of K by K is the cell of the template's grid that it lies on, as much
 * larger. */
static struct teeth_cell teeth_cell_make(float *share,
                                         const struct head_avatar *a,
                                         size_t k, size_t K)
{
    const size_t T = a->mouth, i = (2 * (k / K) + 1) * T / (2 * K);
    const size_t at = i * T + (2 * (k % K) + 1) * T / (2 * K);
    const float wider = (float)T / (float)K;
    struct teeth_cell c = {.layer = (enum mouth_layer)a->mouth_layer[at]};

    for (int n = 0; n < 3; n++) {
        c.mean[n] = a->mouth_place[3 * at + (size_t)n];
        c.scale[n] = a->mouth_size[3 * at + (size_t)n] * (n < 2 ? wider : 1);
        c.color[n] = a->mouth_color[3 * at + (size_t)n];
    }
    for (int n = 0; n < 4; n++)
        c.quat[n] = a->mouth_turn[4 * at + (size_t)n];
    *share = a->mouth_jaw[at];
    return c;
}

void teeth_make(struct teeth_cell *cells, const struct head *h,
                const struct head_mouth *rest, const float chin[3],
                float lift, size_t K)
{
    const float mm = 1e-3f * h->scale;
    const float size = fminf(fmaxf(rest->radius / (HALF * mm), 0.85f), 1.15f);
    const float *hinge = h->joint_template + 3 * JOINT_JAW;
    const float d[3] = {chin[0] - rest->chin[0], chin[1] - rest->chin[1],
                        chin[2] - rest->chin[2]};

    for (size_t k = 0; k < K * K; k++) {
        struct teeth_cell *c = &cells[k];
        float share, *m = c->mean;

        *c = teeth_cell_make(&share, &h->avatar, k, K);
        for (int i = 0; i < 3; i++) {
            m[i] = rest->centre[i] + mm * size * m[i];
            c->scale[i] = fminf(c->scale[i] * mm * size, BRANCH_SCALE_MAX);
        }
        if (c->layer == MOUTH_UPPER)
            m[1] += lift;
        if (!h->nchin)
            continue;
        drive_jaw(c->jaw, m, share, hinge, rest->chin);
        m[0] += c->jaw[0] * d[0];
        m[1] += c->jaw[2] * d[2] + c->jaw[1] * d[1];
        m[2] += c->jaw[1] * d[2] - c->jaw[2] * d[1];
    }
}

/* Column by column the lowest cell that is teeth; the rows of the middle half
 * are as high as the first one's. */
float teeth_lift(const struct teeth_cell *cells, const float *likeness,
                 size_t K)
{
    const size_t crown = teeth_crown_rows(K);
    float sum = 0, found = 0;

    for (size_t j = 3 * K / 8; j < K - 3 * K / 8; j++)
        for (size_t i = 0; i < crown; i++) {
            if (!(likeness[i * K + j] > 0.5f))
                continue;
            found++;
            if (i > 0)
                sum += cells[i * K + j].mean[1] - cells[j].mean[1];
            break;
        }
    return found > (float)(K / 8) ? sum / found : 0;
}

void teeth_light(float light[3], const struct teeth_cell *cells,
                 const float *likeness, const float *pixel, size_t K)
{
    float seen = 0, there[3] = {0}, own[3] = {1e-6f, 1e-6f, 1e-6f};

    for (size_t k = 0; k < teeth_upper_rows(K) * K; k++) {
        seen += likeness[k];
        for (int c = 0; c < 3; c++) {
            there[c] += likeness[k] * pixel[4 * k + c];
            own[c] += likeness[k] * cells[k].color[c];
        }
    }
    const float count = (float)(K * K);
    const float share = branch_ramp(seen, count / 64, count / 32);
    for (int c = 0; c < 3; c++)
        light[c] *= 1 + share * (fminf(there[c] / own[c], 2) - 1);
}

int teeth_hidden(const struct teeth_cell *cells, size_t K, size_t k)
{
    const size_t column = k % K, lower = teeth_upper_rows(K) * K;
    const float y = cells[k].mean[1];

    return (cells[k].layer != MOUTH_UPPER && y > cells[column].mean[1]) ||
           (cells[k].layer == MOUTH_BACK && y < cells[lower + column].mean[1]);
}
