// node segment.mjs NPM FOLDER: what @mediapipe/selfie_segmentation, with whose
// training this project has nothing to do, takes for a person in every
// FOLDER/*.png, as FOLDER/NAME.other.pgm.  NPM holds that package and
// playwright-core.
import fs from "node:fs";
import http from "node:http";
import path from "node:path";
import { createRequire } from "node:module";

const [npm, folder] = process.argv.slice(2).map((p) => path.resolve(p));
const { chromium } = createRequire(path.join(npm, "x.js"))("playwright-core");
const page = `<script src="/npm/selfie_segmentation.js"></script>`;
const root = path.join(npm, "node_modules/@mediapipe/selfie_segmentation");
const server = http.createServer((q, s) => {
  const [, where, name] = q.url.split("/");
  const file = { npm: path.join(root, name ?? ""), at: path.join(folder, name ?? "") }[where];
  if (file && !fs.existsSync(file)) { s.writeHead(404); return s.end(); }
  s.writeHead(200, { "content-type": !file ? "text/html" :
    file.endsWith(".wasm") ? "application/wasm" :
    file.endsWith(".js") ? "text/javascript" : "application/octet-stream" });
  s.end(file ? fs.readFileSync(file) : page);
});
await new Promise((done) => server.listen(0, "127.0.0.1", done));
const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
         "--enable-unsafe-swiftshader"] });
const tab = await browser.newPage();
await tab.goto(`http://127.0.0.1:${server.address().port}/`);
for (const name of fs.readdirSync(folder).filter((f) => f.endsWith(".png"))) {
  const { width, height, mask } = await tab.evaluate(async (name) => {
    const image = new Image();
    image.src = `/at/${name}`;
    await image.decode();
    window.net ??= new SelfieSegmentation({ locateFile: (f) => `/npm/${f}` });
    window.net.setOptions({ modelSelection: 0 });
    const found = new Promise((done) => window.net.onResults(done));
    await window.net.send({ image });
    const { segmentationMask } = await found;
    const canvas = document.createElement("canvas");
    canvas.width = image.width;
    canvas.height = image.height;
    const c = canvas.getContext("2d");
    c.drawImage(segmentationMask, 0, 0, image.width, image.height);
    const rgba = c.getImageData(0, 0, image.width, image.height).data;
    return { width: image.width, height: image.height,
             mask: Array.from({ length: rgba.length / 4 }, (_, i) => rgba[4 * i + 3]) };
  }, name);
  fs.writeFileSync(path.join(folder, name.replace(".png", ".other.pgm")), Buffer.concat([
    Buffer.from(`P5 ${width} ${height} 255\n`), Buffer.from(mask)]));
}
await browser.close();
server.close();
