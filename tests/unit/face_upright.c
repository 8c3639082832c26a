/* Which way is up, by the detector alone: of the portraits of validation's people
 * (../shared/assets, examples/model/splits.tsv) nearly all are certainly upright,
 * and none turned by a quarter or a half is. */
#include <stdio.h>
#include <string.h>

#include "formats/facedetect.h"
#include "formats/image.h"
#include "lib/track/rotated.h"
#include "tests/check.h"

struct count {
    int pictures, certain[4];   /* by quarter turns */
};

/* The picture in all four turns; of one that is not there nothing. */
static void count_picture(struct count *c, struct facedetect *d,
                          const char *path)
{
    struct error err = {0};
    struct image im = {0}, turned;
    struct mipmap picture = {0};
    struct square face;

    if (image_read(&im, path, &err))
        return;
    c->pictures++;
    for (int q = 0; q < 4; q++) {
        REQUIRE(rotated_copy(&turned, &im, q, &err) == 0, "%s", err.text);
        REQUIRE(mipmap_take(&picture, turned.rgb, turned.width, turned.height,
                            &err) == 0, "%s", err.text);
        c->certain[q] += facedetect_find(d, &face, 1, FACEDETECT_LARGEST, true, &picture) > 0;
        image_release(&turned);
    }
    mipmap_release(&picture);
    image_release(&im);
}

/* A line of splits.tsv: neutral and smiling of a person of validation. */
static void count_line(struct count *c, struct facedetect *d, const char *line)
{
    static const char *const look[] = {"neutral", "smiling"};
    char person[200], path[300];

    if (sscanf(line, "validation\tphotos\t%199s", person) != 1)
        return;
    for (int i = 0; i < 2; i++) {
        snprintf(path, sizeof path, "../shared/%s%s.jpg", person, look[i]);
        count_picture(c, d, path);
    }
}

int main(void)
{
    FILE *splits = fopen("examples/model/splits.tsv", "r");
    struct error err = {0};
    struct facedetect *d = facedetect_open(&err);
    struct count c = {0};
    char line[400];

    REQUIRE(splits && d, "%s", err.text);
    while (fgets(line, sizeof line, splits))
        count_line(&c, d, line);
    fclose(splits);
    facedetect_close(d);
    if (!c.pictures) {
        puts("no portraits in ../shared/assets");
        return 77;
    }
    printf("%d portraits\n", c.pictures);
    check_range("certainly upright, all but", c.pictures - c.certain[0], 0, 1);
    for (int q = 1; q < 4; q++)
        check_range("certain of one that is turned", c.certain[q], 0, 0);
    return check_status();
}
