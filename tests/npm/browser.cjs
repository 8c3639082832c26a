// A page in a headless Chromium of its own ($CHROMIUM): a new, empty profile,
// no network, drawing in software.  open(file, options) gives {page, errors,
// requests, close}: what the console called an error, and every address asked
// for that is not the page's own.
const fs = require("fs");
const os = require("os");
const path = require("path");
const { pathToFileURL } = require("url");
const top = process.env.TOP || path.join(__dirname, "../..");
const { chromium } = require(path.join(top, "build/npm/node_modules/playwright-core"));

const patience = 240000;        // ms, for a machine that has other work

exports.open = async (file, { width = 512, height = 600, hash = "", flags = [], ...more } = {}) => {
  const profile = fs.mkdtempSync(path.join(os.tmpdir(), "spid-browser-"));
  const context = await chromium.launchPersistentContext(profile, {
    executablePath: process.env.CHROMIUM, headless: true,
    viewport: { width, height }, timeout: patience, ...more,
    args: ["--no-sandbox", "--disable-gpu", "--use-gl=angle",
      "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
      "--disable-quic", "--no-first-run", "--disable-background-networking",
      "--disable-component-update", "--disable-sync", ...flags] });
  const page = context.pages()[0] ?? await context.newPage();
  const errors = [], requests = [];
  page.setDefaultTimeout(patience);
  page.on("console", (m) => m.type() === "error" && errors.push(m.text()));
  page.on("pageerror", (e) => errors.push(e.message));
  page.on("request", (r) => /^(file|data|blob):/.test(r.url()) || requests.push(r.url()));
  await page.goto(pathToFileURL(path.resolve(file)).href + hash);
  return { page, errors, requests, close: async () => {
    await context.close();
    fs.rmSync(profile, { recursive: true, force: true });
  } };
};

exports.check = (ok, what) => {
  if (ok) return;
  console.log(`FAILED ${what}`);
  process.exitCode = 1;
};

// Controls that no screen reader could name.
const nameless = (page) => page.evaluate(() =>
  [...document.querySelectorAll("button, input, select, summary, canvas, video")]
    .filter((e) => !(e.getAttribute("aria-label") || e.textContent.trim() ||
                     [...(e.labels ?? [])].some((l) => l.textContent.trim())))
    .map((e) => e.outerHTML.slice(0, 80)));

// The least contrast of text with its ground (WCAG asks 4.5), dark and light.
async function readable(page) {
  const grounds = [];
  for (const colorScheme of ["dark", "light"]) {
    await page.emulateMedia({ colorScheme });
    const [ground, least] = await page.evaluate(() => {
      const light = (color) => color.match(/[\d.]+/g).slice(0, 3).map((v) => v / 255)
        .map((v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
        .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
      const ratio = (a, b) => (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
      const style = (id) => getComputedStyle(document.getElementById(id));
      const panel = light(style("panel").backgroundColor);
      return [panel, Math.min(ratio(light(style("facts").color), panel),
                              ratio(light(style("panel").color), panel))];
    });
    exports.check(least >= 4.5, `${colorScheme}: contrast ${least.toFixed(2)}`);
    grounds.push(ground);
  }
  exports.check(grounds[0] < 0.1 && grounds[1] > 0.5, `dark and light are ${grounds}`);
}

// A finger turns the avatar, two make it larger.
async function touched(page) {
  const cdp = await page.context().newCDPSession(page);
  await cdp.send("Emulation.setTouchEmulationEnabled", { enabled: true, maxTouchPoints: 2 });
  const { x, y, width, height } = await page.locator("#canvas").boundingBox();
  const middle = [x + width / 2, y + height / 2];
  const fingers = (type, ...at) => cdp.send("Input.dispatchTouchEvent", { type,
    touchPoints: at.map((across, id) => ({ x: middle[0] + across, y: middle[1], id })) });
  // a page just loaded has no camera before its first picture
  const settled = async () => { await spid.settled(); return spid.camera(); };
  const moves = async (what, ...steps) => {
    const before = await page.evaluate(settled);
    await fingers("touchStart", ...steps[0]);
    for (const step of steps) await fingers("touchMove", ...step);
    await fingers("touchEnd");
    await page.waitForTimeout(100);
    const after = await page.evaluate(settled);
    exports.check(after.some((v, i) => Math.abs(v - before[i]) > 1e-3), what);
  };
  await moves("a finger turns it", [0], [20], [40]);
  await moves("two fingers zoom", [-20, 20], [-40, 40], [-60, 60]);
  await cdp.send("Emulation.setTouchEmulationEnabled", { enabled: false });
}

// What every page must: names for its controls, a phone's width, a silent
// console, and no address but its own.
exports.manners = async (page, errors, requests) => {
  for (const text of await nameless(page)) exports.check(false, `no name: ${text}`);
  await page.setViewportSize({ width: 360, height: 640 });
  const wide = await page.evaluate(() => document.documentElement.scrollWidth);
  exports.check(wide <= 360, `a phone's screen of 360 is ${wide} wide`);
  for (const text of errors) exports.check(false, `console: ${text}`);
  for (const url of requests) exports.check(false, `asked for ${url}`);
};

// What a page with an avatar must, too: text that can be read, and fingers.
exports.playerManners = async (page, errors, requests) => {
  await readable(page);
  await touched(page);
  await exports.manners(page, errors, requests);
};

exports.run = (main) => main().catch((e) => { console.error(e); process.exit(1); });

// A file of the disk dropped on the page.
exports.drop = (page, file, type = "") => page.evaluate(([name, type, text]) => {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const dataTransfer = new DataTransfer();
  dataTransfer.items.add(new File([bytes], name, { type }));
  const event = (kind) => new DragEvent(kind, { dataTransfer, bubbles: true, cancelable: true });
  const target = document.getElementById("canvas");
  if (target.dispatchEvent(event("dragover"))) throw new Error("nothing may be dropped there");
  target.dispatchEvent(event("drop"));
}, [path.basename(file), type, fs.readFileSync(file).toString("base64")]);
