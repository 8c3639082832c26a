/* Base64 (RFC 4648), for bytes inside text. */
#ifndef SPID_FORMATS_BASE64_H
#define SPID_FORMATS_BASE64_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

/* n bytes, without line breaks; the stream's own error flag tells of failed
 * writes. */
void base64_write(FILE *f, const uint8_t *p, size_t n);

#endif
