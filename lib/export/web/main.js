// The page: unpacks the avatar, plays the drive, keeps what is shown and what
// the controls say the same.
import { Live } from "live";
import { Archive } from "./archive.js";
import { drawnArrays, drivenArrays, motionOf } from "./arrays.js";
import { Panel } from "./panel.js";
import { View } from "./view.js";
import { fromLink, toLink } from "./link.js";
import workerCode from "worker";

const $ = (id) => document.getElementById(id);

const countOf = (archive) => archive.array("counts").reduce((s, n) => s + n, 0);

class Player {
  constructor(archive) {
    const count = countOf(archive);
    const bytes = document.documentElement.innerHTML.length;
    this.motion = motionOf(archive);
    this.view = new View($("canvas"), drawnArrays(archive, count), this.motion.row(0)[11]);
    this.worker = new Worker(URL.createObjectURL(
      new Blob([workerCode], { type: "text/javascript" })));
    this.worker.onmessage = ({ data }) => this.take(data);
    this.worker.onerror = (e) => { throw new Error(e.message); };
    this.worker.postMessage({ setup: drivenArrays(archive, count) });
    this.spare = {};
    this.time = 0;
    this.speed = 1;
    this.playing = false;
    this.scale = 1;             // of the canvas's pixels, less when it is slow
    this.drawn = 0;             // pictures so far
    this.wanted = { pose: true, view: true };   // has changed since asked for
    const moving = archive.shape("exp_dirs")[0];
    const ranges = archive.array("exp_dirs.range");
    this.panel = new Panel(this, JSON.parse(archive.meta.names),
      Array.from({ length: moving }, (_, k) => k)
        .filter((k) => ranges[2 * k + 1] > ranges[2 * k]),
      `${count.toLocaleString("en")} Gaussians, ${this.motion.frames} frames, ` +
      `${(bytes / 1e6).toFixed(1)} MB`);
    this.view.orbit.addEventListener("change", () => this.changed("view"));
    new ResizeObserver(() => this.resize()).observe($("stage"));
    this.resize();
    const told = fromLink(this, location.hash);
    addEventListener("hashchange", () => fromLink(this, location.hash));
    this.play(!told && this.motion.frames > 1 &&
              !matchMedia("(prefers-reduced-motion: reduce)").matches);
    requestAnimationFrame((now) => this.tick(now));
  }

  changed(what) { this.wanted[what] = true; }

  resize() {
    const box = $("stage").getBoundingClientRect();
    // more pixels than that show nothing more of a portrait 512 wide
    const ratio = this.scale * Math.min(devicePixelRatio, 2,
                                        1024 / Math.min(box.width, box.height));
    const [width, height] = this.fixed ??
      [box.width, box.height].map((x) => Math.max(1, Math.round(x * ratio)));
    this.view.resize(width, height);
    this.stale = true;
  }

  play(on) {
    if (on) this.driver?.stop();
    this.playing = on && this.motion.frames > 1;
    this.last = null;
    this.panel.playing(this.playing);
  }

  // Frame i, standing still.
  seek(i) {
    const { motion } = this;
    if (motion.live) this.driver.stop();
    this.time = motion.time(Math.max(0, Math.min(motion.frames - 1, i)));
    this.changed("pose");
  }

  frame() { return this.motion.frame(this.time); }

  // Another avatar in this one's place, with the same drive.
  load(archive) {
    const count = countOf(archive), { motion, view } = this;
    if (motion.frames < 2) motion.numbers = motionOf(archive).numbers;
    view.load(drawnArrays(archive, count), motion.row(0)[11]);
    this.panel.views();
    this.avatars = (this.avatars ?? 0) + 1;
    this.spare = {};
    this.worker.postMessage({ setup: drivenArrays(archive, count), avatar: this.avatars });
    this.changed("pose");
    this.resize();
  }

  // A motion from elsewhere, until null.
  live(row) {
    this.motion.live = row;
    this.changed("pose");
  }

  // Seconds have passed.
  advance(now) {
    if (this.playing && this.last !== null) {
      const before = this.frame();
      this.time += Math.min(now - this.last, 250) / 1000 * this.speed;
      if (this.time >= this.motion.length) this.time %= this.motion.length;
      if (this.speed < 1 || this.frame() !== before) this.changed("pose");
    }
    this.last = now;
  }

  // Ask the worker for what has changed; one question at a time.
  ask() {
    const { pose, view } = this.wanted;
    if (this.busy || !(pose || view)) return;
    if (pose) this.now = this.motion.at(this.time, this.playing && this.speed < 1);
    const spare = this.spare;
    this.spare = {};
    this.busy = true;
    this.wanted = { pose: false, view: false };
    this.worker.postMessage(
      { avatar: this.avatars, pose: pose ? this.now.pose : null, cam: this.now.cam,
        view: this.view.through(this.now.cam), spare },
      Object.values(spare).map((x) => x.buffer));
    if (pose) this.panel.show(this.now.values);
  }

  // The worker's answer.
  take(found) {
    this.busy = false;
    if (found.avatar !== this.avatars) {        // of the one before
      this.changed("pose");
      return;
    }
    Object.assign(this.spare, this.view.take(found));
    this.cam = found.cam;
    this.driver?.cost("pose", found.ms);
    this.stale = true;
    $("wait").classList.add("done");
    this.ask();
  }

  // Fewer pixels while it moves too slowly, all of them when it rests.
  adapt(now) {
    const moves = this.playing || now - (this.turned ?? 0) < 300;
    const gap = now - (this.drewAt ?? now);
    this.drewAt = now;
    if (!moves) return;
    this.pace = 0.9 * (this.pace ?? 25) + 0.1 * Math.min(gap, 400);
    if (this.pace > 48 && this.scale > 0.5 && !this.fixed) {
      this.scale = Math.max(0.5, 0.8 * this.scale);
      this.pace = 25;
      this.resize();
    }
  }

  tick(now) {
    this.advance(now);
    if (this.view.orbit.update()) this.turned = now;
    this.ask();
    if (!this.playing && this.scale < 1 && now - (this.turned ?? 0) > 400) {
      this.scale = 1;
      this.resize();
    }
    if ((this.stale || this.wanted.view) && this.cam) {
      const began = performance.now();
      this.view.draw(this.cam);
      this.driver?.cost("draw", performance.now() - began);
      this.onDrawn?.();
      this.drawn++;
      this.stale = false;
      this.adapt(now);
    }
    requestAnimationFrame((next) => this.tick(next));
  }

  link() { return location.href.split("#")[0] + toLink(this); }
}

// For scripts and tests: settled() resolves when the picture is the one asked
// for, camera() is its [R|t], picture() its pixels as a PNG.
function expose(player) {
  const { view } = player;
  window.spid = {
    frames: player.motion.frames, view,
    seek: (i) => { player.play(false); player.seek(i); },
    play: (on) => player.play(on),
    drawn: () => player.drawn,
    size: (width, height) => {  // pixels of the picture, whatever the screen's
      player.fixed = [width, height];
      player.resize();
    },
    link: () => player.link(),
    live: player.driver,
    values: () => player.now.values,
    camera: () => Array.from(view.through(player.cam)),
    settled: async () => {
      do await new Promise(requestAnimationFrame);
      while (player.busy || player.wanted.pose || player.stale);
    },
    picture: () => { view.draw(player.cam); return $("canvas").toDataURL(); },
  };
}

// A lost graphics context comes back by itself: three.js fills it again.
function watchContext(player) {
  const { canvas } = player.view;
  canvas.addEventListener("webglcontextlost", () =>
    player.panel.toast("The graphics card is gone; waiting for it"));
  canvas.addEventListener("webglcontextrestored", () => {
    player.panel.toast("The graphics card is back");
    player.changed("view");
  });
}

// An archive, or a sentence about it.
function unpack() {
  const text = $("avatar")?.textContent;
  if (!text) throw new Error("there is none in it (spid-export --html puts one in)");
  try {
    return new Archive(text);
  } catch {
    throw new Error("it is damaged or cut short");
  }
}

function fail(error) {
  $("wait").textContent = `This page cannot show the avatar: ${error.message}`;
  $("wait").className = "bad";
  throw error;
}

addEventListener("DOMContentLoaded", () => setTimeout(() => {
  try {
    if (!document.createElement("canvas").getContext("webgl2"))
      throw new Error("this browser has no WebGL 2, or has turned it off");
    const archive = unpack();
    const player = new Player(archive);
    if (Live && archive.has("engine.model")) player.driver = new Live(player, archive);
    $("avatar").remove();
    watchContext(player);
    expose(player);
  } catch (error) {
    fail(error);
  }
}, 20));
