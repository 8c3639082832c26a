// node sorry.cjs CUT NONE GOOD: pages without a whole avatar, and a good one
// in a browser without WebGL 2, each say what is wrong in one sentence.
const { open, check, run } = require("./browser.cjs");

async function sorry(file, pattern, flags = []) {
  const { page, close } = await open(file, { flags });
  await page.waitForFunction(() => document.getElementById("wait").className === "bad");
  const text = await page.textContent("#wait");
  console.log(text);
  check(pattern.test(text) && await page.isVisible("#wait"), `${file} says ${pattern}`);
  await close();
}

run(async () => {
  const [cut, none, good] = process.argv.slice(2);
  await sorry(cut, /cannot show the avatar: it is damaged or cut short/);
  await sorry(none, /cannot show the avatar: there is none in it/);
  await sorry(good, /cannot show the avatar: this browser has no WebGL 2/,
              ["--disable-3d-apis"]);
});
