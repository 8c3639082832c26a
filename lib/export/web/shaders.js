// The three programs of the graphics card: Gaussians to blended colours and
// places, those and the photograph to the picture, the mesh as lines.

// A Gaussian's way to the screen, as lib/splat/reference.c has it; WIDTH
// texels in a row of a table.
export const gaussianVertex = `
precision highp float;
precision highp int;
uniform highp sampler2D means, table;
uniform highp usampler2D order;
uniform vec4 cam[3];
uniform vec2 size;
uniform float focal;
uniform ivec3 branches;
uniform vec4 placeA;
uniform vec2 placeB;
out vec2 spread;
flat out vec4 paint;
flat out vec3 place;

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
  float opacity = t1.z;
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
  vec4 t3 = texelFetch(table, at + ivec2(3, 0), 0);
  vec2 n = 12.0 * p.xy / p.z;
  float seen = t1.w * mean.w;
  place = vec3(seen * (2.0 * t3.xy - 1.0 - placeB -
                       vec2(dot(placeA.xy, n), dot(placeA.zw, n))), seen);
#endif
}`;

export const gaussianFragment = `
precision highp float;
in vec2 spread;
flat in vec4 paint;
flat in vec3 place;
layout(location = 0) out vec4 color;
#ifdef PLACES
layout(location = 1) out vec4 where;
#endif

void main() {
  float alpha = paint.a * exp(-0.5 * dot(spread, spread));
  if (alpha < 1.0 / 255.0) discard;
  alpha = min(alpha, 0.99);
  color = vec4(alpha * paint.rgb, alpha);
#ifdef PLACES
  where = vec4(alpha * place, alpha);
#endif
}`;

export const screenVertex = `
in vec3 position;
void main() { gl_Position = vec4(position.xy, 0.0, 1.0); }`;

// Colours over the background, the photograph where places are sure
// (lib/photo/texture.c).  span: pixels of the portrait window.
export const pictureFragment = `
precision highp float;
uniform highp sampler2D colors, wheres, person, backdrop;
uniform vec2 size;
uniform float span;
uniform vec3 background, beyond;
uniform bool photo, scenery, original;
uniform vec4 placeA;
uniform vec2 placeB;
out vec4 color;

/* As in lib/photo/lookup.h. */
const float LEAST = 0.004, JUMP = 1.5, LEAP = 6.0, SHARP = 0.55,
            STRETCHED = 0.12, SOFT = 86.0;

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

/* How much the place's offset changes to the pixel beside it. */
float change(vec3 p, ivec2 at) {
  if (any(lessThan(at, ivec2(0))) ||
      any(greaterThanEqual(at, ivec2(size)))) return 0.0;
  vec3 q = texelFetch(wheres, at, 0).xyz;
  return q.z > LEAST ? 0.5 * span * length(q.xy / q.z - p.xy / p.z) : 0.0;
}

/* The offset's change along a line through at, per half picture; up to three
 * pixels to each side. */
vec2 slope(vec3 p, ivec2 at, ivec2 way) {
  ivec2 last = ivec2(size) - 1, a = clamp(at - 3 * way, ivec2(0), last),
        b = clamp(at + 3 * way, ivec2(0), last);
  vec3 from = texelFetch(wheres, a, 0).xyz, to = texelFetch(wheres, b, 0).xyz;
  if (!(from.z > LEAST)) { from = p; a = at; }
  if (!(to.z > LEAST)) { to = p; b = at; }
  vec2 apart = abs(vec2(b - a));
  return 0.5 * span / max(apart.x + apart.y, 1.0) *
         (to.xy / to.z - from.xy / from.z);
}

/* Less than 1 where places draw the photograph out or fold it. */
float stretch(vec3 p, ivec2 at) {
  vec2 dx = slope(p, at, ivec2(1, 0)), dy = slope(p, at, ivec2(0, -1));
  float square = dot(placeA, placeA);
  float whole = placeA.x * placeA.w - placeA.y * placeA.z;
  float zoom = 0.5 * (square - sqrt(max(square * square - 4.0 * whole * whole,
                                        0.0)));
  float area = (placeA.x + dx.x) * (placeA.w + dy.y) -
               (placeA.y + dy.x) * (placeA.z + dx.y);
  return clamp((area / max(zoom, 1e-6) - STRETCHED) / (SHARP - STRETCHED),
               0.0, 1.0);
}

float confidence(vec3 p, float alpha, ivec2 at) {
  float jump = max(max(change(p, at + ivec2(1, 0)), change(p, at - ivec2(1, 0))),
                   max(change(p, at + ivec2(0, 1)), change(p, at - ivec2(0, 1))));
  return clamp(1.6 * p.z / max(alpha, LEAST) - 0.2, 0.0, 1.0) *
         clamp((LEAP - jump) / (LEAP - JUMP), 0.0, 1.0) * stretch(p, at);
}

/* texture_inside: the least coverage about a place. */
float inside(ivec2 at) {
  ivec2 last = ivec2(size) - 1, far = ivec2(ceil(span / SOFT), 0);
  float least = 1.0;
  for (int i = 0; i < 4; i++) {
    ivec2 way = (i < 2 ? far : far.yx) * (i % 2 * 2 - 1);
    least = min(least, texelFetch(colors, clamp(at + way, ivec2(0), last),
                                  0).a);
  }
  return least;
}

/* seen's share of the picture, the more the head has turned the less: less
 * where matte or coverage is not full (texture_whole, texture_rim_at), no more
 * than twice what is drawn, and as much on an old outline (texture_cover);
 * more where the photograph shows nobody beside a head that has not turned
 * (texture_sure). */
vec4 believe(vec4 own, vec4 seen, float sure, ivec2 at) {
  float square = dot(placeA, placeA);
  float area = max(placeA.x * placeA.w - placeA.y * placeA.z, 1e-6);
  float off = sqrt(max(square / area - 2.0, 0.0));
  float turned = clamp((off - 0.022) / 0.078, 0.0, 1.0);
  float inner = clamp((off - 0.0014) / 0.0084, 0.0, 1.0);
  float least = max(clamp((off - 0.006) / 0.016, 0.0, 1.0),
                    inner * clamp((inside(at) - 0.8) / 0.15, 0.0, 1.0));
  float whole = 0.95 * (2.0 * own.a - 1.0);
  float most = 2.0 / clamp(off / 0.01, 1e-6, 1.0) * own.a;
  float rim = clamp((min(seen.a, own.a) - 0.5) / 0.45, 0.0, 1.0);
  if (seen.a < whole) sure *= 1.0 - least * (1.0 - pow(seen.a / whole, 4.0));
  sure *= 1.0 - turned * (1.0 - rim);
  sure += max(1.0 - off / 0.0014, 0.0) * max(1.0 - 255.0 * seen.a, 0.0) *
          min(3.0 * sure, 1.0) * (1.0 - sure);
  if (seen.a > most) seen *= most / seen.a;
  else if (seen.a < own.a)
    seen *= 1.0 + least * min(own.a / max(seen.a, 1e-6) - 1.0, 1.0);
  return mix(own, seen, sure);
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
    if (p.z > LEAST) {
      float sure = confidence(p, own.a, at);
      vec2 uv = vec2(dot(placeA.xy, n), dot(placeA.zw, n)) + placeB +
                p.xy / p.z + 1.0;
      if (sure > 0.0) {
        vec4 seen = bicubic(person, 0.5 * uv * vec2(textureSize(person, 0)));
        own = believe(own, seen, sure, at);
      }
    }
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
