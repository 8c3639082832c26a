// Where the Gaussians are in a frame, as lib/base/drive.c says: on the mesh,
// blended at the neck with the shoulders, or moved with the lips.

const UPRIGHT = [1, 0, 0, 0, -1, 0, 0, 0, -1];
const CLOSED = 0.0025;          // BAKED_CLOSED in lib/avatar/baked.h
const STAY = 0.1;               // NECK_BLEND_STAY in lib/base/neck_blend.h

// The way back to where the source's camera saw the shoulders (neck_blend_stay
// in lib/base/neck_blend.c).
function stay(pivot, source, cam) {
  if (!source) return [0, 0, 0];
  const d = [0, 4, 8].map((r) => {
    let sum = source[r + 3] - cam[r + 3];
    for (let j = 0; j < 3; j++) sum += (source[r + j] - cam[r + j]) * pivot[j];
    return sum;
  });
  const far = Math.max(Math.hypot(...d) / STAY, 1e-6);
  const share = Math.tanh(far) / far;
  return [0, 1, 2].map((i) => share * (cam[i] * d[0] + cam[4 + i] * d[1] +
                                       cam[8 + i] * d[2]));
}

// [M | p - M p + stay] with M = R^T from (lib/base/neck_blend.c).
export function body(pivot, from, cam, source) {
  const back = stay(pivot, source, cam);
  const out = new Float32Array(12);
  for (let i = 0; i < 3; i++) {
    out[4 * i + 3] = pivot[i] + back[i];
    for (let j = 0; j < 3; j++) {
      const m = cam[i] * from[j] + cam[4 + i] * from[3 + j] +
                cam[8 + i] * from[6 + j];
      out[4 * i + j] = m;
      out[4 * i + 3] -= m * pivot[j];
    }
  }
  return out;
}

// to[at..] = x + w (B x - x).
function blend(to, at, B, w, x, y, z) {
  to[at] = x + w * (B[0] * x + B[1] * y + B[2] * z + B[3] - x);
  to[at + 1] = y + w * (B[4] * x + B[5] * y + B[6] * z + B[7] - y);
  to[at + 2] = z + w * (B[8] * x + B[9] * y + B[10] * z + B[11] - z);
}

export class Drive {
  // a: rides (dynamic,2), mean planes (3, others), bend (N), counts, pivot,
  // shoulders, lip; view (12), the source's camera, where it is known; with
  // jaw planes (3, mouth) chin; reach (any,5), number, home and reach of
  // Gaussians that the photograph shows only near home.
  constructor(a) {
    Object.assign(this, a);
    [this.dynamic, this.fixed, this.mouth] = a.counts;
    this.count = this.dynamic + this.fixed + this.mouth;
    this.meshBend = null;
  }

  // Neck weights of the mesh's vertices: those of the Gaussians on them, and
  // where there is none of the neighbours'.
  bendOfMesh(vertices, faces) {
    const bend = new Float32Array(vertices).fill(-1);
    for (let i = 0; i < this.dynamic; i++)
      if (this.rides[2 * i] === this.rides[2 * i + 1])
        bend[this.rides[2 * i]] = this.bend[i];
    for (let open = true, turn = 0; open && turn < 50; turn++) {
      open = false;
      for (let f = 0; f < faces.length; f++) {
        const next = faces[f % 3 === 2 ? f - 2 : f + 1];
        if (bend[faces[f]] < 0 && bend[next] >= 0) bend[faces[f]] = bend[next];
        open ||= bend[faces[f]] < 0;
      }
    }
    this.meshBend = bend.map((w) => Math.max(w, 0));
  }

  // The posed mesh, its shoulders where the Gaussians' are.
  mesh(out, verts, cam) {
    const B = body(this.pivot, UPRIGHT, cam, this.view);
    for (let v = 0; v < this.meshBend.length; v++)
      blend(out, 3 * v, B, this.meshBend[v], verts[3 * v], verts[3 * v + 1],
            verts[3 * v + 2]);
  }

  // The mouth's: with the lips, or with the jaw (drive_mouth in
  // lib/base/drive.c).
  mouthMeans(out, n, mouth) {
    const { jaw, mean, fixed, dynamic, mouth: m } = this;
    const from = jaw ? this.chin : this.lip;
    const d = [0, 1, 2].map((c) => (jaw ? mouth.chin : mouth.lip)[c] - from[c]);
    for (let i = 0; i < m; i++) {
      const [s, a, b] = jaw ? [jaw[i], jaw[m + i], jaw[2 * m + i]] : [1, 1, 0];
      const at = 4 * (dynamic + fixed + i), j = fixed + i;
      out[at] = mean[j] + s * d[0];
      out[at + 1] = mean[n + j] + b * d[2] + a * d[1];
      out[at + 2] = mean[2 * n + j] + a * d[2] - b * d[1];
    }
  }

  // What is left of seen, as gaussian_seen in lib/base/gaussians.h.
  seen(out) {
    const { reach } = this;
    for (let i = 3; i < out.length; i += 4) out[i] = 1;
    for (let k = 0; k < (reach?.length ?? 0); k += 5) {
      const at = 4 * reach[k];
      const up = out[at + 1] - reach[k + 2], most = reach[k + 4];
      const way = Math.hypot(out[at] - reach[k + 1],
                             most < 0 ? Math.min(up, 0) : up,
                             out[at + 2] - reach[k + 3]);
      const t = Math.min(Math.max(1.5 * (1 - way / Math.abs(most)), 0), 1);
      out[at + 3] = t * t * (3 - 2 * t);
    }
  }

  // means (count,4) of the posed head, and what is left of seen; returns whether
  // the mouth shows.
  means(out, verts, mouth, cam) {
    const { rides, bend, dynamic, fixed, mean } = this;
    const n = fixed + this.mouth;
    let B = body(this.pivot, UPRIGHT, cam, this.view);
    for (let i = 0; i < dynamic; i++) {
      const a = 3 * rides[2 * i], b = 3 * rides[2 * i + 1];
      blend(out, 4 * i, B, bend[i], 0.5 * (verts[a] + verts[b]),
            0.5 * (verts[a + 1] + verts[b + 1]),
            0.5 * (verts[a + 2] + verts[b + 2]));
    }
    B = body(this.pivot, this.shoulders, cam, this.view);
    for (let i = 0; i < fixed; i++)
      blend(out, 4 * (dynamic + i), B, bend[dynamic + i], mean[i], mean[n + i],
            mean[2 * n + i]);
    this.mouthMeans(out, n, mouth);
    this.seen(out);
    return mouth.gap >= CLOSED;
  }
}
