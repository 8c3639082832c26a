// From frames to motion, as lib/track/track.c does it: E_m on a crop that
// follows the projected head; a detector for the start and after a loss.
import { NET, cropFromDetection, cropFromLandmarks, into, outOf, translation,
         windowFromCrop } from "./crop.js";
import { OneEuro } from "./oneeuro.js";

const SIZE = 512, FOCAL = 12 * SIZE / 2;
const FIRST_PASSES = 4, SURE_ENOUGH = 0.35, JUMP = 0.5, GROWTH = 1.6;
const BEHIND = -0.2, VISIBLE = 0.4, DEPTH_SCALE = 10, NEAR = 0.01;
const FLAT_DEVIATION = 0.01, CUT_CORRELATION = 0.3, THUMB = 28;
// Where each head lies in E_m's row (enum motion_out), and the filter's beta.
const ROT = 0, TRANS = 6, EXP = 9, JAW = 109, LID = 112, EYE = 114, OUT = 120;
const SPEED = [[TRANS, 2], [EXP, 4], [JAW, 0.7], [LID, 1.5], [EYE, 6], [OUT, 2]];
const BETA = Array.from({ length: OUT }, (_, i) => SPEED.find(([end]) => i < end)[1]);

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const unit = (a) => a.map((v) => v / Math.hypot(...a));

// A rotation of two rows, always (motion_code_rotation).
function rotation(six) {
  let a = six.slice(0, 3).map((v) => Number.isFinite(v) ? v : 0);
  let b = six.slice(3, 6).map((v) => Number.isFinite(v) ? v : 0);
  if (Math.hypot(...a) < 1e-6) a = [1, 0, 0];
  const n1 = Math.hypot(...a), n2 = Math.hypot(...b), d = dot(a, b) / n1;
  if (n2 < 1e-6 || n2 * n2 - d * d < 1e-8 * n2 * n2)
    b = Math.abs(a[1]) < 0.8 * n1 ? [0, -1, 0] : [0, 0, 1];
  const x = unit(a), along = dot(x, b), y = unit(b.map((v, i) => v - along * x[i]));
  return [...x, ...y, x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2],
          x[0] * y[1] - x[1] * y[0]];
}

const decode = (code, crop) => ({
  R: rotation(code.slice(ROT, TRANS)),
  t: translation(code.slice(TRANS, EXP), crop, SIZE, FOCAL),
  exp: code.slice(EXP, JAW), jaw: code.slice(JAW, LID),
  lid: code.slice(LID, EYE), eye: code.slice(EYE, OUT) });

// Mean-free grey picture of a crop, unit length, and its deviation before.
function thumbnail(rgb) {
  const cell = NET / THUMB, out = new Float32Array(THUMB * THUMB);
  for (let y = 0; y < THUMB; y++)
    for (let x = 0; x < THUMB; x++) {
      let sum = 0;
      for (let i = 0; i < cell; i += 2) {
        const p = 3 * ((y * cell + i) * NET + x * cell);
        for (let k = 0; k < 3 * cell; k++) sum += rgb[p + k];
      }
      out[y * THUMB + x] = sum / (3 * cell * cell / 2);
    }
  const mean = out.reduce((s, v) => s + v, 0) / out.length;
  const square = out.reduce((s, v) => s + (v - mean) ** 2, 0);
  const scale = square > 0 ? 1 / Math.sqrt(square) : 0;
  return { picture: out.map((v) => (v - mean) * scale),
           deviation: Math.sqrt(square / out.length) };
}

const alike = (a, b) => a.picture.reduce((s, v, i) => s + v * b.picture[i], 0);

// encode(frame, square): {code, sure, rgb} of the frame's square; detect(frame):
// the largest face's square, or null; head, corner, bary: whose landmarks are
// followed (lib/export/page_live.h).
export class Follower {
  constructor({ head, corner, bary, encode, detect, smooth }) {
    Object.assign(this, { head, corner, bary, encode, detect });
    this.filter = new OneEuro(smooth);
    this.window = null;         // of the picture, once there was a face
    this.lostFrames = 0;
  }

  get lost() { return this.lostFrames > 0; }

  nextCrop({ R, t, ...pose }) {
    const verts = this.head.pose(pose), points = [];
    for (let l = 0; l < this.corner.length; l += 3) {
      const p = [0, 0, 0];
      for (let k = 0; k < 3; k++)
        for (let c = 0; c < 3; c++)
          p[c] += this.bary[l + k] * verts[3 * this.corner[l + k] + c];
      const [x, y, z] = [0, 1, 2].map((r) => dot(R.slice(3 * r, 3 * r + 3), p) + t[r]);
      const w = FOCAL / Math.max(z, NEAR);
      points.push([SIZE / 2 + w * x, SIZE / 2 + w * y]);
    }
    return cropFromLandmarks(points);
  }

  async look(frame, crop) {
    const { code, ...rest } = await this.encode(frame, outOf(crop, this.window, SIZE));
    return { motion: decode(code, crop), ...rest };
  }

  // Of the next crop, how much lies in the picture.
  visible(crop, frame) {
    const q = outOf(crop, this.window, SIZE), h = q.size / 2;
    const w = Math.min(q.x + h, frame.width) - Math.max(q.x - h, 0);
    const v = Math.min(q.y + h, frame.height) - Math.max(q.y - h, 0);
    return w > 0 && v > 0 ? w * v / (q.size * q.size) : 0;
  }

  // "", or why this cannot be the head that was at `used`.
  implausible(motion, next, used, frame) {
    if (![next.x, next.y, next.size].every(Number.isFinite) || !(motion.t[2] > 1))
      return "no sensible position";
    if (Math.hypot(next.x - used.x, next.y - used.y) > JUMP * used.size)
      return "it jumped";
    if (next.size > GROWTH * used.size || next.size < used.size / GROWTH)
      return "its size jumped";
    if (-motion.R[8] < BEHIND) return "it turned away";
    return this.visible(next, frame) < VISIBLE ? "it left the picture" : "";
  }

  // E_m on a first guess until its own projection agrees.
  async settle(frame, guess) {
    let crop = guess, found;
    for (let i = 0; i < FIRST_PASSES; i++) {
      found = await this.look(frame, crop);
      const next = this.nextCrop(found.motion);
      if (this.implausible(found.motion, next, guess, frame) ||
          Math.hypot(next.x - crop.x, next.y - crop.y) +
          Math.abs(next.size - crop.size) < 0.01 * crop.size) break;
      crop = next;
    }
    if (found.sure < SURE_ENOUGH) return null;
    this.crop = crop;
    this.thumb = thumbnail(found.rgb);
    return found.motion;
  }

  async search(frame, time, why) {
    const first = !this.window;
    const face = this.lostFrames < 3 || this.lostFrames % 6 === 0
      ? await this.detect(frame) : null;
    let motion = null;
    if (face) {
      const crop = cropFromDetection(face);
      if (first) this.window = windowFromCrop(crop);
      const q = into(crop, this.window, SIZE);
      if (q.x > 0 && q.y > 0 && q.x < SIZE && q.y < SIZE && q.size > SIZE / 32)
        motion = await this.settle(frame, q);
      if (first && !motion) this.window = null;
    }
    if (!motion) {
      this.lostFrames++;
      return { lost: true, why };
    }
    if (this.lost) this.filter.reset();
    this.lostFrames = 0;
    return { row: this.smooth(motion, time) };
  }

  // The window is to be found anew: another camera.
  restart() {
    this.window = null;
    this.lostFrames = 0;
    this.filter.reset();
  }

  // One motion, or {lost, why}.
  async step(frame, time) {
    if (!this.window || this.lost) return this.search(frame, time, "no face is seen");
    const { motion, sure, rgb } = await this.look(frame, this.crop);
    const next = this.nextCrop(motion), thumb = thumbnail(rgb);
    let why = this.implausible(motion, next, this.crop, frame);
    if (thumb.deviation < FLAT_DEVIATION) why = "the picture is blank there";
    else if (alike(thumb, this.thumb) < CUT_CORRELATION) why = "the scene changed";
    else if (!why && sure < SURE_ENOUGH) why = "no whole, upright face is seen";
    if (why) return this.search(frame, time, why);
    this.thumb = thumb;
    this.crop = next;
    return { row: this.smooth(motion, time) };
  }

  // A row of the drive's numbers (PAGE_POSE + expression), smoothed as one row
  // in E_m's order.
  smooth({ R, t, exp, jaw, lid, eye }, time) {
    const x = this.filter.step([...R.slice(0, 6), t[0], t[1], t[2] / DEPTH_SCALE, ...exp,
                                ...jaw, ...lid, ...eye], BETA, time);
    return [...rotation(x.slice(ROT, TRANS)), x[TRANS], x[TRANS + 1],
            x[TRANS + 2] * DEPTH_SCALE, ...x.slice(JAW, LID), ...x.slice(LID, EYE),
            ...x.slice(EYE, OUT), ...x.slice(EXP, JAW)];
  }
}
