/* Output to a video device by write(2), one picture in each. */
#include "formats/v4l2.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sysexits.h>
#include <unistd.h>

struct v4l2_sink {
    int fd;
    char *path;
    size_t width, height;
    uint8_t *yuyv;
};

/* Rounded fixed point of 1/65536. */
static uint8_t v4l2_round(int v)
{
    return (uint8_t)((v + 32768) >> 16);
}

/* yuyv [height,width,2] of rgb [height,width,3], BT.601 in limited range, as
 * cameras send it; the colour of two pixels is their mean.  An odd width's
 * last pixel has its own. */
static void v4l2_pack(uint8_t *yuyv, const uint8_t *rgb, size_t width,
                      size_t height)
{
    for (size_t y = 0; y < height; y++)
        for (size_t x = 0; x < width; x++) {
            const uint8_t *p = rgb + 3 * (y * width + x);
            const uint8_t *q = rgb + 3 * (y * width + (x & ~(size_t)1));
            const uint8_t *s = (x | 1) < width ? q + 3 : q;
            int r = q[0] + s[0], g = q[1] + s[1], b = q[2] + s[2];
            uint8_t *out = yuyv + 2 * (y * width + x);

            /* 219 or 224 / 255 of BT.601's, in 65536ths; chroma of a sum of
             * two */
            out[0] = v4l2_round((16 << 16) + 16829 * p[0] + 33039 * p[1] +
                                6416 * p[2]);
            out[1] = x % 2 ? v4l2_round((128 << 16) + 14392 * r - 12051 * g -
                                        2341 * b)
                           : v4l2_round((128 << 16) - 4857 * r - 9535 * g +
                                        14392 * b);
        }
}

/* Ask for pictures of this size; 0 when the device takes them. */
static int v4l2_set(struct v4l2_sink *v, struct error *err)
{
    struct v4l2_format f = {.type = V4L2_BUF_TYPE_VIDEO_OUTPUT};
    struct v4l2_pix_format *p = &f.fmt.pix;

    p->width = (uint32_t)v->width;
    p->height = (uint32_t)v->height;
    p->pixelformat = V4L2_PIX_FMT_YUYV;
    p->field = V4L2_FIELD_NONE;
    p->bytesperline = (uint32_t)(2 * v->width);
    p->sizeimage = (uint32_t)(2 * v->width * v->height);
    p->colorspace = V4L2_COLORSPACE_SRGB;
    if (ioctl(v->fd, VIDIOC_S_FMT, &f) < 0)
        return error_set(err, EX_CANTCREAT, "%s: not a video device to write "
                         "to: %s (expected one of v4l2loopback)", v->path,
                         strerror(errno));
    if (p->width != v->width || p->height != v->height ||
        p->pixelformat != V4L2_PIX_FMT_YUYV)
        return error_set(err, EX_CANTCREAT, "%s: takes pictures of %u x %u "
                         "(expected %zu x %zu, YUYV; another program may "
                         "have set it)", v->path, p->width, p->height,
                         v->width, v->height);
    return 0;
}

struct v4l2_sink *v4l2_open(const char *path, size_t width, size_t height,
                              struct error *err)
{
    struct v4l2_sink *v = calloc(1, sizeof *v);

    if (v) {
        v->fd = -1;
        v->width = width;
        v->height = height;
        v->path = strdup(path);
        v->yuyv = malloc(2 * width * height);
    }
    if (!v || !v->path || !v->yuyv)
        error_set(err, EX_OSERR, "%s: no memory", path);
    else if ((v->fd = open(path, O_WRONLY | O_CLOEXEC)) < 0)
        error_set(err, EX_CANTCREAT, "%s: %s", path, strerror(errno));
    else if (v4l2_set(v, err) == 0)
        return v;
    v4l2_close(v);
    return NULL;
}

int v4l2_write(struct v4l2_sink *v, const uint8_t *rgb, struct error *err)
{
    size_t bytes = 2 * v->width * v->height;

    v4l2_pack(v->yuyv, rgb, v->width, v->height);
    if (write(v->fd, v->yuyv, bytes) == (ssize_t)bytes)
        return 0;
    return error_set(err, EX_IOERR, "%s: cannot write a picture: %s", v->path,
                     strerror(errno));
}

void v4l2_close(struct v4l2_sink *v)
{
    if (!v)
        return;
    if (v->fd >= 0)
        close(v->fd);
    free(v->path);
    free(v->yuyv);
    free(v);
}
