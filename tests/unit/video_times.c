/* Videos that are written keep their frames' times: a driver of a variable rate
 * is followed in its own time, one of a constant rate in equal steps. */
#include <math.h>

#include "formats/video.h"
#include "tests/check.h"
#include "tests/folder.h"

enum { SIDE = 64, FRAMES = 6 };

/* Frames written at these times and read again. */
static void times_back(const char *what, const char *name,
                       const double time[FRAMES], const double want[FRAMES])
{
    static uint8_t rgb[3 * SIDE * SIDE];
    const char *path = folder_at(name);
    struct error err = {0};
    struct video_writer *w = video_create(path, &(struct video_options){
        .width = SIDE, .height = SIDE, .rate = 25}, &err);
    double worst = 0;
    int count = 0;

    REQUIRE(w, "%s", err.text);
    for (int i = 0; i < FRAMES; i++) {
        rgb[3 * i] = 200;
        REQUIRE(video_write(w, rgb, time[i], &err) == 0, "%s", err.text);
    }
    REQUIRE(video_finish(w, 0, &err) == 0, "%s", err.text);

    struct video_reader *r = video_open(path, false, &err);
    const uint8_t *seen;
    size_t width, height;
    double t;

    REQUIRE(r, "%s", err.text);
    while (video_read(r, &seen, &width, &height, &t, &err) == 1 &&
           count < FRAMES)
        worst = fmax(worst, fabs(t - want[count++]));
    check_that("all frames are there", count == FRAMES);
    check(what, worst, 2e-3);
    video_close(r);
}

int main(void)
{
    static const double even[FRAMES] = {0, 0.04, 0.08, 0.12, 0.16, 0.2};
    static const double late[FRAMES] = {7, 7.04, 7.08, 7.12, 7.16, 7.2};
    static const double vary[FRAMES] = {0, 0.04, 0.24, 0.28, 1.2, 1.24};
    static const double back[FRAMES] = {0, 0.04, 0.02, NAN, 0.16, 0.2};

    folder_make();
    times_back("a constant rate", "a.mp4", even, even);
    times_back("times from the first frame on", "b.mp4", late, even);
    times_back("a rate that varies", "c.mp4", vary, vary);
    times_back("the same in Matroska", "d.mkv", vary, vary);
    times_back("times that do not grow: the next step", "e.mp4", back, even);
    return folder_remove() || check_status();
}
