/* Where heads shall turn to, as the command line says it. */
#ifndef SPID_LAB_PEOPLE_TURN_H
#define SPID_LAB_PEOPLE_TURN_H

#include <stddef.h>

#include "lib/base/error.h"
#include "lib/lab/people/motion.h"

/* each (room), *n of them: YAW[:PITCH[:ROLL]] in degrees, commas between.
 * -1: no such list, an angle beyond 90, or more than room. */
int synth_turns_parse(struct synth_turn *each, size_t *n, size_t room,
                      const char *text, struct error *err);

#endif
