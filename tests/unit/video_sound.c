/* The sound of a clip in a video that is written: a click that comes with a
 * white frame comes with it again, whether the sound is copied or coded anew,
 * the pictures start late or the clip was trimmed.  Times are ffmpeg's. */
#include "formats/video.h"
#include "tests/unit/media.h"

#define RATE 48000

/* When the sound of a file first is loud, and how long it is, seconds of the
 * container; negative without any. */
static double sound_onset(const char *name, double *length)
{
    static int16_t pcm[RATE * 20];
    size_t n = 0, at = 0;
    FILE *f;

    if (media_run("ffmpeg -v error -y -copyts -i %s -vn -af "
                  "aresample=%d:async=1:first_pts=0 -ac 1 -f s16le pcm", name,
                  RATE) &&
        (f = fopen(folder_at("pcm"), "rb"))) {
        n = fread(pcm, sizeof *pcm, sizeof pcm / sizeof *pcm, f);
        fclose(f);
    }
    while (at < n && abs(pcm[at]) < 4000)
        at++;
    *length = (double)n / RATE;
    return at < n ? (double)at / RATE : -1;
}

/* When the clip is first white. */
static double flash_time(const char *name)
{
    struct error err = {0};
    struct video_reader *v = video_open(folder_at(name), false, &err);
    const uint8_t *rgb;
    size_t w, h;
    double t, found = -1;

    while (v && found < 0 && video_read(v, &rgb, &w, &h, &t, &err) == 1)
        if (rgb[0] > 128)
            found = t;
    video_close(v);
    return found;
}

/* The frames of `from` with its sound into `to`, as spid animate does it. */
static bool clip_again(const char *from, const char *to)
{
    const char *path = folder_at(from), *clip;
    struct error err = {0};
    struct framesource *in = framesource_open(&path, 1, NULL, &err);
    struct video_writer *out = NULL;
    struct frame f;
    double start;
    int rc, num, den;

    while (in && (rc = framesource_read(in, &f, &err)) == 1) {
        clip = framesource_sound(in, &start);
        framesource_rate(in, &num, &den);
        if (!out)
            out = video_create(folder_at(to), &(struct video_options){
                .width = f.width, .height = f.height, .sound = clip,
                .start = start, .rate = (double)num / den}, &err);
        if (!out || video_write(out, f.rgb, f.time, &err))
            break;
    }
    const double end = in ? framesource_end(in) : 0;
    framesource_close(in);
    if (out && video_finish(out, end, &err) == 0 && !err.code)
        return true;
    check_error(to, false, &err);
    return false;
}

static void compare(const char *from, const char *to, const char *codec)
{
    double length[2];
    const double apart = flash_time(from) - sound_onset(from, &length[0]);

    if (!clip_again(from, to))
        return;
    const double onset = sound_onset(to, &length[1]), flash = flash_time(to);

    printf("%s to %s: flash at %.3f s, click at %.3f s, apart %.3f s, were "
           "%.3f s\n", from, to, flash, onset, flash - onset, apart);
    check_that("white and loud", onset > 0 && flash > 0);
    check("in step", fabs(flash - onset - apart), 0.012);
    check("as long", fabs(length[0] - length[1]), 0.06);
    check_that(codec, media_run("ffprobe -v error -select_streams a "
                                "-show_entries stream=codec_name -of csv=p=0 "
                                "%s | grep -q '^%s'", to, codec));
}

int main(void)
{
    folder_make();
    if (!media_have("ffmpeg ffprobe") ||
        !media_run("ffmpeg -v error -y -f lavfi -i "
                   "color=black:s=64x48:r=25:d=3 -vf \"drawbox=c=white:"
                   "t=fill:enable='between(t,1.2,1.5)'\" "
                   "-c:v libx264 -g 10 v.mp4 && ffmpeg -v error -y -f lavfi -i "
                   "\"aevalsrc='0.9*sin(2500*t)*between(t,1.2,1.4)':d=3\" "
                   "a.wav && ffmpeg -v error -y -i v.mp4 -i a.wav -c:v copy "
                   "-c:a aac b.mp4 && ffmpeg -v error -y -i v.mp4 -i a.wav "
                   "-c:v copy -c:a libopus b.mkv && ffmpeg -v error -y -i "
                   "v.mp4 -i a.wav -c:v mpeg4 -q:v 3 -c:a pcm_s16le b.avi && "
                   "ffmpeg -v error -y -itsoffset 0.7 -i v.mp4 -i a.wav -c:v "
                   "copy -c:a aac late.mp4 && ffmpeg -v error -y -ss 0.5 -i "
                   "b.mp4 -c copy trim.mp4 && ffmpeg -v error -y -ss 0.9 -i "
                   "b.mkv -c copy trim.mkv && ffmpeg -v error -y -i v.mp4 "
                   "-itsoffset 0.3 -i a.wav -c:v copy -c:a aac after.mp4")) {
        folder_remove();
        return 77;
    }
    compare("b.mp4", "o.mp4", "aac");
    compare("b.mp4", "o.mkv", "aac");
    compare("b.mp4", "o.webm", "opus");
    compare("b.mkv", "o.webm", "opus");
    compare("b.mkv", "o.mp4", "aac");
    compare("b.avi", "o.mp4", "aac");
    compare("late.mp4", "o.mp4", "aac");
    compare("late.mp4", "o.webm", "opus");
    compare("after.mp4", "o.mp4", "aac");
    compare("after.mp4", "o.webm", "opus");
    compare("trim.mp4", "o.mp4", "aac");
    compare("trim.mp4", "o.mkv", "aac");
    compare("trim.mkv", "o.mp4", "aac");
    return folder_remove() || check_status();
}
