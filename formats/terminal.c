/* Pictures as half blocks: the upper half in the letter's colour, the lower in
 * the background's. */
#include "formats/terminal.h"

#include <stdlib.h>
#include <sys/ioctl.h>

#define HALF_BLOCK "\xe2\x96\x80"       /* U+2580 */

/* A number of the environment from 1 on, or what stands for it. */
static int terminal_number(const char *name, int otherwise)
{
    const char *text = getenv(name);
    int n = text ? atoi(text) : 0;

    return n > 0 && n < 10000 ? n : otherwise;
}

void terminal_size(FILE *fp, int *columns, int *lines)
{
    struct winsize w;

    *columns = terminal_number("COLUMNS", 80);
    *lines = terminal_number("LINES", 24);
    if (ioctl(fileno(fp), TIOCGWINSZ, &w) == 0 && w.ws_col && w.ws_row) {
        *columns = w.ws_col;
        *lines = w.ws_row;
    }
}

/* The mean of the part of the picture that cell (i,j) of n by m covers. */
static void terminal_mean(int out[3], const uint8_t *rgb, size_t width,
                          size_t height, int i, int j, int n, int m)
{
    size_t x0 = width * (size_t)i / (size_t)n;
    size_t x1 = width * (size_t)(i + 1) / (size_t)n;
    size_t y0 = height * (size_t)j / (size_t)m;
    size_t y1 = height * (size_t)(j + 1) / (size_t)m, sum[3] = {0}, count;

    x1 += x1 == x0;
    y1 += y1 == y0;
    for (size_t y = y0; y < y1; y++)
        for (size_t x = x0; x < x1; x++)
            for (int c = 0; c < 3; c++)
                sum[c] += rgb[3 * (y * width + x) + (size_t)c];
    count = (x1 - x0) * (y1 - y0);
    for (int c = 0; c < 3; c++)
        out[c] = (int)((sum[c] + count / 2) / count);
}

int terminal_draw(FILE *fp, const uint8_t *rgb, size_t width, size_t height,
                  int columns, int lines)
{
    /* square pixels: a line is two of them high */
    double across = columns, down = 2.0 * (lines > 1 ? lines - 1 : 1);
    double scale = across / (double)width < down / (double)height
                       ? across / (double)width : down / (double)height;
    int n = (int)(scale * (double)width), m = (int)(scale * (double)height);

    n = n < 1 ? 1 : n;
    m = m < 2 ? 2 : m / 2 * 2;
    fputs("\x1b[?25l\x1b[H", fp);
    for (int j = 0; j < m; j += 2) {
        for (int i = 0; i < n; i++) {
            int a[3], b[3];

            terminal_mean(a, rgb, width, height, i, j, n, m);
            terminal_mean(b, rgb, width, height, i, j + 1, n, m);
            fprintf(fp, "\x1b[38;2;%d;%d;%dm\x1b[48;2;%d;%d;%dm" HALF_BLOCK,
                    a[0], a[1], a[2], b[0], b[1], b[2]);
        }
        fputs("\x1b[0m\n", fp);
    }
    return fflush(fp) || ferror(fp) ? -1 : 0;
}

int terminal_end(FILE *fp)
{
    fputs("\x1b[0m\x1b[?25h", fp);
    return fflush(fp) || ferror(fp) ? -1 : 0;
}
