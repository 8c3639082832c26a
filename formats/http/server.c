/* The HTTP module: libmicrohttpd with a thread for each that looks, and the
 * newest picture as JPEG. */
#include <arpa/inet.h>
#include <microhttpd.h>
#include <netinet/in.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdio.h>
#include <jpeglib.h>            /* needs stdio.h before it */
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/module.h"

#define QUALITY 90
#define MAX_VIEWERS 16
#define BOUNDARY "spid-picture"
#define PIECE 65536             /* bytes at a time */

/* A JPEG with its part's header, kept while somebody sends it. */
struct shot {
    size_t holders, head, bytes;        /* head: of the bytes */
    uint8_t data[];
};

struct http_server {
    struct MHD_Daemon *daemon;
    bool anyone;
    pthread_mutex_t lock;
    pthread_cond_t newer;
    struct shot *newest;
    size_t number;              /* of pictures so far */
    size_t viewers;
    bool ended;
};

/* ---- pictures ------------------------------------------------------------ */

/* One holder less. */
static void http_drop(struct shot *s)
{
    if (s && --s->holders == 0)
        free(s);
}

/* JPEG of rgb, in memory that the caller frees. */
static unsigned char *http_encode(size_t *bytes, const uint8_t *rgb, size_t w,
                                  size_t h, const char *mark)
{
    struct jpeg_compress_struct c;
    struct jpeg_error_mgr errors;
    unsigned char *out = NULL;
    unsigned long n = 0;

    c.err = jpeg_std_error(&errors);    /* sizes are checked: none comes */
    jpeg_create_compress(&c);
    jpeg_mem_dest(&c, &out, &n);
    c.image_width = (JDIMENSION)w;
    c.image_height = (JDIMENSION)h;
    c.input_components = 3;
    c.in_color_space = JCS_RGB;
    jpeg_set_defaults(&c);
    jpeg_set_quality(&c, QUALITY, TRUE);
    jpeg_start_compress(&c, TRUE);
    if (mark)
        jpeg_write_marker(&c, JPEG_COM, (const JOCTET *)mark,
                          (unsigned)strlen(mark));
    while (c.next_scanline < c.image_height) {
        JSAMPROW row = (JSAMPROW)(rgb + 3 * w * c.next_scanline);

        jpeg_write_scanlines(&c, &row, 1);
    }
    jpeg_finish_compress(&c);
    jpeg_destroy_compress(&c);
    *bytes = n;
    return out;
}

static struct shot *http_shoot(const uint8_t *rgb, size_t w, size_t h,
                               const char *mark)
{
    size_t n;
    unsigned char *jpeg = http_encode(&n, rgb, w, h, mark);
    struct shot *s = jpeg ? malloc(sizeof *s + n + 160) : NULL;

    if (s) {
        s->holders = 1;
        s->head = (size_t)snprintf((char *)s->data, 128, "--" BOUNDARY "\r\n"
                                   "Content-Type: image/jpeg\r\n"
                                   "Content-Length: %zu\r\n\r\n", n);
        memcpy(s->data + s->head, jpeg, n);
        memcpy(s->data + s->head + n, "\r\n", 2);
        s->bytes = s->head + n + 2;
    }
    free(jpeg);
    return s;
}

static int http_write(struct http_server *s, const uint8_t *rgb, size_t width,
                      size_t height, const char *mark, struct error *err)
{
    struct shot *next;

    if (!width || !height || width > 65500 || height > 65500)
        return error_set(err, EX_DATAERR, "%zu x %zu pixels (expected 1 to "
                         "65500 for JPEG)", width, height);
    pthread_mutex_lock(&s->lock);
    const bool seen = s->viewers || !s->newest;
    pthread_mutex_unlock(&s->lock);
    if (!seen)
        return 0;               /* nobody looks */
    if (!(next = http_shoot(rgb, width, height, mark)))
        return error_set(err, EX_OSERR, "out of memory for a JPEG");
    pthread_mutex_lock(&s->lock);
    http_drop(s->newest);
    s->newest = next;
    s->number++;
    pthread_cond_broadcast(&s->newer);
    pthread_mutex_unlock(&s->lock);
    return 0;
}

/* ---- those who look ------------------------------------------------------ */

struct viewer {
    struct http_server *server;
    struct shot *shot;          /* on its way, or NULL */
    size_t sent, number;        /* of its bytes; which picture it is */
};

/* A picture newer than the viewer's; false at the end. */
static bool http_wait(struct viewer *v)
{
    struct http_server *s = v->server;

    pthread_mutex_lock(&s->lock);
    http_drop(v->shot);
    v->shot = NULL;
    v->sent = 0;
    while (!s->ended && (!s->newest || s->number == v->number))
        pthread_cond_wait(&s->newer, &s->lock);
    if (!s->ended) {
        v->number = s->number;
        v->shot = s->newest;
        v->shot->holders++;
    }
    pthread_mutex_unlock(&s->lock);
    return v->shot != NULL;
}

/* libmicrohttpd's: up to `max` bytes of what comes next. */
static ssize_t http_read(void *viewer, uint64_t at, char *to, size_t max)
{
    struct viewer *v = viewer;

    (void)at;
    if ((!v->shot || v->sent == v->shot->bytes) && !http_wait(v))
        return MHD_CONTENT_READER_END_OF_STREAM;
    const size_t left = v->shot->bytes - v->sent;
    const size_t n = left < max ? left : max;
    memcpy(to, v->shot->data + v->sent, n);
    v->sent += n;
    return (ssize_t)n;
}

static void http_leave(void *viewer)
{
    struct viewer *v = viewer;
    struct http_server *s = v->server;

    pthread_mutex_lock(&s->lock);
    s->viewers--;
    http_drop(v->shot);
    pthread_mutex_unlock(&s->lock);
    free(v);
}

/* All pictures from here on. */
static struct MHD_Response *http_stream(struct http_server *s)
{
    struct viewer *v = calloc(1, sizeof *v);

    if (!v)
        return NULL;
    v->server = s;
    pthread_mutex_lock(&s->lock);
    s->viewers++;
    pthread_mutex_unlock(&s->lock);
    struct MHD_Response *r = MHD_create_response_from_callback(
        MHD_SIZE_UNKNOWN, PIECE, http_read, v, http_leave);
    if (!r)
        http_leave(v);
    else
        MHD_add_response_header(r, "Content-Type",
                                "multipart/x-mixed-replace;boundary="
                                BOUNDARY);
    return r;
}

/* The next picture alone; NULL at the end. */
static struct MHD_Response *http_picture(struct http_server *s)
{
    struct viewer v = {.server = s};
    struct MHD_Response *r = NULL;

    pthread_mutex_lock(&s->lock);
    s->viewers++;
    v.number = s->number;
    pthread_mutex_unlock(&s->lock);
    if (http_wait(&v)) {
        const struct shot *shot = v.shot;

        r = MHD_create_response_from_buffer(
            shot->bytes - shot->head - 2,
            (void *)(uintptr_t)(shot->data + shot->head),
            MHD_RESPMEM_MUST_COPY);
        if (r)
            MHD_add_response_header(r, "Content-Type", "image/jpeg");
    }
    pthread_mutex_lock(&s->lock);
    s->viewers--;
    http_drop(v.shot);
    pthread_mutex_unlock(&s->lock);
    return r;
}

static struct MHD_Response *http_text(const char *type, const char *text)
{
    struct MHD_Response *r = MHD_create_response_from_buffer(
        strlen(text), (void *)(uintptr_t)text, MHD_RESPMEM_PERSISTENT);

    if (r)
        MHD_add_response_header(r, "Content-Type", type);
    return r;
}

/* ---- the server ---------------------------------------------------------- */

static const char page[] =
    "<!DOCTYPE html><html lang=\"en\"><meta charset=\"utf-8\">"
    "<meta name=\"viewport\" content=\"width=device-width\">"
    "<title>SpiD, live</title><style>html,body{height:100%;margin:0;"
    "background:#000;color:#ccc;font:13px system-ui,sans-serif}"
    "img{width:100%;height:100%;object-fit:contain}p{position:fixed;left:1em;"
    "bottom:.5em;margin:0}</style><img src=\"live.mjpg\" alt=\"The avatar, "
    "live\"><p>Synthetic: made by SpiD from one photograph</p>";

/* Whether a page asks under our own name: a name that an attacker points at
 * this machine is another one. */
static bool http_is_ours(const struct http_server *s, struct MHD_Connection *c)
{
    const char *host = MHD_lookup_connection_value(c, MHD_HEADER_KIND, "Host");

    return s->anyone || (host && (strncmp(host, "127.", 4) == 0 ||
                                  strcmp(host, "localhost") == 0 ||
                                  strncmp(host, "localhost:", 10) == 0));
}

/* libmicrohttpd's: a request. */
static enum MHD_Result http_answer(void *server, struct MHD_Connection *c,
                                   const char *path, const char *method,
                                   const char *version, const char *upload,
                                   size_t *upload_size, void **request)
{
    struct http_server *s = server;
    struct MHD_Response *r;
    unsigned status = MHD_HTTP_OK;

    (void)version, (void)upload, (void)upload_size, (void)request;
    if (strcmp(method, "GET") && strcmp(method, "HEAD")) {
        status = MHD_HTTP_METHOD_NOT_ALLOWED;
        r = http_text("text/plain", "only GET\n");
    } else if (!http_is_ours(s, c)) {
        status = MHD_HTTP_FORBIDDEN;
        r = http_text("text/plain", "ask 127.0.0.1\n");
    } else if (!strcmp(path, "/")) {
        r = http_text("text/html; charset=utf-8", page);
    } else if (!strcmp(path, "/live.mjpg")) {
        r = http_stream(s);
    } else if (!strcmp(path, "/picture.jpg")) {
        r = http_picture(s);
    } else {
        status = MHD_HTTP_NOT_FOUND;
        r = http_text("text/plain", "/, /live.mjpg or /picture.jpg\n");
    }
    if (!r)
        return MHD_NO;
    MHD_add_response_header(r, "Cache-Control", "no-store");
    enum MHD_Result rc = MHD_queue_response(c, status, r);
    MHD_destroy_response(r);
    return rc;
}

static struct http_server *http_open(const struct sockaddr_in *at, bool anyone,
                                     struct error *err)
{
    struct http_server *s = calloc(1, sizeof *s);

    if (!s)
        return error_null(err, EX_OSERR, "out of memory");
    s->anyone = anyone;
    pthread_mutex_init(&s->lock, NULL);
    pthread_cond_init(&s->newer, NULL);
    s->daemon = MHD_start_daemon(
        MHD_USE_INTERNAL_POLLING_THREAD | MHD_USE_THREAD_PER_CONNECTION,
        ntohs(at->sin_port), NULL, NULL, http_answer, s, MHD_OPTION_SOCK_ADDR,
        (const struct sockaddr *)at, MHD_OPTION_CONNECTION_LIMIT, MAX_VIEWERS,
        MHD_OPTION_CONNECTION_TIMEOUT, 30u, MHD_OPTION_END);
    if (s->daemon)
        return s;
    free(s);
    return error_null(err, EX_UNAVAILABLE, "cannot listen there (expected a "
                      "port that is free, and an address of this machine)");
}

static void http_close(struct http_server *s)
{
    pthread_mutex_lock(&s->lock);
    s->ended = true;
    pthread_cond_broadcast(&s->newer);
    pthread_mutex_unlock(&s->lock);
    MHD_stop_daemon(s->daemon);
    http_drop(s->newest);
    pthread_mutex_destroy(&s->lock);
    pthread_cond_destroy(&s->newer);
    free(s);
}

extern const struct http_module spid_http;

__attribute__((visibility("default"))) const struct http_module spid_http = {
    http_open, http_write, http_close
};
