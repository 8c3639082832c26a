/* spid report: a run's folder as one HTML page.
 *
 * A run is a folder; every file in it is optional and a missing one is named
 * on the page:
 *   source.png                      the source photograph
 *   driver.*  avatar.*  star.*      clips (mp4, y4m, ...): what drove, the
 *                                   result, the result without refiner
 *   dynamic.* static.* mouth.*      the branches apart
 *   motion.spid                     MOTN records of the driver
 *   result.spid                     the same measured on the result
 *   truth.spid                      the same of the truth
 *   me.spid or avatar.spid          the source's own MOTN
 *   stats.tsv                       times of --stats
 *   metrics.json                    spid-eval's figures */
#ifndef SPID_LAB_REPORT_REPORT_H
#define SPID_LAB_REPORT_REPORT_H

#include <stdio.h>

#include "lib/base/error.h"

#define REPORT_FRAMES 6        /* pictures of each clip on the page */

/* Contact sheet of the run's clips as a PNG: a row for each clip that is there
 * (source, driver, star, avatar, dynamic, static, mouth), REPORT_FRAMES cells
 * of REPORT_CELL pixels, over black. */
#define REPORT_CELL 192
/* Of the run in dir.  EX_NOINPUT when none of its clips is there. */
int report_sheet(const char *path, const char *dir, struct error *err);

/* Write the page of the run in folder dir to f.  card: the model's card, for
 * its limits, or NULL.  -1 when dir is no folder or a file in it is damaged
 * (*err names it). */
int report_write(FILE *f, const char *dir, const char *card,
                 struct error *err);

#endif
