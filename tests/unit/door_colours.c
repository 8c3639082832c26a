/* Colours at the door: pictures with a profile come out as littlecms's own
 * tools make them sRGB, within 1.5 levels, whatever file holds them; clips by
 * the primaries, the range and the curve that they say. */
#include <lcms2.h>

#include "tests/unit/media.h"

#define LIMIT 1.5

/* ---- profiles ------------------------------------------------------------ */

static void profile_save(cmsHPROFILE profile, const char *name)
{
    REQUIRE(profile && cmsSaveProfileToFile(profile, folder_at(name)),
            "no profile %s", name);
    cmsCloseProfile(profile);
}

/* x, y of white, red, green and blue, and an exponent. */
static void profile_rgb(const char *name, const double c[8], double gamma)
{
    const cmsCIExyY white = {c[0], c[1], 1};
    const cmsCIExyYTRIPLE p = {
        {c[2], c[3], 1}, {c[4], c[5], 1}, {c[6], c[7], 1}
    };
    cmsToneCurve *curve = cmsBuildGamma(NULL, gamma);
    cmsToneCurve *const three[3] = {curve, curve, curve};

    profile_save(cmsCreateRGBProfile(&white, &p, three), name);
    cmsFreeToneCurve(curve);
}

static void profile_grey(const char *name, double gamma)
{
    cmsToneCurve *curve = cmsBuildGamma(NULL, gamma);

    profile_save(cmsCreateGrayProfile(cmsD50_xyY(), curve), name);
    cmsFreeToneCurve(curve);
}

/* What a press might print: inks as coloured filters, black over them. */
static cmsInt32Number ink_sample(const cmsUInt16Number in[],
                                 cmsUInt16Number out[], void *cargo)
{
    static const double hue[3][2] = {{-36, -48}, {74, -4}, {-5, 92}};
    double a = 0, b = 0, light = 95;
    cmsCIELab lab;

    (void)cargo;
    for (int k = 0; k < 3; k++) {
        const double ink = in[k] / 65535.0;

        a += hue[k][0] * ink * 0.8;
        b += hue[k][1] * ink * 0.8;
        light -= (k == 0 ? 38 : k == 1 ? 42 : 8) * ink * 0.8;
    }
    const double black = 1 - in[3] / 65535.0;
    lab.L = fmax(light, 5) * black;
    lab.a = a * black;
    lab.b = b * black;
    cmsFloat2LabEncodedV2(out, &lab);
    return TRUE;
}

static void profile_inks(const char *name)
{
    cmsHPROFILE p = cmsCreateProfilePlaceholder(NULL);
    cmsPipeline *lut = cmsPipelineAlloc(NULL, 4, 3);
    cmsStage *grid = cmsStageAllocCLut16bit(NULL, 9, 4, 3, NULL);
    cmsMLU *text = cmsMLUalloc(NULL, 1);

    REQUIRE(p && lut && grid && text &&
            cmsStageSampleCLut16bit(grid, ink_sample, NULL, 0) &&
            cmsPipelineInsertStage(lut, cmsAT_BEGIN, grid), "no inks");
    cmsSetProfileVersion(p, 2.4);
    cmsSetDeviceClass(p, cmsSigOutputClass);
    cmsSetColorSpace(p, cmsSigCmykData);
    cmsSetPCS(p, cmsSigLabData);
    cmsMLUsetASCII(text, "en", "US", "inks");
    cmsWriteTag(p, cmsSigProfileDescriptionTag, text);
    cmsWriteTag(p, cmsSigMediaWhitePointTag, cmsD50_XYZ());
    cmsWriteTag(p, cmsSigAToB0Tag, lut);
    profile_save(p, name);
    cmsPipelineFree(lut);
    cmsMLUfree(text);
}

static void profiles_make(void)
{
    static const double p3[8] = {.3127, .3290, .68, .32, .265, .69, .15, .06};
    static const double adobe[8] = {.3127, .3290, .64, .33, .21, .71, .15,
                                    .06};
    static const double pro[8] = {.3457, .3585, .7347, .2653, .1596, .8404,
                                  .0366, .0001};

    profile_rgb("p3.icc", p3, 2.2);
    profile_rgb("adobe.icc", adobe, 563 / 256.0);
    profile_rgb("pro.icc", pro, 1.8);
    profile_grey("grey.icc", 1.8);
    profile_inks("inks.icc");
}

/* ---- pictures ------------------------------------------------------------ */

static const struct {
    const char *profile, *make, *tool;  /* tool: littlecms's, of its file */
    const char *name;                   /* that we read */
} pictures[] = {
    {"p3", "convert base.png", "jpgicc", "a.jpg"},
    {"adobe", "convert base.png", "jpgicc", "a.jpg"},
    {"pro", "convert base.png", "jpgicc", "a.jpg"},
    {"grey", "convert base.png -colorspace Gray", "jpgicc", "a.jpg"},
    {"inks", "convert base.png -colorspace CMYK", "jpgicc", "a.jpg"},
    {"p3", "convert base.png", "tificc", "a.tif"},
    {"pro", "convert base.png", "tificc", "a.tif"},
    {"pro", "convert base.png -depth 16 -evaluate multiply 0.97", "tificc",
     "a.tif"},
    {"grey", "convert base.png -colorspace Gray", "tificc", "a.tif"},
    {"inks", "convert base.png -colorspace CMYK", "tificc", "a.tif"},
    {"p3", "convert base.png", "tificc", "a.png"},
    {"pro", "convert base.png -depth 16 -evaluate multiply 0.97", "tificc",
     "a.png"},
    {"grey", "convert base.png -colorspace Gray", "tificc", "a.png"},
    {"adobe", "convert base.png", "tificc", "a.webp"},
    {"p3", "convert base.png", "tificc", "a.heic"},
    {"adobe", "convert base.png", "tificc", "a.avif"},
};

/* The picture of a profile as a file, and as littlecms shows its pixels.  HEIF
 * loses some of them: there they are what its own tool reads. */
static bool picture_make(size_t i)
{
    const char *name = pictures[i].name, *profile = pictures[i].profile;
    const char *end = strrchr(name, '.') + 1;
    const bool jpeg = !strcmp(end, "jpg"), avif = !strcmp(end, "avif");

    if (!media_run("rm -f a.* h.* want.* && %s -sampling-factor 4:4:4 -quality "
                   "100 +profile '*' -profile %s.icc a.%s", pictures[i].make,
                   profile, jpeg ? "jpg" : "tif"))
        return false;
    if ((avif || !strcmp(end, "heic")) &&
        !media_run("convert a.tif h.png && heif-enc -q 95 -p chroma=444 %s "
                   "h.png -o %s && heif-convert %s h.png && convert h.png "
                   "+profile '*' -profile %s.icc a.tif", avif ? "-A" : "",
                   name, name, profile))
        return false;
    if ((!strcmp(end, "png") || !strcmp(end, "webp")) &&
        !media_run("convert a.tif -define webp:lossless=true %s", name))
        return false;
    return jpeg ? media_run("jpgicc -q100 a.jpg want.jpg")
                : media_run("tificc a.tif want.tif");
}

static void test_pictures(void)
{
    char what[96];

    for (size_t i = 0; i < sizeof pictures / sizeof *pictures; i++) {
        const bool jpeg = !strcmp(pictures[i].tool, "jpgicc");
        double mean;

        snprintf(what, sizeof what, "%s in %s by %s", pictures[i].profile,
                 pictures[i].name, pictures[i].tool);
        if (!picture_make(i)) {
            check_that(what, false);
            continue;
        }
        struct image got = media_picture(pictures[i].name);
        struct image want = media_picture(jpeg ? "want.jpg" : "want.tif");
        struct image plain = media_picture("base.png");

        media_apart(&got, &plain, &mean);
        check_range("  the profile changes it, levels in the mean", mean, 1,
                    255);
        check(what, media_apart(&got, &want, &mean), LIMIT);
        check("  in the mean", mean, LIMIT / 2);
        image_release(&got);
        image_release(&want);
        image_release(&plain);
    }
}

/* What says its colours without a profile, and profiles that say nothing. */
static void test_tags(void)
{
    check_that("Adobe RGB by Exif's R03",
               media_run("convert base.png -sampling-factor 4:4:4 -quality 100 "
                         "a.jpg && cp a.jpg r.jpg && exiftool -q -q "
                         "-overwrite_original -InteropIndex=R03 r.jpg && "
                         "convert a.jpg -profile adobe.icc b.jpg && "
                         "exiftool -q -q -overwrite_original "
                         "'-icc_profile<=adobe.icc' a.jpg"));
    media_check("is as with its profile", media_picture("r.jpg"),
                media_picture("a.jpg"), 1);
    check_that("a curve in PNG: light itself",
               media_run("convert base.png -colorspace RGB -depth 16 g.png && "
                         "python3 -c \"import zlib,struct;d=open('g.png','rb')"
                         ".read();c=b'gAMA'+struct.pack('>I',100000);i=d.find("
                         "b'gAMA')-4;d=d if i<0 else d[:i]+d[i+16:];open("
                         "'l.png','wb').write(d[:33]+struct.pack('>I',4)+c+"
                         "struct.pack('>I',zlib.crc32(c))+d[33:])\""));
    media_check("is encoded", media_picture("l.png"),
                media_picture("base.png"), LIMIT);
    check_that("a profile of other pixels is passed over",
               media_run("cp base.png i.png && exiftool -q -q "
                         "-overwrite_original '-icc_profile<=inks.icc' i.png "
                         "&& head -c 100 p3.icc > cut.icc && cp base.png d.png "
                         "&& exiftool -q -q -overwrite_original "
                         "'-icc_profile<=cut.icc' d.png; true"));
    media_check("inks for RGB", media_picture("i.png"),
                media_picture("base.png"), 0);
    media_check("a damaged one", media_picture("d.png"),
                media_picture("base.png"), 0);
}

/* ---- clips --------------------------------------------------------------- */

/* c.mp4 against base.png; x265 without loss and 4:4:4 of ten bits: what is
 * left is rounding. */
static void clip_check(const char *what, bool made, double mean_is)
{
    struct image got, want;
    double mean;

    check_that(what, made);
    if (!made)
        return;
    got = media_frame("c.mp4", 1);
    want = media_picture("base.png");
    media_apart(&got, &want, &mean);
    check("  levels in the mean", mean, mean_is);
    image_release(&got);
    image_release(&want);
}

/* What encodes the clip, behind its filters. */
static bool clip_make(const char *filters, const char *primaries,
                      const char *curve, const char *range)
{
    return media_run("ffmpeg -v error -y -loop 1 -i base.%s,format=yuv444p10 "
                     "-frames:v 2 -c:v libx265 -x265-params log-level=error:"
                     "lossless=1:range=%s -color_primaries %s -color_trc %s "
                     "-colorspace bt2020nc c.mp4", filters, range, primaries,
                     curve);
}

/* base.png as a clip of these primaries and curve by zscale, diffuse white at
 * 203 cd/m2. */
static void clip_compare(const char *what, const char *primaries,
                         const char *curve, const char *range, double mean_is)
{
    char filters[400];

    snprintf(filters, sizeof filters, "png -vf scale=out_color_matrix=bt709:"
             "out_range=tv,format=yuv444p12,zscale=tin=%s:pin=bt709:min=bt709:"
             "rin=limited:p=%s:t=%s:m=bt2020nc:r=%s:npl=203",
             strcmp(curve, "bt709") ? "iec61966-2-1" : "bt709", primaries,
             curve, range);
    clip_check(what, clip_make(filters, primaries, curve, range), mean_is);
}

/* Signal of HLG, BT.2100. */
static double hlg_signal(double scene)
{
    const double a = 0.17883277, b = 1 - 4 * a, c = 0.5 - a * log(4 * a);

    return scene <= 1 / 12.0 ? sqrt(3 * scene) : a * log(12 * scene - b) + c;
}

/* A pixel of sRGB as HLG of BT.2020 on a display of 1000 cd/m2: by BT.2100,
 * whose system gamma of 1.2 is the luminance's.  (zscale takes it of each
 * channel, which is 5.5 levels elsewhere in the mean.) */
static void hlg_pixel(uint8_t out[6], const uint8_t rgb[3])
{
    static const double wide[3][3] = {          /* BT.2087 */
        {.6274, .3293, .0433}, {.0691, .9195, .0114}, {.0164, .0880, .8956}
    };
    double linear[3], light[3], luma = 0;

    for (int k = 0; k < 3; k++) {
        const double v = rgb[k] / 255.0;

        linear[k] = v <= .04045 ? v / 12.92 : pow((v + .055) / 1.055, 2.4);
    }
    for (int k = 0; k < 3; k++) {
        light[k] = .203 * (wide[k][0] * linear[0] + wide[k][1] * linear[1] +
                           wide[k][2] * linear[2]);
        luma += (double[]){.2627, .6780, .0593}[k] * light[k];
    }
    for (int k = 0; k < 3; k++) {
        const double scene = luma > 0 ? light[k] * pow(luma, 1 / 1.2 - 1) : 0;
        const unsigned v = (unsigned)(65535 * hlg_signal(scene) + 0.5);

        out[2 * k] = (uint8_t)(v >> 8);
        out[2 * k + 1] = (uint8_t)v;
    }
}

static void clip_hlg(double mean_is)
{
    struct image im = media_picture("base.png");
    FILE *f = fopen(folder_at("base.ppm"), "wb");

    REQUIRE(f, "no base.ppm");
    fprintf(f, "P6 %zu %zu 65535\n", im.width, im.height);
    for (size_t i = 0; i < im.width * im.height; i++) {
        uint8_t wide[6];

        hlg_pixel(wide, im.rgb + 3 * i);
        fwrite(wide, 1, sizeof wide, f);
    }
    fclose(f);
    image_release(&im);
    clip_check("HLG", clip_make("ppm -vf scale=out_color_matrix=bt2020:"
                                "out_range=tv", "bt2020", "arib-std-b67",
                                "limited"), mean_is);
}

static void test_clips(void)
{
    clip_compare("BT.2020", "bt2020", "bt709", "limited", 1);
    clip_compare("BT.2020, full range", "bt2020", "bt709", "full", 1);
    clip_compare("Display P3", "smpte432", "bt709", "limited", 1);
    /* diffuse white is that of the picture; only the brightest is rolled off */
    clip_compare("PQ", "bt2020", "smpte2084", "limited", 3);
    clip_hlg(3);
    check_that("a picture below the roll-off",
               media_run("convert base.png -evaluate multiply 0.68 b.png && "
                         "mv b.png base.png"));
    clip_compare("PQ", "bt2020", "smpte2084", "limited", 1);
    clip_hlg(1);
}

int main(void)
{
    folder_make();
    if (!media_have("ffmpeg convert jpgicc tificc exiftool heif-enc") ||
        !media_run("convert -seed 3 -size 64x48 plasma:red-blue plasma:green "
                   "-compose blend -define compose:args=50 -composite -blur "
                   "0x1 -depth 8 -strip PNG24:base.png")) {
        folder_remove();
        return 77;
    }
    profiles_make();
    test_pictures();
    test_tags();
    test_clips();
    return folder_remove() || check_status();
}
