// node player.cjs PAGE SIZE: the page of spid-export --html in a browser.
// Writes pose_N.png and pose_N.cam (the twelve numbers for spid-splat
// --camera) of three poses, each SIZE pixels wide, the last one from an orbit;
// tries controls, keys, links and a phone's screen; prints frames a second.
const fs = require("fs");
const { open, check, playerManners, run } = require("./browser.cjs");

async function pictures(page, size) {
  await page.evaluate((n) => spid.size(n, n), size);
  for (const [n, turn] of [[0, 0], [1, 0], [2, 4]]) {
    for (let k = 0; k < turn; k++) await page.keyboard.press("Shift+ArrowRight");
    const [cam, png] = await page.evaluate(async (i) => {
      spid.seek(i);
      await spid.settled();
      return [spid.camera(), spid.picture()];
    }, n);
    fs.writeFileSync(`pose_${n}.cam`, cam.join(","));
    fs.writeFileSync(`pose_${n}.png`, Buffer.from(png.split(",")[1], "base64"));
  }
}

// A slider holds its value, a link brings all of it back.
async function controls(page) {
  await page.evaluate(() => spid.size(32, 32));
  await page.keyboard.press("p");
  await page.click("text=Jaw, lids and gaze");
  const set = (name, value) => page.evaluate(([name, value]) => {
    const label = [...document.querySelectorAll(".slider label")].find((l) => l.title === name);
    const input = document.getElementById(label.htmlFor);
    input.value = value;
    input.dispatchEvent(new Event("input"));
    return spid.settled();
  }, [name, value]);
  await set("jaw", 0.5);
  await set("mouthSmile_L", 0.75);
  await set("eyeLookUp_L", 1);
  const held = await page.evaluate(() => spid.values());
  check(Math.abs(held[6] - 0.221) < 1e-3, `jaw slider: ${held[6]} rad`);
  check(Math.abs(held[11] + 0.4363) < 1e-3, `gaze slider: ${held[11]} rad`);
  check(Math.abs(held[17 + 45] - 0.75) < 1e-3, `smile slider: ${held[17 + 45]}`);
  await page.keyboard.press("w");
  await page.keyboard.press("3");
  const { link, camera } = await page.evaluate(() => ({ link: spid.link(), camera: spid.camera() }));
  await page.evaluate(() => { location.hash = "#frame=0&view=avatar&mesh=0"; });
  await page.evaluate(() => spid.settled());
  check(await page.evaluate(() => spid.values()[6]) !== held[6], "a plain link holds nothing");
  await page.evaluate((link) => { location.hash = link.split("#")[1]; }, link);
  await page.evaluate(() => spid.settled());
  const back = await page.evaluate(() => ({
    values: spid.values(), camera: spid.camera(),
    view: document.querySelector("input[name=view]:checked").value,
    mesh: document.getElementById("mesh").checked }));
  check(back.values.every((v, i) => Math.abs(v - held[i]) < 1e-3), "the link's sliders");
  check(back.camera.every((v, i) => Math.abs(v - camera[i]) < 1e-3), "the link's camera");
  check(back.view === "dynamic" && back.mesh, "the link's view");
  const names = await page.evaluate(() => [...document.querySelectorAll(".slider label")]
    .map((l) => l.title));
  check(new Set(names).size === names.length && names.length === 53 + 12,
        `${names.length} sliders, each once (expected 65)`);
}

// It plays when it is opened, but not for those who asked for less motion.
async function still(page) {
  const address = (await page.evaluate(() => location.href)).split("#")[0];
  for (const reducedMotion of ["no-preference", "reduce"]) {
    await page.emulateMedia({ reducedMotion });
    await page.goto("about:blank");
    await page.goto(address);
    await page.waitForFunction(() => window.spid);
    const plays = await page.evaluate(() => document.getElementById("play").classList.contains("on"));
    check(plays === (reducedMotion !== "reduce"), `reduced motion ${reducedMotion}: plays ${plays}`);
  }
}

// Frames a second while it plays, in software.
async function pace(page) {
  const rate = await page.evaluate(async () => {
    spid.play(true);
    const before = spid.drawn(), began = performance.now();
    await new Promise((r) => setTimeout(r, 3000));
    spid.play(false);
    return (spid.drawn() - before) / (performance.now() - began) * 1000;
  });
  check(rate > 0, "it plays");
  return rate;
}

run(async () => {
  const [file, size] = process.argv.slice(2);
  const { page, errors, requests, close } = await open(file, { hash: "#frame=0" });
  await page.waitForFunction(() => window.spid);
  await pictures(page, Number(size));
  const rate = await pace(page);
  await controls(page);
  await still(page);
  await playerManners(page, errors, requests);
  console.log(`${rate.toFixed(1)} frames a second at ${size} x ${size}, in software`);
  await close();
});
