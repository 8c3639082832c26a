/* Light from all around as harmonics of degree 2, and the slope of what it does
 * on a face.
 *
 * A panorama is (H,2H,3), linear, its first row the zenith.  World: y up; the
 * panorama's middle column lies at -z. */
#ifndef SPID_BASE_HARMONICS_H
#define SPID_BASE_HARMONICS_H


/* A function on the sphere to second order: f(d) = a + b.d + d^T C d with C
 * symmetric and without trace (xx, yy, zz, xy, xz, yz). */
struct harmonic2 {
    float a, b[3], c[6];
};

static inline float light_luminance(const float c[3])
{
    return 0.30f * c[0] + 0.59f * c[1] + 0.11f * c[2];
}

/* World direction of the middle of a panorama's pixel (x, y). */
void panorama_direction(float d[3], int x, int y, int w, int h);
/* Of a pixel in row y of a panorama. */
float panorama_solid_angle(int y, int w, int h);

/* h += light v per steradian and steradians from d, unit. */
void harmonic2_add(struct harmonic2 *h, const float d[3], float v);
/* Irradiance over pi of a surface with unit normal n that sees all of it. */
float harmonic2_diffuse(const struct harmonic2 *h, const float n[3]);

/* slope (3), at most 1 long: of what faces the camera (camera frame: z forward),
 * a surface of normal n has nearest to 1 + slope.n times its mean luminance
 * on(ctx, n). */
void light_fit(float slope[3], float (*on)(const void *ctx, const float n[3]),
               const void *ctx);
/* The same under a panorama rgb (h,w,3) whose middle the camera faces. */
void light_of_panorama(float slope[3], const float *rgb, int w, int h);

#endif
