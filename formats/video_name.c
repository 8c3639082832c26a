/* What is live by its name (video.h): the program asks, and so does the
 * module that opens it. */
#include <string.h>

#include "formats/video.h"

bool video_is_camera(const char *path)
{
    return strncmp(path, "camera:", 7) == 0 ||
           strncmp(path, "/dev/video", 10) == 0;
}

bool video_is_live(const char *path)
{
    return video_is_camera(path) || strstr(path, "://");
}
