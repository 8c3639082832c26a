// The head posed, as lib/head/lbs.c does it: blendshapes, pose correctives,
// linear blend skinning with five joints, lids.
import { fromAxis, multiply } from "./rotation.js";

const JOINTS = 5;

// A direction's vertices that move, so that a brow costs what a brow is.
function sparse(planes, row, n) {
  const index = [], value = [];
  for (let i = 0; i < n; i++)
    if (planes[row * n + i] !== 0) {
      index.push(i);
      value.push(planes[row * n + i]);
    }
  return { index: Uint32Array.from(index), value: Float32Array.from(value) };
}

function sparseRows(planes, rows, n) {
  return Array.from({ length: rows }, (_, r) => sparse(planes, r, n));
}

function addTo(out, direction, weight) {
  const { index, value } = direction;
  if (weight === 0) return;
  for (let i = 0; i < index.length; i++) out[index[i]] += weight * value[i];
}

export class Head {
  // a: the archive's arrays of these names.
  constructor(a) {
    const n = a.shaped.length;
    this.shaped = a.shaped;
    this.vertices = n / 3;
    this.expressions = sparseRows(a.expDirs, a.expDirs.length / n, n);
    this.correctives = sparseRows(a.poseDirs, a.poseDirs.length / n, n);
    this.lids = sparseRows(a.lids, 2, n);
    this.weights = a.weights;
    this.joints = a.joints;
    this.jointExp = a.jointExp;
    this.parents = a.parents;
    this.lipInner = a.lipInner;
    this.chinVertices = a.chinVertices;
    this.rest = new Float32Array(n);
    this.verts = new Float32Array(n);
  }

  // Skinning matrices (5,12) of rotations about the joints.
  chain(R, exp) {
    const J = Float64Array.from(this.joints);
    for (let k = 0; k < this.expressions.length; k++)
      if (exp[k] !== 0)
        for (let i = 0; i < 15; i++) J[i] += exp[k] * this.jointExp[15 * k + i];
    const turn = [], at = [], A = new Float32Array(12 * JOINTS);
    for (let j = 0; j < JOINTS; j++) {
      const p = this.parents[j], own = J.subarray(3 * j, 3 * j + 3);
      turn[j] = p < 0 ? R[j] : multiply(turn[p], R[j]);
      at[j] = p < 0 ? own : own.map((_, i) => at[p][i] +
        [0, 1, 2].reduce((s, k) => s + turn[p][3 * i + k] *
                                       (J[3 * j + k] - J[3 * p + k]), 0));
      for (let i = 0; i < 3; i++) {
        let t = at[j][i];
        for (let k = 0; k < 3; k++) {
          A[12 * j + 4 * i + k] = turn[j][3 * i + k];
          t -= turn[j][3 * i + k] * own[k];
        }
        A[12 * j + 4 * i + 3] = t;
      }
    }
    return A;
  }

  // verts (V,3) of jaw (3), eyes (6), lids (2) and expression.
  pose({ jaw, eye, lid, exp }) {
    const { rest, verts, vertices: V } = this;
    const still = [1, 0, 0, 0, 1, 0, 0, 0, 1];
    const R = [still, still, fromAxis(...jaw), fromAxis(...eye.slice(0, 3)),
               fromAxis(...eye.slice(3))];
    rest.set(this.shaped);
    this.expressions.forEach((d, k) => addTo(rest, d, exp[k]));
    for (let k = 0; k < this.correctives.length; k++)
      addTo(rest, this.correctives[k],
            R[1 + Math.floor(k / 9)][k % 9] - (k % 9 % 4 === 0 ? 1 : 0));
    const A = this.chain(R, exp), W = this.weights;
    const M = new Float32Array(12);
    for (let v = 0; v < V; v++) {
      M.fill(0);
      for (let j = 0; j < JOINTS; j++) {
        const w = W[j * V + v];
        if (w !== 0) for (let i = 0; i < 12; i++) M[i] += w * A[12 * j + i];
      }
      const x = rest[3 * v], y = rest[3 * v + 1], z = rest[3 * v + 2];
      for (let i = 0; i < 3; i++)
        verts[3 * v + i] = M[4 * i] * x + M[4 * i + 1] * y + M[4 * i + 2] * z +
                           M[4 * i + 3];
    }
    addTo(verts, this.lids[0], lid[0]);
    addTo(verts, this.lids[1], lid[1]);
    return verts;
  }

  // Centroids of the inner lips and the chin, and the lips' opening away from
  // the corners (head_mouth in lib/head/measure.c).
  mouth() {
    const points = (list) => Array.from(list, (v) => this.verts.subarray(3 * v, 3 * v + 3));
    const mean = (x) => x.reduce((s, v) => s + v, 0) / (x.length || 1);
    const centroid = (p) => [0, 1, 2].map((c) => mean(p.map((v) => v[c])));
    const ring = points(this.lipInner), lip = centroid(ring);
    const chin = centroid(points(this.chinVertices));
    const across = ring.map((v) => v[0]);
    const half = 0.25 * (Math.max(...across) - Math.min(...across));
    const heights = ring.filter((v) => Math.abs(v[0] - lip[0]) <= half)
      .map((v) => v[1] - lip[1]);
    return { lip, chin, gap: mean(heights.filter((y) => y > 0)) -
                       mean(heights.filter((y) => !(y > 0))) };
  }
}
