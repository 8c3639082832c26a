/* Takes of Live Link Face: a motion to a file and back; gaps; which way the
 * angles turn; files that are none. */
#include "formats/livelink.h"
#include "lib/track/take.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/random.h"
#include "lib/base/rotation.h"
#include "lib/head/arkit.h"
#include "tests/check.h"
#include "tests/folder.h"

#define FRAMES 50

static char path[300];

/* A motion such as a face makes; the halves of what ARKit does not split are
 * alike. */
static void take_sample(struct motion *m, struct random *r)
{
    float w[ARKIT_COUNT], v[3];

    memset(m, 0, sizeof *m);
    for (int k = 0; k < ARKIT_COUNT; k++)
        w[k] = (float)random_range(r, 0, 1);
    w[ARKIT_BROW_INNER_UP_R] = w[ARKIT_BROW_INNER_UP_L];
    w[ARKIT_CHEEK_PUFF_R] = w[ARKIT_CHEEK_PUFF_L];
    arkit_to_motion(m->exp, ARKIT_EXP, m->pose.jaw, m->pose.lid, m->pose.eye,
                    w);
    for (int i = 0; i < 6; i++)
        m->pose.eye[i] = (float)random_range(r, -0.6, 0.6);
    for (int i = 0; i < 3; i++)
        v[i] = (float)random_range(r, -1.2, 1.2);
    rotation_exp(m->R, v);
    for (int i = 3; i < 9; i++)
        m->R[i] = -m->R[i];
    m->t[2] = TAKE_DISTANCE;
    m->pose.exp = m->exp;
}

/* The largest difference of two motions' numbers. */
static double take_difference(const struct motion *a, const struct motion *b)
{
    double worst = 0;

    for (int i = 0; i < 9; i++)
        worst = fmax(worst, fabs(a->R[i] - b->R[i]));
    for (int i = 0; i < ARKIT_EXP; i++)
        worst = fmax(worst, fabs(a->exp[i] - b->exp[i]));
    for (int i = 0; i < 3; i++)
        worst = fmax(worst, fabs(a->t[i] - b->t[i]));
    for (int i = 0; i < 3; i++)
        worst = fmax(worst, fabs(a->pose.jaw[i] - b->pose.jaw[i]));
    for (int i = 0; i < 2; i++)
        worst = fmax(worst, fabs(a->pose.lid[i] - b->pose.lid[i]));
    for (int i = 0; i < 6; i++)
        worst = fmax(worst, fabs(a->pose.eye[i] - b->pose.eye[i]));
    return worst;
}

static void test_round_trip(void)
{
    static struct motion sent[FRAMES];
    struct error err = {0};
    struct livelink_writer *w = livelink_create(path, 29.97, &err);
    struct livelink *l;
    struct livelink_frame f;
    struct random r;
    double worst = 0, late = 0;
    int n = 0, held = 0;
    float value[LIVELINK_CHANNELS];

    random_init(&r, 1, "livelink_take");
    for (int i = 0; w && i < FRAMES; i++) {
        take_sample(&sent[i], &r);
        take_from_motion(value, &sent[i], ARKIT_EXP);
        livelink_write(w, i / 29.97, i == 7 ? NULL : value, &err);
    }
    if (w)
        livelink_finish(w, &err);
    l = livelink_open(path, 0, &err);
    check_error("written and opened", l, &err);
    while (l && livelink_read(l, &f, &err) > 0) {
        struct motion got;

        take_to_motion(&got, ARKIT_EXP, f.value);
        worst = fmax(worst, take_difference(&got, &sent[n == 7 ? 6 : n]));
        late = fmax(late, fabs(f.time - n / 29.97));
        held += f.held;
        n++;
    }
    check_range("frames", n, FRAMES, FRAMES);
    check_range("held: the one without a face", held, 1, 1);
    check("motion there and back", worst, 1e-3);
    check("times there and back, s", late, 1e-3);
    check_range("rate found", livelink_rate(l), 30, 30);
    livelink_close(l);
}

/* A look to the subject's right and down is the same by angles and by weights;
 * a head's yaw goes the way its eyes' does. */
static void test_ways(void)
{
    float angles[LIVELINK_CHANNELS] = {0}, weights[LIVELINK_CHANNELS] = {0};
    struct motion a, w;

    angles[LIVELINK_LEFT_EYE] = angles[LIVELINK_RIGHT_EYE] = 0.3f;
    angles[LIVELINK_LEFT_EYE + 1] = 0.2f;
    angles[LIVELINK_HEAD] = 0.3f;
    angles[LIVELINK_HEAD + 1] = 0.2f;
    weights[2] = weights[10] = 0.5f;    /* LookInLeft, LookOutRight */
    weights[1] = 0.4f;                  /* LookDownLeft */
    take_to_motion(&a, ARKIT_EXP, angles);
    take_to_motion(&w, ARKIT_EXP, weights);
    check_that("left eye to the right", a.pose.eye[1] < -0.2 &&
               w.pose.eye[1] < -0.2);
    check_that("right eye to the right", a.pose.eye[4] < -0.2 &&
               w.pose.eye[4] < -0.2);
    check_that("left eye down", a.pose.eye[0] > 0.1 && w.pose.eye[0] > 0.1);
    /* The face's direction in the picture: its third column, x right. */
    check_that("head to the subject's right: the picture's left",
               a.R[2] < -0.2);
    check_that("head down: the picture's down", a.R[5] > 0.1);
}

/* Write a file of lines that a row's numbers end; fields: how many. */
static void write_row(FILE *f, const char *timecode, int fields, double x)
{
    fprintf(f, "%s,%d", timecode, fields);
    for (int k = 0; k < fields; k++)
        fprintf(f, ",%.4f", x);
    fputs("\r\n", f);
}

static FILE *begin_file(void)
{
    FILE *f = fopen(path, "w");

    fputs("\xef\xbb\xbfTimecode,BlendShapeCount", f);
    for (int k = 0; k < LIVELINK_CHANNELS; k++)
        fprintf(f, ",%s", livelink_channel(k));
    fputs("\r\n", f);
    return f;
}

/* Steps of two frames over midnight; a row without a face; one that is
 * missing. */
static void test_gaps(void)
{
    static const struct { double time, value; bool held; } want[] = {
        {0, 0.1, false}, {2, 0.2, false}, {4, 0.2, true}, {6, 0.3, false},
        {8, 0.3, true}, {10, 0.4, false}, {12, 0.5, false}
    };
    struct error err = {0};
    struct livelink_frame f;
    struct livelink *l;
    FILE *file = begin_file();
    int n = 0, bad = 0;

    write_row(file, "23:59:59:52.5", 61, 0.1);
    write_row(file, "23:59:59:54.5", 61, 0.2);
    write_row(file, "23:59:59:56.5", 0, 0);
    write_row(file, "23:59:59:58.5", 61, 0.3);
    write_row(file, "00:00:00:02.5", 61, 0.4);
    write_row(file, "00:00:00:04.5", 61, 0.5);
    fclose(file);
    l = livelink_open(path, 0, &err);
    for (; l && livelink_read(l, &f, &err) > 0 && n < 7; n++)
        bad += fabs(f.time - want[n].time / 60) > 1e-6 ||
               fabs(f.value[0] - want[n].value) > 1e-6 ||
               f.held != want[n].held;
    check_error("gaps: opened and read", l && !err.code, &err);
    check_range("gaps: frames", n, 7, 7);
    check_range("gaps: frames that are wrong", bad, 0, 0);
    livelink_close(l);
}

/* Opening or reading ends with text. */
static void check_refused(const char *what, const char *text)
{
    struct error err = {0};
    struct livelink_frame f;
    struct livelink *l = livelink_open(path, 0, &err);

    while (l && livelink_read(l, &f, &err) > 0)
        ;
    livelink_close(l);
    printf("%-28s %s  ", what, err.text);
    check_count(err.code == EX_DATAERR && strstr(err.text, text) &&
                strstr(err.text, path) == err.text &&
                !strchr(err.text, '\n'));
}

/* The header and one row of text. */
static void write_bad(const char *header, const char *row)
{
    FILE *f = header ? fopen(path, "w") : begin_file();

    fprintf(f, "%s%s%s", header ? header : "", header && *header ? "\n" : "",
            row);
    fclose(f);
}

static void test_refused(void)
{
    char row[2000], *at;
    FILE *f;

    write_bad("", "");
    check_refused("nothing", "empty");
    write_bad(NULL, "");
    check_refused("a header alone", "no rows");
    write_bad("Timecode,BlendShapeCount,EyeBlinkLeft", "");
    check_refused("columns missing", "row 1: no column EyeLookDownLeft, nor "
                  "49 others");
    write_bad("EyeBlinkLeft,EyeBlinkLeft", "");
    check_refused("a column twice", "column EyeBlinkLeft twice");
    write_bad(NULL, "00:00:00:00.000,61,0.5\n");
    check_refused("a row cut short", "row 2: 3 fields (expected 63");
    f = begin_file();
    fputs("00:00:00:00.000,61", f);
    for (int k = 0; k < 61; k++)
        fputs(",0,25", f);
    fclose(f);
    check_refused("decimal commas", "are there decimal commas?");
    at = row + sprintf(row, "00:00:00:00.000,61,nan");
    for (int k = 1; k < 61; k++)
        at += sprintf(at, ",0.5");
    write_bad(NULL, row);
    check_refused("not a number", "row 2: column EyeBlinkLeft: 'nan'");
    memcpy(strstr(row, "nan"), "\"1\"", 3);
    strcpy(strrchr(row, ','), ",45.0");
    write_bad(NULL, row);
    check_refused("degrees", "column RightEyeRoll: 45.0 (expected radians)");
    memcpy(row, "00:00:00.00", 11);
    write_bad(NULL, row);
    check_refused("another timecode", "column Timecode: '00:00:00.00.000'");
    f = begin_file();
    write_row(f, "00:00:01:00.0", 61, 0.5);
    write_row(f, "00:00:00:59.0", 61, 0.5);
    fclose(f);
    check_refused("time that runs back", "row 3: its Timecode");
    f = begin_file();
    write_row(f, "00:00:01:00.0", 61, 0.5);
    write_row(f, "01:00:01:00.0", 61, 0.5);
    fclose(f);
    check_refused("an hour's gap", "row 3: 3600 seconds after");
    f = begin_file();
    for (int i = 0; i < 100000; i++)
        fputs("0,", f);
    fclose(f);
    check_refused("a huge line", "row 2: longer than 65535 bytes");
}

int main(void)
{
    folder_make();
    snprintf(path, sizeof path, "%s", folder_at("take.csv"));
    test_round_trip();
    test_ways();
    test_gaps();
    test_refused();
    folder_remove();
    return check_status();
}
