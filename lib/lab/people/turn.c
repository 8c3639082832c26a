/* A list of turns, by strtod. */
#include "lib/lab/people/turn.h"

#include <math.h>
#include <stdlib.h>
#include <sysexits.h>

#define TURN_MAX 90.0          /* degrees */

/* One angle into radians; *at moves past it. */
static int turn_parse_angle(float *angle, const char **at, struct error *err)
{
    char *end;
    const double degrees = strtod(*at, &end);

    if (end == *at || !(fabs(degrees) <= TURN_MAX))
        return error_set(err, EX_USAGE, "'%s' is no angle (expected -%g to %g "
                         "degrees)", *at, TURN_MAX, TURN_MAX);
    *angle = (float)(degrees * acos(-1) / 180);
    *at = end;
    return 0;
}

int synth_turns_parse(struct synth_turn *each, size_t *n, size_t room,
                      const char *text, struct error *err)
{
    const char *at = text;

    for (*n = 0; *n < room; at++) {
        struct synth_turn *t = &each[(*n)++];
        float *const next[] = {&t->pitch, &t->roll};

        *t = (struct synth_turn){0};
        if (turn_parse_angle(&t->yaw, &at, err))
            return -1;
        for (int i = 0; i < 2 && *at == ':'; i++) {
            at++;
            if (turn_parse_angle(next[i], &at, err))
                return -1;
        }
        if (!*at)
            return 0;
        if (*at != ',')
            break;
    }
    return error_set(err, EX_USAGE, "'%s' is no list of turns (expected up to "
                     "%zu of YAW[:PITCH[:ROLL]], commas between)", text, room);
}
