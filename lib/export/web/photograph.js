// The photograph as texture, as lib/photo does it: the person cut out in
// several sizes, and the affine view from a picture to the photograph.
import {
  DataTexture, NearestFilter, RGBAFormat, UnsignedByteType,
} from "three";

const FOCAL = 12, NEAR = 0.01, STEEPEST = 0.35, LEVELS = 4;
const NECK = [0.1, 0.03];       // PLACE_NECK_TOP and _BOTTOM of lib/photo/place.c

// person = rgb - (1 - matte) back, no more than the matte allows.
function cut(rgb, matte, back) {
  const out = new Uint8Array(4 * matte.length);
  for (let i = 0; i < matte.length; i++) {
    const m = matte[i];
    for (let c = 0; c < 3; c++) {
      const hidden = Math.trunc(((255 - m) * back[3 * i + c] + 127) / 255);
      out[4 * i + c] = Math.max(0, Math.min(m, rgb[3 * i + c] - hidden));
    }
    out[4 * i + 3] = m;
  }
  return out;
}

// Means of two by two pixels of a picture `width` wide.
function halve(pixels, width) {
  const s = width >> 1, out = new Uint8Array(4 * s * s);
  for (let y = 0; y < s; y++)
    for (let x = 0; x < 4 * s; x++) {
      const p = 8 * y * width + 2 * (x & ~3) + (x & 3);
      out[4 * s * y + x] = (pixels[p] + pixels[p + 4] + pixels[p + 4 * width] +
                            pixels[p + 4 * width + 4] + 2) >> 2;
    }
  return out;
}

export function pictureTexture(pixels, size) {
  const t = new DataTexture(pixels, size, size, RGBAFormat, UnsignedByteType);
  t.minFilter = t.magFilter = NearestFilter;
  t.needsUpdate = true;
  return t;
}

// Three channels as four, the fourth 255.
export function opaque(rgb) {
  const out = new Uint8Array(rgb.length / 3 * 4).fill(255);
  for (let i = 0; i < rgb.length / 3; i++)
    out.set(rgb.subarray(3 * i, 3 * i + 3), 4 * i);
  return out;
}

// Textures of the person, each half as large as the one before.
export function personLevels(rgb, matte, back) {
  let size = Math.sqrt(matte.length), pixels = cut(rgb, matte, back);
  const levels = [];
  while (levels.length < LEVELS && size >= 2) {
    levels.push(pictureTexture(pixels, size));
    if (size < 4) break;
    pixels = halve(pixels, size);
    size >>= 1;
  }
  return levels;
}

// A (2,2) and b (2): place_map of lib/photo/place.c.
function placeMap(source, cam) {
  const P = [0, 1, 2, 3].map((e) => [0, 1, 2].reduce((s, k) =>
    s + cam[4 * (e >> 1) + k] * source[4 * (e & 1) + k], 0));
  const origin = (c) => [3, 7].map((i) => FOCAL * c[i] / Math.max(c[11], NEAR));
  const scale = Math.max(cam[11], NEAR) / Math.max(source[11], NEAR);
  const inv = scale / Math.max(P[0] * P[3] - P[1] * P[2], STEEPEST);
  const A = [P[3] * inv, -P[1] * inv, -P[2] * inv, P[0] * inv];
  const from = origin(source), to = origin(cam);
  return [...A, from[0] - A[0] * to[0] - A[1] * to[1],
          from[1] - A[2] * to[0] - A[3] * to[1]];
}

// place_view_make of lib/photo/place.c: A (2,2), b (2), toward (2),
// and of the shoulders, which body (3,4) moves about pivot (3), shouldersA,
// shouldersB and neck (3).
export function placeView(source, cam, body, pivot) {
  const toward = [0, 1].map((i) => -[0, 1, 2].reduce((s, k) =>
    s + source[4 * i + k] * cam[8 + k], 0));
  const seen = cam.map((c, e) => [0, 1, 2].reduce((s, k) =>
    s + cam[(e & ~3) + k] * body[4 * k + (e & 3)], (e & 3) === 3 ? c : 0));
  const head = placeMap(source, cam), map = placeMap(source, seen);
  const shoulders = map.map((m, i) => m - head[i]);
  const [top, bottom] = NECK.map((up) => {
    const x = [pivot[0], pivot[1] + up, pivot[2]];
    const p = [0, 4, 8].map((r) =>
      [0, 1, 2].reduce((s, k) => s + source[r + k] * x[k], source[r + 3]));
    return [0, 1].map((k) => FOCAL * p[k] / Math.max(p[2], NEAR));
  });
  const down = [0, 1].map((k) => bottom[k] - top[k]);
  const least = (NECK[0] - NECK[1]) * FOCAL / (2 * Math.max(source[11], NEAR));
  const square = Math.max(down[0] ** 2 + down[1] ** 2, least ** 2);
  const along = (x, y) => (down[0] * x + down[1] * y) / square;
  return { A: head.slice(0, 4), b: head.slice(4), toward,
           shouldersA: shoulders.slice(0, 4), shouldersB: shoulders.slice(4),
           neck: [along(map[0], map[2]), along(map[1], map[3]),
                  along(map[4] - top[0], map[5] - top[1])] };
}

// The level whose pixels are no smaller than three quarters of the picture's.
export function pickLevel(levels, A, size) {
  let step = Math.sqrt(Math.abs(A[0] * A[3] - A[1] * A[2])) *
             levels[0].image.width / size, l = 0;
  for (; l + 1 < levels.length && step > 1.6; l++) step *= 0.5;
  return levels[l];
}
