// What the canvas shows as a WebM file, with the mark of synthetic origin in
// its pictures and in its tags.
import { withComment } from "./webm.js";

const RATE = 30;
const TYPES = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm"];

export class Recorder {
  // canvas: what is recorded; mark: the sentence; done(blob) is called at the
  // end, failed(why) when it cannot begin or go on.
  constructor(canvas, mark, done, failed) {
    Object.assign(this, { canvas, mark, done, failed });
    this.copy = document.createElement("canvas");
    this.paint = this.copy.getContext("2d", { alpha: false });
  }

  get on() { return this.recorder?.state === "recording"; }

  start() {
    const type = globalThis.MediaRecorder &&
      TYPES.find((t) => MediaRecorder.isTypeSupported(t));
    if (!type || !this.copy.captureStream) {
      this.failed("this browser records no WebM");
      return;
    }
    // encoders want even sides, and one size from the first picture to the last
    this.copy.width = this.canvas.width & ~1;
    this.copy.height = this.canvas.height & ~1;
    this.drawn();
    this.parts = [];
    this.recorder = new MediaRecorder(this.copy.captureStream(RATE),
                                      { mimeType: type, videoBitsPerSecond: 6e6 });
    this.recorder.ondataavailable = ({ data }) => this.parts.push(data);
    this.recorder.onerror = ({ error }) => this.failed(error?.message ?? "it broke off");
    this.recorder.onstop = () => this.finish();
    this.recorder.start(1000);
  }

  stop() { if (this.on) this.recorder.stop(); }

  async finish() {
    const bytes = new Uint8Array(await new Blob(this.parts).arrayBuffer());
    this.parts = [];
    this.done(new Blob([withComment(bytes, this.mark)], { type: "video/webm" }));
  }

  // A picture has been drawn: call it before the browser shows it.
  drawn() {
    const { copy, paint, mark } = this, { width, height } = copy;
    if (!width || !height) return;
    paint.drawImage(this.canvas, 0, 0, width, height);
    const font = (pixels) => { paint.font = `${pixels}px system-ui, sans-serif`; };
    let size = Math.max(10, height / 42);
    font(size);
    size *= Math.min(1, 0.92 * width / paint.measureText(mark).width);
    font(size);
    paint.textBaseline = "bottom";
    paint.shadowColor = "#000";
    paint.shadowBlur = size / 3;
    paint.fillStyle = "#fffc";
    paint.fillText(mark, size * 0.8, height - size * 0.6);
    paint.shadowBlur = 0;
  }
}
