/* The table that spid-eval prints. */
#ifndef SPID_CMD_LAB_EVAL_OUTPUT_H
#define SPID_CMD_LAB_EVAL_OUTPUT_H

#include <stdbool.h>

#include "lib/lab/eval/compare.h"
#include "lib/lab/eval/table.h"

struct eval_output {
    enum table_format format;
    bool summary;               /* of a model, in JSON */
    unsigned protocols;         /* explained below the table */
    const struct compare_nets *nets;    /* the paper's columns without weights
                                         * are named below, too; NULL: not */
};

/* To -o, complete or not at all; ends the program where it cannot. */
void eval_output_write(const struct table *t, const struct eval_output *o);

#endif
