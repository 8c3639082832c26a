/* The library in another program: a person turns its head and smiles.
 *
 *   cc embed.c -o embed $(pkg-config --cflags --libs spid)
 *   ./embed me.jpg > turn.pam          # PAM pictures, one after another
 *
 * ffmpeg -f pam_pipe reads them; spid(3) explains the calls. */
#include <spid.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define FRAMES 25

/* m, turned about the head's vertical axis. */
static void turn(struct spid_motion *m, const struct spid_motion *from,
                 float angle)
{
    const float c = cosf(angle), s = sinf(angle);

    *m = *from;
    for (int i = 0; i < 3; i++) {       /* R Ry(angle) */
        const float *r = from->rotation + 3 * i;

        m->rotation[3 * i] = c * r[0] - s * r[2];
        m->rotation[3 * i + 2] = s * r[0] + c * r[2];
    }
}

int main(int argc, char **argv)
{
    const struct spid_options opt = {.model = getenv("SPID_MODEL")};
    struct spid_motion rest, m;
    char error[500];

    if (argc != 2) {
        fprintf(stderr, "usage: embed PICTURE > PAM\n");
        return 64;
    }
    struct spid *s = spid_open(argv[1], &opt, error, sizeof error);
    if (!s) {
        fprintf(stderr, "embed: %s\n", error);
        return 1;
    }
    const size_t size = spid_size(s);
    unsigned char *rgba = malloc(4 * size * size);
    spid_motion(&rest, s);
    for (int i = 0; rgba && i < FRAMES; i++) {
        const float wave = sinf(6.2831853f * (float)i / FRAMES);

        turn(&m, &rest, 0.35f * wave);
        m.expression[45] = m.expression[46] = fabsf(wave);  /* mouthSmile */
        if (spid_drive(s, &m) || spid_draw(s, rgba)) {
            fprintf(stderr, "embed: %s\n", spid_error(s));
            return 1;
        }
        printf("P7\nWIDTH %zu\nHEIGHT %zu\nDEPTH 4\nMAXVAL 255\n"
               "TUPLTYPE RGB_ALPHA\nENDHDR\n", size, size);
        fwrite(rgba, 4 * size, size, stdout);
    }
    free(rgba);
    spid_close(s);
    return fflush(stdout) || ferror(stdout);
}
