/* Pictures and videos say that they are synthetic; read back by libpng's
 * chunks, OpenImageIO's reader of EXR, and ffprobe where it is installed. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/framesink.h"
#include "formats/mark.h"
#include "formats/video.h"
#include "tests/check.h"
#include "tests/folder.h"

#define SIDE 64

/* One grey picture, or three as a video. */
static void write_grey(const char *path)
{
    static uint8_t rgb[3 * SIDE * SIDE];
    struct framesink_frame f = {.width = SIDE, .height = SIDE, .rgb = rgb,
                                .channels = 3};
    const bool picture = strstr(path, ".png") || strstr(path, ".exr");
    struct error err = {0};
    struct framesink *s = framesink_open(&(struct framesink_options){
        .path = path}, &err);

    memset(rgb, 99, sizeof rgb);
    for (; s && f.frame < (picture ? 1 : 3); f.frame++)
        framesink_write(s, &f, &err);
    check_error(path, s && framesink_finish(s, &err) == 0, &err);
}

/* Whether the file holds text. */
static bool mark_holds(const char *path, const char *text)
{
    FILE *f = fopen(path, "rb");
    char *data = NULL;
    size_t n = 0, room = 0;
    bool found;

    for (int c; f && (c = getc(f)) != EOF; data[n++] = (char)c)
        if (n == room)
            data = realloc(data, room = 2 * room + 4096);
    if (f)
        fclose(f);
    found = n && memmem(data, n, text, strlen(text));
    free(data);
    return found;
}

/* The comment that ffprobe sees; "" without one. */
static const char *mark_probe(const char *path)
{
    static char line[300];
    char command[500];
    FILE *p;

    snprintf(command, sizeof command, "ffprobe -v error -show_entries "
             "format_tags=comment -of csv=p=0 '%s' 2>&1", path);
    p = popen(command, "r");
    if (!p || !fgets(line, sizeof line, p))
        line[0] = 0;
    if (p)
        pclose(p);
    line[strcspn(line, "\n")] = 0;
    return line;
}

/* Every frame is still there, and the video is read as before. */
static void check_video(const char *path, bool marked)
{
    struct error err = {0};
    struct video_reader *v = video_open(path, false, &err);
    const uint8_t *rgb;
    size_t w, h, n = 0;
    double t;

    while (v && video_read(v, &rgb, &w, &h, &t, &err) == 1)
        n++;
    video_close(v);
    check_range("frames that can be read", (double)n, 3, 3);
    if (system("command -v ffprobe >/dev/null") != 0) {
        printf("no ffprobe: comment not compared\n");
        return;
    }
    printf("ffprobe: %s\n", mark_probe(path));
    check_that(marked ? "comment in the video" : "no comment in the video",
               (strstr(mark_probe(path), "Synthetic: drawn by the SpiD toolkit")
                != NULL) == marked);
}

static void check_all(bool marked)
{
    static const char *const video[] = {"a.mp4", "a.mov", "a.mkv", "a.webm",
                                        "a.avi"};
    const char *png = folder_at("a.png"), *exr = folder_at("a.exr");

    write_grey(png);
    check_that("PNG: the comment",
               mark_holds(png, "Synthetic: drawn") == marked);
    check_that("PNG: IPTC's source type",
               mark_holds(png, "trainedAlgorithmicMedia") == marked);
    write_grey(exr);
    check_that(
        "EXR: the comments attribute",
        (mark_holds(exr, "Synthetic: drawn") && mark_holds(exr, "comments"))
            == marked);
    for (size_t i = 0; i < sizeof video / sizeof *video; i++) {
        write_grey(folder_at(video[i]));
        check_video(folder_at(video[i]), marked);
    }
}

int main(void)
{
    folder_make();
    check_all(true);
    mark_off();
    check_all(false);
    folder_remove();
    return check_status();
}
