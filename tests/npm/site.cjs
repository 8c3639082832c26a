// node site.cjs FOLDER: examples/web as a static host serves it, in a browser:
// the avatar moves in a three.js scene, an avatar that is none is said, and
// nothing is asked of others.
const fs = require("fs");
const http = require("http");
const path = require("path");
const { open, check, run } = require("./browser.cjs");

const types = { ".html": "text/html", ".js": "text/javascript" };

function serve(folder) {
  const server = http.createServer((request, answer) => {
    const name = path.join(folder, new URL(request.url, "http://x").pathname);
    if (!fs.existsSync(name)) { answer.writeHead(404).end(); return; }
    answer.writeHead(200, { "Content-Type": types[path.extname(name)] ?? "application/octet-stream" });
    fs.createReadStream(name).pipe(answer);
  });
  return new Promise((r) => { server.listen(0, "127.0.0.1", () => r(server)); });
}

run(async () => {
  const server = await serve(process.argv[2]);
  const site = `http://127.0.0.1:${server.address().port}/index.html`;
  const { page, errors, requests, close } = await open("/dev/null", { width: 256, height: 256 });
  await page.goto(site);
  await page.waitForFunction(() => window.frames_drawn > 1);
  const one = await page.screenshot();
  await page.waitForFunction(() => window.frames_drawn > 4);
  const two = await page.screenshot({ path: "site.png" });
  check(!one.equals(two), "the avatar moves");
  for (const text of errors) check(/favicon/.test(text) || /404/.test(text), `console: ${text}`);
  for (const url of requests)
    check(url.startsWith(site.replace("index.html", "")), `asked for ${url}`);
  await page.goto(`${site}?avatar=index.html`);
  await page.waitForFunction(() => /No avatar: this is no avatar/.test(
    document.getElementById("say").textContent));
  console.log(await page.textContent("#say"));
  await close();
  server.close();
});
