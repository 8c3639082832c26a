// Which square of a frame the network sees, what its translation means, and
// its pixels, as lib/base/crop.c and lib/track/track.c have them.  Squares are
// {x, y, size}: centre and side in pixels.

export const NET = 224;         // CROP_NET: pixels of what the network sees
const GROW = 1.6;               // CROP_GROW
const WINDOW = 2.2;             // CROP_WINDOW
const DETECTION_SIDE = GROW * 0.86, DETECTION_DOWN = 0.14;

export function cropFromLandmarks(points) {
  const xs = points.map((p) => p[0]), ys = points.map((p) => p[1]);
  const [l, r] = [Math.min(...xs), Math.max(...xs)];
  const [t, b] = [Math.min(...ys), Math.max(...ys)];
  return { x: (l + r) / 2, y: (t + b) / 2, size: GROW * Math.max(r - l, b - t) };
}

export const cropFromDetection = ({ x, y, size }) => ({
  x, y: y + DETECTION_DOWN * size, size: DETECTION_SIDE * size });

export function windowFromCrop({ x, y, size }) {
  const face = size / DETECTION_SIDE;
  return { x, y: y - DETECTION_DOWN * face, size: WINDOW * face };
}

// A square of the picture from inside window, whose side becomes S; and back.
export function into(q, window, S) {
  const k = S / window.size;
  return { x: (q.x - window.x) * k + S / 2, y: (q.y - window.y) * k + S / 2,
           size: q.size * k };
}

export function outOf(q, window, S) {
  const k = window.size / S;
  return { x: (q.x - S / 2) * k + window.x, y: (q.y - S / 2) * k + window.y,
           size: q.size * k };
}

// The network's translation, relative to its crop, in the window of S pixels.
export function translation(t, crop, S, focal) {
  const z = S / crop.size * t[2];
  return [t[0] + (crop.x - S / 2) * z / focal,
          t[1] + (crop.y - S / 2) * z / focal, z];
}

// RGBA (w,h) at half its size.
function halve({ data, width, height }) {
  const w = width >> 1, h = height >> 1, out = new Uint8ClampedArray(4 * w * h);
  for (let y = 0; y < h; y++)
    for (let x = 0, p = 8 * y * width, o = 4 * y * w; x < w; x++, p += 8, o += 4)
      for (let c = 0; c < 3; c++)
        out[o + c] = (data[p + c] + data[p + c + 4] + data[p + c + 4 * width] +
                      data[p + c + 4 * width + 4] + 2) >> 2;
  return { data: out, width: w, height: h };
}

// Where outputs of n samples over q lie among `size` pixels: the lower index
// (-1: black) and the weight of the next.
function places(centre, side, n, size) {
  return Array.from({ length: n }, (_, i) => {
    const p = centre + ((i + 0.5) / n - 0.5) * side - 0.5, lower = Math.floor(p);
    return lower >= -1 && lower < size ? [lower, p - lower] : [-2, 0];
  });
}

// (224,224,3) floats of 0 to 1: square q of a frame {width, height,
// pixels(x, y, w, h)}, bilinear, black outside; halved first while it has more
// than two pixels for one of these.
export function cut(frame, q) {
  const clamp = (v, most) => Math.max(0, Math.min(most, Math.floor(v)));
  const half = q.size / 2 + 4;
  const x0 = clamp(q.x - half, frame.width) & ~1, y0 = clamp(q.y - half, frame.height) & ~1;
  const x1 = clamp(q.x + half + 1, frame.width), y1 = clamp(q.y + half + 1, frame.height);
  const out = new Float32Array(3 * NET * NET);
  if (x1 <= x0 || y1 <= y0) return out;
  let part = frame.pixels(x0, y0, x1 - x0, y1 - y0);
  let { size } = q, x = q.x - x0, y = q.y - y0;
  for (; size > 2 * NET && part.width > 1 && part.height > 1;
       size /= 2, x /= 2, y /= 2) part = halve(part);
  const { data, width, height } = part;
  const across = places(x, size, NET, width), down = places(y, size, NET, height);
  for (let i = 0, o = 0; i < NET; i++) {
    const [v, wy] = down[i];
    for (let j = 0; j < NET; j++, o += 3) {
      const [u, wx] = across[j];
      for (let k = 0; k < 4; k++) {
        const px = u + (k & 1), py = v + (k >> 1);
        if (px < 0 || py < 0 || px >= width || py >= height) continue;
        const w = (k & 1 ? wx : 1 - wx) * (k & 2 ? wy : 1 - wy) / 255;
        const p = 4 * (py * width + px);
        out[o] += w * data[p];
        out[o + 1] += w * data[p + 1];
        out[o + 2] += w * data[p + 2];
      }
    }
  }
  return out;
}
