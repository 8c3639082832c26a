/* Reading takes of Live Link Face (livelink.h), a line at a time: header,
 * timecodes, rows, and the rows that should have been there. */
#include "formats/livelink.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>

#define LINE_MAX_BYTES 65536
#define MAX_COLUMNS 512
#define DEFAULT_RATE 60.0       /* the app's timecodes, in a pipe */
#define GAP_MAX 60.0            /* seconds made up at most */
#define STEP_MIN 0.125          /* frames between interpolated ones */
#define DAY 86400.0
#define WEIGHT_MAX 10.0         /* beyond it a file means something else */

/* Meanings of a column beside channel numbers. */
enum { COLUMN_UNKNOWN = -1, COLUMN_TIMECODE = -2, COLUMN_COUNT = -3 };

/* One row as it stands in the file. */
struct livelink_row {
    double frame;               /* its timecode, in frames since midnight */
    bool face;
    float value[LIVELINK_CHANNELS];
};

struct livelink {
    FILE *file;
    bool wide, high;            /* of UTF-16, the high byte first */
    char *name;                 /* for messages */
    double rate;
    char separator;             /* of fields */
    char line[LINE_MAX_BYTES];
    size_t number;              /* of that line, from 1 */
    int column[MAX_COLUMNS], columns;
    int share[LIVELINK_CHANNELS];       /* columns that mean a channel */
    size_t repeated;
    char unknown[200];
    size_t unknowns;
    struct livelink_row next;   /* read already, due at next.frame */
    bool pending, begun;
    double first, last;         /* frames: of the first row, given out last */
    double step;                /* frames from row to row */
    float value[LIVELINK_CHANNELS];
};

/* ---- lines and fields ---------------------------------------------------- */

static int livelink_fail(const struct livelink *l, struct error *err,
                         const char *what)
{
    return error_set(err, EX_DATAERR, "%s: row %zu: %s", l->name, l->number,
                     what);
}

/* UTF-16, as Windows writes text, begins with a mark that no other text has. */
static void livelink_begin(struct livelink *l)
{
    const int c = getc_unlocked(l->file);

    l->number = 0;
    l->wide = (c == 0xff || c == 0xfe) &&
              getc_unlocked(l->file) == (c ^ 0xff ^ 0xfe);
    l->high = c == 0xfe;
    if (!l->wide)
        ungetc(c, l->file);
}

/* The next character; what is beyond ASCII in UTF-16 as a question mark. */
static int livelink_char(struct livelink *l)
{
    const int a = getc_unlocked(l->file);

    if (!l->wide || a == EOF)
        return a;
    const int b = getc_unlocked(l->file);

    if (b == EOF)
        return EOF;
    return (l->high ? a : b) ? '?' : l->high ? b : a;
}

/* The next line that is not blank, without its end.  1; 0 at the end; -1. */
static int livelink_line(struct livelink *l, struct error *err)
{
    size_t n = 0;
    int c;

    do {
        l->number++;
        for (n = 0; (c = livelink_char(l)) != EOF && c != '\n';) {
            if (c == '\0')
                return livelink_fail(l, err, "a zero byte (expected text)");
            if (n == LINE_MAX_BYTES - 1)
                return livelink_fail(l, err, "longer than 65535 bytes "
                                     "(expected a row of 63 fields)");
            l->line[n++] = (char)c;
        }
        while (n && isspace((unsigned char)l->line[n - 1]))
            n--;
    } while (n == 0 && c != EOF);
    l->line[n] = '\0';
    if (ferror(l->file))
        return error_set(err, EX_IOERR, "%s: %s", l->name, strerror(errno));
    return n > 0;
}

/* The field at *at, without blanks and quotation marks about it; *at moves on,
 * NULL after the last one. */
static char *livelink_field(const struct livelink *l, char **at)
{
    char *s = *at, *end = strchr(s, l->separator);

    if (*s == '"' && strchr(s + 1, '"'))
        end = strchr(strchr(s + 1, '"'), l->separator);
    *at = end ? end + 1 : NULL;
    if (end)
        *end = '\0';
    else
        end = s + strlen(s);
    while (end > s && (isspace((unsigned char)end[-1]) || end[-1] == '"'))
        *--end = '\0';
    while (isspace((unsigned char)*s) || *s == '"')
        s++;
    for (char *p = s; *p; p++)
        if (!isprint((unsigned char)*p))
            *p = '?';           /* fit for a message */
    return s;
}

/* How many fields the line has. */
static int livelink_fields(const struct livelink *l)
{
    int n = 1;
    bool quoted = false;

    for (const char *p = l->line; *p; p++) {
        quoted ^= *p == '"';
        n += *p == l->separator && !quoted;
    }
    return n;
}

/* A number with a decimal point or comma; *end as strtod sets it. */
static double livelink_parse(char *text, char **end)
{
    char *comma = strchr(text, ',');

    if (comma)
        *comma = '.';
    return strtod(text, end);
}

/* "HH:MM:SS:FF.fff" as frames since midnight, or "HH:MM:SS.mmm" as the same; -1:
 * it is none. */
static double livelink_timecode_parse(char *text, double rate)
{
    unsigned h, m, s;
    double f;
    int used = 0;
    char last, *end;

    if (sscanf(text, "%2u:%2u:%2u%c%n", &h, &m, &s, &last, &used) != 4 ||
        !strchr(":;.,", last) || h > 23 || m > 59 || s > 59 ||
        !isdigit((unsigned char)text[used]))
        return -1;
    if (last == '.' || last == ',')
        f = rate * livelink_parse(text + used - 1, &end);
    else
        f = livelink_parse(text + used, &end);
    if (*end || !(f < 1e4))
        return -1;
    return ((h * 60.0 + m) * 60.0 + s) * rate + f;
}

/* ---- the header --------------------------------------------------------- */

/* The channel of that name, large or small; -1: there is none. */
static int livelink_find_channel(const char *name)
{
    for (int k = 0; k < LIVELINK_CHANNELS; k++)
        if (!strcasecmp(name, livelink_channel(k)))
            return k;
    return COLUMN_UNKNOWN;
}

/* What a header's name means by its letters alone: as Apple writes it, or
 * with L or R for a side at either end, or one side of what has none. */
static int livelink_column_meaning(const char *name)
{
    static const char *const side[2] = {"left", "right"};
    char letters[41], other[50];
    int n = 0, k;

    for (; *name && n < 40; name++)
        if (isalpha((unsigned char)*name))
            letters[n++] = (char)tolower((unsigned char)*name);
    letters[n] = '\0';
    if (!strcmp(letters, "timecode"))
        return COLUMN_TIMECODE;
    if (!strcmp(letters, "blendshapecount"))
        return COLUMN_COUNT;
    k = livelink_find_channel(letters);
    for (int i = 0; i < 2 && k == COLUMN_UNKNOWN && n > 1; i++) {
        const int word = (int)strlen(side[i]);
        const bool whole = n > word && !strcmp(letters + n - word, side[i]);
        const int tail = whole ? word : letters[n - 1] == side[i][0];

        if (letters[0] == side[i][0]) {
            sprintf(other, "%s%s", side[i], letters + 1);
            k = livelink_find_channel(other);
        }
        if (k == COLUMN_UNKNOWN && tail) {
            sprintf(other, "%.*s%s", n - tail, letters, side[i]);
            k = livelink_find_channel(other);
            other[n - tail] = '\0';
            k = k == COLUMN_UNKNOWN ? livelink_find_channel(other) : k;
        }
    }
    return k;
}

/* Whether the same name stands in an earlier column. */
static bool livelink_has_name(const struct livelink *l, const char *name,
                              char *const *earlier)
{
    for (int i = 0; i < l->columns; i++)
        if (!strcasecmp(earlier[i], name))
            return true;
    return false;
}

/* Name the column among the unknown ones. */
static void livelink_keep_unknown(struct livelink *l, const char *name)
{
    size_t n = strlen(l->unknown);

    if (l->unknowns++ < 4)
        snprintf(l->unknown + n, sizeof l->unknown - n, "%s%.40s",
                 n ? ", " : "", name);
}

/* Fail for the first weight without a column. */
static int livelink_check_header(const struct livelink *l, bool timecode,
                                 struct error *err)
{
    int missing = 0, first = -1;

    if (!timecode)
        return livelink_fail(l, err, "no column Timecode (expected the "
                             "header of Live Link Face)");
    for (int k = LIVELINK_WEIGHTS - 2; k >= 0; k--)  /* without TongueOut */
        if (!l->share[k]) {
            first = k;
            missing++;
        }
    if (missing == 0)
        return 0;
    if (missing == 1)
        return error_set(err, EX_DATAERR, "%s: row %zu: no column %s",
                         l->name, l->number, livelink_channel(first));
    return error_set(err, EX_DATAERR, "%s: row %zu: no column %s, nor %d "
                     "others (expected the header of Live Link Face)",
                     l->name, l->number, livelink_channel(first),
                     missing - 1);
}

static int livelink_header(struct livelink *l, struct error *err)
{
    static const char mark[] = "\xef\xbb\xbf";      /* UTF-8's */
    char *name[MAX_COLUMNS], *at;
    bool timecode = false;
    int rc = livelink_line(l, err);

    if (rc <= 0)
        return rc ? rc : error_set(err, EX_DATAERR, "%s: empty (expected the "
                                   "header of Live Link Face)", l->name);
    at = l->line + (strncmp(l->line, mark, 3) ? 0 : 3);
    if (!strncasecmp(at, "sep=", 4)) {          /* Excel's own line */
        if (livelink_line(l, err) <= 0)
            return livelink_fail(l, err, "no header (expected that of Live "
                                 "Link Face)");
        at = l->line;
    }
    l->separator = at[strcspn(at, ",;\t")];
    while (at) {
        if (l->columns == MAX_COLUMNS)
            return livelink_fail(l, err, "more than 512 columns");
        char *const here = livelink_field(l, &at);
        const int k = livelink_column_meaning(here);

        if (k != COLUMN_UNKNOWN && livelink_has_name(l, here, name))
            return error_set(err, EX_DATAERR, "%s: row %zu: column %s twice",
                             l->name, l->number, here);
        if (k >= 0)
            l->share[k]++;
        timecode |= k == COLUMN_TIMECODE;
        if (k == COLUMN_UNKNOWN)
            livelink_keep_unknown(l, here);
        name[l->columns] = here;
        l->column[l->columns++] = k;
    }
    return livelink_check_header(l, timecode, err);
}

/* ---- the rate ----------------------------------------------------------- */

/* Frames of a second by the largest number of a frame in the file, which is
 * then at its beginning again; the default when all lie in one second. */
static double livelink_find_rate(struct livelink *l)
{
    static const double rates[] = {24, 25, 30, 48, 50, 60, 90, 100, 120};
    double max = 0, second = -1;
    bool several = false;

    while (livelink_line(l, NULL) > 0) {
        double frame, s;

        l->line[strcspn(l->line, ",;\t")] = '\0';
        frame = livelink_timecode_parse(l->line, 0);     /* within its second */
        s = livelink_timecode_parse(l->line, 1);
        if (frame < 0)
            continue;
        several |= second >= 0 && s - frame != second;
        second = s - frame;
        max = fmax(max, frame);
    }
    rewind(l->file);
    livelink_begin(l);
    for (size_t i = 0; several && i < sizeof rates / sizeof *rates; i++)
        if (max < rates[i])
            return rates[i];
    return DEFAULT_RATE;
}

/* ---- rows --------------------------------------------------------------- */

/* The number of column k. */
static int livelink_number(const struct livelink *l, float *out, int k,
                           char *text, struct error *err)
{
    const bool angle = k >= LIVELINK_WEIGHTS;
    char *end;
    double v = livelink_parse(text, &end);

    if (end == text || *end || !isfinite(v))
        return error_set(err, EX_DATAERR, "%s: row %zu: column %s: '%.40s' "
                         "is not a number (expected such as 0.25)", l->name,
                         l->number, livelink_channel(k), text);
    if (fabs(v) > (angle ? 6.2832 : WEIGHT_MAX))
        return error_set(err, EX_DATAERR, "%s: row %zu: column %s: %.40s "
                         "(expected %s)", l->name, l->number,
                         livelink_channel(k), text,
                         angle ? "radians" : "a weight, 0 to 1");
    *out += (float)v / (float)l->share[k];
    return 0;
}

/* The line's fields into *row, whose face is set by the count of shapes. */
static int livelink_row_fields(struct livelink *l, struct livelink_row *row,
                               struct error *err)
{
    int fields = livelink_fields(l);
    char *at = l->line;

    memset(row, 0, sizeof *row);
    row->frame = -1;
    row->face = fields > 2;
    if (fields != l->columns && fields != 2)
        return error_set(err, EX_DATAERR, "%s: row %zu: %d fields (expected "
                         "%d as in the header, or 2 without a face)%s",
                         l->name, l->number, fields, l->columns,
                         fields > l->columns + 20 ? "; are there decimal "
                                                    "commas?" : "");
    for (int i = 0; at && i < l->columns; i++) {
        char *text = livelink_field(l, &at);
        int k = l->column[i];

        if (k == COLUMN_TIMECODE) {
            row->frame = livelink_timecode_parse(text, l->rate);
            if (row->frame < 0)
                return error_set(err, EX_DATAERR, "%s: row %zu: column "
                                 "Timecode: '%.40s' (expected "
                                 "HH:MM:SS:FF.fff)", l->name, l->number,
                                 text);
        } else if (k == COLUMN_COUNT) {
            row->face &= strcmp(text, "0") != 0;
        } else if (k >= 0 && row->face &&
                   livelink_number(l, &row->value[k], k, text, err)) {
            return -1;
        }
    }
    if (row->frame < 0)
        return livelink_fail(l, err, "no Timecode");
    return 0;
}

/* The next row, later than the one before.  1; 0 at the end; -1. */
static int livelink_row(struct livelink *l, struct error *err)
{
    struct livelink_row *row = &l->next;
    int rc;

    for (;; l->repeated++) {
        rc = livelink_line(l, err);
        if (rc <= 0)
            return rc;
        if (livelink_row_fields(l, row, err))
            return -1;
        if (!l->begun)
            return 1;
        while (row->frame < l->last - DAY / 2 * l->rate)
            row->frame += DAY * l->rate;        /* past midnight */
        if (row->frame > l->last)
            break;
        if (row->frame < l->last)
            return livelink_fail(l, err, "its Timecode is before that of the "
                                 "row before");
    }
    if (row->frame - l->last > GAP_MAX * l->rate)
        return error_set(err, EX_DATAERR, "%s: row %zu: %.0f seconds after "
                         "the row before (expected at most %.0f)", l->name,
                         l->number, (row->frame - l->last) / l->rate,
                         GAP_MAX);
    return 1;
}

/* Is the row to come too late to be the next one?  Rows that are none made up
 * between teach the usual step, but not one so short that a gap would be
 * filled for ever. */
static bool livelink_gap(struct livelink *l)
{
    double step = l->next.frame - l->last;

    if (!l->pending && (l->step == 0 || step < 0.75 * l->step))
        l->step = fmax(step, STEP_MIN);
    return step > 1.5 * l->step;
}

int livelink_read(struct livelink *l, struct livelink_frame *f,
                  struct error *err)
{
    int rc = l->pending ? 1 : livelink_row(l, err);

    if (rc <= 0)
        return rc == 0 && !l->begun
                   ? error_set(err, EX_DATAERR, "%s: no rows after the "
                               "header", l->name) : rc;
    if (!l->begun)
        l->first = l->next.frame;
    l->pending = l->begun && livelink_gap(l);
    l->begun = true;
    l->last = l->pending ? l->last + l->step : l->next.frame;
    f->held = l->pending || !l->next.face;
    if (!f->held)
        memcpy(l->value, l->next.value, sizeof l->value);
    f->time = (l->last - l->first) / l->rate;
    f->value = l->value;
    return 1;
}

/* ---- opening and closing ------------------------------------------------ */

bool livelink_probe(const char *path)
{
    struct stat st;
    struct livelink *l = stat(path, &st) || !S_ISREG(st.st_mode)
                       ? NULL : calloc(1, sizeof *l);
    bool found = false;

    if (l && (l->file = fopen(path, "rb"))) {
        livelink_begin(l);
        for (int i = 0; i < 2 && !found && livelink_line(l, NULL) > 0; i++)
            found = strcasestr(l->line, "Timecode") &&
                    strcasestr(l->line, "JawOpen");
    }
    livelink_close(l);
    return found;
}

struct livelink *livelink_open(const char *path, double rate,
                               struct error *err)
{
    bool standard = strcmp(path, "-") == 0;
    struct livelink *l = calloc(1, sizeof *l);
    struct stat st;

    if (!l || !(l->name = strdup(standard ? "<stdin>" : path))) {
        free(l);
        return error_null(err, EX_OSERR, "%s: no memory", path);
    }
    l->file = standard ? stdin : fopen(path, "rb");
    if (!l->file || fstat(fileno(l->file), &st)) {
        error_set(err, EX_NOINPUT, "%s: %s", path, strerror(errno));
    } else if (S_ISDIR(st.st_mode)) {
        error_set(err, EX_NOINPUT, "%s: is a directory", path);
    } else {
        livelink_begin(l);
        l->rate = rate > 0 ? rate : S_ISREG(st.st_mode)
                                        ? livelink_find_rate(l)
                                        : DEFAULT_RATE;
        if (livelink_header(l, err) == 0)
            return l;
    }
    livelink_close(l);
    return NULL;
}

size_t livelink_repeated(const struct livelink *l)
{
    return l->repeated;
}

double livelink_rate(const struct livelink *l)
{
    return l->rate;
}

const char *livelink_unknown(const struct livelink *l, size_t *count)
{
    *count = l->unknowns;
    return l->unknowns ? l->unknown : NULL;
}

void livelink_close(struct livelink *l)
{
    if (!l)
        return;
    if (l->file && l->file != stdin)
        fclose(l->file);
    free(l->name);
    free(l);
}
