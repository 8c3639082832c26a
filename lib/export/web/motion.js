// The drive: a frame's numbers, and what the sliders put in their place.
//
// Values of a frame: 0-2 yaw, pitch, roll in degrees, 3-5 t, 6-8 jaw, 9-10
// lids, 11-16 eyes, then the expression.
import { fromAngles, mix, toAngles } from "./rotation.js";

export const YAW = 0, SHIFT = 3, JAW = 6, LID = 9, EYE = 11, EXP = 17;
const RECORD = 23;              // PAGE_POSE in lib/export/page.h
const DEGREES = 180 / Math.PI;

export class Motion {
  // numbers (frames, 23 + expressions) at times (frames); overrides: a Map
  // from value to number.
  constructor(numbers, times, width) {
    this.numbers = numbers;
    this.width = width;
    this.frames = numbers.length / width;
    this.times = times;
    this.overrides = new Map();
    this.live = null;           // a row that takes the drive's place
    const steps = Array.from(times).slice(1).map((t, i) => t - times[i]);
    this.step = steps.sort((a, b) => a - b)[steps.length >> 1] ?? 1 / 25;
    this.length = this.frames ? times[this.frames - 1] - times[0] + this.step : 0;
  }

  // Seconds from the start of the drive to frame i.
  time(i) { return this.times[i] - this.times[0]; }

  // The frame that shows at t seconds.
  frame(t) {
    let lo = 0, hi = this.frames - 1;
    while (lo < hi) {
      const mid = (lo + hi + 1) >> 1;
      if (this.time(mid) <= t + 1e-6) lo = mid; else hi = mid - 1;
    }
    return lo;
  }

  row(i) {
    return Array.from(this.numbers.subarray(i * this.width, (i + 1) * this.width));
  }

  // The drive's own numbers at t, between frames when smooth.
  raw(t, smooth) {
    if (this.live) return Array.from(this.live);
    const i = this.frame(t), a = this.row(i);
    if (!smooth || i + 1 >= this.frames) return a;
    const b = this.row(i + 1), gap = this.time(i + 1) - this.time(i);
    const s = Math.max(0, Math.min(1, (t - this.time(i)) / gap));
    const R = mix(a.slice(0, 9), b.slice(0, 9), s);
    return [...R, ...a.slice(9).map((x, k) => x + s * (b[9 + k] - x))];
  }

  // cam (3,4), pose for the head, and the values that the sliders show.
  at(t, smooth = false) {
    const raw = this.raw(t, smooth), set = this.overrides;
    const values = [...toAngles(raw).map((a) => a * DEGREES), ...raw.slice(9)];
    for (const [k, v] of set) values[k] = v;
    const turned = [0, 1, 2].some((k) => set.has(YAW + k));
    const R = turned ? fromAngles(...values.slice(0, 3).map((a) => a / DEGREES))
                     : raw.slice(0, 9);
    const cam = Float32Array.from([0, 1, 2].flatMap((i) =>
      [R[3 * i], R[3 * i + 1], R[3 * i + 2], values[SHIFT + i]]));
    return { values, cam, pose: {
      jaw: values.slice(JAW, JAW + 3), lid: values.slice(LID, LID + 2),
      eye: values.slice(EYE, EYE + 6), exp: values.slice(EXP) } };
  }
}
