// node build.mjs OUT LIVE MODULE: the player as one file, OUT, that lacks only
// the avatar (formats/pagefile.h); LIVE, which a camera can drive, too, where
// there is an engine, glue.mjs and glue.wasm; and MODULE, for other people's
// sites (examples/web).  make web runs a copy of this folder, where npm has
// installed what package.json names.
import { build } from "esbuild";
import { existsSync, readFileSync, writeFileSync } from "node:fs";
import { deflateSync } from "node:zlib";

const read = (path) => readFileSync(path, "utf8");

async function bundle(entry, plugins = []) {
  const made = await build({
    entryPoints: [entry], bundle: true, minify: true,
    format: "iife", target: "es2022", write: false, legalComments: "inline",
    define: { window: "globalThis", "import.meta.url": "\"\"" },
    logOverride: { "assign-to-define": "silent" }, plugins });
  return made.outputFiles[0].text;
}

// import code from "worker" or "engine": that bundled worker as a string.
const workers = {
  name: "workers",
  setup(b) {
    b.onResolve({ filter: /^(worker|engine)$/ },
                ({ path }) => ({ path, namespace: "text" }));
    b.onLoad({ filter: /.*/, namespace: "text" }, async ({ path }) => ({
      contents: await bundle(`${path}.js`), loader: "text" }));
  },
};

// import { Live } from "live": live.js, or nothing.
const live = (on) => ({
  name: "live",
  setup(b) {
    b.onResolve({ filter: /^live$/ }, ({ resolveDir }) => on
      ? { path: `${resolveDir}/live.js` } : { path: "live", namespace: "none" });
    b.onLoad({ filter: /.*/, namespace: "none" },
             () => ({ contents: "export const Live = null;", loader: "js" }));
  },
});

// The engine's code, deflated, as the text of an element.
function engine() {
  const wasm = readFileSync("glue.wasm");
  return `<script type="application/x-wasm" id="engine">${
    deflateSync(wasm, { level: 9 }).toString("base64")}</script>\n`;
}

function notice(names) {
  const file = (name) => [`node_modules/${name}/LICENSE`, `node_modules/${name}/LICENSE.md`]
    .find(existsSync);
  return names.map((name) => `${name}: ${file(name)
    ? read(file(name)).trim()
    : `${JSON.parse(read(`node_modules/${name}/package.json`)).license} licence`}`)
    .join("\n\n") + "\n\nEmscripten's runtime and musl: MIT licence";
}

async function page(out, on) {
  const script = (await bundle("main.js", [workers, live(on)]))
    .replaceAll("</script", "<\\/script");
  const names = ["three", "fflate", ...on ? ["tracking"] : []];
  const text = read("player.html")
    .replace("/*STYLE*/", () => read("player.css"))
    .replace(" /*WASM*/", on ? " 'wasm-unsafe-eval'" : "")
    .replace("/*MEDIA*/", on ? "; media-src blob:" : "")
    .replace("<!--LIVE-->", () => on ? read("live.html") : "")
    .replace("<!--ENGINE-->", () => on ? engine() : "")
    .replace("/*SCRIPT*/", () => "/* Parts of this script are other people's:\n\n" +
      `${notice(names).replaceAll("*/", "* /")} */\n${script}`);
  if (text.split("<!--AVATAR-->").length !== 2)
    throw new Error("the page has no single place for the avatar");
  writeFileSync(out, text);
}

// The module for sites, which bring their own three.js.
async function module(out) {
  const made = await build({
    entryPoints: ["avatar.js"], bundle: true, minify: true, format: "esm",
    target: "es2022", write: false, external: ["three", "three/*"],
    banner: { js: `/* ${notice(["fflate"]).replaceAll("*/", "* /")} */` } });
  writeFileSync(out, made.outputFiles[0].text);
}

await page(process.argv[2], false);
if (existsSync("glue.wasm")) await page(process.argv[3], true);
await module(process.argv[4]);
