/* The ONNX form of every network against the network itself, by another
 * engine: onnxruntime on node.  Inputs are random; the weights are the shipped
 * model's, and random ones for kinds of network that it has not. */
#include "lib/export/networks.h"

#include <string.h>
#include <unistd.h>

#include "lib/base/random.h"
#include "lib/head/head.h"
#include "tests/check.h"
#include "tests/folder.h"

#define MODEL "examples/model/model.safetensors"
#define HEAD "examples/model/head.safetensors"
#define VERSION "build/npm/node_modules/onnxruntime-node"
#define SIDE 128                /* of the refiner's pictures */

static const struct nn_options plain = {NN_INFER, NN_F32};
static FILE *cases;
static int written;

/* n random numbers, 0 to 1 or signed; the caller frees them. */
static float *noise(const char *name, size_t n, bool positive)
{
    float *x = malloc(n * sizeof *x);
    struct random r;

    random_init(&r, 7, name);
    REQUIRE(x, "out of memory");
    for (size_t i = 0; i < n; i++)
        x[i] = positive ? random_float(&r, 0, 1) : random_float(&r, -1, 1);
    return x;
}

static void save(const char *net, const char *name, const float *x, size_t n)
{
    char file[160];

    snprintf(file, sizeof file, "%s.onnx.%s", net, name);
    FILE *f = fopen(folder_at(file), "wb");
    REQUIRE(f && fwrite(x, sizeof *x, n, f) == n && fclose(f) == 0,
            "cannot write %s", file);
}

/* The network's file, and its line of cases.json: names and shapes are what
 * the graph says. */
static void save_graph(const char *net, struct graph *g)
{
    struct error err = {0};
    char file[160];
    const char *comma = "";

    snprintf(file, sizeof file, "%s.onnx", net);
    CHECK(!g->err.code, "%s: %s", net, g->err.text);
    CHECK(onnx_write(folder_at(file), &g->file, &err) == 0, "%s", err.text);
    fprintf(cases, "%s{\"file\":\"%s\",\"inputs\":{", written++ ? "," : "[",
            file);
    for (size_t i = 0; i < g->file.values; i++) {
        const struct onnx_value *v = &g->file.value[i];

        if (v->kind != ONNX_INPUT)
            continue;
        fprintf(cases, "%s\"%s\":[", comma, v->name);
        for (int d = 0; d < v->ndim; d++)
            fprintf(cases, "%s%zu", d ? "," : "", v->dim[d]);
        fprintf(cases, "]");
        comma = ",";
    }
    fprintf(cases, "},\"outputs\":[");
    for (size_t i = 0; i < g->file.outputs; i++)
        fprintf(cases, "%s\"%s\"", i ? "," : "",
                g->file.value[g->file.output[i]].name);
    fprintf(cases, "]}");
    graph_release(g);
}

static void save_network(const struct networks *n, enum network which)
{
    struct error err = {0};
    struct graph g;

    CHECK(networks_graph(&g, n, which, &err) == 0, "%s", err.text);
    save_graph(networks_name(which), &g);
}

static void run_encoders(struct networks *n)
{
    struct encoders *e = &n->encoders;
    struct error err = {0};
    size_t count = 3 * 224 * 224, S = MATTE_SIDE;
    float *rgb = noise("picture", count, true);
    float code[MOTION_OUT], beta[SHAPE_ENCODER_OUT], confidence;

    REQUIRE(motion_encoder_plan(&e->motion, 1, plain, &err) == 0, "%s",
            err.text);
    motion_encoder_forward(code, rgb, &e->motion);
    confidence = motion_encoder_confidence(&e->motion, 0);
    save_network(n, NETWORK_MOTION);
    save("motion", "picture", rgb, count);
    save("motion", "code", code, MOTION_OUT);
    save("motion", "sure", &confidence, 1);
    shape_encoder_forward(beta, rgb, &e->shape);
    save_network(n, NETWORK_SHAPE);
    save("shape", "picture", rgb, count);
    save("shape", "shape", beta, SHAPE_ENCODER_OUT);
    free(rgb);
    rgb = noise("portrait", 3 * S * S, true);
    float *alpha = malloc(S * S * sizeof *alpha);
    REQUIRE(alpha, "out of memory");
    matte_net_forward(alpha, rgb, &e->matte);
    for (size_t i = 0; i < S * S; i++)
        alpha[i] = (float)matte_net_alpha(alpha[i]);
    save_network(n, NETWORK_MATTE);
    save("matte", "picture", rgb, 3 * S * S);
    save("matte", "alpha", alpha, S * S);
    free(alpha);
    free(rgb);
}

static void run_backbone(struct networks *n)
{
    struct backbone *b = &n->avatar.backbone;
    struct error err = {0};
    size_t S = n->avatar.config.size, c = n->avatar.config.plane;
    size_t count = c * c * b->config.features;
    float *rgb = noise("source", 3 * S * S, true);
    float *features = malloc(count * sizeof *features);

    REQUIRE(features && backbone_plan(b, 1, S, plain, &err) == 0, "%s",
            err.text);
    backbone_forward(features, rgb, b);
    save_network(n, NETWORK_BACKBONE);
    save("backbone", "picture", rgb, 3 * S * S);
    save("backbone", "features", features, count);
    free(rgb);
    free(features);
}

/* Phi_init, whose last layer starts at zero. */
static void run_plane(void)
{
    enum { CELLS = 24, IN = 9 };
    struct params ps;
    struct plane_init p;
    struct error err = {0};
    struct graph g;
    float *features = noise("cells", CELLS * CELLS * IN, false);
    float delta[2 * CELLS * CELLS];

    params_init(&ps);
    plane_init_init(&p, &ps, "p.", IN, 8);
    REQUIRE(params_allocate(&ps, &err) == 0, "%s", err.text);
    for (size_t t = 0; t < ps.count; t++)
        ps.tensor[t].init = PARAM_HE;
    params_randomise(&ps, 4);
    REQUIRE(plane_init_plan(&p, CELLS, CELLS, plain, &err) == 0, "%s",
            err.text);
    plane_init_forward(delta, features, &p);
    graph_init(&g, "plane", "");
    plane_init_graph(&g, CELLS, &p);
    save_graph("plane", &g);
    save("plane", "features", features, CELLS * CELLS * IN);
    save("plane", "delta", delta, 2 * CELLS * CELLS);
    plane_init_release(&p);
    params_release(&ps);
    free(features);
}

/* The attributes that a decoder gave. */
struct attributes {
    struct gaussian_out out;
    size_t n, colors, positions;
};

static void attributes_init(struct attributes *a, size_t n,
                            const struct gaussian_head *h)
{
    const size_t width = gaussian_head_width(h);
    float *at = calloc(n * width, sizeof *at);

    REQUIRE(at, "out of memory");
    *a = (struct attributes){.n = n, .colors = h->colors};
    a->out.color = at;
    if (h->colors_only)
        return;
    a->positions = width - h->colors - 8;
    a->out.opacity = at + n * a->colors;
    a->out.scale = a->out.opacity + n;
    a->out.quat = a->out.scale + 3 * n;
    a->out.position = a->positions ? a->out.quat + 4 * n : NULL;
}

static void attributes_save(struct attributes *a, const char *net)
{
    save(net, "color", a->out.color, a->n * a->colors);
    if (a->out.opacity) {
        save(net, "opacity", a->out.opacity, a->n);
        save(net, "scale", a->out.scale, 3 * a->n);
        save(net, "quat", a->out.quat, 4 * a->n);
    }
    if (a->positions)
        save(net, "position", a->out.position, a->n * a->positions);
    free(a->out.color);
}

static void run_conv_decoder(struct networks *n, enum network which,
                             struct conv_decoder *d, size_t side)
{
    const char *net = networks_name(which);
    const float direction[3] = {0.1f, -0.2f, 0.97f};
    struct error err = {0};
    struct attributes a;
    size_t N = side * side;
    float *features = noise(net, N * d->tape.picture.channels, false);
    float *logit = noise("logit", 3 * N, false);

    REQUIRE(conv_decoder_plan(d, 1, side, side, plain, &err) == 0, "%s",
            err.text);
    attributes_init(&a, N, &d->head);
    conv_decoder_forward(&a.out, features, direction, logit, d);
    save_network(n, which);
    save(net, "features", features, N * d->tape.picture.channels);
    save(net, "direction", direction, 3);
    save(net, "rgb_logit", logit, 3 * N);
    attributes_save(&a, net);
    free(features);
    free(logit);
}

static void run_mlp_decoder(struct networks *n)
{
    const float direction[3] = {-0.3f, 0.2f, 0.9f};
    struct mlp_decoder *d = &n->avatar.dynamic.decoder;
    struct error err = {0};
    struct attributes a;
    size_t N = n->avatar.dynamic.count;
    float *features = noise("points", N * d->tape.picture.channels, false);
    float *logit = noise("logit", 3 * N, false);

    REQUIRE(mlp_decoder_plan(d, 1, N, plain, &err) == 0, "%s", err.text);
    attributes_init(&a, N, &d->head);
    mlp_decoder_forward(&a.out, features, direction, logit, d);
    save_network(n, NETWORK_DYNAMIC);
    save("dynamic", "features", features, N * d->tape.picture.channels);
    save("dynamic", "direction", direction, 3);
    save("dynamic", "rgb_logit", logit, 3 * N);
    attributes_save(&a, "dynamic");
    free(features);
    free(logit);
}

/* On a part of the picture, turned. */
static void run_refiner(struct networks *n)
{
    const float turn[RELATIVE_POSE_SIZE] = {0.1f, 0.2f, -0.1f, 0.05f, 0, 0.3f};
    struct refiner *r = &n->refiner;
    struct error err = {0};
    struct graph g;
    size_t N = SIDE * SIDE, C = r->config.channels;
    float *features = noise("splats", N * C, true);
    float *photo = noise("photo", 5 * N, true);
    float *rgb = malloc(3 * N * sizeof *rgb);

    REQUIRE(rgb && refiner_plan(r, 1, SIDE, SIDE, plain, &err) == 0, "%s",
            err.text);
    refiner_turn(r, turn);
    refiner_photo(r, photo);
    refiner_forward(rgb, features, r);
    graph_init(&g, "refiner", "");
    refiner_graph(&g, SIDE, SIDE, r);
    save_graph("refiner", &g);
    save("refiner", "features", features, N * C);
    save("refiner", "turn", turn, RELATIVE_POSE_SIZE);
    save("refiner", "photo", photo, 5 * N);
    save("refiner", "rgb", rgb, 3 * N);
    save("refiner", "field", refiner_field(r), N / 4);
    free(features);
    free(photo);
    free(rgb);
}

/* TensorFlow's padding, and a backbone of an odd size. */
static void run_untrained(void)
{
    struct params ps;
    struct shape_encoder s;
    struct small_backbone b;
    struct error err = {0};
    struct graph g;
    float *rgb = noise("picture", 3 * 224 * 224, true), beta[300];
    float *features = malloc(37 * 37 * 8 * sizeof *features);

    params_init(&ps);
    REQUIRE(features &&
            shape_encoder_init(&s, &ps, "s.",
                               "tf_mobilenetv3_large_minimal_100", &err) == 0,
            "%s", err.text);
    small_backbone_init(&b, &ps, "b.", 8, 37, 8);
    REQUIRE(params_allocate(&ps, &err) == 0, "%s", err.text);
    params_randomise(&ps, 3);
    REQUIRE(shape_encoder_plan(&s, 1, plain, &err) == 0 &&
            small_backbone_plan(&b, 1, 64, plain, &err) == 0, "%s", err.text);
    shape_encoder_forward(beta, rgb, &s);
    tape_forward(features, rgb, &b.tape);
    graph_init(&g, "minimal", "");
    shape_encoder_graph(&g, &s);
    save_graph("minimal", &g);
    save("minimal", "picture", rgb, 3 * 224 * 224);
    save("minimal", "shape", beta, 300);
    graph_init(&g, "odd", "");
    int x = small_backbone_graph(&g, GRAPH_INPUT(&g, "picture", 1, 64, 64, 3),
                                 64, &b);
    GRAPH_OUTPUT(&g, graph_rows(&g, x), "features", 1, 37, 37, 8);
    save_graph("odd", &g);
    save("odd", "picture", rgb, 3 * 64 * 64);
    save("odd", "features", features, 37 * 37 * 8);
    graph_init(&g, "small", "");
    small_backbone_graph(&g, GRAPH_INPUT(&g, "picture", 1, 96, 96, 3), 96,
                         &b);
    check_that("a backbone that shrinks its picture is refused",
               g.err.code != 0);
    graph_release(&g);
    shape_encoder_release(&s);
    small_backbone_release(&b);
    params_release(&ps);
    free(features);
    free(rgb);
}

/* What has no ONNX form says so. */
static void run_refused(void)
{
    const struct backbone_config dino = {
        .type = BACKBONE_DINOV2, .features = 8, .size = 16, .embed = 32,
        .depth = 4, .heads = 2, .patch = 14, .image = 28
    };
    const struct refiner_config unet = {
        .type = REFINER_STYLE_UNET, .channels = 8, .multiplier = 0.1f,
        .size = 64
    };
    struct params ps;
    struct backbone b;
    struct refiner r;
    struct error err = {0};
    struct graph g;

    params_init(&ps);
    REQUIRE(backbone_init(&b, &ps, "b.", &dino, &err) == 0 &&
            refiner_init(&r, &ps, "r.", &unet, &err) == 0, "%s", err.text);
    graph_init(&g, "dino", "");
    backbone_graph(&g, 64, &b);
    check_that("DINOv2 is refused", strstr(g.err.text, "DINOv2"));
    graph_release(&g);
    graph_init(&g, "unet", "");
    refiner_graph(&g, 64, 64, &r);
    check_that("the StyleUNet is refused", strstr(g.err.text, "StyleUNet"));
    graph_release(&g);
    backbone_release(&b);
    refiner_release(&r);
    params_release(&ps);
}

static void run_all(const struct model *m, const struct head *head)
{
    struct networks n;
    struct error err = {0};

    REQUIRE(networks_open(&n, m, head, &err) == 0, "%s", err.text);
    run_encoders(&n);
    run_backbone(&n);
    run_conv_decoder(&n, NETWORK_STATIC, &n.avatar.plane.decoder,
                     n.avatar.plane.n);
    run_conv_decoder(&n, NETWORK_MOUTH, &n.avatar.mouth.decoder,
                     n.avatar.mouth.K);
    run_mlp_decoder(&n);
    run_refiner(&n);
    networks_release(&n);
}

int main(void)
{
    struct model m;
    struct head head;
    struct error err = {0};
    char command[200];

    if (access(VERSION, R_OK) || system("command -v node >/dev/null")) {
        printf("no onnxruntime-node (apt: npm, then make deps)\n");
        return 77;
    }
    folder_make();
    REQUIRE(cases = fopen(folder_at("cases.json"), "w"), "no cases.json");
    REQUIRE(model_open(&m, MODEL, &err) == 0 &&
            head_load(&head, HEAD, &err) == 0, "%s", err.text);
    run_all(&m, &head);
    run_plane();
    run_untrained();
    run_refused();
    fprintf(cases, "]\n");
    REQUIRE(fclose(cases) == 0, "cases.json is cut short");
    fflush(stdout);
    snprintf(command, sizeof command, "NODE_PATH=build/npm/node_modules node "
             "tests/npm/onnx.cjs %s", folder);
    check_that("onnxruntime agrees", system(command) == 0);
    head_release(&head);
    model_close(&m);
    CHECK(folder_remove() == 0, "%s stays", folder);
    return check_status();
}
