// Off the main thread: frames to motion, a photograph to an avatar, by the C of
// spid-motion, spid-shape and spid-branches in WebAssembly (wasm/, on one
// thread: no page needs to be isolated for it).  The first guess of where a
// face is comes from tracking.js's cascade.
//   in   {setup: {code, model, head, smooth}}, then {frame: VideoFrame or
//        ImageBitmap, time, mirror}, {restart: true}, {source: who is driven, a
//        row}, {rest: true} (the last frame is neutral) or {photo: ImageBitmap}
//   out  {ready: true}; of a frame {row, driven} (lib/track/relative.h) or {lost,
//        why}, with window, time and the times spent (ms: read, detect, crop,
//        network, head); of a photograph {progress, share}, then {avatar: {meta,
//        arrays}, ms} or {refused: why}; {failed: why}
import glue from "./glue.mjs";
import "tracking";
import "tracking/build/data/face.js";

const ROW = 7 * 8;              // bytes before it in motion_found
const KINDS = { I444: 0, I422: 1, I420: 2, NV12: 2 };   // enum y4m_chroma
const BT601 = ["smpte170m", "bt470bg"];
const { tracking } = self;
const canvas = new OffscreenCanvas(1, 1), small = new OffscreenCanvas(1, 1);
const [paint, paintSmall] = [canvas, small]
  .map((c) => c.getContext("2d", { willReadFrequently: true }));
let engine, width, avatar;
let finder = 240;               // pixels of the larger side that faces are
                                // looked for in: fewer in a clip

// Upright faces of RGB pixels, those that at least three windows agree on, the
// largest first.
function faces(rgb, W, H) {
  const k = Math.min(1, finder / Math.max(W, H));
  const picture = new ImageData(W, H);
  for (let i = 0, j = 0; j < rgb.length; i += 4, j += 3) {
    picture.data[i] = rgb[j];
    picture.data[i + 1] = rgb[j + 1];
    picture.data[i + 2] = rgb[j + 2];
    picture.data[i + 3] = 255;
  }
  canvas.width = W;
  canvas.height = H;
  paint.putImageData(picture, 0, 0);
  small.width = Math.round(k * W);
  small.height = Math.round(k * H);
  paintSmall.drawImage(canvas, 0, 0, small.width, small.height);
  const { data, width: w, height: h } =
    paintSmall.getImageData(0, 0, small.width, small.height);
  return tracking.ViolaJones.detect(data, w, h, 1.6, 1.2, 1, 0,
    tracking.ViolaJones.classifiers.face).filter((f) => f.total >= 3)
    .sort((a, b) => b.width - a.width)
    .map((f) => ({ x: (f.x + f.width / 2) / k, y: (f.y + f.height / 2) / k,
                   size: f.width / k }));
}

const why = () => engine.UTF8ToString(engine._engine_error());

async function setup({ code, model, head, smooth }) {
  engine = await glue({
    wasmBinary: code, locateFile: (name) => name, faces,
    tell: (progress, share) => postMessage({ progress, share }),
    note: (key, value) => { avatar.meta[key] = value; },
    take: (name, dtype, shape, bytes) => { avatar.arrays[name] = { dtype, shape, bytes }; } });
  engine.FS.writeFile("/model", model);
  engine.FS.writeFile("/head", head);
  if (engine._engine_open() || (width = engine._motion_open(smooth)) < 0)
    throw new Error(why());
  postMessage({ ready: true });
}

// A picture's pixels as the browser shows them, to the engine.
function givePixels(picture, W, H, at) {
  canvas.width = W;
  canvas.height = H;
  paint.drawImage(picture, 0, 0, W, H);
  engine.HEAPU8.set(paint.getImageData(0, 0, W, H).data, at);
}

// Whether a frame is planes that formats/y4m.c turns into the colours which
// spid-motion sees: browsers' own differ by some levels.
const plain = (frame, W, H) =>
  KINDS[frame.format] >= 0 && !frame.rotation && !frame.flip &&
  frame.visibleRect.width === W && frame.visibleRect.height === H &&
  [undefined, null, "bt709", ...BT601].includes(frame.colorSpace.matrix);

async function givePlanes(frame, W, H, at) {
  const { fullRange, matrix } = frame.colorSpace, size = frame.allocationSize();
  const planes = engine.HEAPU8.subarray(at, at + size);
  await frame.copyTo(planes);
  if (frame.format === "NV12") {
    const pairs = planes.slice(W * H), n = pairs.length / 2;
    for (let i = 0; i < n; i++) {
      planes[W * H + i] = pairs[2 * i];
      planes[W * H + n + i] = pairs[2 * i + 1];
    }
  }
  engine._motion_colours(KINDS[frame.format], fullRange ?? false,
                         matrix ? BT601.includes(matrix) : W < 1280 && H <= 576);
}

async function frame({ frame: picture, time, mirror }) {
  const began = performance.now();
  const W = picture.displayWidth ?? picture.width, H = picture.displayHeight ?? picture.height;
  const room = engine._engine_room(W, H);
  if (!room) throw new Error(`frames of ${W} x ${H} pixels are too large`);
  if (plain(picture, W, H)) await givePlanes(picture, W, H, room);
  else {
    givePixels(picture, W, H, room);
    engine._motion_colours(-1, false, false);
  }
  picture.close();
  finder = 240;
  const found = engine._motion_step(W, H, time, mirror), at = engine._motion_found();
  if (found < 0) throw new Error(why());
  const [detect, crop, network, head, x, y, size] = engine.HEAPF64.slice(at / 8, at / 8 + 7);
  const rowAt = (at) => engine.HEAPF32.slice(at / 4, at / 4 + width);
  const spent = { read: 0, detect: 1e3 * detect, crop: 1e3 * crop, network: 1e3 * network,
                  head: 1e3 * head };
  spent.read = Object.values(spent).reduce((left, ms) => left - ms, performance.now() - began);
  postMessage({
    time, window: { x, y, size }, spent,
    ...found ? { row: rowAt(at + ROW), driven: rowAt(engine._motion_driven()) }
             : { lost: true, why: engine.UTF8ToString(engine._motion_why()) } });
}

function photo({ photo: bitmap }) {
  const { width: W, height: H } = bitmap, began = performance.now();
  avatar = { meta: {}, arrays: {} };
  finder = 480;
  const room = engine._engine_room(W, H);
  if (room) givePixels(bitmap, W, H, room);
  bitmap.close();
  const refused = !room ? `${W} x ${H} pixels are too many for a page (at most 4096 a side)`
    : engine._face_make(W, H) ? why() : null;
  if (refused) postMessage({ refused });
  else postMessage({ avatar, ms: performance.now() - began },
                   Object.values(avatar.arrays).map(({ bytes }) => bytes.buffer));
  avatar = null;
}

// One after another, whatever comes while the engine starts.
let last = Promise.resolve();
onmessage = ({ data }) => {
  last = last.then(async () => {
    if (data.setup) await setup(data.setup);
    else if (data.restart) engine._motion_restart();
    else if (data.rest) engine._motion_rest();
    else if (data.source) engine.HEAPF32.set(data.source, engine._motion_source() / 4);
    else if (data.photo) photo(data);
    else await frame(data);
  }).catch((error) => postMessage({ failed: error.message }));
};
