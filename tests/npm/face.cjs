// node face.cjs PAGE NOT-A-PICTURE NO-FACE PHOTO...: each photograph dropped on
// the page of spid-export --html --live becomes its avatar, which is drawn as the
// one that spid-shape and spid-branches make of it in the same window; files that
// show no face are refused in a sentence.
const { execFileSync } = require("child_process");
const { open, check, drop, run } = require("./browser.cjs");

const SIDE = 384, LEAST = 40;
const POSES = [{ yaw: 0, pitch: 0, jaw: 0 }, { yaw: 20, pitch: 0, jaw: 0.4 },
               { yaw: -25, pitch: 10, jaw: 0.4 }];

const said = (page, pattern) => page.waitForFunction((p) => {
  const { textContent } = document.getElementById("said");
  return new RegExp(p).test(textContent) && textContent;
}, pattern).then((found) => found.jsonValue());

async function begin(file) {
  const browser = await open(file, { width: 1100, height: 620 });
  await browser.page.waitForFunction(() => window.spid);
  await browser.page.evaluate((n) => spid.size(n, n), SIDE);
  return browser;
}

// Pixels of the avatar at each pose.
const pictures = (page) => page.evaluate(async ([poses, side]) => {
  const out = [];
  for (const pose of poses) {
    for (const label of document.querySelectorAll(".slider label")) {
      if (!(label.title in pose)) continue;
      const input = document.getElementById(label.htmlFor);
      input.value = pose[label.title];
      input.dispatchEvent(new Event("input"));
    }
    await spid.settled();
    const image = new Image();
    image.src = spid.picture();
    await image.decode();
    const paint = new OffscreenCanvas(side, side).getContext("2d");
    paint.drawImage(image, 0, 0);
    out.push(Array.from(paint.getImageData(0, 0, side, side).data));
  }
  return out;
}, [POSES, SIDE]);

function psnr(a, b) {
  const square = a.reduce((s, v, i) => s + (v - b[i]) ** 2, 0);
  return 10 * Math.log10(255 ** 2 / (square / (a.length * 3 / 4)));
}

// The same avatar's pictures, made by the programs.
async function native(photo, window) {
  execFileSync("sh", ["-ec", 'spid-shape -q --window "$1" "$2" -o native.spid;' +
    "spid-branches -q --bake native.spid | spid-export -q --html native.html -i native.spid",
    "sh", window, photo], { stdio: "inherit" });
  const { page, close } = await begin("native.html");
  const out = await pictures(page);
  await close();
  return out;
}

async function made(page, photo) {
  await page.evaluate(() => { document.getElementById("said").textContent = ""; });
  await drop(page, photo, "image/png");
  const outcome = await said(page, "A new face|No avatar|do not start|failed");
  console.log(`${photo}: ${outcome}`);
  if (!outcome.startsWith("A new face")) throw new Error("no new face");
  const found = await pictures(page);
  const expected = await native(photo, await page.evaluate(() => spid.live.window));
  POSES.forEach((pose, i) => {
    const db = psnr(found[i], expected[i]);
    console.log(`${JSON.stringify(pose)}: ${db.toFixed(1)} dB of the native avatar's picture`);
    check(db >= LEAST, `${LEAST} dB`);
  });
}

run(async () => {
  const [file, text, wall, ...photos] = process.argv.slice(2);
  const { page, errors, requests, close } = await begin(file);
  await page.evaluate(() => {
    window.seen = [];
    new MutationObserver(() => seen.push(document.getElementById("making").value))
      .observe(document.getElementById("making"), { attributes: true });
  });
  for (const photo of photos) await made(page, photo);
  check(await page.evaluate(() => seen.length > 3 && Math.max(...seen) > 0.9), "progress is shown");
  await page.setInputFiles("#photo-picked", text);
  console.log(await said(page, "reads no picture"));
  const began = performance.now();
  await page.setInputFiles("#photo-picked", wall);
  console.log(await said(page, "No avatar of that photograph: no face[^-]*$"),
              `${((performance.now() - began) / 1000).toFixed(1)} s`);
  check(await page.evaluate(() => !document.getElementById("camera").disabled &&
                                  document.getElementById("making").hidden), "it goes on");
  for (const text of errors) check(false, `console: ${text}`);
  for (const url of requests) check(false, `asked for ${url}`);
  await close();
});
