/* Phase A in the page: what spid-shape, spid-branches --bake and spid-export
 * --web do to a photograph. */
#include <emscripten.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/avatar/baker.h"
#include "lib/export/page.h"
#include "lib/export/web/wasm/engine.h"
#include "lib/track/source.h"

static struct baker baker;

/* Say how far it is. */
EM_JS(void, face_tell, (const char *what, double share), {
    Module.tell(UTF8ToString(what), share);
})

/* The branches' networks, with the first photograph. */
static int face_open(void)
{
    const struct baker_options opt = {.colors = 3, .type = NN_FAST};

    return baker.head ? 0 : baker_open(&baker, &engine.model, &engine.head,
                                       &opt, &engine.err);
}

/* The Gaussians of the person, given to the worker as the page reads them. */
static int face_bake(struct person *p)
{
    struct identity id = {0};
    struct page page;
    float *verts = malloc(3 * engine.head.V * sizeof *verts);
    int rc = -1;

    page_init(&page, engine.head.nexp);
    if (!verts)
        error_set(&engine.err, EX_OSERR, "no memory for the mesh");
    else if (face_open() == 0 &&
             baker_bake(&baker, verts, p, &engine.err) == 0 &&
             baker_copy(&page.baked, &baker, true, &engine.err) == 0 &&
             person_fold(&id, &engine.head, p, &engine.err) == 0) {
        page.has_avatar = true;
        face_tell("Packing", 0.95);
        rc = page_write(&page, "/avatar", NULL, &id, p, NULL, &engine.err);
    }
    identity_release(&id);
    page_release(&page);
    free(verts);
    return rc;
}

/* The pictures of formats/image.h that source_find turns are these alone. */
void image_release(struct image *im)
{
    free(im->rgb);
    free(im->alpha);
    memset(im, 0, sizeof *im);
}

/* Where the portrait's window is, for who makes the same avatar elsewhere. */
static void face_note_window(struct square window)
{
    char text[96];

    snprintf(text, sizeof text, "%.1f,%.1f,%.1f", window.x, window.y,
             window.size);
    archive_note("window", text);
}

/* The avatar of the picture in engine_room, handed to the worker (archive.c):
 * 0, or -1 and engine_error. */
EMSCRIPTEN_KEEPALIVE
int face_make(size_t W, size_t H)
{
    const struct track_options opt = {.size = (double)engine.model.config.size};
    struct source s = {0};
    struct image im = {.width = W, .height = H};
    int rc = -1;

    face_tell("Looking for the face", 0);
    if (!(im.rgb = engine_rgb(&im.alpha, W, H)))
        error_set(&engine.err, EX_OSERR, "no memory for the picture");
    else if (source_find(&s, &im, NULL, &engine.head, &engine.nets, &opt,
                         &engine.err) == 0) {
        face_note_window(s.window);
        face_tell("Cutting out the person", 0.3);
        if (source_cut_out(&s, &im, NULL, &engine.head, &engine.nets,
                           &engine.err) == 0) {
            face_tell("Making the Gaussians", 0.6);
            rc = face_bake(&s.person);
        }
    }
    image_release(&im);
    source_release(&s);
    return rc;
}
