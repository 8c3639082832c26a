/* Every input that fuzzing ever found (tests/fuzz/found) and every seed
 * (tests/fuzz/seed) goes through its target again. */
#include <glob.h>
#include <string.h>

#define LLVMFuzzerTestOneInput fuzz_stream
#include "tests/fuzz/fuzz_stream.c"
#undef LLVMFuzzerTestOneInput

#define LLVMFuzzerTestOneInput fuzz_npy
#include "tests/fuzz/fuzz_npy.c"
#undef LLVMFuzzerTestOneInput

#define LLVMFuzzerTestOneInput fuzz_json
#include "tests/fuzz/fuzz_json.c"
#undef LLVMFuzzerTestOneInput

#define LLVMFuzzerTestOneInput fuzz_safetensors
#include "tests/fuzz/fuzz_safetensors.c"
#undef LLVMFuzzerTestOneInput

#define LLVMFuzzerTestOneInput fuzz_frames
#include "tests/fuzz/fuzz_frames.c"
#undef LLVMFuzzerTestOneInput

#define LLVMFuzzerTestOneInput fuzz_pickle
#include "tests/fuzz/fuzz_pickle.c"
#undef LLVMFuzzerTestOneInput

#define LLVMFuzzerTestOneInput fuzz_zip
#include "tests/fuzz/fuzz_zip.c"
#undef LLVMFuzzerTestOneInput

#define LLVMFuzzerTestOneInput fuzz_npz
#define put put_npz
#include "tests/fuzz/fuzz_npz.c"
#undef put
#undef LLVMFuzzerTestOneInput

#define LLVMFuzzerTestOneInput fuzz_jpeg
#include "tests/fuzz/fuzz_jpeg.c"
#undef LLVMFuzzerTestOneInput

#define LLVMFuzzerTestOneInput fuzz_video
#define LLVMFuzzerInitialize fuzz_video_begin
#include "tests/fuzz/fuzz_video.c"
#undef LLVMFuzzerInitialize
#undef LLVMFuzzerTestOneInput

#define LLVMFuzzerTestOneInput fuzz_ply
#include "tests/fuzz/fuzz_ply.c"
#undef LLVMFuzzerTestOneInput

#define LLVMFuzzerTestOneInput fuzz_wavefront
#include "tests/fuzz/fuzz_wavefront.c"
#undef LLVMFuzzerTestOneInput

#define LLVMFuzzerTestOneInput fuzz_livelink
#include "tests/fuzz/fuzz_livelink.c"
#undef LLVMFuzzerTestOneInput

#define LLVMFuzzerTestOneInput fuzz_glb
#include "tests/fuzz/fuzz_glb.c"
#undef LLVMFuzzerTestOneInput

#define LLVMFuzzerTestOneInput fuzz_pictures
#define LLVMFuzzerInitialize fuzz_pictures_begin
#include "tests/fuzz/fuzz_pictures.c"
#undef LLVMFuzzerInitialize
#undef LLVMFuzzerTestOneInput

static const struct {
    const char *name;
    int (*run)(const uint8_t *data, size_t size);
} targets[] = { { "fuzz_stream", fuzz_stream },
                { "fuzz_npy", fuzz_npy },
                { "fuzz_json", fuzz_json },
                { "fuzz_safetensors", fuzz_safetensors },
                { "fuzz_frames", fuzz_frames },
                { "fuzz_pickle", fuzz_pickle },
                { "fuzz_zip", fuzz_zip },
                { "fuzz_npz", fuzz_npz },
                { "fuzz_jpeg", fuzz_jpeg },
                { "fuzz_video", fuzz_video },
                { "fuzz_ply", fuzz_ply },
                { "fuzz_wavefront", fuzz_wavefront },
                { "fuzz_livelink", fuzz_livelink },
                { "fuzz_glb", fuzz_glb },
                { "fuzz_pictures", fuzz_pictures } };

static int fuzz_replay(const char *path, int (*run)(const uint8_t *, size_t))
{
    static uint8_t data[1 << 20];
    FILE *f = fopen(path, "rb");
    size_t n;

    if (!f)
        return 1;
    n = fread(data, 1, sizeof data, f);
    fclose(f);
    return run(data, n);
}

int main(void)
{
    int bad = 0;
    size_t files = 0;

    for (size_t t = 0; t < sizeof targets / sizeof *targets; t++) {
        char pattern[100];
        glob_t g = { 0 };

        snprintf(pattern, sizeof pattern, "tests/fuzz/found/%s-*",
                 targets[t].name);
        glob(pattern, 0, NULL, &g);
        snprintf(pattern, sizeof pattern, "tests/fuzz/seed/%s/*",
                 targets[t].name);
        glob(pattern, GLOB_APPEND, NULL, &g);
        for (size_t i = 0; i < g.gl_pathc; i++)
            bad += fuzz_replay(g.gl_pathv[i], targets[t].run);
        files += g.gl_pathc;
        globfree(&g);
    }
    printf("%zu inputs, %d refused to end well\n", files, bad);
    return bad || files == 0;
}
