/* Pictures by OpenImageIO, turned upright and brought to 8 bits of sRGB. */
extern "C" {
#include "formats/module.h"
#include "formats/media/exr.h"
#include "formats/orient.h"
}

#include <sysexits.h>

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

/* ---- what the file holds, checked before its pixels are read ---------- */

/* TIFF's PhotometricInterpretation of pictures for printing. */
#define TIFF_INKS 5

/* Whatever name the format gives it. */
static bool image_is_cmyk(const OIIO::ImageSpec &spec)
{
    std::string space = spec.get_string_attribute("tiff:ColorSpace");

    for (const char *key : {"oiio:ColorSpace", "psd:ColorMode"})
        space += spec.get_string_attribute(key);
    if (space.find("CMYK") != std::string::npos)
        return true;
    if (spec.get_int_attribute("tiff:PhotometricInterpretation") == TIFF_INKS)
        return true;
    return spec.nchannels >= 4 && (spec.channelnames[0] == "C"
                                   || spec.channelnames[0] == "Cyan");
}

/* Size and channels, before anything is allocated. */
static int image_check_spec(const OIIO::ImageSpec &spec, const char *name,
                            struct error *err)
{
    const int w = spec.width, h = spec.height;

    if (w < 1 || h < 1)
        return error_set(err, EX_DATAERR, "%s: picture of %d x %d pixels has "
                         "no content", name, w, h);
    if (w > IMAGE_MAX_SIDE || h > IMAGE_MAX_SIDE
        || (size_t)w * (size_t)h > IMAGE_MAX_PIXELS || spec.depth > 1)
        return error_set(err, EX_DATAERR, "%s: picture of %d x %d pixels is "
                         "too large (at most %d a side and %zu in all)",
                         name, w, h, IMAGE_MAX_SIDE, IMAGE_MAX_PIXELS);
    if (image_is_cmyk(spec))
        return error_set(err, EX_DATAERR, "%s: CMYK picture (expected grey "
                         "or RGB; convert it with its colour profile first)",
                         name);
    if (spec.nchannels < 1 || spec.nchannels > 64)
        return error_set(err, EX_DATAERR, "%s: %d channels (expected grey or "
                         "RGB, with or without alpha)", name,
                         spec.nchannels);
    return 0;
}

/* ---- pixels ----------------------------------------------------------- */

/* Linear to a byte of sRGB; what is not a number becomes 0. */
static uint8_t image_encode_srgb(float v)
{
    if (!(v > 0))
        return 0;
    if (v >= 1)
        return 255;
    v = v <= 0.0031308f ? 12.92f * v
                        : 1.055f * std::pow(v, 1 / 2.4f) - 0.055f;
    return (uint8_t)(v * 255 + 0.5f);
}

/* All channels as 8 bits, [h,w,nchannels]. */
static int image_read_levels(std::vector<uint8_t> &out, OIIO::ImageInput &in,
                             const char *name, struct error *err)
{
    const OIIO::ImageSpec &spec = in.spec();
    const size_t n = (size_t)spec.width * (size_t)spec.height
                     * (size_t)spec.nchannels;
    const bool linear = spec.format.is_floating_point()
        && spec.get_string_attribute("spid:encoding") != "sRGB"
        && spec.get_string_attribute("oiio:ColorSpace", "Linear") == "Linear";

    out.resize(n);
    if (!linear) {
        if (in.read_image(0, 0, 0, -1, OIIO::TypeDesc::UINT8, out.data()))
            return 0;
    } else {
        std::vector<float> f(n);
        if (in.read_image(0, 0, 0, -1, OIIO::TypeDesc::FLOAT, f.data())) {
            for (size_t i = 0; i < n; i++) {
                bool a = (int)(i % (size_t)spec.nchannels)
                         == spec.alpha_channel;
                float v = f[i] > 0 ? f[i] < 1 ? f[i] : 1 : 0;
                out[i] = a ? (uint8_t)(v * 255 + 0.5f)
                           : image_encode_srgb(f[i]);
            }
            return 0;
        }
    }
    return error_set(err, EX_DATAERR, "%s: damaged picture: %s", name,
                     in.geterror().c_str());
}

/* im from the stored pixels [h,w,channels]. */
static int image_fill(struct image *im, const std::vector<uint8_t> &pix,
                      const OIIO::ImageSpec &spec, struct error *err)
{
    const size_t W = (size_t)spec.width, H = (size_t)spec.height;
    const size_t C = (size_t)spec.nchannels;
    const enum orientation o =
        orient_read((unsigned)spec.get_int_attribute("Orientation", 1));
    size_t ac = spec.alpha_channel >= 0 ? (size_t)spec.alpha_channel : C;
    bool grey = C < 3, opaque = true;

    if (ac == C && (C == 2 || C == 4))
        ac = C - 1;
    im->width = orient_swaps(o) ? H : W;
    im->height = orient_swaps(o) ? W : H;
    im->rgb = (uint8_t *)malloc(3 * W * H);
    im->alpha = ac < C ? (uint8_t *)malloc(W * H) : nullptr;
    if (!im->rgb || (ac < C && !im->alpha))
        return error_set(err, EX_OSERR, "out of memory");
    for (size_t y = 0; y < H; y++)
        for (size_t x = 0; x < W; x++) {
            const uint8_t *p = pix.data() + (y * W + x) * C;
            size_t to = orient_pixel(x, y, W, H, o);
            for (size_t k = 0; k < 3; k++)
                im->rgb[3 * to + k] = p[grey ? 0 : k];
            if (im->alpha) {
                im->alpha[to] = p[ac];
                opaque = opaque && p[ac] == 255;
            }
        }
    if (im->alpha && opaque) {
        free(im->alpha);
        im->alpha = nullptr;
    }
    return 0;
}

/* How OpenImageIO is asked to read: colours not premultiplied, not turned. */
static OIIO::ImageSpec image_straight_alpha()
{
    OIIO::ImageSpec config;
    config.attribute("oiio:UnassociatedAlpha", 1);
    config.attribute("oiio:reorient", 0);
    return config;
}

/* By the file's own reader. */
static int image_read_any(struct image *im, const char *path,
                          OIIO::Filesystem::IOProxy &io, struct error *err)
{
    OIIO::ImageSpec config = image_straight_alpha();
    std::vector<uint8_t> pix;
    auto in = OIIO::ImageInput::open(path, &config, &io);

    if (!in) {
        /* formats without proxies, from the file itself */
        (void)OIIO::geterror();
        in = OIIO::ImageInput::open(path, &config);
    }
    if (!in) {
        (void)OIIO::geterror();
        return error_set(err, EX_DATAERR, "%s: not a picture that can be "
                         "read", path);
    }
    if (image_check_spec(in->spec(), path, err) != 0
        || image_read_levels(pix, *in, path, err) != 0)
        return -1;
    return image_fill(im, pix, in->spec(), err);
}

/* Everything but PNG and JPEG, which formats/image.c has read. */
int image_read(struct image *im, const char *path, struct error *err)
{
    try {
        OIIO::Filesystem::IOFile io(path,
                                    OIIO::Filesystem::IOProxy::Mode::Read);
        if (io.size() == 0)
            return error_set(err, EX_DATAERR, "%s: empty file (expected a "
                             "picture)", path);
        if (image_read_any(im, path, io, err) == 0)
            return 0;
    } catch (const std::exception &e) {
        error_set(err, EX_DATAERR, "%s: %s", path, e.what());
    }
    free(im->rgb);
    free(im->alpha);
    *im = image();
    return -1;
}

/* ---- EXR -------------------------------------------------------------- */

int media_exr_write(const char *path, const float *pixel, size_t width,
                    size_t height, int channels, const char *const *names,
                    const char *mark, struct error *err)
{
    try {
        OIIO::ImageSpec spec((int)width, (int)height, channels,
                             OIIO::TypeDesc::FLOAT);
        spec.channelnames.assign(names, names + channels);
        spec.attribute("compression", "zip");
        spec.attribute("spid:encoding", "sRGB");
        if (mark)
            spec.attribute("ImageDescription", mark);
        auto out = OIIO::ImageOutput::create("exr");
        if (!out || !out->open(path, spec))
            return error_set(err, EX_CANTCREAT, "%s: cannot create: %s", path,
                             out ? out->geterror().c_str() : "no EXR writer");
        if (!out->write_image(OIIO::TypeDesc::FLOAT, pixel) || !out->close())
            return error_set(err, EX_IOERR, "%s: cannot write: %s", path,
                             out->geterror().c_str());
        return 0;
    } catch (const std::exception &e) {
        return error_set(err, EX_IOERR, "%s: %s", path, e.what());
    }
}
