/* Environment maps through OpenImageIO. */
extern "C" {
#include "formats/media/still.h"
}

#include <sysexits.h>

#include <cmath>
#include <cstdlib>
#include <memory>
#include <vector>

#include <OpenImageIO/imageio.h>

/* Twice as wide as high, and colours: checked before memory is asked for. */
static int panorama_check_spec(const OIIO::ImageSpec &spec, const char *path,
                               struct error *err)
{
    if (spec.width != 2 * spec.height || spec.height < 64
        || spec.width > PANORAMA_MAX_SIDE)
        return error_set(err, EX_DATAERR, "%s: picture of %d x %d pixels "
                         "(expected a panorama twice as wide as high, at "
                         "least 128 x 64)", path,
                         spec.width, spec.height);
    if (spec.nchannels < 3)
        return error_set(err, EX_DATAERR, "%s: %d channels (expected RGB)",
                         path, spec.nchannels);
    return 0;
}

/* The pixels of p, checked. */
static int panorama_check_pixels(const struct panorama *p, const char *path,
                                 struct error *err)
{
    size_t n = 3 * p->width * p->height;
    double sum = 0;

    for (size_t i = 0; i < n; i++) {
        if (!(p->rgb[i] >= 0) || !std::isfinite(p->rgb[i]))
            return error_set(err, EX_DATAERR, "%s: pixel %zu,%zu is %g "
                             "(expected light, 0 or more)", path,
                             i / 3 % p->width, i / 3 / p->width,
                             (double)p->rgb[i]);
        sum += (double)p->rgb[i];
    }
    if (!(sum > 0))
        return error_set(err, EX_DATAERR, "%s: black all over (expected "
                         "light)", path);
    return 0;
}

/* All pixels as floats, checked. */
static int panorama_pixels(struct panorama *p, const char *path,
                           struct error *err)
{
    auto in = OIIO::ImageInput::open(path);

    if (!in)
        return error_set(err, EX_NOINPUT, "%s: cannot be opened as a "
                         "panorama (%s)", path,
                         OIIO::geterror().substr(0, 200).c_str());
    const OIIO::ImageSpec spec = in->spec();
    if (panorama_check_spec(spec, path, err))
        return -1;
    size_t n = (size_t)spec.width * (size_t)spec.height;
    p->width = (size_t)spec.width;
    p->height = (size_t)spec.height;
    p->rgb = (float *)malloc(3 * n * sizeof *p->rgb);
    if (!p->rgb)
        return error_set(err, EX_OSERR, "%s: no memory for %zu pixels", path,
                         n);
    if (!in->read_image(0, 0, 0, 3, OIIO::TypeDesc::FLOAT, p->rgb))
        return error_set(err, EX_DATAERR, "%s: cut or damaged (%s)", path,
                         in->geterror().substr(0, 200).c_str());
    return panorama_check_pixels(p, path, err);
}

int media_panorama_read(struct panorama *p, const char *path,
                        struct error *err)
{
    int rc;

    *p = panorama();
    try {
        rc = panorama_pixels(p, path, err);
    } catch (const std::exception &e) {
        rc = error_set(err, EX_DATAERR, "%s: %s", path, e.what());
    }
    if (rc) {
        free(p->rgb);
        *p = panorama();
    }
    return rc;
}
