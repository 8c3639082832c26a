// The sliders: each shows one or more values of a frame and can hold them.
import { EXP, EYE, JAW, LID, SHIFT, YAW } from "./motion.js";

// Angles of a weight of 1, as in lib/head/arkit.h.
const JAW_OPEN = 0.442, JAW_SIDE = 0.085;
const EYE_UP = 25 * Math.PI / 180, EYE_ANY = 30 * Math.PI / 180;
const DEGREES = 180 / Math.PI;

// A slider over values `at`, which are its position times `unit`.
function slider(label, at, unit = 1, more = {}) {
  return { label, at: [at].flat(), unit, min: 0, max: 1, step: 0.01, ...more };
}

// What a joint's or a lid's name stands for; null for a shape of its own.
function rig(name) {
  const right = name.endsWith("_R") ? 1 : 0, eye = EYE + 3 * right;
  const out = right ? -1 : 1;
  const table = {
    eyeBlink: [LID + right, 1], eyeLookDown: [eye, EYE_ANY],
    eyeLookUp: [eye, -EYE_UP], eyeLookOut: [eye + 1, out * EYE_ANY],
    eyeLookIn: [eye + 1, -out * EYE_ANY], jawOpen: [JAW, JAW_OPEN],
    jawLeft: [JAW + 1, JAW_SIDE], jawRight: [JAW + 1, -JAW_SIDE],
  };
  return table[name.replace(/_[LR]$/, "")] ?? null;
}

// "mouthSmile_L" as "Smile, left".
function spoken(name) {
  const side = { L: ", left", R: ", right" }[name.match(/_([LR])$/)?.[1]] ?? "";
  const words = name.replace(/_[LR]$/, "").replace(/([A-Z])/g, " $1").toLowerCase()
    .replace(/^(brow|eye|cheek|nose|mouth|jaw) /, "");
  return words[0].toUpperCase() + words.slice(1) + side;
}

const parts = { brow: "Brows", eye: "Eyes", cheek: "Cheeks and nose",
                nose: "Cheeks and nose", mouth: "Mouth", jaw: "Jaw" };

function named(names) {
  const groups = {};
  names.forEach((name, k) => {
    const [at, unit] = rig(name) ?? [EXP + k, 1];
    const group = parts[name.match(/^[a-z]+/)[0]] ?? "Other";
    (groups[group] ??= []).push(slider(spoken(name), at, unit, { name }));
  });
  return groups;
}

// Components without names: those that move anything.
function numbered(moving) {
  const list = moving.map((k) => slider(`Component ${k + 1}`, EXP + k, 1,
    { name: `exp${k + 1}`, min: -3, max: 3 }));
  return list.length ? { Expression: list } : {};
}

// Groups of sliders, in the order of the page.
export function sliderGroups(names, moving) {
  return {
    Head: [
      slider("Yaw", YAW, 1, { name: "yaw", min: -60, max: 60, step: 0.5, suffix: "°" }),
      slider("Pitch", YAW + 1, 1, { name: "pitch", min: -45, max: 45, step: 0.5, suffix: "°" }),
      slider("Roll", YAW + 2, 1, { name: "roll", min: -45, max: 45, step: 0.5, suffix: "°" }),
      slider("Across", SHIFT, 1, { name: "x", min: -1, max: 1 }),
      slider("Down", SHIFT + 1, 1, { name: "y", min: -1, max: 1 }),
      slider("Distance", SHIFT + 2, 1, { name: "z", min: 6, max: 30, step: 0.1 }),
    ],
    "Jaw, lids and gaze": [
      slider("Jaw, open", JAW, JAW_OPEN, { name: "jaw" }),
      slider("Jaw, aside", JAW + 1, JAW_SIDE, { name: "jawAside", min: -1 }),
      slider("Left lid", LID, 1, { name: "lidLeft" }),
      slider("Right lid", LID + 1, 1, { name: "lidRight" }),
      slider("Gaze, across", [EYE + 1, EYE + 4], 1 / DEGREES,
             { name: "gazeAcross", min: -30, max: 30, step: 0.5, suffix: "°" }),
      slider("Gaze, up", [EYE, EYE + 3], -1 / DEGREES,
             { name: "gazeUp", min: -30, max: 25, step: 0.5, suffix: "°" }),
    ],
    ...(names.length ? named(names) : numbered(moving)),
  };
}

// Where a slider stands at these values.
export function position(s, values) {
  const mean = s.at.reduce((sum, k) => sum + values[k], 0) / s.at.length;
  return Math.max(s.min, Math.min(s.max, mean / s.unit));
}

export function hold(s, overrides, where) {
  for (const k of s.at) overrides.set(k, where * s.unit);
}

export const release = (s, overrides) => s.at.forEach((k) => overrides.delete(k));
export const held = (s, overrides) => s.at.some((k) => overrides.has(k));
