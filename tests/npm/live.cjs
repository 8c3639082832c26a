// node live.cjs PAGE FRAMES RATE NEUTRAL CLIP...: the page of spid-export --html --live
// in a browser, driven by the frames of video files.  Writes CLIP.json: the
// portrait window that it took and, of every frame, the motion it found before
// any smoothing, or null, and what the page's person did: since frame NEUTRAL,
// when "Neutral now" is clicked.
const fs = require("fs");
const { open, check, run } = require("./browser.cjs");

async function motions(page, clip, frames, rate, neutral) {
  await page.evaluate(() => spid.live.stop());
  await page.setInputFiles("#picked", clip);
  await page.waitForFunction(() => spid.live.open);
  const found = [], driven = [];
  let window = null;
  for (let i = 0; i < frames; i++) {
    const f = await page.evaluate((t) => spid.live.at(t), (i + 0.5) / rate);
    window = f.window ?? window;
    found.push(f.row ?? null);
    driven.push(f.driven ?? null);
    if (i === neutral) await page.click("#rest");
  }
  fs.writeFileSync(`${clip}.json`, JSON.stringify({ window, found, driven }));
}

run(async () => {
  const [file, frames, rate, neutral, ...clips] = process.argv.slice(2);
  const { page, errors, requests, close } = await open(file);
  await page.waitForFunction(() => window.spid);
  await page.evaluate(() => { spid.live.smooth = 0; spid.live.held = true; spid.size(64, 64); });
  for (const clip of clips) await motions(page, clip, frames, rate, +neutral);
  console.log("meter:", await page.textContent("#meter"));
  for (const text of errors) check(false, `console: ${text}`);
  for (const url of requests) check(false, `asked for ${url}`);
  await close();
});
