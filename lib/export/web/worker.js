// Off the main thread: poses the head, moves the Gaussians, sorts them.
//   in   {setup: arrays}, then {avatar, pose, cam, view, spare}: pose null when
//        only the view has changed; spare: buffers given back
//   out  {avatar, order, means, mesh, mouth, cam, ms}: means and mesh null when
//        unchanged; ms: what it took
import { Drive } from "./drive.js";
import { Head } from "./head.js";
import { Order } from "./order.js";

let head, drive, order, texels;
let means = null;               // the last frame's, for a turn of the view

function setup(a) {
  head = new Head(a);
  drive = new Drive(a);
  drive.bendOfMesh(head.vertices, a.faces);
  order = new Order(drive.count);
  texels = a.texels;
  means = new Float32Array(4 * texels);
}

function frame({ avatar, pose, cam, view, spare }) {
  const began = performance.now();
  const out = { order: spare.order ?? new Uint32Array(texels), cam, avatar,
                means: null, mesh: null };
  if (pose) {
    const verts = head.pose(pose);
    out.mesh = spare.mesh ?? new Float32Array(verts.length);
    out.means = spare.means ?? new Float32Array(4 * texels);
    drive.mesh(out.mesh, verts, cam);
    out.mouth = drive.means(means, verts, head.mouth(), cam);
    out.means.set(means);
  }
  order.sort(out.order, drive.count, means, view);
  out.ms = performance.now() - began;
  postMessage(out, [out.order, out.means, out.mesh].filter(Boolean)
    .map((x) => x.buffer));
}

onmessage = ({ data }) => data.setup ? setup(data.setup) : frame(data);
