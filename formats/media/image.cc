/* Pictures by OpenImageIO: what no reader of its own takes. */
extern "C" {
#include "formats/media/still.h"
}

#include <sysexits.h>

#include <cmath>
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
    if (spec.depth > 1 || spec.width < 0 || spec.height < 0)
        return error_set(err, EX_DATAERR, "%s: a volume (expected a picture)",
                         name);
    if (spec.nchannels < 1 || spec.nchannels > 64)
        return error_set(err, EX_DATAERR, "%s: %d channels (expected grey or "
                         "RGB, with or without alpha)", name,
                         spec.nchannels);
    return door_check_size((size_t)spec.width, (size_t)spec.height, name, err);
}

/* What it says of its pixels, and how many channels of them are read. */
static struct door_tag image_tag(const OIIO::ImageSpec &spec, bool cmyk)
{
    const OIIO::ParamValue *icc = spec.find_attribute("ICCProfile");
    struct door_tag t = {};
    const int colours = cmyk ? 4 : spec.nchannels < 3 ? 1 : 3;

    t.orientation =
        orient_read((unsigned)spec.get_int_attribute("Orientation", 1));
    t.aspect = (double)spec.get_float_attribute("PixelAspectRatio", 1);
    t.pixels.channels = colours;
    t.alpha = spec.alpha_channel == colours ||
              (spec.alpha_channel < 0 && spec.nchannels == colours + 1);
    t.pixels.extra = t.alpha;
    t.pixels.bits = spec.format.size() == 1 ? 8 : 16;
    t.pixels.inverted = cmyk && spec.find_attribute("psd:ColorMode");
    if (icc && icc->type().basetype == OIIO::TypeDesc::UINT8) {
        t.colour.icc = (const uint8_t *)icc->data();
        t.colour.icc_bytes = icc->type().size();
    }
    return t;
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

/* A picture of light: as bytes of sRGB, alpha as it is. */
static bool image_read_linear(std::vector<uint8_t> &out, OIIO::ImageInput &in,
                              const struct door_tag &t)
{
    const size_t C = (size_t)(t.pixels.channels + t.pixels.extra);
    std::vector<float> f(out.size());

    if (!in.read_image(0, 0, 0, (int)C, OIIO::TypeDesc::FLOAT, f.data()))
        return false;
    for (size_t i = 0; i < f.size(); i++) {
        const bool a = t.alpha && i % C == C - 1;
        const float v = f[i] > 0 ? f[i] < 1 ? f[i] : 1 : 0;

        out[i] = a ? (uint8_t)(v * 255 + 0.5f) : image_encode_srgb(f[i]);
    }
    return true;
}

/* The channels that t names, of its bits. */
static int image_read_pixels(std::vector<uint8_t> &out, OIIO::ImageInput &in,
                             struct door_tag *t, const char *name,
                             struct error *err)
{
    const OIIO::ImageSpec &spec = in.spec();
    const int C = t->pixels.channels + t->pixels.extra;
    const size_t n = (size_t)spec.width * (size_t)spec.height * (size_t)C;
    const bool linear = spec.format.is_floating_point()
        && spec.get_string_attribute("spid:encoding") != "sRGB"
        && spec.get_string_attribute("oiio:ColorSpace", "Linear") == "Linear"
        && !t->colour.icc;

    if (linear)
        t->pixels.bits = 8;
    out.resize(n * (size_t)t->pixels.bits / 8);
    if (linear ? image_read_linear(out, in, *t)
               : in.read_image(0, 0, 0, C,
                               t->pixels.bits == 8 ? OIIO::TypeDesc::UINT8
                                                   : OIIO::TypeDesc::UINT16,
                               out.data()))
        return 0;
    return error_set(err, EX_DATAERR, "%s: damaged picture: %s", name,
                     in.geterror().c_str());
}

/* A reader of the file, asked not to premultiply colours, nor to make RGB of
 * inks. */
static std::unique_ptr<OIIO::ImageInput>
image_open(const char *path, OIIO::Filesystem::IOProxy &io, bool inks)
{
    OIIO::ImageSpec config;

    config.attribute("oiio:UnassociatedAlpha", 1);
    config.attribute("oiio:RawColor", inks ? 1 : 0);
    auto in = OIIO::ImageInput::open(path, &config, &io);
    if (!in) {
        /* formats without proxies, from the file itself */
        (void)OIIO::geterror();
        in = OIIO::ImageInput::open(path, &config);
    }
    return in;
}

/* By the file's own reader. */
static int image_read_any(struct image *im, const char *path,
                          OIIO::Filesystem::IOProxy &io, struct error *err)
{
    std::vector<uint8_t> pix;
    auto in = image_open(path, io, false);
    struct door door = {};
    int rc;

    if (!in) {
        (void)OIIO::geterror();
        return error_set(err, EX_DATAERR, "%s: not a picture that can be "
                         "read", path);
    }
    /* OpenImageIO 2.4 writes past its frame where the decoder's rows are
     * padded */
    if (std::string(in->format_name()) == "FFmpeg movie")
        return error_set(err, EX_DATAERR, "%s: a video (expected a picture, "
                         "such as one of its frames)", path);
    const bool cmyk = image_is_cmyk(in->spec());
    if (cmyk) {
        in.reset();
        in = image_open(path, io, true);
    }
    if (!in || (cmyk && in->spec().nchannels < 4))
        return error_set(err, EX_DATAERR, "%s: CMYK picture that cannot be "
                         "read", path);
    if (image_check_spec(in->spec(), path, err))
        return -1;
    const size_t W = (size_t)in->spec().width, H = (size_t)in->spec().height;
    struct door_tag tag = image_tag(in->spec(), cmyk);

    if (image_read_pixels(pix, *in, &tag, path, err))
        return -1;
    rc = door_picture(&door, im, W, H, &tag, pix.data(), pix.size() / H, path,
                      err);
    door_release(&door);
    return rc;
}

/* Everything but PNG and JPEG, which formats/image.c has read. */
int media_image_read(struct image *im, const char *path, struct error *err)
{
    int rc = still_read(im, path, err);

    try {
        if (rc > 0) {
            OIIO::Filesystem::IOFile io(
                path, OIIO::Filesystem::IOProxy::Mode::Read);
            rc = image_read_any(im, path, io, err);
        }
    } catch (const std::exception &e) {
        rc = error_set(err, EX_DATAERR, "%s: %s", path, e.what());
    }
    if (rc == 0)
        return 0;
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
