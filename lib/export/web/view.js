// What is drawn: the Gaussians into blended colours, places and gains, the
// picture of those over the background, the mesh as lines.  Orbit, zoom and pan
// are three.js's.
import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { body } from "./drive.js";
import { opaque, personLevels, pickLevel, pictureTexture, placeView }
  from "./photograph.js";
import { through } from "./rotation.js";
import * as shaders from "./shaders.js";

const WIDTH = 2048;             // texels in a row of a table
const FOCAL = 12;               // in half pictures

export const texelsFor = (count) => WIDTH * Math.ceil(count / WIDTH);

function floatTexture(data, width, height) {
  const t = new THREE.DataTexture(data, width, height, THREE.RGBAFormat,
                                  THREE.FloatType);
  t.needsUpdate = true;
  return t;
}

// Covariance of scales and a quaternion: xx, xy, xz, yy, yz, zz.
function covariance(out, at, scale, quat, i, n) {
  const [w, x, y, z] = [0, 1, 2, 3].map((k) => quat[k * n + i]);
  const s = 2 / Math.max(w * w + x * x + y * y + z * z, 1e-12);
  const R = [1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y),
             s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x),
             s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)];
  for (let a = 0, e = 0; a < 3; a++)
    for (let b = a; b < 3; b++, e++) {
      let sum = 0;
      for (let k = 0; k < 3; k++)
        sum += R[3 * a + k] * R[3 * b + k] * scale[k * n + i] ** 2;
      out[at + e] = sum;
    }
}

// Four texels of each Gaussian: covariance, opacity, seen; colour, branch;
// place, tilt.
function tableTexture(g) {
  const n = g.count, rows = Math.ceil(4 * n / WIDTH);
  const out = new Float32Array(4 * WIDTH * rows);
  const channels = g.color.length / n;
  for (let i = 0, at = 0; i < n; i++, at += 16) {
    covariance(out, at, g.scale, g.quat, i, n);
    out[at + 6] = g.opacity[i];
    out[at + 7] = g.seen?.[i] ?? 0;
    for (let c = 0; c < 3; c++)
      out[at + 8 + c] = g.color[Math.min(c, channels - 1) * n + i];
    out[at + 11] = i < g.counts[0] ? 0 : i < g.counts[0] + g.counts[1] ? 1 : 2;
    out[at + 12] = g.uv?.[i] ?? 0;
    out[at + 13] = g.uv?.[n + i] ?? 0;
    out[at + 14] = g.tilt?.[i] ?? 0;
    out[at + 15] = g.tilt?.[n + i] ?? 0;
  }
  return floatTexture(out, WIDTH, rows);
}

// A texel for each of n Gaussians, from planes.
function planesTexture(n, planes) {
  const rows = texelsFor(n) / WIDTH, out = new Float32Array(4 * WIDTH * rows);
  planes.forEach((v, at) => { out[4 * (at % n) + Math.floor(at / n)] = v; });
  return floatTexture(out, WIDTH, rows);
}

// Linear between the grain's pixels.
function grainTexture(pixels) {
  const size = Math.sqrt(pixels.length);
  const t = new THREE.DataTexture(pixels, size, size, THREE.RedFormat,
                                  THREE.UnsignedByteType);
  t.minFilter = t.magFilter = THREE.LinearFilter;
  t.needsUpdate = true;
  return t;
}

function rawMaterial(vertexShader, fragmentShader, uniforms, more = {}) {
  return new THREE.RawShaderMaterial({
    glslVersion: THREE.GLSL3, vertexShader, fragmentShader, uniforms,
    depthTest: false, depthWrite: false, side: THREE.DoubleSide, ...more });
}

const uniform = (value) => ({ value });

// A picture's mean colour at half its brightness, 0 to 1.
function dimmed(rgb) {
  const sum = [0, 0, 0];
  rgb.forEach((v, i) => { sum[i % 3] += v; });
  return sum.map((v) => v / (rgb.length / 3) / 510);
}

// Two triangles for each of n Gaussians, corners counted on: no instances,
// which graphics cards of phones and software draw one by one.
function squares(n) {
  const index = new Uint32Array(6 * n), geometry = new THREE.BufferGeometry();
  for (let i = 0; i < n; i++)
    index.set([0, 1, 2, 2, 1, 3].map((c) => 4 * i + c), 6 * i);
  geometry.setIndex(new THREE.BufferAttribute(index, 1));
  return geometry;
}

// What the graphics card holds of a scene: its textures are its materials'.
function dispose(scene) {
  scene.traverse(({ geometry, material }) => {
    geometry?.dispose();
    for (const { value } of Object.values(material?.uniforms ?? {}))
      if (value?.isTexture) value.dispose();
    material?.dispose();
  });
}

export class View {
  // g: count, counts, scale, quat, opacity, color, uv, seen, normal, around; view,
  // rgb, matte, back of the photograph, grain, light on it and, in its pose, now (lamp);
  // faces and vertices of the mesh.
  constructor(canvas, g, distance) {
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: false,
                                              powerPreference: "high-performance" });
    this.renderer.autoClear = false;
    this.camera = new THREE.PerspectiveCamera(
      2 * Math.atan(1 / FOCAL) * 180 / Math.PI, 1, 0.1, 1000);
    this.orbit = new OrbitControls(this.camera, canvas);
    Object.assign(this.orbit, { enableDamping: true, dampingFactor: 0.15,
                                minDistance: 2, maxDistance: 60 });
    this.show = { branches: [1, 1, 1], photo: true, mesh: false,
                  original: false, scenery: false,
                  background: new THREE.Color(0) };
    this.load(g, distance);
  }

  // What is drawn from now on, at such a distance from the camera at home.
  load(g, distance) {
    this.scenes?.forEach(dispose);
    for (const t of [this.target, this.empty, this.rgb, this.back, this.grain,
                     ...this.levels ?? []])
      t?.dispose();
    this.source = g.view;
    this.pivot = g.pivot;
    this.upright = g.shoulders;
    this.lamp = g.lamp;
    this.home = distance;
    this.reset();
    this.mouth = true;
    this.addPhotograph(g);
    this.addGaussians(g);
    this.addPicture();
    this.addMesh(g);
    this.scenes = [this.cloud, this.screen, this.lines];
  }

  reset() {
    this.camera.position.set(0, 0, 0);
    this.orbit.target.set(0, 0, -this.home);
    this.orbit.update();
  }

  // The camera about the target, radians.
  turn(across, up) {
    const { position } = this.camera, { target } = this.orbit;
    const s = new THREE.Spherical().setFromVector3(position.clone().sub(target));
    s.theta += across;
    s.phi = Math.max(0.05, Math.min(Math.PI - 0.05, s.phi + up));
    position.setFromSpherical(s).add(target);
    this.orbit.update();
  }

  zoom(factor) {
    const { position } = this.camera, { target } = this.orbit;
    position.sub(target).multiplyScalar(factor).add(target);
    this.orbit.update();
  }

  addPhotograph(g) {
    this.empty = pictureTexture(new Uint8Array(4), 1);
    this.rgb = g.rgb ? pictureTexture(opaque(g.rgb), Math.sqrt(g.rgb.length / 3))
                     : null;
    this.back = g.back ? pictureTexture(opaque(g.back),
                                        Math.sqrt(g.back.length / 3)) : null;
    this.beyond = new THREE.Vector3(...dimmed(g.back ?? [0, 0, 0]));
    const gl = this.renderer.getContext();
    this.deep = Boolean(gl.getExtension("EXT_color_buffer_float") ||
                        gl.getExtension("EXT_color_buffer_half_float"));
    this.grain = g.grain ? grainTexture(g.grain) : null;
    this.levels = g.uv && this.deep ? personLevels(g.rgb, g.matte, g.back) : null;
  }

  addGaussians(g) {
    const rows = texelsFor(g.count) / WIDTH;
    this.means = floatTexture(new Float32Array(4 * WIDTH * rows), WIDTH, rows);
    this.order = new THREE.DataTexture(new Uint32Array(WIDTH * rows), WIDTH,
                                       rows, THREE.RedIntegerFormat,
                                       THREE.UnsignedIntType);
    this.order.needsUpdate = true;
    this.uniforms = {
      means: uniform(this.means), order: uniform(this.order),
      table: uniform(tableTexture(g)),
      normals: uniform(g.normal ? planesTexture(g.count, g.normal) : this.empty),
      arounds: uniform(g.around ? planesTexture(g.count, g.around) : this.empty),
      grained: uniform(Boolean(g.around)),
      light: uniform(new THREE.Vector3()),
      photoLight: uniform(new THREE.Vector3(...g.light ?? [])),
      cam: uniform([0, 1, 2].map(() => new THREE.Vector4())),
      size: uniform(new THREE.Vector2()), focal: uniform(1),
      branches: uniform([1, 1, 1]), toward: uniform(new THREE.Vector2()),
      placeA: uniform(new THREE.Vector4()),
      placeB: uniform(new THREE.Vector2()),
      shouldersA: uniform(new THREE.Vector4()),
      shouldersB: uniform(new THREE.Vector2()),
      neck: uniform(new THREE.Vector3()) };
    const defines = { WIDTH };
    if (this.levels) defines.PLACES = 1;
    const material = rawMaterial(shaders.gaussianVertex,
                                 shaders.gaussianFragment, this.uniforms, {
      defines, transparent: true, blending: THREE.CustomBlending,
      blendSrc: THREE.OneFactor, blendDst: THREE.OneMinusSrcAlphaFactor });
    const mesh = new THREE.Mesh(squares(g.count), material);
    mesh.frustumCulled = false;
    this.cloud = new THREE.Scene().add(mesh);
    this.target = new THREE.WebGLRenderTarget(1, 1, {
      count: this.levels ? 3 : 1, depthBuffer: false, generateMipmaps: false,
      type: this.deep ? THREE.HalfFloatType : THREE.UnsignedByteType,
      minFilter: THREE.NearestFilter, magFilter: THREE.NearestFilter });
    if (this.levels) Object.assign(this.target.textures[2], {
      generateMipmaps: true,
      minFilter: THREE.LinearMipmapNearestFilter });
  }

  addPicture() {
    const u = this.uniforms, [colors, wheres, gains] = this.target.textures;
    this.picture = {
      colors: uniform(colors), wheres: uniform(wheres ?? this.empty),
      gains: uniform(gains ?? this.empty),
      person: uniform(this.empty), backdrop: uniform(this.empty),
      grain: uniform(this.grain ?? this.empty),
      size: u.size, span: uniform(1), background: uniform(this.show.background),
      beyond: uniform(this.beyond), tint: uniform(new THREE.Vector3(1, 1, 1)),
      photo: uniform(false), scenery: uniform(false), original: uniform(false),
      placeA: u.placeA, placeB: u.placeB, shouldersA: u.shouldersA,
      shouldersB: u.shouldersB, neck: u.neck, toward: u.toward };
    const quad = new THREE.Mesh(new THREE.PlaneGeometry(2, 2),
      rawMaterial(shaders.screenVertex, shaders.pictureFragment, this.picture));
    quad.frustumCulled = false;
    this.screen = new THREE.Scene().add(quad);
  }

  addMesh(g) {
    this.verts = new THREE.BufferAttribute(new Float32Array(3 * g.vertices), 3);
    this.verts.setUsage(THREE.DynamicDrawUsage);
    const solid = new THREE.BufferGeometry();
    solid.setAttribute("position", this.verts);
    solid.setIndex(new THREE.BufferAttribute(Uint32Array.from(g.faces), 1));
    const edges = new Set(), lines = [];
    g.faces.forEach((a, f) => {
      const b = g.faces[f % 3 === 2 ? f - 2 : f + 1];
      const key = Math.min(a, b) * g.vertices + Math.max(a, b);
      if (!edges.has(key)) lines.push(a, b);
      edges.add(key);
    });
    const wire = new THREE.BufferGeometry();
    wire.setAttribute("position", this.verts);
    wire.setIndex(lines);
    const { cam, size, focal } = this.uniforms;
    const material = (paint, nearer, more) => rawMaterial(
      shaders.meshVertex, shaders.meshFragment,
      { cam, size, focal, nearer: uniform(nearer), paint: uniform(paint) },
      { depthTest: true, ...more });
    const parts = [
      new THREE.Mesh(solid, material(new THREE.Vector4(), 0, {
        colorWrite: false, depthWrite: true })),
      new THREE.LineSegments(wire, material(
        new THREE.Vector4(0.35, 0.85, 1, 0.4), 0.0015, { transparent: true })),
    ];
    parts.forEach((p, i) => { p.frustumCulled = false; p.renderOrder = i; });
    this.lines = new THREE.Scene().add(...parts);
  }

  // Pixels of the canvas.
  resize(width, height) {
    this.renderer.setSize(width, height, false);
    this.target.setSize(width, height);
    this.uniforms.size.value.set(width, height);
    // an upright screen leaves out some of the portrait's sides
    this.span = Math.min(1.3 * width, height);
  }

  // The camera [R|t] of a drive's camera as the orbit sees it.
  through(cam) {
    this.camera.updateMatrixWorld();
    const e = this.camera.matrixWorldInverse.elements, flip = [1, -1, -1];
    const view = new Float64Array(12);
    for (let i = 0; i < 3; i++)
      for (let j = 0; j < 4; j++)
        view[4 * i + j] = flip[i] * e[4 * j + i] * (j < 3 ? flip[j] : 1);
    return through(view, cam);
  }

  // What the worker found; returns the buffers it may have back.
  take({ order, means, mesh, mouth }) {
    const spare = { order: this.order.image.data };
    this.order.image.data = order;
    this.order.needsUpdate = true;
    if (means) {
      spare.means = this.means.image.data;
      spare.mesh = this.verts.array;
      this.means.image.data = means;
      this.means.needsUpdate = true;
      this.verts.array = mesh;
      this.verts.needsUpdate = true;
      this.mouth = mouth;
    }
    return spare;
  }

  // shoulders (3,4): where a frame has them, in the head's frame; the light
  // stays before the camera as they do (relative_light in
  // lib/base/relative_pose.c).
  aim(cam, shoulders) {
    const u = this.uniforms, p = this.picture, show = this.show;
    u.cam.value.forEach((row, i) => row.fromArray(cam, 4 * i));
    u.focal.value = FOCAL / 2 * this.span;
    u.branches.value = show.branches.map((on, b) => on && (b < 2 || this.mouth) ? 1 : 0);
    p.span.value = this.span;
    p.photo.value = Boolean(show.photo && this.levels);
    p.scenery.value = Boolean(show.scenery && this.back);
    p.original.value = Boolean(show.original && this.rgb);
    p.backdrop.value = (p.original.value ? this.rgb : this.back) ?? this.empty;
    if (!this.levels) return;
    const { A, b, ...rest } = placeView(this.source, cam, shoulders, this.pivot);
    u.placeA.value.fromArray(A);
    u.placeB.value.fromArray(b);
    const [x, y, z] = this.lamp;
    u.light.value.fromArray([0, 4, 8].map((r) => shoulders[r] * x +
      shoulders[r + 1] * y + shoulders[r + 2] * z));
    p.tint.value.fromArray(this.lamp.slice(3).map(Math.sqrt));
    for (const name in rest) u[name].value.fromArray(rest[name]);
    p.person.value = pickLevel(this.levels, A, this.span);
  }

  // One picture of the drive's camera `cam` as the orbit sees it.
  draw(cam) {
    const { renderer, camera } = this;
    this.aim(this.through(cam), this.levels &&
             body(this.pivot, this.upright, cam, this.source));
    renderer.setClearColor(0, 0);
    renderer.setRenderTarget(this.target);
    renderer.clear();
    if (!this.picture.original.value) renderer.render(this.cloud, camera);
    renderer.setRenderTarget(null);
    renderer.clear();
    renderer.render(this.screen, camera);
    if (this.show.mesh && !this.picture.original.value)
      renderer.render(this.lines, camera);
  }
}
