/* Memory for what kernels walk across in large strides: zeros, in huge pages
 * where the system has them, since there are more rows and planes at once than
 * entries for small pages.  It is never part of the heap, whose small blocks
 * would then cost a huge page each time it grows. */
#ifndef SPID_BASE_PAGES_H
#define SPID_BASE_PAGES_H

#include <stddef.h>

/* `bytes` zeros aligned to 64 bytes at least, or NULL without memory. */
void *pages_alloc(size_t bytes);
/* What pages_alloc(bytes) gave; p may be NULL. */
void pages_free(void *p, size_t bytes);

#endif
