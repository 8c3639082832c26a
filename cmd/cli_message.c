/* What a program says on standard error: how it ends, warnings, and a progress
 * bar that makes room for both. */
#include <ctype.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "cmd/cli.h"
#include "lib/base/cpu.h"

#define LONG_WORK 1.0          /* seconds before a bar appears */
#define REDRAW 0.1             /* seconds between two drawings */

static struct {
    double begun, drawn;       /* seconds; 0: no work under way */
    int width;                 /* of the line on the screen; 0: none */
} bar;

/* The bar's, and of the line that it is on: threads speak, too. */
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;

/* Clear the bar's line for what comes next. */
static void cli_bar_erase(void)
{
    if (bar.width)
        fprintf(stderr, "\r%-*s\r", bar.width, "");
    bar.width = 0;
}

/* "program: KIND text" on a line of its own, whatever names are in the text. */
static void cli_message_print(const char *kind, const char *format, va_list ap)
{
    char text[1024];

    vsnprintf(text, sizeof text, format, ap);
    for (char *c = text; *c; c++)
        if (iscntrl((unsigned char)*c))
            *c = '?';
    pthread_mutex_lock(&lock);
    cli_bar_erase();
    fprintf(stderr, "%s: %s%s\n", cli.program, kind, text);
    pthread_mutex_unlock(&lock);
}

void die(int code, const char *format, ...)
{
    va_list ap;

    va_start(ap, format);
    cli_message_print("", format, ap);
    va_end(ap);
    exit(code);
}

void die_error(const struct error *err)
{
    die(err->code ? err->code : EX_SOFTWARE, "%s", err->text);
}

void warn(const char *format, ...)
{
    va_list ap;

    if (cli.quiet)
        return;
    va_start(ap, format);
    cli_message_print("warning: ", format, ap);
    va_end(ap);
}

void notice(const char *format, ...)
{
    va_list ap;

    if (cli.quiet)
        return;
    va_start(ap, format);
    cli_message_print("", format, ap);
    va_end(ap);
}

/* Draw it, unless that was done a moment ago. */
static void cli_bar_draw(const char *what, size_t done, size_t total,
                         const char *note)
{
    double now = cpu_seconds(), spent, left;
    char line[200], mid[60] = "";
    int n;

    if (bar.begun <= 0)
        bar.begun = now;
    spent = now - bar.begun;
    if (spent < LONG_WORK || (now - bar.drawn < REDRAW && done != total))
        return;
    bar.drawn = now;
    if (total && done) {
        int part = (int)(20 * (double)done / (double)total);

        left = spent / (double)done * (double)(total - done);
        snprintf(mid, sizeof mid, "/%zu [%-20.*s] %.0f s left", total,
                 part > 20 ? 20 : part, "####################", left);
    }
    n = snprintf(line, sizeof line, "%s %zu%s%s%s", what, done, mid,
                 note ? " " : "", note ? note : "");
    n = n > 79 ? 79 : n;
    fprintf(stderr, "\r%-*.79s", bar.width > n ? bar.width : n, line);
    bar.width = n;
}

void progress(const char *what, size_t done, size_t total, const char *note)
{
    if (cli.quiet || !isatty(STDERR_FILENO))
        return;
    pthread_mutex_lock(&lock);
    cli_bar_draw(what, done, total, note);
    pthread_mutex_unlock(&lock);
}

void progress_end(void)
{
    pthread_mutex_lock(&lock);
    cli_bar_erase();
    bar.begun = 0;
    pthread_mutex_unlock(&lock);
}
