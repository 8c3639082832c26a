/* What leaves the door is upright, unmirrored and has square pixels: all eight
 * orientations of photographs and display matrices of clips, aspects, crop
 * rectangles and fields, against ImageMagick and ffmpeg. */
#include "tests/unit/media.h"

/* ImageMagick's way to what a stored picture of an orientation shows; a matrix
 * of MP4 that says the same: x' = a x + c y, y' = b x + d y. */
static const struct {
    const char *way;
    int a, b, c, d;
} held[9] = {
    [1] = {"-rotate 0", 1, 0, 0, 1}, {"-flop", -1, 0, 0, 1},
    {"-rotate 180", -1, 0, 0, -1}, {"-flip", 1, 0, 0, -1},
    {"-transpose", 0, 1, 1, 0}, {"-rotate 90", 0, 1, -1, 0},
    {"-transverse", 0, -1, -1, 0}, {"-rotate 270", 0, -1, 1, 0}
};

/* Orientation o in a file of this ending. */
static void photograph_held(const char *ending, int o)
{
    char name[32], what[64];

    snprintf(what, sizeof what, "%s with orientation %d", ending, o);
    snprintf(name, sizeof name, "o.%s", ending);
    if (!media_run("convert base.png -quality 100 plain.%s && convert "
                   "plain.%s %s -depth 8 want.ppm && cp plain.%s o.%s && "
                   "exiftool -q -q -overwrite_original -n -Orientation=%d "
                   "o.%s", ending, ending, held[o].way, ending, ending, o,
                   ending)) {
        check_that(what, false);
        return;
    }
    media_check(what, media_picture(name), media_picture("want.ppm"), 0);
}

/* `matrix` written into all track headers of a clip (ISO/IEC 14496-12). */
static bool clip_set_matrix(const char *from, const char *to, int o)
{
    const int32_t one = 1 << 16;
    const int32_t m[9] = {held[o].a * one, held[o].b * one, 0, held[o].c * one,
                          held[o].d * one, 0, 0, 0, 1 << 30};
    FILE *f = fopen(folder_at(from), "rb");
    static unsigned char b[1 << 20];
    const size_t n = f ? fread(b, 1, sizeof b, f) : 0;
    bool found = false;

    for (size_t i = 0; i + 80 < n; i++) {
        if (memcmp(b + i, "tkhd", 4))
            continue;
        unsigned char *p = b + i + 8 + (b[i + 4] ? 32 : 20) + 16;

        for (int k = 0; k < 9; k++)
            for (int j = 0; j < 4; j++)
                *p++ = (unsigned char)((uint32_t)m[k] >> (24 - 8 * j));
        found = true;
    }
    if (f)
        fclose(f);
    f = fopen(folder_at(to), "wb");
    found = f && fwrite(b, 1, n, f) == n && found;
    return f && fclose(f) == 0 && found;
}

static void test_photographs(void)
{
    static const char *const ending[] = {"jpg", "png", "tif", "webp"};

    if (!media_have("convert exiftool"))
        return;
    for (size_t i = 0; i < sizeof ending / sizeof *ending; i++)
        for (int o = 1; o <= 8; o++)
            photograph_held(ending[i], o);
}

static void test_matrices(void)
{
    char what[64];

    for (int o = 1; o <= 8; o++) {
        snprintf(what, sizeof what, "display matrix %d", o);
        if (!clip_set_matrix("base.mp4", "m.mp4", o) ||
            !media_run("convert frame.ppm %s -depth 8 want.ppm",
                       held[o].way))
            check_that(what, false);
        else
            media_check(what, media_frame("m.mp4", 0),
                        media_picture("want.ppm"), 0);
    }
    check_that("orientation in H.264's own messages",
               media_run("ffmpeg -v error -y -i base.mp4 -c copy -bsf:v "
                         "h264_metadata=display_orientation=insert:rotate=90:"
                         "flip=horizontal m.mp4 && convert frame.ppm "
                         "-transpose want.ppm"));
    media_check("is followed", media_frame("m.mp4", 0),
                media_picture("want.ppm"), 0);
}

/* A clip or picture whose pixels are k times as wide as high, or high as
 * wide. */
static void square_size(const char *name, size_t width, size_t height)
{
    struct image im = media_frame(name, 0);

    printf("%s: %zu x %zu, ", name, im.width, im.height);
    check_that("square pixels", im.width == width && im.height == height);
    image_release(&im);
}

static void test_aspects(void)
{
    check_that("pixels that are not square",
               media_run("for s in 2/1 1/2; do n=$(echo $s | tr -d /); "
                         "ffmpeg -v error -y -i base.mp4 -vf setsar=$s -c:v "
                         "libx264 a$n.mp4 && ffmpeg -v error -y -i base.png "
                         "-vf setsar=$s -frames:v 1 a$n.jpg && ffmpeg -v error "
                         "-y -i base.png -vf setsar=$s -frames:v 1 a$n.png && "
                         "ffmpeg -v error -y -i base.mp4 -vf setsar=$s "
                         "-strict -1 -f yuv4mpegpipe a$n.y4m || exit; done"));
    square_size("a21.mp4", 80, 56);
    square_size("a12.mp4", 40, 112);
    square_size("a21.jpg", 80, 56);
    square_size("a12.jpg", 40, 112);
    square_size("a21.png", 80, 56);
    square_size("a12.png", 40, 112);
    square_size("a21.y4m", 80, 56);
    square_size("a12.y4m", 40, 112);
    check_that("and turned", clip_set_matrix("a21.mp4", "m.mp4", 6));
    square_size("m.mp4", 56, 80);
}

/* The first frame of a clip as a picture of this name. */
static void clip_show(const char *clip, const char *name)
{
    struct image im = media_frame(clip, 0);
    FILE *out = fopen(folder_at(name), "wb");

    if (im.rgb && out) {
        fprintf(out, "P6 %zu %zu 255\n", im.width, im.height);
        fwrite(im.rgb, 3, im.width * im.height, out);
    }
    if (out)
        fclose(out);
    image_release(&im);
}

/* A crop rectangle in the stream is followed to the pixel; each has chroma of
 * its own, which halved would lean on what is cut off. */
static void test_crop(void)
{
    check_that("a clip in 4:4:4",
               media_run("ffmpeg -v error -y -i base.mp4 -pix_fmt yuv444p -c:v "
                         "libx264 -qp 8 444.mp4"));
    clip_show("444.mp4", "444.ppm");
    check_that("a crop rectangle",
               media_run("ffmpeg -v error -y -i 444.mp4 -c copy -bsf:v "
                         "h264_metadata=crop_left=6:crop_right=10:crop_top=4:"
                         "crop_bottom=10 c.mp4 && convert 444.ppm "
                         "-crop 32x50+6+4 +repage want.ppm"));
    media_check("is cut to the pixel", media_frame("c.mp4", 0),
                media_picture("want.ppm"), 0);
}

/* So is one of the container: the clean aperture of MP4, PixelCrop of
 * Matroska (in place of a size to show it at). */
static void test_container_crop(void)
{
    static const char script[] =
        "import struct\n"
        "d = open('base.mp4', 'rb').read()\n"
        "at = d.find(b'avc1', d.find(b'stsd'))\n"
        "box = struct.pack('>I4s4I4i', 40, b'clap', 24, 1, 40, 1, -2, 1, 3, 1)\n"
        "end = at - 4 + struct.unpack('>I', d[at - 4:at])[0]\n"
        "d = bytearray(d[:end] + box + d[end:])\n"
        "for name in (b'moov', b'trak', b'mdia', b'minf', b'stbl', b'stsd', "
        "b'avc1'):\n"
        "    i = d.find(name) - 4\n"
        "    d[i:i + 4] = struct.pack('>I', struct.unpack('>I', d[i:i + 4])[0] "
        "+ 40)\n"
        "open('clap.mp4', 'wb').write(d)\n"
        "d = bytearray(open('sar.mkv', 'rb').read())\n"
        "i, k = d.find(b'\\x54\\xb0\\x81'), d.find(b'\\x54\\xba\\x81')\n"
        "assert i > 0 and k > 0\n"
        "d[i + 1], d[i + 3] = 0xcc, 7\n"
        "d[k + 1], d[k + 3] = 0xaa, 12\n"
        "open('crop.mkv', 'wb').write(d)\n";
    FILE *f = fopen(folder_at("crop.py"), "w");

    check_that("a script", f && fputs(script, f) >= 0 && fclose(f) == 0);
    check_that("a clean aperture and PixelCrop",
               media_run("ffmpeg -v error -y -i base.mp4 -c copy -aspect 2:1 "
                         "sar.mkv && python3 crop.py && convert frame.ppm "
                         "-crop 24x40+6+11 +repage c.ppm && convert frame.ppm "
                         "-crop 33x44+7+0 +repage k.ppm"));
    media_check("MP4", media_frame("clap.mp4", 0), media_picture("c.ppm"), 0);
    square_size("crop.mkv", 33, 44);
    media_check("Matroska", media_frame("crop.mkv", 0), media_picture("k.ppm"),
                0);
}

/* Fields are woven as ffmpeg's bwdif does; whole frames stay as they are. */
static void test_fields(void)
{
    check_that("a clip of fields",
               media_run("ffmpeg -v error -y -f lavfi -i testsrc2=s=64x48:r=50:"
                         "d=0.4 -vf interlace=lowpass=0 -c:v libx264 -flags "
                         "+ildct+ilme -x264opts tff=1 -qp 8 i.mp4 && ffmpeg -v "
                         "error -y -i i.mp4 -vf bwdif=send_frame,zscale=min=470bg:"
                         "m=gbr:rin=tv:r=pc:cin=left:f=bilinear,format=gbrp "
                         "-frames:v 5 -update 1 -f image2 want.ppm"));
    media_check("is woven", media_frame("i.mp4", 4),
                media_picture("want.ppm"), 2);
    check_that("and complete",
               media_run("ffprobe -v error -count_frames -show_entries "
                         "stream=nb_read_frames -of csv=p=0 i.mp4 | grep -q "
                         "^10"));
    struct image last = media_frame("i.mp4", 9);
    check_that("to the last frame", last.rgb != NULL);
    image_release(&last);
}

/* A broadcast of fields whose size changes: each part is woven for itself, and
 * none of its frames is lost at the change. */
static void test_fields_change(void)
{
    check_that("fields of two sizes",
               media_run("for s in 64x48 128x96; do ffmpeg -v error -y -f lavfi "
                         "-i testsrc2=s=$s:r=50:d=0.4 -vf interlace=lowpass=0 "
                         "-c:v mpeg2video -flags +ildct+ilme -q 2 -f mpeg2video "
                         "$s.m2v || exit; done; cat 64x48.m2v 128x96.m2v "
                         ">change.m2v"));
    media_check("before the change", media_frame("change.m2v", 7),
                media_frame("64x48.m2v", 7), 0);
    media_check("after it", media_frame("change.m2v", 10),
                media_frame("128x96.m2v", 1), 0);
    media_check("at the end", media_frame("change.m2v", 18),
                media_frame("128x96.m2v", 9), 0);
}

int main(void)
{
    folder_make();
    if (!media_have("ffmpeg convert") ||
        !media_run("convert -seed 3 -size 40x56 plasma:fractal -depth 8 "
                   "base.png && ffmpeg -v error -y -loop 1 -i base.png -vf "
                   "format=yuv420p,setsar=1 -frames:v 3 -c:v libx264 -qp 8 "
                   "base.mp4")) {
        folder_remove();
        return 77;
    }
    clip_show("base.mp4", "frame.ppm");
    test_photographs();
    test_matrices();
    test_aspects();
    test_crop();
    test_container_crop();
    test_fields();
    test_fields_change();
    return folder_remove() || check_status();
}
