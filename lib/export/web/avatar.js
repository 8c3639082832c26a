// An avatar for a site of your own: the file of spid-export --web, driven from
// JavaScript, as an object for three.js (examples/web).
import * as THREE from "three";
import { Archive } from "./archive.js";
import { drawnArrays, drivenArrays, motionOf } from "./arrays.js";
import { Drive } from "./drive.js";
import { Head } from "./head.js";
import { Order } from "./order.js";
import { hold, release, sliderGroups } from "./sliders.js";
import { View } from "./view.js";

export class Avatar {
  // The file at an address.
  static async load(address) {
    const answer = await fetch(address);
    if (!answer.ok) throw new Error(`${address}: ${answer.status} ${answer.statusText}`);
    return new Avatar(await answer.arrayBuffer());
  }

  // The file's bytes.
  constructor(bytes) {
    try {
      this.archive = new Archive(bytes);
    } catch {
      throw new Error("this is no avatar of spid-export --web, or not all of it");
    }
    const a = this.archive;
    this.count = a.array("counts").reduce((s, n) => s + n, 0);
    const driven = drivenArrays(a, this.count);
    this.head = new Head(driven);
    this.gaussians = new Drive(driven);
    this.gaussians.bendOfMesh(this.head.vertices, driven.faces);
    this.texels = driven.texels;
    this.motion = motionOf(a);
    this.time = 0;              // seconds of the drive that is in the file
    const moving = Array.from({ length: a.shape("exp_dirs")[0] }, (_, k) => k);
    this.sliders = new Map(Object.values(sliderGroups(JSON.parse(a.meta.names), moving))
      .flat().map((s) => [s.name, s]));
  }

  // What can be set: "yaw", "pitch", "roll" (degrees), "x", "y", "z", "jaw",
  // "gazeAcross", "mouthSmile_L" and the other names of ARKit.
  get names() { return [...this.sliders.keys()]; }

  // Hold a value, whatever the drive does; null lets it go.
  set(name, value) {
    const s = this.sliders.get(name);
    if (!s) throw new Error(`${name}: no such value (expected one of ${this.names.join(", ")})`);
    if (value === null) release(s, this.motion.overrides);
    else hold(s, this.motion.overrides, value);
  }

  // Drive it by numbers from elsewhere, as MOTN has them: rotation 9,
  // translation 3, jaw 3, lids 2, eyes 6, expression; null: by the file again.
  drive(row) { this.motion.live = row; }

  // Where the Gaussians are now: means (count,4), mesh (V,3), the camera (3,4),
  // and whether the mouth shows.
  pose() {
    const { cam, pose } = this.motion.at(this.time, true);
    const verts = this.head.pose(pose), means = new Float32Array(4 * this.texels);
    const mouth = this.gaussians.means(means, verts, this.head.mouth(), cam);
    const mesh = new Float32Array(verts.length);
    this.gaussians.mesh(mesh, verts, cam);
    return { means, mesh, cam, mouth };
  }

  // A mesh for a scene, one unit high, that shows the portrait over `background`
  // in so many pixels; update() before the scene is rendered.
  object({ size = 512, background = 0x000000 } = {}) {
    const canvas = document.createElement("canvas");
    this.view = new View(canvas, drawnArrays(this.archive, this.count),
                         this.motion.row(0)[11]);
    this.view.show.background.set(background).convertLinearToSRGB();
    this.view.resize(size, size);
    this.order = new Order(this.count);
    this.texture = new THREE.CanvasTexture(canvas);
    this.texture.colorSpace = THREE.SRGBColorSpace;
    this.update();
    return new THREE.Mesh(new THREE.PlaneGeometry(1, 1),
      new THREE.MeshBasicMaterial({ map: this.texture, toneMapped: false }));
  }

  update() {
    const found = this.pose(), order = new Uint32Array(this.texels);
    this.order.sort(order, this.count, found.means, found.cam);
    this.view.take({ order, ...found });
    this.view.draw(found.cam);
    this.texture.needsUpdate = true;
  }
}
