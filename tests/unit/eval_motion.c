/* Two motion streams: landmarks from the head agree with those stored, a
 * turned head is that many degrees off, different lengths are refused. */
#include <sysexits.h>

#include "lib/lab/eval/compare.h"
#include "tests/check.h"
#include "tests/unit/train_toy.h"

/* Copy a stream's SHAP and MOTN, without lmk, turned by `degrees` in roll,
 * and without the last `less` motions. */
static void motion_eval_twist(const char *to, const char *from, double degrees,
                              int less)
{
    struct error err = {0};
    struct stream_reader *in = stream_open(from, NULL, &err);
    struct stream_writer *out = stream_create(to, &err);
    struct record rec;
    double a = degrees * 3.14159265358979 / 180;
    float turn[9] = {(float)cos(a), (float)-sin(a), 0, (float)sin(a),
                     (float)cos(a), 0, 0, 0, 1}, R[9];
    uint64_t max = 8 - (uint64_t)less;
    int n;

    while (in && out && stream_read(in, &rec, &err) > 0) {
        if (record_is(&rec, "IMAG") || rec.frame >= max)
            continue;
        if (record_is(&rec, "MOTN")) {
            mat3_mul(R, turn, record_find(&rec, "rot")->data);
            for (n = 0; n < rec.count && strcmp(rec.array[n].name, "lmk");)
                n++;
            rec.count = n;      /* lmk is the last */
            for (int i = 0; i < rec.count; i++)
                if (!strcmp(rec.array[i].name, "rot"))
                    rec.array[i].data = R;
        }
        stream_write(out, rec.type, rec.frame, rec.time, rec.array,
                     rec.count, &err);
    }
    stream_close(in);
    if (!out || stream_finish(out, &err))
        exit(1);
}

static double motion_eval_mean(const struct table *t, const char *column)
{
    for (size_t c = 0; c < t->columns; c++)
        if (!strcmp(t->column[c], column))
            return table_mean(t, 0, c);
    return NAN;
}

int main(void)
{
    char dir[] = "/tmp/eval_motion.XXXXXX", a[100], b[100], cmd[100];
    struct head h;
    struct table t;
    struct error err = {0};

    if (!mkdtemp(dir))
        return 1;
    snprintf(a, sizeof a, "%s/a.spid", dir);
    snprintf(b, sizeof b, "%s/b.spid", dir);
    toy_head(&h, 8);
    toy_stream(a, &h, 2, 4, 128);

    table_init(&t);
    motion_eval_twist(b, a, 0, 0);
    if (compare_motions(&t, table_row(&t, "x"), a, b, &h, NULL, &err))
        printf("%s\n", err.text);
    expect("akd, stored against posed landmarks", motion_eval_mean(&t, "akd"),
           0, 2e-3);
    expect("pose_deg of the same motion", motion_eval_mean(&t, "pose_deg"), 0,
           1e-4);
    expect("jaw_corr of the same motion", motion_eval_mean(&t, "jaw_corr"), 1,
           1e-9);
    table_release(&t);

    table_init(&t);
    motion_eval_twist(b, a, 7, 0);
    compare_motions(&t, table_row(&t, "x"), a, b, &h, NULL, &err);
    expect("pose_deg of a head turned by 7", motion_eval_mean(&t, "pose_deg"),
           7, 1e-3);
    expect("akd is (51 aed + 17 apd) / 68", motion_eval_mean(&t, "akd"),
           (51 * motion_eval_mean(&t, "aed") + 17 * motion_eval_mean(&t, "apd"))
               / 68,
           1e-6);
    motion_eval_twist(b, a, 0, 2);
    expect("fewer motions are refused",
           compare_motions(&t, 0, a, b, &h, NULL, &err), -1, 0);
    printf("%s\n", err.text);
    expect("as bad data", err.code, EX_DATAERR, 0);
    table_release(&t);
    head_release(&h);
    snprintf(cmd, sizeof cmd, "rm -rf %s", dir);
    return system(cmd) || check_status();
}
