// A camera or a video drives the avatar, a photograph becomes another one: frames
// and pictures to the engine's worker, what it finds to the player; neutral,
// mirror, recording, and what all of it costs.
import engineCode from "engine";
import { Archive, bytesOf, inflate } from "./archive.js";
import { Recorder } from "./record.js";

const $ = (id) => document.getElementById(id);
const SMOOTH = 1.5;             // Hz at rest
const MARK = () => $("mark").textContent;
// A module with one SIMD instruction (i8x16.splat).
const SIMD = Uint8Array.of(0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1,
                           0, 10, 10, 1, 8, 0, 65, 0, 253, 15, 253, 98, 11);
const REFUSED = {
  NotAllowedError: "The camera was not allowed; the avatar plays on without it.",
  NotFoundError: "There is no camera here; the avatar plays on without it.",
  NotReadableError: "Another program has the camera; the avatar plays on without it.",
};

export class Live {
  constructor(player, archive) {
    this.player = player;
    this.source = archive.array("source");
    this.spent = {};
    this.video = $("eye");
    this.smooth = SMOOTH;
    this.waiting = [];          // for settled()
    this.files = { model: archive.array("engine.model"), head: archive.array("engine.head") };
    this.recorder = new Recorder($("canvas"), MARK(), (blob) => this.save(blob),
                                 (why) => this.say(`No recording: ${why}.`));
    this.addControls();
    player.panel.open(true);
    player.onDrawn = () => { if (this.recorder.on) this.recorder.drawn(); };
  }

  addControls() {
    $("camera").onclick = () => this.stream ? this.stop() : this.openCamera();
    $("file").onclick = () => $("picked").click();
    $("picked").onchange = () => {
      const [file] = $("picked").files;
      if (file) this.openFile(file);
      $("picked").value = "";
    };
    $("photo-file").onclick = () => $("photo-picked").click();
    $("photo-picked").onchange = () => {
      const [file] = $("photo-picked").files;
      if (file) this.openPhoto(file);
      $("photo-picked").value = "";
    };
    $("rest").onclick = () => this.worker.postMessage({ rest: true });
    $("record").onclick = () => this.recorder.on ? this.recorder.stop() : this.record();
    $("mirror").onchange = () => this.restart();
    const click = (id) => () => $(id).click();
    Object.assign(this.player.panel.more, { c: click("camera"), v: click("file"),
                                            n: click("rest"), r: click("record"),
                                            f: click("photo-file") });
    addEventListener("dragover", (e) => e.preventDefault());
    addEventListener("drop", (e) => {
      e.preventDefault();
      const files = [...e.dataTransfer.files];
      if (files[0]?.type.startsWith("video/")) this.openFile(files[0]);
      else if (files[0]) this.openPhoto(files[0]);
    });
  }

  say(text) { $("said").textContent = text; }

  /* ---- the worker ---- */

  // Once, when it is first wanted; false where this browser cannot.
  async begin() {
    if (!globalThis.WebAssembly || !WebAssembly.validate(SIMD) ||
        !globalThis.OffscreenCanvas) {
      this.say("This browser lacks WebAssembly SIMD or OffscreenCanvas, which cameras " +
               "and photographs need; the avatar plays on without them.");
      return false;
    }
    this.ready ??= new Promise((resolve, reject) => {
      this.say("Starting the networks…");
      this.worker = new Worker(URL.createObjectURL(
        new Blob([engineCode], { type: "text/javascript" })));
      this.worker.onerror = (e) => reject(new Error(e.message));
      this.worker.onmessage = ({ data }) => {
        if (data.ready) resolve(true);
        else if (data.failed && !this.running) reject(new Error(data.failed));
        else if (data.failed || data.row || data.lost) this.take(data);
        else this.made(data);
      };
      const code = inflate(bytesOf($("engine").textContent)).buffer;
      $("engine").remove();
      this.worker.postMessage({ setup: { code, smooth: this.smooth, ...this.files } }, [code]);
      if (this.source) this.worker.postMessage({ source: this.source });
      this.files = null;
    });
    try {
      this.running = await this.ready;
      return true;
    } catch (error) {
      this.say(`The networks do not start here (${error.message}); the avatar plays on ` +
               "without it.");
      return false;
    }
  }

  restart() {
    this.video.classList.toggle("mirror", $("mirror").checked);
    this.worker?.postMessage({ restart: true });
  }

  // A frame's answer.
  take({ row, driven, lost, why, window, spent, time, failed }) {
    this.busy = false;
    this.found = { row, driven, lost, window, time };
    if (failed) this.refuse(`That failed: ${failed}.`);
    if (row) {
      $("rest").disabled = false;
      if (this.open) this.drive(driven);
    }
    for (const [k, v] of Object.entries(spent ?? {})) this.cost(k, v);
    if (this.open && Boolean(lost) !== this.wasLost) {
      this.wasLost = Boolean(lost);
      this.say(lost ? `${why[0].toUpperCase()}${why.slice(1)}.` : "Your face drives it.");
    }
    this.waiting.splice(0).forEach((resolve) => resolve(this.found));
  }

  drive(row) {
    this.player.live(row);
    this.frames = (this.frames ?? 0) + 1;
  }

  /* ---- a new face ---- */

  // The browser decodes it, upright and in sRGB.
  async openPhoto(file) {
    if (this.making) return;
    this.stop();
    const picture = await createImageBitmap(file).catch(() => null);
    if (!picture) {
      this.say("This browser reads no picture in that file.");
      return;
    }
    if (!await this.begin()) return;
    this.making = true;
    $("making").hidden = false;
    $("photo-file").disabled = $("camera").disabled = $("file").disabled = true;
    this.worker.postMessage({ photo: picture }, [picture]);
  }

  // How far a photograph is, its avatar, or why there is none.
  made({ progress, share, avatar, ms, refused }) {
    if (progress) {
      $("making").value = share;
      this.say(`${progress}…`);
    } else if (refused) {
      this.refuse(`No avatar of that photograph: ${refused.replace(/; --[^)]*/, "")}.`);
    } else {
      this.refuse(`A new face, made in ${(ms / 1000).toFixed(1)} seconds.`);
      const archive = new Archive(avatar);
      this.worker.postMessage({ source: archive.array("source") });
      this.window = archive.meta.window;
      this.player.load(archive);
    }
  }

  // Nothing is being made any more.
  refuse(text) {
    this.making = false;
    $("making").hidden = true;
    $("photo-file").disabled = $("camera").disabled = $("file").disabled = false;
    this.say(text);
  }

  /* ---- where frames come from ---- */

  async openCamera() {
    this.stop();
    if (!navigator.mediaDevices?.getUserMedia) {
      this.say("This page may not ask for a camera here; the avatar plays on without it.");
      return;
    }
    if (!await this.begin()) return;
    try {
      this.stream = await navigator.mediaDevices.getUserMedia({
        video: { width: { ideal: 640 }, height: { ideal: 480 }, facingMode: "user" } });
    } catch (error) {
      this.say(REFUSED[error.name] ??
               `The camera fails (${error.message}); the avatar plays on without it.`);
      return;
    }
    this.stream.getVideoTracks()[0].onended = () => {
      this.stop();
      this.say("The camera is gone; the avatar plays on without it.");
    };
    this.video.srcObject = this.stream;
    $("camera").setAttribute("aria-pressed", "true");
    $("camera").textContent = "Stop camera";
    await this.start();
  }

  async openFile(file) {
    this.stop();
    if (!await this.begin()) return;
    $("mirror").checked = false;
    this.url = URL.createObjectURL(file);
    this.video.src = this.url;
    this.video.loop = true;
    this.video.onerror = () => {
      this.stop();
      this.say("This browser cannot play that video.");
    };
    await this.start();
  }

  async start() {
    this.player.play(false);
    this.open = true;
    this.wasLost = null;
    this.video.hidden = false;
    this.restart();
    await this.video.play().catch(() => {});
    this.next();
  }

  stop() {
    this.open = false;
    this.stream?.getTracks().forEach((t) => t.stop());
    this.video.pause();
    this.video.onerror = null;
    this.video.srcObject = null;
    this.video.removeAttribute("src");
    if (this.url) URL.revokeObjectURL(this.url);
    this.stream = this.url = null;
    this.video.hidden = true;
    $("camera").setAttribute("aria-pressed", "false");
    $("camera").textContent = "Camera";
    $("meter").textContent = "";
    this.player.live(null);
  }

  // The newest frame whenever the worker is free: late ones are dropped.
  next() {
    if (!this.open) return;
    const again = () => { this.send(); this.next(); };
    if (this.video.requestVideoFrameCallback) this.video.requestVideoFrameCallback(again);
    else requestAnimationFrame(again);
  }

  async send() {
    if (this.busy || this.held || !this.video.videoWidth) return;
    this.busy = true;
    const began = performance.now(), { video } = this;
    try {
      const frame = globalThis.VideoFrame ? new VideoFrame(video)
                                          : await createImageBitmap(video);
      this.cost("grab", performance.now() - began);
      this.worker.postMessage({ frame, time: this.stream ? began / 1000 : video.currentTime,
                                mirror: $("mirror").checked }, [frame]);
    } catch {
      this.busy = false;        // there was no picture after all
    }
  }

  // The answer for the frame at t seconds of a video, which stands still from
  // then on: for tests.
  async at(t) {
    this.held = true;
    this.video.pause();
    while (this.busy) await new Promise((r) => setTimeout(r, 5));
    // what played until now may still be on its way to the screen
    for (let k = 0; k < 2; k++) await new Promise(requestAnimationFrame);
    await new Promise((resolve) => {
      this.video.requestVideoFrameCallback(resolve);
      this.video.currentTime = t;
    });
    const found = new Promise((resolve) => { this.waiting.push(resolve); });
    this.held = false;
    this.send();
    this.held = true;
    return found;
  }

  /* ---- recording ---- */

  record() {
    this.recorder.start();
    const { on } = this.recorder;
    $("record").textContent = on ? "Stop recording" : "Record";
    $("record").setAttribute("aria-pressed", on);
  }

  save(blob) {
    $("record").textContent = "Record";
    $("record").setAttribute("aria-pressed", "false");
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = "avatar.webm";
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60000);
  }

  /* ---- the meter ---- */

  // Means of the last frames or so, shown twice a second.
  cost(what, ms) {
    const { spent } = this;
    spent[what] = spent[what] === undefined ? ms : 0.9 * spent[what] + 0.1 * ms;
    const now = performance.now();
    if (!this.open || now - (this.shownAt ?? 0) < 500) return;
    const rate = 1000 * (this.frames ?? 0) / (now - (this.shownAt ?? now - 500));
    Object.assign(this, { shownAt: now, frames: 0 });
    const names = { grab: "grab", read: "read", detect: "find", crop: "crop", network: "network",
                    head: "head", pose: "pose", draw: "draw" };
    $("meter").textContent = `${rate.toFixed(0)} motions a second; ms: ` +
      Object.entries(names).filter(([k]) => spent[k] !== undefined)
        .map(([k, name]) => `${name} ${spent[k].toFixed(1)}`).join(", ");
  }
}
