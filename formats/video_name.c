/* What a name or the first bytes say of a video (video.h): the program asks,
 * and so do the modules. */
#include <string.h>

#include "formats/video.h"
#include "lib/base/file.h"

bool video_is_camera(const char *path)
{
    return strncmp(path, "camera:", 7) == 0 ||
           strncmp(path, "/dev/video", 10) == 0;
}

bool video_is_live(const char *path)
{
    return video_is_camera(path) || strstr(path, "://");
}

bool video_is_webp(const uint8_t *begin, size_t n)
{
    return n >= 21 && !memcmp(begin, "RIFF", 4) &&
           !memcmp(begin + 8, "WEBPVP8X", 8) && (begin[20] & 2);
}

/* Whether the name ends as one of the endings, up to NULL. */
static bool video_ends(const char *path, const char *const *ending)
{
    while (*ending && !file_ends(path, *ending))
        ending++;
    return *ending;
}

bool video_has_alpha(const char *path)
{
    static const char *const ending[] = {".webm", ".mkv", ".mov", ".gif",
                                         ".webp", ".apng", ".png", NULL};

    return video_ends(path, ending);
}

bool video_has_sound(const char *path)
{
    static const char *const ending[] = {".mp4", ".m4v", ".mov", ".mkv",
                                         ".webm", ".avi", NULL};

    return video_ends(path, ending);
}
