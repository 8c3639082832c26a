/* Frames of videos to RGB, by what the file says of their colours. */
#include <libavutil/frame.h>
#include <libswscale/swscale.h>

#include "formats/video/table.h"

/* swscale's name of the matrix that the frame says, or that players take. */
static int colours_matrix(const AVFrame *f, bool bt601)
{
    const enum AVColorSpace says = f->colorspace;

    if (bt601)
        return SWS_CS_ITU601;
    if (says == AVCOL_SPC_BT709)
        return SWS_CS_ITU709;
    if (says == AVCOL_SPC_BT2020_NCL || says == AVCOL_SPC_BT2020_CL)
        return SWS_CS_BT2020;
    if (says == AVCOL_SPC_SMPTE240M)
        return SWS_CS_SMPTE240M;
    return (says == AVCOL_SPC_UNSPECIFIED || says == AVCOL_SPC_RGB) &&
                   video_is_hd(f->width, f->height)
               ? SWS_CS_ITU709 : SWS_CS_ITU601;
}

/* Whether the frame is planes as Y4M has them, and which.  Chroma whose place
 * nothing says lies left, as H.264's does. */
static bool colours_planes(struct y4m *y, const AVFrame *f, int matrix)
{
    static const double site[AVCHROMA_LOC_NB][2] = {
        {0, 0.5}, [AVCHROMA_LOC_LEFT] = {0, 0.5},
        [AVCHROMA_LOC_CENTER] = {0.5, 0.5}, [AVCHROMA_LOC_TOP] = {0.5, 0},
        [AVCHROMA_LOC_BOTTOMLEFT] = {0, 1}, [AVCHROMA_LOC_BOTTOM] = {0.5, 1}
    };
    const unsigned where = (unsigned)f->chroma_location;
    const double *at = site[where < AVCHROMA_LOC_NB ? where : 0];

    *y = (struct y4m){
        .width = (size_t)f->width, .height = (size_t)f->height,
        .site_x = at[0], .site_y = at[1],
        .full = f->color_range == AVCOL_RANGE_JPEG,
        .bt601 = matrix == SWS_CS_ITU601
    };
    switch (f->format) {
    case AV_PIX_FMT_YUV420P: case AV_PIX_FMT_YUVJ420P:
        y->chroma = Y4M_420;
        break;
    case AV_PIX_FMT_YUV422P: case AV_PIX_FMT_YUVJ422P:
        y->chroma = Y4M_422;
        break;
    case AV_PIX_FMT_YUV444P: case AV_PIX_FMT_YUVJ444P:
        y->chroma = Y4M_444;
        break;
    default:
        return false;
    }
    return matrix == SWS_CS_ITU601 || matrix == SWS_CS_ITU709;
}

const char *video_to_rgb(uint8_t *rgb, size_t stride, int bits,
                         const AVFrame *f, struct video_colours *c)
{
    const uint8_t *const *planes = (const uint8_t *const *)f->data;
    const int matrix = colours_matrix(f, c->bt601);
    uint8_t *to[4] = {rgb};
    const int line[4] = {(int)stride};
    struct y4m y;

    if (colours_planes(&y, f, matrix) && bits == 8) {
        c->to_rgb(rgb, stride, planes, f->linesize, &y);
        return NULL;
    }
    c->swscale = sws_getCachedContext(c->swscale, f->width, f->height,
                                      (enum AVPixelFormat)f->format, f->width,
                                      f->height,
                                      bits == 8 ? AV_PIX_FMT_RGB24
                                                : AV_PIX_FMT_RGB48,
                                      SWS_BICUBIC, NULL, NULL, NULL);
    if (!c->swscale)
        return "pixels of an unknown kind";
    const int *weights = sws_getCoefficients(matrix);

    sws_setColorspaceDetails(c->swscale, weights, y.full, weights, 1, 0,
                             1 << 16, 1 << 16);
    return sws_scale(c->swscale, planes, f->linesize, 0, f->height, to,
                     line) == f->height ? NULL : "cannot be turned into RGB";
}

void video_colours_release(struct video_colours *c)
{
    sws_freeContext(c->swscale);
    c->swscale = NULL;
}
