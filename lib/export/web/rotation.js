// Rotations as nine numbers, row by row; cameras as [R|t], twelve.

export const multiply = (a, b) => {
  const out = new Float64Array(9);
  for (let i = 0; i < 3; i++)
    for (let j = 0; j < 3; j++)
      out[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] +
                       a[3 * i + 2] * b[6 + j];
  return out;
};

// Rodrigues' formula for axis times angle.
export function fromAxis(x, y, z) {
  const angle = Math.hypot(x, y, z), s = angle < 1e-8 ? 1 : Math.sin(angle) / angle;
  const c = angle < 1e-8 ? 0.5 : (1 - Math.cos(angle)) / (angle * angle);
  return [
    1 - c * (y * y + z * z), c * x * y - s * z, c * x * z + s * y,
    c * x * y + s * z, 1 - c * (x * x + z * z), c * y * z - s * x,
    c * x * z - s * y, c * y * z + s * x, 1 - c * (x * x + y * y),
  ];
}

// Yaw, pitch, roll in radians: diag(1,-1,-1) R = Rz(roll) Rx(pitch) Ry(yaw),
// as spid-eval measures them.
export function toAngles(R) {
  return [
    Math.atan2(R[6], -R[8]),
    Math.asin(Math.max(-1, Math.min(1, -R[7]))),
    Math.atan2(-R[1], -R[4]),
  ];
}

export function fromAngles(yaw, pitch, roll) {
  const q = multiply(fromAxis(0, 0, roll),
                     multiply(fromAxis(pitch, 0, 0), fromAxis(0, yaw, 0)));
  return q.map((v, i) => i < 3 ? v : -v);
}

// R between two, for slow motion: the mean of the rows made a rotation again.
export function mix(a, b, t) {
  const m = a.map((v, i) => v + t * (b[i] - v));
  const row = (i) => m.slice(3 * i, 3 * i + 3);
  const unit = (v) => v.map((x) => x / Math.hypot(...v));
  const x = unit(row(0)), d = row(1).reduce((s, v, i) => s + v * x[i], 0);
  const y = unit(row(1).map((v, i) => v - d * x[i]));
  return [...x, ...y, x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2],
          x[0] * y[1] - x[1] * y[0]];
}

// The camera [R|t] seen through another rigid motion [Q|s] of camera space.
export function through(view, cam) {
  const out = new Float64Array(12);
  for (let i = 0; i < 3; i++) {
    for (let j = 0; j < 4; j++)
      for (let k = 0; k < 3; k++) out[4 * i + j] += view[4 * i + k] * cam[4 * k + j];
    out[4 * i + 3] += view[4 * i + 3];
  }
  return out;
}
