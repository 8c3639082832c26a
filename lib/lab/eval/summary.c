/* A model's summary as JSON. */
#include "lib/lab/eval/summary.h"

#include <string.h>

static const struct {
    const char *key, *row, *column;
} figure[] = {
    {"psnr", "SpiD", "psnr"},
    {"ssim", "SpiD", "ssim"},
    {"msssim", "SpiD", "msssim"},
    {"l1", "SpiD", "l1"},
    {"psnr_star", "SpiD*", "psnr"},
    {"ssim_star", "SpiD*", "ssim"},
    {"psnr_source", "source", "psnr"},
    {"ssim_source", "source", "ssim"},
    {"pose_deg", "SpiD", "pose_deg"},
    {"yaw_deg", "SpiD", "yaw_deg"},
    {"pitch_deg", "SpiD", "pitch_deg"},
    {"roll_deg", "SpiD", "roll_deg"},
    {"landmark_pct", "SpiD", "landmark_pct"},
    {"landmark_pct_2d", "SpiD", "landmark_pct_2d"},
    {"akd", "SpiD", "akd"},
    {"aed", "SpiD", "aed"},
    {"apd", "SpiD", "apd"},
    {"jaw_corr", "SpiD", "jaw_corr"},
    {"blink_corr", "SpiD", "blink_corr"},
    {"cross_colour_to_source", "cross", "colour_to_source"},
    {"cross_colour_to_driver", "cross", "colour_to_driver"},
};

/* The mean in the row and column of these names; NaN when there is none. */
static double summary_figure(const struct table *t, const char *row,
                             const char *column)
{
    size_t r = 0, c = 0;

    while (r < t->rows && strcmp(t->row[r].name, row))
        r++;
    while (c < t->columns && strcmp(t->column[c], column))
        c++;
    return table_mean(t, r, c);
}

void summary_write(FILE *f, const struct table *t)
{
    cJSON *json = cJSON_CreateObject();

    for (size_t i = 0; i < sizeof figure / sizeof *figure; i++)
        cJSON_AddNumberToObject(json, figure[i].key,
                                summary_figure(t, figure[i].row,
                                               figure[i].column));
    cJSON_AddItemToObject(json, "rows", table_json(t));
    table_put_json(f, json);
}
