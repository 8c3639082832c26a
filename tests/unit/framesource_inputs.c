/* Frames in: every kind of input, its times, and what happens at a fault. */
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>
#include <unistd.h>

#include "formats/framesink.h"
#include "formats/framesource.h"
#include "formats/image.h"
#include "tests/check.h"
#include "tests/folder.h"

/* n frames whose grey level is 10 times their number, plus a texture of so
 * many levels. */
static void input_make(const char *path, size_t W, size_t H, uint64_t n,
                       uint32_t texture)
{
    struct framesink_options opt = {.path = path, .rate_num = 30,
                                    .rate_den = 1};
    struct error err = {0};
    struct framesink *s = framesink_open(&opt, &err);
    uint8_t *rgb = malloc(3 * W * H);
    struct framesink_frame f = {.width = W, .height = H, .rgb = rgb};
    int rc = s ? 0 : -1;

    for (f.frame = 0; rc == 0 && f.frame < n; f.frame++) {
        for (size_t i = 0; i < 3 * W * H; i++)
            rgb[i] = (uint8_t)(10 * f.frame
                               + ((uint32_t)i * 2654435761u >> 20) % texture);
        rc = framesink_write(s, &f, &err);
    }
    if (rc != 0 || framesink_finish(s, &err) != 0)
        check_error(path, 0, &err);
    free(rgb);
}

struct seen {
    size_t frames, width, height;
    int first, last;           /* level of pixel 0 */
    double time;               /* of the last */
    int rc, num, den;
    struct error err;
};

static struct seen input_see(const char *const *paths, size_t count)
{
    struct framesource_options opt = {.rate = 10};
    struct seen r = {0};
    struct frame f;
    struct framesource *s = framesource_open(paths, count, &opt, &r.err);

    if (!s) {
        r.rc = -1;
        return r;
    }
    while ((r.rc = framesource_read(s, &f, &r.err)) == 1) {
        if (r.frames++ == 0)
            r.first = f.rgb[0];
        r.last = f.rgb[0];
        r.time = f.time;
        r.width = f.width;
        r.height = f.height;
    }
    framesource_rate(s, &r.num, &r.den);
    framesource_close(s);
    return r;
}

static struct seen see_one(const char *name)
{
    const char *path = folder_at(name);

    return input_see(&path, 1);
}

static void input_cut(const char *from, const char *to, double part)
{
    char *data = malloc(1 << 22);
    FILE *in = fopen(folder_at(from), "rb"), *out = fopen(folder_at(to), "wb");
    size_t n = fread(data, 1, 1 << 22, in);

    fwrite(data, 1, (size_t)((double)n * part), out);
    fclose(in);
    fclose(out);
    free(data);
}

static void test_kinds(void)
{
    static const char *const name[] = {"a.y4m", "a.ppm", "a.avi", "a.mp4",
                                       "dir"};
    struct seen r;

    input_make(folder_at("a.y4m"), 31, 21, 12, 7);
    input_make(folder_at("a.ppm"), 31, 21, 12, 7);
    input_make(folder_at("a.avi"), 64, 48, 12, 7);
    input_make(folder_at("a.mp4"), 64, 48, 12, 7);
    mkdir(folder_at("dir"), 0777);
    input_make(folder_at("dir/x%d.png"), 31, 21, 12, 7);
    for (int i = 0; i < 5; i++) {
        double rate = i == 1 || i == 4 ? 10 : 30;
        r = see_one(name[i]);
        printf("%s: %zu frames of %zu x %zu, levels %d to %d, %d/%d, last at "
               "%.4f s\n", name[i], r.frames, r.width, r.height, r.first,
               r.last, r.num, r.den, r.time);
        check_error(name[i],
                    r.rc == 0 && r.frames == 12 && abs(r.first) <= 6 &&
                    abs(r.last - 110) <= 6 &&
                    fabs(r.time - 11 / rate) < 1e-6 && r.num == (int)rate,
                    &r.err);
    }
}

static void test_lists(void)
{
    const char *two[2] = {folder_at("a.y4m"), folder_at("dir")}, *list;
    struct seen r = input_see(two, 2);
    FILE *fp;

    check_error("two inputs make one clip",
                r.rc == 0 && r.frames == 24 && fabs(r.time - 23 / 30.0) < 1e-6,
                &r.err);
    fp = fopen(folder_at("list"), "w");
    fprintf(fp, "%s\n%s\n", folder_at("dir/x3.png"),
            folder_at("dir/x11.png"));
    fclose(fp);
    list = folder_at("list");
    {
        char name[300];
        snprintf(name, sizeof name, "@%s", list);
        list = name;
        r = input_see(&list, 1);
    }
    check_error("a list of pictures",
                r.rc == 0 && r.frames == 2 && r.first == 30 && r.last == 110,
                &r.err);
}

static void test_faults(void)
{
    static const struct {
        const char *from, *to;
        double part;
    } t[] = {
        {"a.y4m", "cut.y4m", 0.6}, {"a.ppm", "cut.ppm", 0.6},
        {"b.avi", "cut.avi", 0.7},
    };
    struct seen r;

    input_make(folder_at("b.avi"), 320, 240, 12, 120);
    for (size_t i = 0; i < sizeof t / sizeof *t; i++) {
        input_cut(t[i].from, t[i].to, t[i].part);
        r = see_one(t[i].to);
        printf("%s: %zu frames before the fault\n", t[i].to, r.frames);
        check_error(t[i].to,
                    r.rc == -1 && r.err.code == EX_DATAERR &&
                    r.frames >= 1 && r.frames < 12,
                    &r.err);
    }
    input_cut("a.mp4", "cut.mp4", 0.5);
    r = see_one("cut.mp4");
    check_error("a video without its index",
                r.rc == -1 && r.err.code == EX_DATAERR, &r.err);
    input_cut("a.mp4", "empty.mp4", 0);
    r = see_one("empty.mp4");
    check_error("an empty file", r.rc == -1 && r.err.code == EX_DATAERR,
                &r.err);
    r = see_one("none.mp4");
    check_error("a missing file", r.rc == -1 && r.err.code == EX_NOINPUT,
                &r.err);
    mkdir(folder_at("bare"), 0777);
    r = see_one("bare");
    check_error("a folder without pictures",
                r.rc == -1 && r.err.code == EX_DATAERR, &r.err);
}

/* MPEG-TS, which says nowhere how long it is: cut inside a packet. */
static void test_transport(void)
{
    char cmd[1024];
    struct stat st;
    struct seen r;

    snprintf(cmd, sizeof cmd, "ffmpeg -nostdin -v error -y -i %s/b.avi -c:v "
             "mpeg2video -q:v 2 %s/b.ts", folder_at("."), folder_at("."));
    if (system("command -v ffmpeg >/dev/null 2>&1") != 0) {
        printf("no ffmpeg here: MPEG-TS left out\n");
        return;
    }
    check_error("MPEG-TS by ffmpeg", system(cmd) == 0, &(struct error){0});
    r = see_one("b.ts");
    check_error("a whole MPEG-TS file", r.rc == 0 && r.frames == 12, &r.err);
    input_cut("b.ts", "cut.ts", 0.7);
    check_error("cutting it",
                stat(folder_at("cut.ts"), &st) == 0 &&
                truncate(folder_at("cut.ts"), st.st_size / 188 * 188 - 60) == 0,
                &(struct error){0});
    r = see_one("cut.ts");
    printf("cut.ts: %zu frames before the fault\n", r.frames);
    check_error("one cut short",
                r.rc == -1 && r.err.code == EX_DATAERR && r.frames >= 1 &&
                r.frames < 12,
                &r.err);
}

/* ffmpeg's file of that name: 60 frames of two seconds, of which `select`
 * stay; with sound of `sound` seconds. */
static bool input_by_ffmpeg(const char *name, const char *select, double sound)
{
    char cmd[1024];

    snprintf(cmd, sizeof cmd, "ffmpeg -nostdin -v error -y -f lavfi -i "
             "testsrc=s=128x96:d=2:r=30 -f lavfi -i sine=d=%g -vf "
             "\"select='%s'\" -fps_mode vfr -c:v mpeg4 -q:v 2 %s", sound,
             select, folder_at(name));
    return system(cmd) == 0;
}

/* What recorders make: sound that outlasts the pictures, and pictures at a
 * rate that varies.  Neither is damage; a file without its end is. */
static void test_recorded(void)
{
    static const char *const name[] = {"r.mkv", "r.mp4", "r.mov", "r.avi",
                                       "r.ts"};
    struct seen r;

    if (system("command -v ffmpeg >/dev/null 2>&1") != 0) {
        printf("no ffmpeg here: recordings left out\n");
        return;
    }
    for (size_t i = 0; i < sizeof name / sizeof *name; i++) {
        check_error(name[i], input_by_ffmpeg(name[i], "1", 6),
                    &(struct error){0});
        r = see_one(name[i]);
        check_error("sound longer than the pictures",
                    r.rc == 0 && r.frames == 60, &r.err);
        check_error(name[i], input_by_ffmpeg(name[i], "lt(n,20)+not(mod(n,4))",
                                             2), &(struct error){0});
        r = see_one(name[i]);
        check_error("a rate that varies", r.rc == 0 && r.frames == 30, &r.err);
    }
    input_by_ffmpeg("r.mkv", "1", 2);
    input_cut("r.mkv", "cut.mkv", 0.7);
    r = see_one("cut.mkv");
    printf("cut.mkv: %zu frames before the fault\n", r.frames);
    check_error("Matroska cut short", r.rc == -1 && r.err.code == EX_DATAERR &&
                r.frames >= 1 && r.frames < 60, &r.err);
}

/* Clips that were trimmed without being coded again, by an edit list or in
 * front of a picture that stands alone; a last picture that stays long; WMV,
 * whose length is the sound's.  What ffmpeg shows is there, and no more. */
static void test_trimmed(void)
{
    static const char *const make[] = {
        "-ss 0.7 -i whole.mp4 -c copy t.mp4",
        "-ss 0.7 -i whole.mp4 -c copy t.mkv",
        "-ss 0.7 -to 1.4 -i whole.mp4 -c copy t.mov",
        "-i whole.mp4 -t 0.9 -c copy t.mp4",
        "-ss 0.5 -i whole.mkv -c copy t.ts",
        "-i whole.mp4 -vf \"setpts='PTS+gte(N\\,59)*4/TB'\" -fps_mode vfr "
        "t.mp4",
        "-i whole.mp4 -vf \"setpts='PTS+gte(N\\,59)*4/TB'\" -fps_mode vfr "
        "t.mkv",
        "-i whole.mp4 -f lavfi -i sine=d=5 -shortest t.wmv",
        "-i whole.mp4 -f lavfi -i sine=d=5 t.wmv",
        "-i whole.mp4 -f lavfi -i sine=d=5 -c:v copy t.mkv",
    };
    char cmd[1024];

    snprintf(cmd, sizeof cmd, "cd %s && ffmpeg -nostdin -v error -y -f lavfi "
             "-i testsrc2=s=128x96:d=2:r=30 -c:v libx264 -g 25 -bf 2 "
             "whole.mp4 && ffmpeg -v error -y -i whole.mp4 -c copy whole.mkv",
             folder_at("."));
    if (system("command -v ffmpeg >/dev/null 2>&1") || system(cmd)) {
        printf("no ffmpeg here: trimmed clips left out\n");
        return;
    }
    for (size_t i = 0; i < sizeof make / sizeof *make; i++) {
        const char *name = strrchr(make[i], ' ') + 1;
        struct seen r;
        int want = -1;
        FILE *count;

        snprintf(cmd, sizeof cmd, "cd %s && ffmpeg -nostdin -v error -y %s && "
                 "ffmpeg -v quiet -i %s -map 0:v -fps_mode passthrough -f "
                 "framecrc - | grep -vc '^#'", folder_at("."), make[i], name);
        count = popen(cmd, "r");
        if (!count || fscanf(count, "%d", &want) != 1)
            want = -1;
        if (count)
            pclose(count);
        r = see_one(name);
        printf("%d frames, %s ", want, make[i]);
        check_error("trimmed", r.rc == 0 && want > 10 &&
                    r.frames == (size_t)want, &r.err);
    }
}

/* Containers that say how long they are, cut anywhere. */
static void test_cut(void)
{
    static const char *const name[] = {"k.mkv", "k.webm", "k.avi", "k.wmv",
                                       "k.mp4"};
    char cmd[1024];

    if (system("command -v ffmpeg >/dev/null 2>&1"))
        return;
    for (size_t i = 0; i < sizeof name / sizeof *name; i++)
        for (double part = 0.6; part < 0.7; part += 0.03) {
            struct seen r;

            snprintf(cmd, sizeof cmd, "cd %s && ffmpeg -nostdin -v error -y -i "
                     "whole.mp4 -movflags +faststart %s", folder_at("."),
                     name[i]);
            check_error(name[i], system(cmd) == 0, &(struct error){0});
            input_cut(name[i], "cut", part);
            rename(folder_at("cut"), folder_at(name[i]));
            r = see_one(name[i]);
            check_error("cut short", r.rc == -1 && r.err.code == EX_DATAERR &&
                        r.frames >= 1 && r.frames < 60, &r.err);
        }
}

static void write_text(const char *name, const char *text, size_t n)
{
    FILE *fp = fopen(folder_at(name), "wb");

    fwrite(text, 1, n, fp);
    fclose(fp);
}

static void test_hostile(void)
{
    static const struct {
        const char *name, *text;
    } t[] = {
        {"h1.ppm", "P6 99999 99999 255\n"}, {"h2.ppm", "P6 0 5 255\n"},
        {"h3.ppm", "P6 5 5 0\n"}, {"h4.pam", "P7\nWIDTH 4\nHEIGHT 4\n"},
        {"h5.y4m", "YUV4MPEG2 W0 H5\n"}, {"h6.y4m", "YUV4MPEG2 W9\n"},
        {"h7.y4m", "YUV4MPEG2 W30000 H30000\nFRAME\n"},
        {"h8.y4m", "YUV4MPEG2 W8 H8 C420p10\nFRAME\n"},
        {"h9.y4m", "YUV4MPEG2 W8 H8\n"}, {"h10.png", "\x89PNG\r\n\x1a\nxx"},
        {"h11.jpg", "\xff\xd8\xff\xe0 nothing"}, {"h12.mp4", "garbage"},
    };

    for (size_t i = 0; i < sizeof t / sizeof *t; i++) {
        struct seen r;
        write_text(t[i].name, t[i].text, strlen(t[i].text));
        r = see_one(t[i].name);
        check_error(t[i].name,
                    r.rc == -1 && r.err.code == EX_DATAERR && r.frames == 0,
                    &r.err);
    }
}

static void test_images(void)
{
    struct image im = {0};
    struct error err = {0};
    uint8_t px[2 * 3 * 4] = {200, 100, 50, 128, 10, 20, 30, 255,
                             1, 2, 3, 0, 4, 5, 6, 7};
    char cmd[1024];

    image_write_png(folder_at("rgba.png"), px, 2, 3, 4, &err);
    check_error("alpha stays straight",
                image_read(&im, folder_at("rgba.png"), &err) == 0 && im.alpha &&
                im.rgb[0] == 200 && im.rgb[2] == 50 && im.alpha[0] == 128,
                &err);
    image_release(&im);
    image_write_png(folder_at("grey.png"), px, 2, 3, 1, &err);
    check_error("grey is spread",
                image_read(&im, folder_at("grey.png"), &err) == 0 &&
                !im.alpha &&
                im.rgb[0] == 200 && im.rgb[1] == 200 && im.rgb[2] == 200,
                &err);
    image_release(&im);
    if (system("command -v convert >/dev/null 2>&1") != 0) {
        printf("no convert here: orientation, 16 bits, CMYK left out\n");
        return;
    }
    snprintf(cmd, sizeof cmd, "cd %s && convert -size 4x2 xc:red -fill blue "
             "-draw 'point 0,0' -orient RightTop -quality 100 "
             "-sampling-factor 4:4:4 turned.tif && "
             "convert -size 4x2 xc:red -colorspace CMYK cmyk.jpg && "
             "convert -size 4x2 xc:red -colorspace CMYK cmyk.tif && "
             "convert -size 4x2 xc:'#80008000ffff' -depth 16 deep.png", folder);
    if (system(cmd) != 0)
        return;
    check_error("an orientation tag is applied",
                image_read(&im, folder_at("turned.tif"), &err) == 0 &&
                im.width == 2 && im.height == 4 && im.rgb[0] == 255 &&
                im.rgb[5] == 255,
                &err);
    image_release(&im);
    check_error("16 bits are rounded",
                image_read(&im, folder_at("deep.png"), &err) == 0 &&
                im.rgb[0] == 128 && im.rgb[2] == 255,
                &err);
    image_release(&im);
    check_error("CMYK JPEG is refused",
                image_read(&im, folder_at("cmyk.jpg"), &err) != 0 &&
                strstr(err.text, "CMYK"),
                &err);
    check_error("CMYK TIFF is refused",
                image_read(&im, folder_at("cmyk.tif"), &err) != 0 &&
                strstr(err.text, "CMYK"),
                &err);
}

int main(void)
{
    folder_make();
    test_kinds();
    test_lists();
    test_faults();
    test_transport();
    test_recorded();
    test_trimmed();
    test_cut();
    test_hostile();
    test_images();
    return folder_remove() || check_status();
}
