/* The mark's words. */
#include "formats/mark.h"

#include <stdbool.h>
#include <stddef.h>

static bool off;

void mark_off(void)
{
    off = true;
}

const char *mark_text(void)
{
    return off ? NULL : "Synthetic: drawn by the SpiD toolkit " SPID_VERSION
                        ", not a recording.";
}

const char *mark_xmp(void)
{
    static const char packet[] =
        "<x:xmpmeta xmlns:x=\"adobe:ns:meta/\"><rdf:RDF xmlns:rdf="
        "\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\"><rdf:Description "
        "xmlns:Iptc4xmpExt=\"http://iptc.org/std/Iptc4xmpExt/2008-02-29/\" "
        "Iptc4xmpExt:DigitalSourceType=\"http://cv.iptc.org/newscodes/"
        "digitalsourcetype/trainedAlgorithmicMedia\"/></rdf:RDF>"
        "</x:xmpmeta>";

    return off ? NULL : packet;
}
