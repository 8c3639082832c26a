// Off the main thread: frames to motion.  Networks run by onnxruntime-web
// (WASM SIMD, one thread: no page needs to be isolated for it), faces are found
// by tracking.js's cascade.  TensorFlow.js's WASM backend runs the shipped E_m
// as fast (18.7 ms of a processor's time where this takes 21.0) and is 4.6 MB
// smaller in the page, but needs the network said once more in its own words;
// this one runs the very file of spid-export --onnx, which is tested.
//   in   {setup: {engine, net, ...arrays, smooth}}, then
//        {frame: ImageBitmap, time, mirror} or {restart: true}
//   out  {ready: true}, then {row} or {lost, why}, with window and the times
//        spent (ms: detect, crop, network, head); or {failed: why}
import * as ort from "onnxruntime-web/wasm";
import "tracking";
import "tracking/build/data/face.js";
import { NET, cut } from "./crop.js";
import { Follower } from "./follow.js";
import { Head } from "./head.js";

const FINDER = 240;             // pixels of the larger side that faces are
                                // looked for in
const { tracking } = self;
const canvas = new OffscreenCanvas(1, 1), small = new OffscreenCanvas(1, 1);
const [paint, paintSmall] = [canvas, small]
  .map((c) => c.getContext("2d", { willReadFrequently: true }));
let follower, session, spent;

// Runs f and adds its time to `spent`.
async function timed(what, f) {
  const began = performance.now();
  const out = await f();
  spent[what] += performance.now() - began;
  return out;
}

async function encode(frame, square) {
  const rgb = await timed("crop", () => cut(frame, square));
  const picture = new ort.Tensor("float32", rgb, [1, NET, NET, 3]);
  const found = await timed("network", () => session.run({ picture }));
  return { rgb, code: Array.from(found.code.data), sure: found.sure?.data[0] ?? 1 };
}

// The largest face that at least three windows agree on.
function find(frame) {
  const k = Math.min(1, FINDER / Math.max(frame.width, frame.height));
  small.width = Math.round(k * frame.width);
  small.height = Math.round(k * frame.height);
  paintSmall.drawImage(canvas, 0, 0, small.width, small.height);
  const { data, width, height } = paintSmall.getImageData(0, 0, small.width, small.height);
  const faces = tracking.ViolaJones.detect(data, width, height, 1.6, 1.2, 1, 0,
    tracking.ViolaJones.classifiers.face).filter((f) => f.total >= 3);
  const best = faces.sort((a, b) => b.width - a.width)[0];
  return best ? { x: (best.x + best.width / 2) / k, y: (best.y + best.height / 2) / k,
                  size: best.width / k } : null;
}

async function setup({ engine, net, smooth, ...a }) {
  ort.env.wasm.numThreads = 1;
  ort.env.wasm.wasmBinary = engine;
  session = await ort.InferenceSession.create(net, { executionProviders: ["wasm"] });
  follower = new Follower({
    head: new Head(a), corner: a.corner, bary: a.bary, smooth, encode,
    detect: (frame) => timed("detect", () => find(frame)) });
  postMessage({ ready: true });
}

async function frame({ frame: bitmap, time, mirror }) {
  const { width, height } = bitmap;
  spent = { detect: 0, crop: 0, network: 0 };
  if (canvas.width !== width || canvas.height !== height)
    Object.assign(canvas, { width, height });
  paint.setTransform(mirror ? -1 : 1, 0, 0, 1, mirror ? width : 0, 0);
  paint.drawImage(bitmap, 0, 0);
  bitmap.close();
  const began = performance.now();
  const found = await follower.step({ width, height, pixels: (...q) => paint.getImageData(...q) },
                                    time);
  const head = performance.now() - began - spent.detect - spent.crop - spent.network;
  postMessage({ ...found, time, window: follower.window, spent: { ...spent, head } });
}

// One after another, whatever comes while the network runs.
let last = Promise.resolve();
onmessage = ({ data }) => {
  last = last.then(async () => {
    if (data.setup) await setup(data.setup);
    else if (data.restart) follower?.restart();
    else await frame(data);
  }).catch((error) => postMessage({ failed: error.message }));
};
