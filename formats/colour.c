/* Colours to sRGB (colour.h): every tag becomes one transform of
 * littlecms2. */
#include "formats/colour.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <lcms2.h>

/* Code points of ITU-T H.273. */
enum { PRIMARIES_BT2020 = 9, PRIMARIES_DCI = 11, PRIMARIES_P3 = 12 };
enum { TRANSFER_LINEAR = 8, TRANSFER_PQ = 16, TRANSFER_HLG = 18 };

#define CHUNK 256               /* pixels that are spread at a time */
#define GRID 65                 /* nodes a side of what has no profile */

struct colour {
    cmsHTRANSFORM transform;
    bool spread;                /* grey pixels with a profile of RGB */
};

/* ---- profiles ------------------------------------------------------------ */

/* What H.273 says of a set of primaries; sRGB's for all that a display's
 * differ little from. */
static void colour_chroma(double chroma[8], int primaries)
{
    static const double srgb[8] = {.3127, .3290, .64, .33, .30, .60, .15, .06};
    static const double p3[8] = {.3127, .3290, .680, .320, .265, .690,
                                 .150, .060};
    static const double bt2020[8] = {.3127, .3290, .708, .292, .170, .797,
                                     .131, .046};

    memcpy(chroma, primaries == PRIMARIES_BT2020 ? bt2020
                   : primaries == PRIMARIES_P3 || primaries == PRIMARIES_DCI
                       ? p3 : srgb, 8 * sizeof *chroma);
    if (primaries == PRIMARIES_DCI) {           /* the white of a cinema */
        chroma[0] = .314;
        chroma[1] = .351;
    }
}

/* A profile of RGB with white and primaries as in colour_tag; gamma 0: the
 * curve of sRGB. */
static cmsHPROFILE colour_rgb_profile(const double c[8], double gamma)
{
    static const cmsFloat64Number srgb[5] = {2.4, 1 / 1.055, .055 / 1.055,
                                             1 / 12.92, .04045};
    const cmsCIExyY white = {c[0], c[1], 1};
    const cmsCIExyYTRIPLE p = {
        {c[2], c[3], 1}, {c[4], c[5], 1}, {c[6], c[7], 1}
    };
    cmsToneCurve *curve = gamma > 0 ? cmsBuildGamma(NULL, gamma)
                                    : cmsBuildParametricToneCurve(NULL, 4,
                                                                  srgb);
    cmsToneCurve *const three[3] = {curve, curve, curve};
    cmsHPROFILE profile = curve ? cmsCreateRGBProfile(&white, &p, three)
                                : NULL;

    cmsFreeToneCurve(curve);
    return profile;
}

/* ---- high dynamic range -------------------------------------------------- */

/* SMPTE ST 2084: light, 1 is 10,000 cd/m2, of a signal, and back. */
#define PQ_M1 (2610.0 / 16384)
#define PQ_M2 (2523.0 / 4096 * 128)
#define PQ_C1 (3424.0 / 4096)
#define PQ_C2 (2413.0 / 4096 * 32)
#define PQ_C3 (2392.0 / 4096 * 32)

static double pq_light(double v)
{
    const double p = pow(fmax(v, 0), 1 / PQ_M2);

    return pow(fmax(p - PQ_C1, 0) / (PQ_C2 - PQ_C3 * p), 1 / PQ_M1);
}

static double pq_signal(double light)
{
    const double p = pow(fmax(light, 0), PQ_M1);

    return pow((PQ_C1 + PQ_C2 * p) / (1 + PQ_C3 * p), PQ_M2);
}

/* ITU-R BT.2100: scene light 0..1 of a signal of HLG. */
static double hlg_light(double v)
{
    const double a = 0.17883277, b = 1 - 4 * a, c = 0.5 - a * log(4 * a);

    return v <= 0.5 ? v * v / 3 : (exp((v - c) / a) + b) / 12;
}

#define WHITE 203.0             /* cd/m2 of diffuse white, BT.2408 */
#define HLG_PEAK 1000.0         /* cd/m2 of the display that HLG is made for */

struct colour_hdr {
    bool hlg;
    double peak;                /* cd/m2 */
    cmsHTRANSFORM encode;       /* linear RGB of the primaries to sRGB */
};

/* cd/m2 on the display that the signal is made for. */
static void hdr_light(double out[3], const double v[3], bool hlg)
{
    double luma = 1;

    for (int k = 0; k < 3; k++)
        out[k] = hlg ? hlg_light(v[k]) : 10000 * pq_light(v[k]);
    if (hlg)
        luma = HLG_PEAK * pow(.2627 * out[0] + .6780 * out[1] +
                              .0593 * out[2], 0.2);
    for (int k = 0; k < 3; k++)
        out[k] *= luma;
}

/* The roll-off of BT.2390, section 5.4.1: light up to `peak` cd/m2 into what
 * WHITE is the brightest of; black stays. */
static double hdr_roll(double light, double peak)
{
    const double max = pq_signal(peak / 10000);
    const double top = pq_signal(WHITE / 10000) / max;
    const double knee = 1.5 * top - 0.5;
    const double e = fmin(pq_signal(light / 10000) / max, 1);

    if (e <= knee || knee >= 1)
        return fmin(light, WHITE);
    const double t = (e - knee) / (1 - knee), t2 = t * t, t3 = t2 * t;

    return 10000 * pq_light(max * ((2 * t3 - 3 * t2 + 1) * knee +
                                    (t3 - 2 * t2 + t) * (1 - knee) +
                                    (3 * t2 - 2 * t3) * top));
}

/* A node of the grid: the brightest channel is rolled off, and the others with
 * it, so that hues stay. */
static cmsInt32Number hdr_sample(const cmsUInt16Number in[],
                                 cmsUInt16Number out[], void *cargo)
{
    const struct colour_hdr *h = cargo;
    const double v[3] = {in[0] / 65535.0, in[1] / 65535.0, in[2] / 65535.0};
    double light[3];
    float linear[3], srgb[3];

    hdr_light(light, v, h->hlg);
    const double max = fmax(fmax(light[0], light[1]), light[2]);
    const double scale = max > 0 ? hdr_roll(max, h->peak) / max / WHITE : 0;

    for (int k = 0; k < 3; k++)
        linear[k] = (float)(light[k] * scale);
    cmsDoTransform(h->encode, linear, srgb, 1);
    for (int k = 0; k < 3; k++)
        out[k] = (cmsUInt16Number)(65535 * fmin(fmax((double)srgb[k], 0), 1) +
                                   0.5);
    return TRUE;
}

/* A profile that links such a signal to sRGB. */
static cmsHPROFILE colour_hdr_link(const struct colour_tag *tag)
{
    struct colour_hdr h = {.hlg = tag->transfer == TRANSFER_HLG,
                           .peak = tag->peak > 0 ? tag->peak : HLG_PEAK};
    double chroma[8];
    cmsHPROFILE from, to = cmsCreate_sRGBProfile();
    cmsHPROFILE link = cmsCreateProfilePlaceholder(NULL);
    cmsPipeline *lut = cmsPipelineAlloc(NULL, 3, 3);
    cmsStage *grid = cmsStageAllocCLut16bit(NULL, GRID, 3, 3, NULL);

    h.peak = fmin(fmax(h.peak, WHITE), 10000);
    colour_chroma(chroma, tag->primaries);
    from = colour_rgb_profile(chroma, 1);
    h.encode = from && to ? cmsCreateTransform(from, TYPE_RGB_FLT, to,
                                               TYPE_RGB_FLT,
                                               INTENT_RELATIVE_COLORIMETRIC,
                                               cmsFLAGS_NOCACHE)
                          : NULL;
    bool ok = link && lut && grid && h.encode &&
              cmsStageSampleCLut16bit(grid, hdr_sample, &h, 0) &&
              cmsPipelineInsertStage(lut, cmsAT_BEGIN, grid);
    if (!ok)
        cmsStageFree(grid);
    if (ok) {
        cmsSetProfileVersion(link, 4.3);
        cmsSetDeviceClass(link, cmsSigLinkClass);
        cmsSetColorSpace(link, cmsSigRgbData);
        cmsSetPCS(link, cmsSigRgbData);
        ok = cmsWriteTag(link, cmsSigAToB0Tag, lut);
    }
    cmsPipelineFree(lut);
    if (h.encode)
        cmsDeleteTransform(h.encode);
    cmsCloseProfile(from);
    cmsCloseProfile(to);
    if (ok)
        return link;
    cmsCloseProfile(link);
    return NULL;
}

/* ---- transforms ---------------------------------------------------------- */

/* The profile that a tag says or means; NULL: sRGB, or none that can be. */
static cmsHPROFILE colour_profile(const struct colour_tag *t)
{
    const bool chroma = t->chroma[1] > 0;
    double c[8];

    if (t->icc)
        return cmsOpenProfileFromMem(t->icc, (cmsUInt32Number)t->icc_bytes);
    if (t->transfer == TRANSFER_PQ || t->transfer == TRANSFER_HLG)
        return colour_hdr_link(t);
    colour_chroma(c, t->primaries);
    if (t->gamma > 0 || t->transfer == TRANSFER_LINEAR)
        return colour_rgb_profile(chroma ? t->chroma : c,
                                  t->gamma > 0 ? t->gamma : 1);
    return t->primaries ? colour_rgb_profile(c, 0) : NULL;
}

/* littlecms's name of the pixels, or 0 where the profile is of others. */
static cmsUInt32Number colour_format(cmsHPROFILE profile,
                                     const struct colour_pixels *p,
                                     bool *spread)
{
    const cmsColorSpaceSignature space = cmsGetColorSpace(profile);
    const cmsUInt32Number bytes = BYTES_SH(p->bits == 16 ? 2u : 1u);
    const cmsUInt32Number extra = EXTRA_SH((cmsUInt32Number)p->extra);

    *spread = space == cmsSigRgbData && p->channels == 1;
    if (*spread)
        return COLORSPACE_SH(PT_RGB) | CHANNELS_SH(3) | bytes;
    if (space == cmsSigRgbData && p->channels == 3)
        return COLORSPACE_SH(PT_RGB) | CHANNELS_SH(3) | bytes | extra;
    if (space == cmsSigGrayData && p->channels == 1)
        return COLORSPACE_SH(PT_GRAY) | CHANNELS_SH(1) | bytes | extra;
    if (space == cmsSigCmykData && p->channels == 4)
        return COLORSPACE_SH(PT_CMYK) | CHANNELS_SH(4) | bytes | extra |
               FLAVOR_SH(p->inverted);
    return 0;
}

/* Whether no colour becomes another by more than a level: nine levels of each
 * channel, in all combinations. */
static bool colour_is_srgb(const struct colour *c, struct colour_pixels p)
{
    enum { SIDE = 9 };
    const int n = p.channels == 1 ? SIDE : SIDE * SIDE * SIDE;
    uint16_t wide[5] = {0};
    uint8_t row[5] = {0}, rgb[3];

    if (p.channels == 4)
        return false;
    for (int i = 0; i < n; i++) {
        const int at[3] = {i % SIDE, i / SIDE % SIDE, i / SIDE / SIDE};

        for (int k = 0; k < p.channels; k++) {
            row[k] = (uint8_t)(at[k] * 255 / (SIDE - 1));
            wide[k] = (uint16_t)(row[k] * 257);
        }
        colour_row(c, rgb, p.bits == 16 ? (const void *)wide : row, 1, p);
        for (int k = 0; k < 3; k++)
            if (abs(rgb[k] - row[p.channels == 1 ? 0 : k]) > 1)
                return false;
    }
    return true;
}

struct colour *colour_open(const struct colour_tag *tag,
                           struct colour_pixels pixels)
{
    cmsHPROFILE from = colour_profile(tag), to;
    struct colour *c = from ? calloc(1, sizeof *c) : NULL;
    cmsUInt32Number format = c ? colour_format(from, &pixels, &c->spread) : 0;
    const cmsUInt32Number flags = cmsFLAGS_NOCACHE | cmsFLAGS_GRIDPOINTS(GRID);

    if (format && cmsGetDeviceClass(from) == cmsSigLinkClass) {
        cmsHPROFILE one[1] = {from};

        c->transform = cmsCreateMultiprofileTransform(one, 1, format,
                                                      TYPE_RGB_8,
                                                      INTENT_PERCEPTUAL,
                                                      flags);
    } else if (format && (to = cmsCreate_sRGBProfile())) {
        c->transform = cmsCreateTransform(from, format, to, TYPE_RGB_8,
                                          INTENT_PERCEPTUAL, cmsFLAGS_NOCACHE);
        cmsCloseProfile(to);
    }
    cmsCloseProfile(from);
    if (c && c->transform && !colour_is_srgb(c, pixels))
        return c;
    colour_close(c);
    return NULL;
}

void colour_close(struct colour *c)
{
    if (c && c->transform)
        cmsDeleteTransform(c->transform);
    free(c);
}

/* ---- rows ---------------------------------------------------------------- */

/* Grey pixels as RGB of the same bits, then through the transform. */
static void colour_row_spread(const struct colour *c, uint8_t *rgb,
                              const uint8_t *row, size_t n,
                              struct colour_pixels p)
{
    const size_t bytes = p.bits == 16 ? 2 : 1;
    uint8_t three[CHUNK * 6];

    for (size_t from = 0; from < n; from += CHUNK) {
        const size_t m = n - from < CHUNK ? n - from : CHUNK;

        for (size_t i = 0; i < 3 * m; i++)
            memcpy(three + i * bytes,
                   row + (from + i / 3) * (size_t)(1 + p.extra) * bytes,
                   bytes);
        cmsDoTransform(c->transform, three, rgb + 3 * from,
                       (cmsUInt32Number)m);
    }
}

void colour_row(const struct colour *c, uint8_t *rgb, const void *row,
                size_t n, struct colour_pixels p)
{
    const size_t all = (size_t)(p.channels + p.extra);
    const uint8_t *narrow = row;
    const uint16_t *wide = row;

    if (c && c->spread) {
        colour_row_spread(c, rgb, row, n, p);
    } else if (c) {
        cmsDoTransform(c->transform, row, rgb, (cmsUInt32Number)n);
    } else if (p.bits == 8 && all == 3) {
        memcpy(rgb, row, 3 * n);
    } else {
        for (size_t i = 0; i < 3 * n; i++) {
            const size_t at = i / 3 * all + (p.channels == 1 ? 0 : i % 3);

            rgb[i] = p.bits == 8 ? narrow[at]
                                 : (uint8_t)((wide[at] * 255u + 32767) / 65535);
        }
    }
}
