/* Animations of GIF, WebP and APNG: every frame and its time, of other people's
 * files and of our own, which other people's tools read; alpha in videos; and
 * numbered pictures, none missing. */
#include "formats/video.h"
#include "tests/unit/media.h"

enum { SIDE = 48, FRAMES = 5 };

static const double times[FRAMES + 1] = {0, 0.05, 0.2, 0.25, 0.5, 0.8};

/* A picture of frame k: a bar at its place, and a clear corner. */
static void draw(uint8_t *pixel, int k, size_t channels)
{
    for (size_t i = 0; i < SIDE * SIDE; i++) {
        const size_t x = i % SIDE, y = i / SIDE;
        uint8_t *p = pixel + channels * i;

        p[0] = (uint8_t)(x / 8 == (size_t)k ? 220 : 40);
        p[1] = (uint8_t)(2 * y);
        p[2] = 90;
        if (channels == 4)
            p[3] = x + y < 24 ? 0 : 255;
    }
}

/* The clip's frames: count, their times against ours, which bar they show, and
 * when the last ends. */
static void read_back(const char *name, double tolerance, double end)
{
    const char *path = folder_at(name);
    struct error err = {0};
    struct framesource *s = framesource_open(&path, 1, NULL, &err);
    double worst = 0, wrong = 0;
    int n = 0, rc = -1;
    struct frame f;

    while (s && (rc = framesource_read(s, &f, &err)) == 1 && n < FRAMES) {
        const uint8_t *row = f.rgb + 3 * f.width * (SIDE - 4);

        worst = fmax(worst, fabs(f.time - times[n]));
        for (int k = 0; k < 6; k++)
            wrong += (row[3 * (8 * k + 4)] > 128) != (k == n);
        n++;
    }
    check_error(name, rc == 0 && n == FRAMES, &err);
    check("times", worst, tolerance);
    check("pictures", wrong, 0);
    check("the last one's end", s ? fabs(framesource_end(s) - end) : 1,
          tolerance);
    framesource_close(s);
}

static void write_clip(const char *name, bool alpha)
{
    static uint8_t pixel[4 * SIDE * SIDE];
    struct error err = {0};
    struct video_writer *v = video_create(folder_at(name),
                                          &(struct video_options){
        .width = SIDE, .height = SIDE, .rate = 20, .alpha = alpha}, &err);

    REQUIRE(v, "%s", err.text);
    for (int k = 0; k < FRAMES; k++) {
        draw(pixel, k, alpha ? 4 : 3);
        REQUIRE(video_write(v, pixel, times[k], &err) == 0, "%s", err.text);
    }
    REQUIRE(video_finish(v, times[FRAMES], &err) == 0, "%s", err.text);
}

static void test_own(void)
{
    write_clip("o.gif", false);
    read_back("o.gif", 1e-6, 0.8);
    write_clip("o.webp", false);        /* libwebp guesses the last one's */
    read_back("o.webp", 0.002, 0.5 + 0.125);
    write_clip("o.apng", false);
    read_back("o.apng", 1e-6, 0.8);
    write_clip("o.mp4", false);
    read_back("o.mp4", 1e-3, 0.8);
    write_clip("o.mkv", false);
    read_back("o.mkv", 2e-3, 0.8);
    if (!media_have("identify"))
        return;
    check_that("ImageMagick agrees on GIF",
               media_run("identify -format '%%n %%T\\n' o.gif | tr '\\n' ' ' | "
                         "grep -q '^5 5 5 15 5 5 5 25 5 30 '"));
    check_that("and on WebP", media_run("webpinfo o.webp | grep -c Duration | "
                                        "grep -qx 5"));
    check_that("they repeat for ever",
               media_run("grep -aq NETSCAPE2.0 o.gif && webpinfo o.webp | "
                         "grep -q 'Loop count *: 0'"));
}

/* Frames of other people's, at the same times. */
static void test_others(void)
{
    check_that("animations of ImageMagick, img2webp and ffmpeg",
               media_run("for k in 0 1 2 3 4; do ffmpeg -v error -y -i o.mkv "
                         "-vf \"select='eq(n\\,$k)'\" -frames:v 1 f$k.png || "
                         "exit; done; convert -delay 5 f0.png -delay 15 f1.png "
                         "-delay 5 f2.png -delay 25 f3.png -delay 30 f4.png "
                         "i.gif && img2webp -lossless -d 50 f0.png -d 150 "
                         "f1.png -d 50 f2.png -d 250 f3.png -d 300 f4.png -o "
                         "i.webp && ffmpeg -v error -y -i i.gif -fps_mode vfr "
                         "-final_delay 3/10 -f apng i.png"));
    read_back("i.gif", 1e-6, 0.8);
    read_back("i.webp", 1e-6, 0.8);
    read_back("i.png", 1e-3, 0.8);
}

/* Alpha comes back as it was, but for what coding loses. */
static void test_alpha(void)
{
    static const struct {
        const char *name, *decoder;
    } t[] = {
        {"a.webm", "-c:v libvpx-vp9"}, {"a.mkv", "-c:v libvpx-vp9"},
        {"a.mov", ""}, {"a.gif", ""}, {"a.apng", "-f apng"}
    };

    for (size_t i = 0; i < sizeof t / sizeof *t; i++) {
        write_clip(t[i].name, true);
        check_that(t[i].name,
                   media_run("ffmpeg -v error -y %s -i %s -frames:v 1 -pix_fmt "
                             "rgba a.png", t[i].decoder, t[i].name));
        struct image im = media_picture("a.png");
        double worst = 0;

        for (size_t p = 0; im.alpha && p < im.width * im.height; p++) {
            const size_t sum = p % SIDE + p / SIDE;

            if (sum < 20 || sum > 28)
                worst = fmax(worst, abs(im.alpha[p] - (sum < 24 ? 0 : 255)));
        }
        check_that("has alpha", im.alpha != NULL);
        check("within levels", worst, 24);
        image_release(&im);
    }
}

static void test_patterns(void)
{
    const char *path = folder_at("n%03d.png");
    struct error err = {0};
    struct framesource *s;
    struct frame f;
    int n = 0;

    check_that("numbered pictures",
               media_run("for k in 0 1 2 3 4; do cp f$k.png n00$((k + 7)).png "
                         "2>/dev/null || cp f$k.png n0$((k + 7)).png; done; mv "
                         "n0010.png n010.png; mv n0011.png n011.png; cp f0.png "
                         "n1.png; cp f0.png nn007.png"));
    s = framesource_open(&path, 1, NULL, &err);
    while (s && framesource_read(s, &f, &err) == 1)
        n++;
    framesource_close(s);
    check_error("are one clip", n == 5, &err);
    check_that("one of them lost", media_run("rm n009.png"));
    s = framesource_open(&path, 1, NULL, &err);
    check_error("is named", !s && strstr(err.text, "n009.png is missing"),
                &err);
    framesource_close(s);
    path = folder_at("none%d.png");
    s = framesource_open(&path, 1, NULL, &err);
    check_error("none at all", !s, &err);
}

int main(void)
{
    folder_make();
    test_own();
    if (media_have("ffmpeg convert img2webp")) {
        test_others();
        test_alpha();
        test_patterns();
    }
    return folder_remove() || check_status();
}
