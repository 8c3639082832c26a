/* Motion JPEG: the address, and the module that listens there. */
#include "formats/httpsink.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/mark.h"
#include "formats/module.h"

#define SCHEME "http://"

struct httpsink {
    const struct http_module *by;
    struct http_server *server;
};

bool httpsink_is_address(const char *name)
{
    return strncmp(name, SCHEME, strlen(SCHEME)) == 0;
}

/* http://A.B.C.D:PORT or http://localhost:PORT, a slash may follow. */
static int httpsink_parse(struct sockaddr_in *to, const char *address,
                          struct error *err)
{
    char host[64], number[INET_ADDRSTRLEN], slash = '/', more;
    unsigned port;
    int n = sscanf(address, SCHEME "%63[^:/]:%5u%c%c", host, &port, &slash,
                   &more);

    *to = (struct sockaddr_in){.sin_family = AF_INET};
    if (n >= 2 && strcmp(host, "localhost") == 0)
        strcpy(host, "127.0.0.1");
    if (n < 2 || n == 4 || slash != '/' || port == 0 || port > 65535 ||
        inet_pton(AF_INET, host, &to->sin_addr) != 1)
        return error_set(err, EX_USAGE, "%s: bad address (expected "
                         "http://127.0.0.1:PORT)", address);
    to->sin_port = htons((uint16_t)port);
    inet_ntop(AF_INET, &to->sin_addr, number, sizeof number);
    return 0;
}

struct httpsink *httpsink_open(const char *address, bool anyone,
                               struct error *err)
{
    struct sockaddr_in at;
    struct httpsink *h = NULL;
    const struct http_module *by;

    if (httpsink_parse(&at, address, err))
        return NULL;
    if (!anyone && ntohl(at.sin_addr.s_addr) >> 24 != 127)
        return error_null(err, EX_USAGE, "%s: other machines could look "
                          "(expected 127.0.0.1, or --public)", address);
    if (!(by = module_http(err)) || !(h = malloc(sizeof *h)) ||
        !(h->server = by->open(&at, anyone, err))) {
        if (!err->code)
            error_set(err, EX_OSERR, "out of memory");
        error_prefix(err, "%s", address);
        free(h);
        return NULL;
    }
    h->by = by;
    return h;
}

int httpsink_write(struct httpsink *h, const uint8_t *rgb, size_t width,
                   size_t height, struct error *err)
{
    return h->by->write(h->server, rgb, width, height, mark_text(), err);
}

void httpsink_close(struct httpsink *h)
{
    if (h)
        h->by->close(h->server);
    free(h);
}
