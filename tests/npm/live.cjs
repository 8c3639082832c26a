// node live.cjs PAGE CLIP FRAMES RATE: the page of spid-export --html --live
// in a browser, driven by the frames of a video file.  Writes motion.json: the
// portrait window that it took and, of every frame, the motion it found before
// any smoothing, or null.
const fs = require("fs");
const { open, check, run } = require("./browser.cjs");

run(async () => {
  const [file, clip, frames, rate] = process.argv.slice(2);
  const { page, errors, requests, close } = await open(file);
  await page.waitForFunction(() => window.spid);
  await page.evaluate(() => { spid.live.smooth = 0; spid.live.held = true; spid.size(64, 64); });
  await page.setInputFiles("#picked", clip);
  await page.waitForFunction(() => spid.live.open || /not|cannot|fails/.test(
    document.getElementById("said").textContent));
  console.log(await page.textContent("#said"));
  const found = [];
  let window = null;
  for (let i = 0; i < frames; i++) {
    const f = await page.evaluate((t) => spid.live.at(t), (i + 0.5) / rate);
    window = f.window ?? window;
    found.push(f.row ?? null);
  }
  console.log("meter:", await page.textContent("#meter"));
  fs.writeFileSync("motion.json", JSON.stringify({ window, found }));
  for (const text of errors) check(false, `console: ${text}`);
  for (const url of requests) check(false, `asked for ${url}`);
  await close();
});
