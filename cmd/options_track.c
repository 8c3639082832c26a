/* What programs that follow a face say of it. */
#include "cmd/options.h"

#include "lib/track/driver.h"
#include "lib/track/source.h"

void option_faces_tell(const char *name, const struct track_faces *faces,
                       const char *option)
{
    char at[TRACK_FACES * 40] = "";
    size_t n = 0;

    if (faces->n < 2)
        return;
    for (size_t i = 0; i < faces->n; i++)
        n += (size_t)snprintf(at + n, sizeof at - n, "%s%zu at %.0f,%.0f,%.0f",
                              i ? ", " : "", i + 1, faces->crop[i].x,
                              faces->crop[i].y, faces->crop[i].size);
    notice("%s: %zu faces (%s): number %zu is taken (--%s N takes another)",
           name, faces->n, at, faces->chosen + 1, option);
}

void option_source_tell(const char *name, const struct source_notes *n)
{
    option_faces_tell(name, &n->faces, "face");
    if (n->damaged)
        warn("%s: the picture is damaged or cut short: what is missing is grey",
             name);
    if (n->rotated)
        warn("%s: the face lay on its side or upside down: turned by %d "
             "degrees clockwise", name, 90 * n->rotated);
    if (n->outside)
        warn("%s: the picture's edge cuts the face (%zu of %d landmarks lie "
             "beyond it): what is missing is made up", name, n->outside,
             HEAD_LANDMARKS);
    if (n->how == SOURCE_HEAD)
        warn("%s: the matte is by the head's outline and the colours alone "
             "(--mask FILE gives a better one)", name);
}

void option_damage_tell(const char *name, const struct framesource *in)
{
    if (framesource_damaged(in))
        warn("%s: %zu picture%s damaged or cut short: what is missing is grey",
             name, framesource_damaged(in), plural(framesource_damaged(in)));
}

void option_driver_tell(const char *name, const struct driver *d,
                        const char *option)
{
    if (d->track)
        option_faces_tell(name, &d->track->faces, option);
    if (d->early_count)
        warn("%s: no face in the first %zu frame%s: the motion of frame %zu is "
             "taken", name, d->early_count, plural(d->early_count),
             d->early_count);
}

void option_track_tell(const char *name, uint64_t frame,
                       const struct track_result *r)
{
    const unsigned long long n = frame;

    if (r->event == TRACK_LOST)
        warn("%s: frame %llu: face lost (%s); holding the last motion", name,
             n, r->why);
    else if (r->event == TRACK_FOUND)
        warn("%s: frame %llu: face found again", name, n);
    else if (r->event == TRACK_CUT)
        warn("%s: frame %llu: another scene: its face is taken to be the same "
             "person's", name, n);
}
