// node report.cjs PAGE: the page of spid-report in a browser: the video plays,
// the wipe uncovers either side, a chart is a way to its moment.
const { open, check, manners, run } = require("./browser.cjs");

// Mean colour of columns from .. to (shares of the width).
const mean = (page, from, to) => page.evaluate(([from, to]) => {
  const c = document.querySelector("#wipe canvas"), x = Math.round(from * c.width);
  const w = Math.round((to - from) * c.width);
  const d = c.getContext("2d").getImageData(x, 0, w, c.height).data;
  const sum = [0, 0, 0];
  d.forEach((v, i) => { if (i % 4 < 3) sum[i % 4] += v; });
  return sum.map((s) => s / (d.length / 4));
}, [from, to]);

const near = (a, b) => a.every((v, i) => Math.abs(v - b[i]) < 12);

async function wipe(page, value) {
  await page.evaluate((v) => {
    const line = document.getElementById("line");
    line.value = v;
    line.dispatchEvent(new Event("input"));
  }, value);
}

run(async () => {
  const { page, errors, requests, close } =
    await open(process.argv[2], { width: 800, height: 900 });
  await page.waitForFunction(() => document.querySelector("video").currentTime > 0);
  await page.evaluate(() => document.querySelector("video").pause());
  await wipe(page, 50);
  const [left, right] = [await mean(page, 0, 0.5), await mean(page, 0.5, 1)];
  check(near(left, [200, 40, 40]), `driver on the left: ${left}`);
  check(near(right, [40, 60, 200]), `result on the right: ${right}`);
  await wipe(page, 100);
  check(near(await mean(page, 0.5, 1), left), "the wipe shows the driver");
  const chart = page.locator("svg.chart").first();
  const box = await chart.boundingBox();
  await chart.click({ position: { x: box.width * 0.6, y: box.height / 2 } });
  await page.waitForFunction(() => !document.querySelector("video").seeking);
  const time = await page.evaluate(() => document.querySelector("video").currentTime);
  check(time > 0.4 && time < 0.9, `a click on a chart goes to ${time} s`);
  await manners(page, errors, requests);
  await close();
});
