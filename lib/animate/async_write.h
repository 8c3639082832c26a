/* A picture leaves by a thread, so that the next one is drawn while its
 * receiver takes this one: a pipe holds a small part of it. */
#ifndef SPID_ANIMATE_ASYNC_WRITE_H
#define SPID_ANIMATE_ASYNC_WRITE_H

#include <pthread.h>
#include <stdbool.h>

#include "formats/framesink.h"

/* A zeroed struct is idle. */
struct async_write {
    pthread_t thread;
    bool busy;
    struct framesink *sink;
    struct framesink_frame frame;
    int rc;
    struct error err;
};

/* Start writing f; w is idle.  True: its pixels and the sink are the thread's
 * until async_write_wait.  False: no thread could be made, nothing was done. */
bool async_write_start(struct async_write *w, struct framesink *sink,
                       const struct framesink_frame *f);

/* Wait until the picture is out; 0, or -1 and why it is not.  0 if idle. */
int async_write_wait(struct async_write *w, struct error *err);

#endif
