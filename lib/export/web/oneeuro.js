// The one-euro filter (Casiez et al. 2012), as lib/track/oneeuro.c has it: a
// low-pass whose cut-off rises with speed.
const SPEED_CUTOFF = 1;         // Hz, of the derivative

const weight = (cutoff, dt) => {
  const r = 2 * Math.PI * cutoff * dt;
  return r / (r + 1);
};

export class OneEuro {
  // cutoff: Hz at rest; 0: samples are left as they are.
  constructor(cutoff) {
    this.cutoff = cutoff;
    this.reset();
  }

  reset() { this.x = null; }

  // x smoothed, sampled at time seconds; beta: Hz that the cut-off of each
  // rises by per unit of speed.
  step(x, beta, time) {
    if (this.cutoff <= 0) return x;
    const dt = Math.max(time - this.time, 1e-6), { x: was, dx } = this;
    this.time = time;
    if (!was) {
      this.x = x.slice();
      this.dx = x.map(() => 0);
      return x;
    }
    const a = weight(SPEED_CUTOFF, dt);
    this.x = x.map((v, i) => {
      dx[i] = a * (v - was[i]) / dt + (1 - a) * dx[i];
      const b = weight(this.cutoff + beta[i] * Math.abs(dx[i]), dt);
      return b * v + (1 - b) * was[i];
    });
    return this.x.slice();
  }
}
