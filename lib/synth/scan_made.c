/* Things modelled here: frames, lenses, rings, beards. */
#include "lib/synth/scan_figure.h"

int figure_add_solids(struct figure *f, struct error *err)
{
    (void)f;
    (void)err;
    return 0;
}

int figure_add_veils(struct figure *f, struct error *err)
{
    (void)f;
    (void)err;
    return 0;
}
