/* Means, failures and the four ways to write a table. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "lib/lab/eval/table.h"
#include "tests/check.h"

static void expect_text(const struct table *t, enum table_format f,
                        const char *part)
{
    char text[4000] = "";
    FILE *m = fmemopen(text, sizeof text - 1, "w");

    table_write(m, t, f);
    fclose(m);
    printf("%s", text);
    check_that(part, strstr(text, part) != NULL);
}

int main(void)
{
    struct table t;
    enum table_format f;
    size_t a, b, psnr, l1;

    table_init(&t);
    psnr = table_column(&t, "psnr", 1);
    l1 = table_column(&t, "l1_x", -1);
    a = table_row(&t, "one \"way\"");
    b = table_row(&t, "other_way");
    check_that("the same name is the same column",
               table_column(&t, "psnr", 1) == psnr);
    check_that("the same name is the same row",
               table_row(&t, "other_way") == b);
    table_add(&t, a, psnr, 20);
    table_add(&t, a, psnr, 30);
    table_add(&t, a, psnr, INFINITY);
    table_add(&t, b, psnr, 24);
    table_add(&t, b, l1, 0.03);
    check_that("mean over what was measured", table_mean(&t, a, psnr) == 25);
    check_that("failures are counted apart", t.row[a].cell[psnr].failed == 1);
    check_that("nothing measured is NaN", isnan(table_mean(&t, a, l1)));
    check_that("no such cell is NaN", isnan(table_mean(&t, 9, 9)));
    check_that("unknown format", table_format_parse(&f, "xml") == -1);
    expect_text(&t, TABLE_TSV, "one \"way\"\t25\t-\t2\t1\n");
    expect_text(&t, TABLE_JSON, "\"one \\\"way\\\"\":\t{\n\t\t\"psnr\":\t25,\n"
                                "\t\t\"l1_x\":\tnull,\n\t\t\"frames\":\t2,\n"
                                "\t\t\"failed\":\t1\n\t}");
    expect_text(&t, TABLE_LATEX, "\\textbf{25.00} & --");
    expect_text(&t, TABLE_LATEX, "l1\\_x$\\downarrow$");
    expect_text(&t, TABLE_TEXT, "24.00");
    table_release(&t);
    return check_status();
}
