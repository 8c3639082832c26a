// What the driver has done since its neutral frame, done from where the source
// is (lib/track/relative.c).  Rows: R 9, t 3, jaw 3, lids 2, eyes 6, expression.
import { multiply } from "./rotation.js";

const MOST = 1.2, JAW_OPEN = 0.442;     // RELATIVE_MOST, ARKIT_JAW_OPEN
const T = 9, JAW = 12, LID = 15, EYE = 17, EXP = 23, NEAR = 0.01;

const share = (neutral, source, most) => Math.max(most - source, 0) / (most - neutral);
const transposed = (R) => [0, 3, 6, 1, 4, 7, 2, 5, 8].map((i) => R[i]);

function weight(x, neutral, source, most) {
  let way = x - neutral;
  if (way > 0 && source > neutral)
    way *= neutral < most ? share(neutral, source, most) : 0;
  return source + way;
}

function lid(x, neutral, source) {
  let way = x - neutral;
  if (way > 0 && neutral < 1) way *= share(neutral, source, 1);
  return Math.max(0, Math.min(1, source + way));
}

// arkit: expressions are weights from 0 to 1.
export function relative(row, neutral, source, arkit) {
  const out = Float32Array.from(row);
  out.set(multiply(multiply(row.slice(0, 9), transposed(neutral)), source.slice(0, 9)));
  const [z, zn, zs] = [row, neutral, source].map((r) => Math.max(r[T + 2], NEAR));
  const depth = zs * z / zn;
  for (let i = T; i < T + 2; i++)
    out[i] = (source[i] / zs + (row[i] / z - neutral[i] / zn) * zn / zs) * depth;
  out[T + 2] = depth;
  const open = weight(row[JAW], neutral[JAW], source[JAW], MOST * JAW_OPEN);
  out[JAW] = Math.max(open, Math.min(source[JAW], row[JAW], 0));
  for (let i = JAW + 1; i < LID; i++) out[i] = source[i] + row[i] - neutral[i];
  for (let i = LID; i < EYE; i++) out[i] = lid(row[i], neutral[i], source[i]);
  for (let i = EYE; i < EXP; i++) out[i] = source[i] + row[i] - neutral[i];
  for (let i = EXP; i < out.length; i++)
    out[i] = arkit ? weight(row[i], neutral[i], source[i], MOST)
                   : source[i] + row[i] - neutral[i];
  return out;
}
