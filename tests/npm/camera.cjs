// node camera.cjs PAGE CAMERA.y4m: the page of spid-export --html --live with
// a file as the browser's camera.  The camera drives the avatar, sliders and
// neutral work on, a lost graphics card comes back, what is recorded goes to
// recorded.webm; refused or absent cameras, a browser without WebAssembly SIMD,
// and a video that is none are said, and the page plays on.
const fs = require("fs");
const path = require("path");
const { open, check, drop, playerManners, run } = require("./browser.cjs");

const FAKE = ["--use-fake-device-for-media-stream"];
const said = (page) => page.textContent("#said");

async function ready(file, options) {
  const browser = await open(file, options);
  await browser.page.waitForFunction(() => window.spid);
  await browser.page.evaluate(() => spid.size(192, 192));
  return browser;
}

// Clicks Camera and waits for a sentence that says why not.
async function refused(file, options, pattern, prepare) {
  const { page, close } = await ready(file, options);
  if (prepare) await page.evaluate(prepare);
  await page.keyboard.press("c");
  await page.waitForFunction((p) => new RegExp(p).test(
    document.getElementById("said").textContent), pattern);
  console.log(await said(page));
  check(await page.evaluate(async () => {
    const before = spid.drawn();
    spid.seek(0);
    await spid.settled();
    return spid.drawn() > before;
  }), "the page plays on");
  await close();
}

async function driven(page) {
  await page.click("#camera");
  await page.waitForFunction(() => spid.live.frames > 0 || spid.live.shownAt);
  await page.waitForFunction(() => /motions a second/.test(
    document.getElementById("meter").textContent));
  // values change by themselves, and a slider holds its own
  const first = await page.evaluate(() => spid.values());
  await page.waitForFunction((was) => spid.values().some((v, i) =>
    Math.abs(v - was[i]) > 0.02), first);
  await page.evaluate(() => {
    const label = [...document.querySelectorAll(".slider label")].find((l) => l.title === "jaw");
    const input = document.getElementById(label.htmlFor);
    input.value = 0.5;
    input.dispatchEvent(new Event("input"));
  });
  await page.waitForFunction(() => Math.abs(spid.values()[6] - 0.221) < 1e-3);
  await page.click("#release");
  await page.click("#rest");
  const costs = await page.textContent("#meter");
  for (const stage of ["grab", "read", "find", "crop", "network", "head", "pose", "draw"])
    check(costs.includes(` ${stage} `), `the meter says ${stage}`);
  console.log(costs);
}

// Megabytes of the page: its heap after a collection, and all that its renderer
// holds, WebAssembly's memory included.
async function held(page, cdp) {
  await cdp.send("HeapProfiler.collectGarbage");
  const heap = await page.evaluate(() => performance.memory.usedJSHeapSize) / 1e6;
  const all = fs.readdirSync("/proc").filter((name) => /^\d+$/.test(name)).map((pid) => {
    try {
      const ours = fs.readFileSync(`/proc/${pid}/cmdline`, "utf8");
      return ours.includes("--type=renderer") && descends(pid)
        ? 4096e-6 * fs.readFileSync(`/proc/${pid}/statm`, "utf8").split(" ")[1] : 0;
    } catch {
      return 0;                 // it has ended
    }
  });
  return { heap, all: Math.max(...all) };
}

function descends(pid) {
  while (Number(pid) > 1 && Number(pid) !== process.pid)
    pid = fs.readFileSync(`/proc/${pid}/stat`, "utf8").split(") ").pop().split(" ")[1];
  return Number(pid) === process.pid;
}

// What is kept does not grow with the frames: sixty pictures, or MINUTES.
async function flat(page) {
  const cdp = await page.context().newCDPSession(page);
  const minutes = Number(process.env.MINUTES ?? 0);
  const pictures = async (n) => {
    const until = await page.evaluate(() => spid.drawn()) + n;
    await page.waitForFunction((n) => spid.drawn() >= n, until);
  };
  await pictures(minutes ? 60 : 10);
  const before = await held(page, cdp);
  await pictures(60);
  await page.waitForTimeout(60000 * minutes);
  const after = await held(page, cdp);
  const text = ({ heap, all }) => `${heap.toFixed(1)} MB of ${all.toFixed(0)}`;
  console.log(`heap ${text(before)}; ${minutes ? `${minutes} minutes` : "sixty pictures"} ` +
              `later ${text(after)}`);
  check(after.heap - before.heap < 2, "the heap is flat");
  // one frame of 320 x 240 kept a second is 69 MB of planes in ten minutes
  check(after.all - before.all < 64, "memory is flat");
}

// The mouth alone over black: the mark's letters are all that is light below.
async function recorded(page) {
  await page.evaluate(() => document.querySelector("input[value=mouth]").click());
  const [download] = await Promise.all([
    page.waitForEvent("download"),
    (async () => {
      await page.click("#record");
      await page.waitForTimeout(3000);
      await page.click("#record");
    })()]);
  await download.saveAs("recorded.webm");
  await page.evaluate(() => document.querySelector("input[value=avatar]").click());
}

// What the card showed before is there again after.
async function lost(page) {
  check(await page.evaluate(async () => {
    spid.seek(0);
    await spid.settled();
    const before = spid.picture();
    const gl = document.getElementById("canvas").getContext("webgl2");
    const card = gl.getExtension("WEBGL_lose_context");
    card.loseContext();
    await new Promise((r) => setTimeout(r, 300));
    const without = spid.picture();
    card.restoreContext();
    await new Promise((r) => setTimeout(r, 500));
    await spid.settled();
    return spid.picture() === before && without !== before;
  }), "a lost graphics card comes back");
}

run(async () => {
  const [file, camera] = process.argv.slice(2);
  const flags = [...FAKE, "--use-fake-ui-for-media-stream",
                 `--use-file-for-fake-video-capture=${path.resolve(camera)}`];
  const { page, errors, requests, close } =
    await ready(file, { flags, width: 1100, height: 620, acceptDownloads: true });
  await driven(page);
  await flat(page);
  await recorded(page);
  await page.click("#camera");
  check(await page.evaluate(() => !spid.live.open && !spid.live.stream), "the camera stops");
  await lost(page);
  await drop(page, camera, "video/y4m");
  await page.waitForFunction(() => /cannot play/.test(
    document.getElementById("said").textContent));
  console.log(await said(page));
  await playerManners(page, errors.filter((e) => !/Context Lost/i.test(e)), requests);
  await close();
  await refused(file, { flags: [...FAKE, "--deny-permission-prompts"] }, "not allowed");
  await refused(file, {}, "no camera|not allowed");
  await refused(file, {}, "lacks WebAssembly SIMD",
                () => { WebAssembly.validate = () => false; });
});
