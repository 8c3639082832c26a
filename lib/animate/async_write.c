/* One thread for one framesink_write. */
#include "lib/animate/async_write.h"

/* The thread: one frame. */
static void *async_write_run(void *arg)
{
    struct async_write *w = arg;

    w->rc = framesink_write(w->sink, &w->frame, &w->err);
    return NULL;
}

bool async_write_start(struct async_write *w, struct framesink *sink,
                       const struct framesink_frame *f)
{
    *w = (struct async_write){.sink = sink, .frame = *f};
    w->busy = pthread_create(&w->thread, NULL, async_write_run, w) == 0;
    return w->busy;
}

int async_write_wait(struct async_write *w, struct error *err)
{
    if (!w->busy)
        return 0;
    pthread_join(w->thread, NULL);
    w->busy = false;
    if (w->rc)
        *err = w->err;
    return w->rc;
}
