// The Gaussians from the farthest to the nearest: a counting sort of their
// depths in 16 bits.

const BINS = 65536;

export class Order {
  constructor(count) {
    this.depth = new Float32Array(count);
    this.bin = new Uint16Array(count);
    this.start = new Uint32Array(BINS + 1);
  }

  // order (n, and unused room) of means (n,4) seen by cam (3,4).
  sort(order, n, means, cam) {
    const { depth, bin, start } = this;
    let lo = Infinity, hi = -Infinity;
    for (let i = 0; i < n; i++) {
      const d = cam[8] * means[4 * i] + cam[9] * means[4 * i + 1] +
                cam[10] * means[4 * i + 2];
      depth[i] = d;
      if (d < lo) lo = d;
      if (d > hi) hi = d;
    }
    const scale = hi > lo ? (BINS - 1) / (hi - lo) : 0;
    start.fill(0);
    for (let i = 0; i < n; i++) {
      bin[i] = (hi - depth[i]) * scale;
      start[bin[i] + 1]++;
    }
    for (let b = 0; b < BINS; b++) start[b + 1] += start[b];
    for (let i = 0; i < n; i++) order[start[bin[i]]++] = i;
  }
}
