/* spid-export: Gaussians, meshes and motion of a stream as PLY, .splat, glTF,
 * OBJ and a page that plays them; and a check of other people's files. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "cmd/options.h"
#include "formats/glb.h"
#include "formats/ply.h"
#include "lib/base/file.h"
#include "lib/export/export.h"
#include "lib/export/networks.h"

static struct export_options opt = {.frame = -1};
static const char *identity_path, *head_path, *lint_path, *onnx_path;
static long expressions = 50;
static bool live;

static const struct cli_option options[] = {
    OPTION_OUTPUT("ply", 0, &opt.file[EXPORT_PLY], "FILE",
                  "3DGS PLY; name_%06d.ply for every frame"),
    OPTION_OUTPUT("ply-compressed", 0, &opt.file[EXPORT_PLY_PACKED], "FILE",
                  "the same in SuperSplat's compressed form"),
    OPTION_OUTPUT("splat", 0, &opt.file[EXPORT_SPLAT], "FILE",
                  ".splat of the web viewers"),
    OPTION_OUTPUT("glb-splats", 0, &opt.file[EXPORT_GLB_SPLATS], "FILE",
                  "GLB with KHR_gaussian_splatting"),
    OPTION_OUTPUT("glb-head", 0, &opt.file[EXPORT_GLB_HEAD], "FILE",
                  "GLB of the head: skin, morph targets, the motion as "
                  "animation"),
    OPTION_OUTPUT("obj", 0, &opt.file[EXPORT_OBJ], "FILE",
                  "OBJ of one frame's mesh; name_%06d.obj for every frame"),
    OPTION_OUTPUT("html", 0, &opt.file[EXPORT_HTML], "FILE",
                  "a page that plays the driven avatar in a browser"),
    OPTION_STRING("web", 0, &opt.file[EXPORT_WEB], "FILE",
                  "the avatar for sites, driven from JavaScript"),
    OPTION_FLAG("live", 0, &live,
                "--html: with a camera that drives it in the browser"),
    OPTION_STRING("onnx", 0, &onnx_path, "DIR",
                  "the model's networks as ONNX files in this folder"),
    OPTION_INT("frame", 0, &opt.frame, 0, 1e9, "N",
               "the frame for names without %d (default: the first)"),
    OPTION_STRING("identity", 'i', &identity_path, "FILE",
                  "shape, source picture and, for --html, Gaussians "
                  "from this identity"),
    OPTION_HEAD(&head_path),
    OPTION_INT("expressions", 0, &expressions, 0, 198, "N",
               "expression directions kept as morph targets (default 50)"),
    OPTION_FLAG("correctives", 0, &opt.head.correctives,
                "pose correctives as morph targets"),
    OPTION_FLAG("model-space", 0, &opt.model_space,
                "PLY: keep y up instead of turning to y down"),
    OPTION_STRING("lint", 0, &lint_path, "FILE",
                  "say what a viewer would trip over in a PLY or GLB"),
    {0}
};

static const struct cli_usage usage = {
    "spid-export", "[OPTION ...] [STREAM] | --lint FILE",
    "write Gaussians and the driven head for other programs", options
};

/* A line of --lint. */
static void export_print_finding(void *context, const char *text)
{
    printf("%s: %s\n", (const char *)context, text);
}

/* Exit 0 for a clean file, EX_DATAERR with a line per finding. */
static int export_lint_file(const char *path)
{
    struct error err = {0};
    int found = file_ends(path, ".ply")
                    ? ply_lint(path, export_print_finding, (void *)path, &err)
                    : glb_lint(path, export_print_finding, (void *)path, &err);

    if (found < 0)
        die_error(&err);
    if (!found)
        printf("%s: nothing a viewer would trip over\n", path);
    return found ? EX_DATAERR : EX_OK;
}

/* What came back out of the files, beside our own picture. */
static void export_print_drawn(const struct export *x)
{
    for (int i = 0; i < DRAWN_FORMATS && !cli.quiet; i++) {
        const struct drawn *d = &x->drawn[i];

        if (d->files == 0)
            continue;
        printf("%s: %zu Gaussians", opt.file[i], d->n);
        if (d->files > 1)
            printf(", the worst of %zu files", d->files);
        if (isinf(d->psnr_db))
            printf(", read back and drawn: the same picture");
        else
            printf(", read back and drawn: %.1f dB, %.2g at most from our "
                   "picture", d->psnr_db, d->max_abs);
        printf("; by a viewer's rules %.1f dB\n", d->viewer_db);
    }
    const struct drawn_head *h = &x->drawn_head;
    if (cli.quiet || h->vertices == 0)
        return;
    printf("%s: %zu vertices, the %s read back and drawn: %.1f micrometres "
           "at most from our mesh, ", opt.file[EXPORT_GLB_HEAD], h->vertices,
           x->frames ? "first frame" : "head at rest", h->metres * 1e6);
    if (isinf(h->psnr_db))
        printf("the same picture\n");
    else
        printf("%.1f dB\n", h->psnr_db);
}

/* How large the page became. */
static void export_print_page(const struct export *x)
{
    if (opt.file[EXPORT_HTML] && !cli.quiet)
        printf("%s: %zu Gaussians, %zu frame%s, %.1f MB\n",
               opt.file[EXPORT_HTML], x->page.baked.N, x->page.frames,
               plural(x->page.frames), (double)x->page_bytes / 1e6);
}

/* Whether something is asked for that a stream has. */
static bool export_streams(void)
{
    for (int k = 0; k < EXPORT_KINDS; k++)
        if (opt.file[k])
            return true;
    return false;
}

/* --onnx: the model's networks as files. */
static void export_networks(void)
{
    struct networks networks;
    struct model model;
    struct head head;
    struct error err = {0};

    if (!onnx_path)
        return;
    if (option_model_open(&model, &err) ||
        option_head_load(&head, head_path, &err) ||
        networks_open(&networks, &model, &head, &err) ||
        networks_write(onnx_path, &networks, &err))
        die_error(&err);
    networks_release(&networks);
    head_release(&head);
    model_close(&model);
}

/* --live: the files that go into the page, checked. */
static void export_open_live(struct export *x, const char *head)
{
    static char path[4096];
    struct error err = {0};
    struct model model;

    if (!live)
        return;
    if (option_model_open(&model, &err) ||
        model_check_head(&model.config, &x->head, &err))
        die_error(&err);
    snprintf(path, sizeof path, "%s", model_path(&model));
    model_close(&model);
    x->page.live_model = path;
    x->page.live_head = head;
}

/* The template of --html. */
static void export_open_player(void)
{
    static char path[4096];
    struct error err = {0};

    if (!opt.file[EXPORT_HTML])
        return;
    if (cli_find_model(live ? "player-live.html" : "player.html", path,
                       sizeof path, &err))
        die(EX_NOINPUT, "--html needs the player that make web builds: %s",
            err.text);
    opt.player = path;
}

/* What the options ask for, with the head where one is needed. */
static void export_open_all(struct export *x)
{
    struct error err = {0};
    static char path[4096];

    if (live && !opt.file[EXPORT_HTML])
        die(EX_USAGE, "--live: no page (expected --html FILE)");
    if (!export_streams())
        die(EX_USAGE, "nothing to write (expected --ply, --splat, "
            "--glb-splats, --glb-head, --obj, --html, --web or --onnx)");
    opt.head.expressions = (size_t)expressions;
    opt.head.clip = "driven";
    if (export_needs_head(&opt) && !head_path &&
        cli_find_model("head.safetensors", path, sizeof path, &err))
        die_error(&err);
    export_open_player();
    if (export_init(x, &opt, head_path ? head_path : path, &err))
        die_error(&err);
    export_open_live(x, head_path ? head_path : path);
    if (identity_path && x->has_head &&
        export_load_identity(x, identity_path, &err))
        die_error(&err);
}

/* Every record to the files. */
static int export_take(const struct record *rec, void *export,
                       struct error *err)
{
    return export_record(export, rec, err);
}

int main(int argc, char **argv)
{
    static struct export x;
    struct error err = {0};
    int at = cli_parse(&usage, argc, argv);
    const char *input = cli_stream_operand(at, argc, argv);

    if (lint_path)
        return export_lint_file(lint_path);
    export_networks();
    if (onnx_path && !export_streams()) {
        stats_write();
        return EX_OK;
    }
    export_open_all(&x);
    if (stream_load(input, export_take, &x, &err) || export_finish(&x, &err))
        die_error(&err);
    export_print_drawn(&x);
    export_print_page(&x);
    if (x.coarse)
        warn("only the first three channels were written: the coarse picture "
             "without the refiner");
    export_release(&x);
    stats_write();
    return EX_OK;
}
