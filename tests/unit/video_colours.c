/* One colour through videos that ffmpeg writes by either matrix, tagged or
 * not, small and high definition: what video_read gives is within 4 levels
 * (H.264 4:2:0), and of any planes what Y4M of them gives.  And an HD video of
 * our own writing, read by ffmpeg as BT.709.  Skipped without ffmpeg and its
 * H.264 encoder. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/video.h"
#include "tests/unit/media.h"

static const int colour[3] = { 192, 128, 96 };
static void colours_compare(const char *what, const uint8_t *rgb, size_t pixels)
{
    int worst = 0;

    for (size_t i = 0; i < 3 * pixels; i++) {
        int d = abs((int)rgb[i] - colour[i % 3]);
        worst = d > worst ? d : worst;
    }
    printf("%d,%d,%d ", rgb[0], rgb[1], rgb[2]);
    check(what, worst, 4);
}

static void read_back(const char *path, bool bt601, const char *what)
{
    struct error err = { 0 };
    const uint8_t *rgb;
    size_t w, h;
    double t;
    struct video_reader *v = video_open(path, bt601, &err);

    if (!v || video_read(v, &rgb, &w, &h, &t, &err) != 1) {
        check_error(what, false, &err);
    } else {
        colours_compare(what, rgb, w * h);
    }
    video_close(v);
}

static void from_ffmpeg(const char *dir, const char *name, const char *size,
                        const char *matrix, const char *tags, bool bt601)
{
    char path[300], command[900];

    snprintf(path, sizeof path, "%s/%s", dir, name);
    snprintf(command, sizeof command, "ffmpeg -v error -y -f lavfi -i "
             "color=c=0xC08060:s=%s:d=0.2,format=rgb24 -vf scale="
             "out_color_matrix=%s:out_range=tv,format=yuv420p -c:v libx264 "
             "-crf 8 %s %s", size,
             matrix, tags, path);
    if (system(command) != 0) {
        printf("%s: ffmpeg did not write it\n", name);
        exit(77);
    }
    read_back(path, bt601, name);
}

/* Our writer's HD file as a player that takes it for BT.709 sees it. */
static void to_ffmpeg(const char *dir)
{
    static uint8_t frame[1280 * 720 * 3], seen[16 * 16 * 3];
    char path[300], command[900];
    struct error err = { 0 };

    for (size_t i = 0; i < sizeof frame; i++)
        frame[i] = (uint8_t)colour[i % 3];
    snprintf(path, sizeof path, "%s/ours.mp4", dir);
    struct video_writer *v = video_create(path, &(struct video_options){
        .width = 1280, .height = 720, .rate = 25}, &err);
    if (!v || video_write(v, frame, 0, &err) ||
        video_write(v, frame, 0.04, &err) ||
        video_finish(v, 0, &err)) {
        check_error("ours.mp4", false, &err);
        return;
    }
    read_back(path, false, "ours.mp4 read by us");
    snprintf(command, sizeof command, "ffmpeg -v error -i %s -frames:v 1 -vf "
             "scale=in_color_matrix=bt709:in_range=tv,format=rgb24 -f rawvideo "
             "- 2>/dev/null",
             path);
    FILE *p = popen(command, "r");
    if (p && fread(seen, 1, sizeof seen, p) == sizeof seen)
        colours_compare("ours.mp4 read by ffmpeg", seen, 256);
    else
        check_that("ours.mp4 read by ffmpeg", false);
    if (p)
        pclose(p);
}

/* A clip of a telephone that was held upright: as ffmpeg turns it and zimg makes
 * colours of it, chroma at its place, which is the bottom of two rows then. */
static void colours_rotated(const char *dir)
{
    static uint8_t seen[3 * 64 * 48];
    char command[900], path[300];
    struct error err = { 0 };
    const uint8_t *rgb = NULL;
    size_t w = 0, h = 0;
    int worst = 255;
    double t;

    snprintf(path, sizeof path, "%s/turned.mp4", dir);
    snprintf(command, sizeof command, "ffmpeg -v error -y -f lavfi -i "
             "testsrc=s=64x48:d=0.1 -pix_fmt yuv420p %s/lying.mp4 && ffmpeg "
             "-v error -y -i %s/lying.mp4 -c copy -metadata:s:v:0 rotate=90 "
             "%s", dir, dir, path);
    if (system(command) != 0)
        return;
    snprintf(command, sizeof command, "ffmpeg -v error -i %s -frames:v 1 -vf "
             "zscale=min=470bg:m=gbr:rin=tv:r=pc:cin=bottom:f=bilinear,"
             "format=gbrp,format=rgb24 -f rawvideo -", path);
    FILE *p = popen(command, "r");
    bool there = p && fread(seen, 1, sizeof seen, p) == sizeof seen;
    struct video_reader *v = video_open(path, false, &err);

    if (there && v && video_read(v, &rgb, &w, &h, &t, &err) == 1 &&
        w == 48 && h == 64) {
        worst = 0;
        for (size_t i = 0; i < sizeof seen; i++)
            worst = abs(rgb[i] - seen[i]) > worst ? abs(rgb[i] - seen[i])
                                                  : worst;
    }
    check("a clip held upright, against ffmpeg", worst, 4);
    video_close(v);
    if (p)
        pclose(p);
}

/* A file's planes become the colours that Y4M of them has, to the bit. */
static void colours_planes(const char *format, const char *codec)
{
    check_that("the same planes twice",
               media_run("ffmpeg -v error -y -f lavfi -i testsrc2=d=0.1 "
                         "-vf scale=75:49:out_color_matrix=bt709,format=%s "
                         "-colorspace bt709 -c:v %s planes.mkv && ffmpeg -v "
                         "error -y -i planes.mkv -strict -1 planes.y4m", format,
                         codec));
    media_check(format, media_frame("planes.mkv", 1),
                media_frame("planes.y4m", 1), 0);
}

int main(void)
{
    const char *tags709 = "-color_range tv -colorspace bt709 "
                          "-color_primaries bt709 -color_trc bt709";
    const char *tags601 = "-color_range tv -colorspace smpte170m "
                          "-color_primaries smpte170m -color_trc smpte170m";

    if (system("ffmpeg -version > /dev/null 2>&1") != 0) {
        printf("no ffmpeg (apt: ffmpeg)\n");
        return 77;
    }
    folder_make();
    from_ffmpeg(folder, "small-709.mp4", "320x240", "bt709", tags709, false);
    from_ffmpeg(folder, "small-709.mkv", "320x240", "bt709", tags709, false);
    from_ffmpeg(folder, "small-601.mp4", "320x240", "bt601", tags601, false);
    from_ffmpeg(folder, "small.mp4", "320x240", "bt601", "", false);
    from_ffmpeg(folder, "hd.mp4", "1280x720", "bt709", "", false);
    from_ffmpeg(folder, "hd-601.mov", "1280x720", "bt601", tags601, false);
    from_ffmpeg(folder, "hd-601.mkv", "1280x720", "bt601", tags601, false);
    from_ffmpeg(folder, "lying.mp4", "1280x720", "bt601", tags709, true);
    to_ffmpeg(folder);
    colours_rotated(folder);
    colours_planes("yuv420p", "mpeg2video");
    colours_planes("yuv420p", "mpeg1video");
    colours_planes("yuv422p", "ffv1");
    colours_planes("yuvj422p", "ffv1");
    colours_planes("yuv444p", "libvpx-vp9");
    return folder_remove() || check_status();
}
