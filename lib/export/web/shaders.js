// The three programs of the graphics card: Gaussians to blended colours, places
// and gains, those and the photograph to the picture, the mesh as lines.

// Where the view takes a place of the picture, and the way and the cosine to the
// frame's camera (splat_place_at and splat_place_side of lib/splat/types.h).
const viewed = `
uniform vec2 toward;
vec3 side() {
  float square = dot(toward, toward);
  return vec3(square > 0.0 ? toward * inversesqrt(square) : vec2(0.0),
              max(sqrt(max(1.0 - square, 0.0)), 0.35));
}
uniform vec4 placeA, shouldersA;
uniform vec2 placeB, shouldersB;
uniform vec3 neck;
vec2 viewed(vec2 n) {
  float share = clamp(dot(neck, vec3(n, 1.0)), 0.0, 1.0);
  return vec2(dot(placeA.xy, n), dot(placeA.zw, n)) + placeB +
         share * (vec2(dot(shouldersA.xy, n), dot(shouldersA.zw, n)) +
                  shouldersB);
}`;

// A Gaussian's way to the screen, as lib/splat/reference.c has it; WIDTH
// texels in a row of a table.
export const gaussianVertex = `
precision highp float;
precision highp int;
uniform highp sampler2D means, table, normals, arounds;
uniform highp usampler2D order;
uniform vec4 cam[3];
uniform vec2 size;
uniform float focal;
uniform ivec3 branches;
uniform vec3 light, photoLight;
${viewed}
out vec2 spread;
flat out vec4 paint;
flat out vec4 place;
flat out float gain;

/* gaussian_more, gaussian_visible, gaussian_halved and gaussian_light of
 * lib/base/gaussians.h. */
float more(vec2 tilt) { return 1.0 + dot(tilt, toward); }
float visible(float more) {
  return clamp(min((1.0 / max(more, 1.0) - 0.4) / (0.75 - 0.4),
                   (more - 0.05) / (0.3 - 0.05)), 0.0, 1.0);
}
float halved(float more) {
  return 8.0 / (1.0 / 0.4 - 1.0 / 0.75) * max(more - 1.0 / 0.75, 0.0);
}
uniform bool grained;
/* splat_place_unrolled of lib/splat/types.h. */
float unrolled(vec3 normal, float facing) {
  vec2 n = vec2(dot(cam[0].xyz, normal), -dot(cam[2].xyz, normal));
  return dot(n, n) > 0.0 ? 1.0 - facing / max(normalize(n).y, 0.35) : 0.0;
}
float lit(vec3 normal, vec3 l) { return max(1.0 + dot(normal, l), 0.4); }

void main() {
  int nth = gl_VertexID >> 2;
  vec2 corner = vec2(float(gl_VertexID & 1), float(gl_VertexID >> 1 & 1)) * 2.0 - 1.0;
  int i = int(texelFetch(order, ivec2(nth % WIDTH, nth / WIDTH), 0).x);
  vec4 mean = texelFetch(means, ivec2(i % WIDTH, i / WIDTH), 0);
  vec3 m = mean.xyz;
  ivec2 at = ivec2(4 * (i % (WIDTH / 4)), i / (WIDTH / 4));
  vec4 t0 = texelFetch(table, at, 0);
  vec4 t1 = texelFetch(table, at + ivec2(1, 0), 0);
  vec4 t2 = texelFetch(table, at + ivec2(2, 0), 0);
  vec3 p = vec3(dot(cam[0].xyz, m) + cam[0].w, dot(cam[1].xyz, m) + cam[1].w,
                dot(cam[2].xyz, m) + cam[2].w);
  vec4 t3 = texelFetch(table, at + ivec2(3, 0), 0);
  float opacity = t1.z, surface = more(t3.zw);
  if (int(t2.w) == 1 && t1.w > 0.0)
    opacity *= exp2(-halved(surface));
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  if (p.z <= 0.01 || opacity < 1.0 / 255.0 || branches[int(t2.w)] == 0)
    return;
  mat3 sigma = mat3(t0.x, t0.y, t0.z, t0.y, t0.w, t1.x, t0.z, t1.x, t1.y);
  vec2 lim = 0.65 * size / focal;
  vec2 u = clamp(p.xy / p.z, -lim, lim);
  vec3 wx = focal / p.z * (cam[0].xyz - u.x * cam[2].xyz);
  vec3 wy = focal / p.z * (cam[1].xyz - u.y * cam[2].xyz);
  vec3 sx = sigma * wx, sy = sigma * wy;
  float xx = dot(wx, sx) + 0.3, xy = dot(wx, sy), yy = dot(wy, sy) + 0.3;

  /* the ellipse's axes, and how far out alpha is still 1/255 */
  float mid = 0.5 * (xx + yy), d = length(vec2(0.5 * (xx - yy), xy));
  float l1 = mid + d, l2 = max(mid - d, 0.25);
  vec2 axis = xx >= yy ? vec2(l1 - yy, xy) : vec2(xy, l1 - xx);
  axis = d > 1e-6 * mid ? normalize(axis) : vec2(1.0, 0.0);
  float reach = sqrt(2.0 * log(255.0 * opacity));
  spread = reach * corner;
  vec2 pixel = focal * p.xy / p.z + 0.5 * size +
               spread.x * sqrt(l1) * axis +
               spread.y * sqrt(l2) * vec2(-axis.y, axis.x);
  gl_Position = vec4(2.0 * pixel / size - 1.0, 0.0, 1.0);
  gl_Position.y = -gl_Position.y;
  paint = vec4(t2.xyz, opacity);
#ifdef PLACES
  vec2 n = 12.0 * p.xy / p.z;
  float sure = t1.w * mean.w * visible(surface);
  vec3 e = side();
  vec2 view = viewed(n);
  float shorter = (surface - 1.0) / max(e.z + surface - 1.0, 0.35);
  place = sure * vec4(2.0 * t3.xy - 1.0 - view +
                      shorter * dot(e.xy, view) * e.xy, 1.0, shorter);
  vec3 normal = texelFetch(normals, ivec2(i % WIDTH, i / WIDTH), 0).xyz;
  vec2 around = 2.0 * texelFetch(arounds, ivec2(i % WIDTH, i / WIDTH), 0).xy - 1.0;
  if (grained && around.x > -3.0) {
    shorter = unrolled(normal, e.z);
    place += max(1.0 - 8.0 * sure, 0.0) / 4096.0 *
             vec4(around - view + shorter * dot(e.xy, view) * e.xy, 1.0, shorter);
  }
  gain = sqrt(lit(normal, light) / lit(normal, photoLight));
#endif
}`;

export const gaussianFragment = `
precision highp float;
in vec2 spread;
flat in vec4 paint;
flat in vec4 place;
flat in float gain;
layout(location = 0) out vec4 color;
#ifdef PLACES
layout(location = 1) out vec4 where;
layout(location = 2) out vec4 gained;
#endif

void main() {
  float alpha = paint.a * exp(-0.5 * dot(spread, spread));
  if (alpha < 1.0 / 255.0) discard;
  alpha = min(alpha, 0.99);
  color = vec4(alpha * paint.rgb, alpha);
#ifdef PLACES
  where = vec4(alpha * place.xyz, alpha);
  gained = vec4(alpha * gain, alpha, alpha * place.w, alpha);
#endif
}`;

export const screenVertex = `
in vec3 position;
void main() { gl_Position = vec4(position.xy, 0.0, 1.0); }`;

// Colours over the background, the photograph where places are sure
// (lib/photo/texture.c), in its light now (lib/splat/relight.c).  span: pixels of
// the portrait window.
export const pictureFragment = `
precision highp float;
uniform highp sampler2D colors, wheres, gains, person, grain, backdrop;
uniform vec2 size;
uniform float span;
uniform vec3 background, beyond, tint;
uniform bool photo, scenery, original;
${viewed}
out vec4 color;

const float LEAST = 0.004;         /* as in lib/photo/lookup.h, */
const float GRAIN = 1.0 / 4096.0;  /* SPLAT_PLACE_GRAIN of lib/splat/types.h */
/* texture_turn times TEXTURE_SOLID: this, too, */
float solid(vec2 n, float alpha) {
  return (1.0 - clamp(dot(neck, vec3(n, 1.0)) - 1.0, 0.0, 1.0)) *
         min(length(toward) / 0.35, 1.0) * clamp(10.0 * alpha - 9.0, 0.0, 1.0);
}
/* TEXTURE_GRAIN, as much as TEXTURE_GRAIN_NO_MORE allows: this, too, */
float grained(float share) {
  return clamp(min(5.0 * share / GRAIN - 4.0, 5.0 - 10.0 / 3.0 * share / GRAIN),
               0.0, 1.0);
}
float cover() { return 1.4 / max(length(toward), 1e-3); }   /* this, too */

/* Keys's weights, as in lib/photo/lookup_tmpl.c. */
vec4 weights(float t) {
  float t2 = t * t, t3 = t2 * t;
  return vec4(-0.75 * t3 + 1.5 * t2 - 0.75 * t, 1.25 * t3 - 2.25 * t2 + 1.0,
              -1.25 * t3 + 1.5 * t2 + 0.75 * t, 0.75 * t3 - 0.75 * t2);
}

vec4 bicubic(sampler2D t, vec2 uv) {
  ivec2 last = textureSize(t, 0) - 1;
  vec2 at = clamp(uv, vec2(-2.0), vec2(last) + 3.0) - 0.5, from = floor(at);
  vec4 wx = weights(at.x - from.x), wy = weights(at.y - from.y);
  vec4 sum = vec4(0.0);
  for (int j = 0; j < 4; j++)
    for (int i = 0; i < 4; i++)
      sum += wx[i] * wy[j] *
             texelFetch(t, clamp(ivec2(from) + ivec2(i, j) - 1, ivec2(0),
                                 last), 0);
  return clamp(sum, 0.0, 1.0);
}

/* The source's own picture, and its mean colour, dimmed, beyond its edges. */
vec3 behind(vec2 n) {
  vec2 size = vec2(textureSize(backdrop, 0));
  vec3 inside = bicubic(backdrop, (0.5 * n + 0.5) * size).rgb;
  float past = max(abs(n.x), abs(n.y)) - 1.0;
  return mix(inside, beyond, clamp(1.0 + past / 0.06, 0.0, 1.0));
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec2 down = vec2(gl_FragCoord.x, size.y - gl_FragCoord.y);
  vec2 n = (down - 0.5 * size) * 2.0 / span;
  bool within = all(lessThanEqual(abs(n), vec2(1.0)));
  if (original) {
    vec2 uv = (0.5 * n + 0.5) * vec2(textureSize(backdrop, 0));
    color = vec4(within ? bicubic(backdrop, uv).rgb : background, 1.0);
    return;
  }
  vec4 own = texelFetch(colors, at, 0);
  if (photo) {
    vec3 p = texelFetch(wheres, at, 0).xyz;
    vec2 gain = textureLod(gains, gl_FragCoord.xy / size, 3.0).xy + LEAST;
    if (p.z > 0.1 * GRAIN) {
      float share = p.z / max(own.a, LEAST);
      float sure = p.z > LEAST ? clamp(1.6 * share - 0.2, 0.0, 1.0) *
                                 min(cover() * own.a, 1.0) : 0.0;
      vec2 e = side().xy, view = viewed(n);
      float shorter = texelFetch(gains, at, 0).z;
      vec2 uv = view + (p.xy - shorter * dot(e, view) * e) / p.z + 1.0;
      vec4 seen = bicubic(person, 0.5 * uv * vec2(textureSize(person, 0)));
      sure *= 1.0 - (1.0 - seen.a) * solid(n, own.a);
      own = mix(own, seen, sure);
      vec2 around = 0.5 * uv;
      if (sure == 0.0 && clamp(around, 0.0, 1.0) == around)
        own.rgb *= mix(1.0, texture(grain, around).r * 255.0 / 128.0,
                       grained(share));
    }
    own.rgb = min(gain.x / gain.y * tint * own.rgb, own.a);
  }
  vec3 back = scenery ? behind(n) : background;
  color = vec4(clamp(own.rgb, 0.0, 1.0) + (1.0 - own.a) * back, 1.0);
}`;

export const meshVertex = `
precision highp float;
uniform vec4 cam[3];
uniform vec2 size;
uniform float focal, nearer;
in vec3 position;
void main() {
  vec3 p = vec3(dot(cam[0].xyz, position) + cam[0].w,
                dot(cam[1].xyz, position) + cam[1].w,
                dot(cam[2].xyz, position) + cam[2].w);
  vec2 pixel = 2.0 * focal * p.xy / (max(p.z, 0.01) * size);
  gl_Position = vec4(pixel.x, -pixel.y, 1.0 - 2.0 / (1.0 + 0.1 * p.z) - nearer,
                     1.0);
  if (p.z <= 0.01) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
}`;

export const meshFragment = `
precision highp float;
uniform vec4 paint;
out vec4 color;
void main() { color = paint; }`;
