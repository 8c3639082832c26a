/* A reading thread and its consumer: each frame is taken or counted as
 * dropped, in order; a followed source that ends is opened again until it is
 * told to stop.  make tsan looks for races between the two. */
#include <string.h>

#include "lib/animate/live.h"
#include "tests/check.h"
#include "tests/folder.h"

enum { SIDE = 16, FRAMES = 300 };

static void live_write(const char *path)
{
    uint8_t planes[SIDE * SIDE * 3 / 2];
    FILE *f = fopen(path, "wb");

    REQUIRE(f, "%s cannot be written", path);
    fprintf(f, "YUV4MPEG2 W%d H%d F25:1 Ip C420jpeg\n", SIDE, SIDE);
    for (int i = 0; i < FRAMES; i++) {
        memset(planes, 40 + i % 150, sizeof planes);
        fprintf(f, "FRAME\n");
        fwrite(planes, sizeof planes, 1, f);
    }
    fclose(f);
}

static struct framesource *live_open(void *path, struct error *err)
{
    const char *name = path;
    const struct framesource_options opt = {0};

    return framesource_open(&name, 1, &opt, err);
}

/* Called by the thread, while the test counts restarts. */
static void live_is_away(void *path, const struct error *why)
{
    (void)path;
    (void)why;
}

/* A source that ends: what is taken and what is dropped is all there was. */
static void live_test_end(const char *path)
{
    struct live l;
    struct frame f;
    struct error err = {0};
    struct framesource *source = live_open((void *)path, &err);
    size_t taken = 0, next = 0, before = 0;
    bool ordered = true, counted = true;
    int rc;

    REQUIRE(source && !live_start(&l, source, &(struct live_follow){0}, &err), "%s", err.text);
    while ((rc = live_read(&l, &f, &err)) == 1) {
        ordered = ordered && f.index >= next;
        next = f.index + 1;
        counted = counted && l.dropped >= before;
        before = l.dropped;
        taken++;
    }
    check_that("a source that ends: 0 at the end", rc == 0);
    check_that("  frames in order", ordered && taken > 0);
    expect("  taken and dropped", (double)(taken + l.dropped), FRAMES, 0);
    check_that("  what is dropped only grows", counted);
    live_stop(&l);
    framesource_close(source);
}

/* A followed source: opened again whenever it ends, until stop is set. */
static void live_test_follow(const char *path)
{
    static _Atomic bool stop;
    const struct live_follow follow = {
        .open = live_open, .away = live_is_away, .ctx = (void *)path,
        .patience = 60, .stop = &stop
    };
    struct live l;
    struct frame f;
    struct error err = {0};
    struct framesource *source = live_open((void *)path, &err);
    size_t restarts = 0;
    int rc = 1;

    REQUIRE(source && !live_start(&l, source, &follow, &err), "%s",
            err.text);
    while (rc == 1 && l.restarts < 3) {
        rc = live_read(&l, &f, &err);
        restarts += rc == 1 && f.restart;
    }
    check_that("a source that comes back: frames go on",
               rc == 1 && restarts > 0);
    stop = true;
    check_that("  told to stop: 0", live_read(&l, &f, &err) == 0);
    live_stop(&l);
    check_that("  and the thread has ended", !l.started);
}

int main(void)
{
    folder_make();
    live_write(folder_at("a.y4m"));
    live_test_end(folder_at("a.y4m"));
    live_test_follow(folder_at("a.y4m"));
    return folder_remove() || check_status();
}
