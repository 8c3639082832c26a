/* What a picture or video that the toolkit drew says about itself: that it is
 * synthetic.  PNG holds it as text and, for programs that look for IPTC's
 * digital source type, as XMP; EXR and videos as a comment.  Y4M, PAM and streams
 * go through pipes and carry none. */
#ifndef SPID_FORMATS_MARK_H
#define SPID_FORMATS_MARK_H

/* Off for the rest of the process: --no-mark, and programs that draw upon
 * recordings.  On at start. */
void mark_off(void);
/* The sentence; NULL when marks are off. */
const char *mark_text(void);
/* The same as an XMP packet; NULL when marks are off. */
const char *mark_xmp(void);

#endif
