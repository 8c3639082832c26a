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

exports.run = (main) => main().catch((e) => { console.error(e); process.exit(1); });
