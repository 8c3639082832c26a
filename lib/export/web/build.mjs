// node build.mjs OUT: the player as one file, OUT, that lacks only the avatar
// (formats/pagefile.h).  make web runs a copy of this folder, where npm has
// installed what package.json names.
import { build } from "esbuild";
import { readFileSync, writeFileSync } from "node:fs";

async function bundle(entry, plugins = []) {
  const made = await build({
    entryPoints: [entry], bundle: true, minify: true,
    format: "iife", target: "es2022", write: false, legalComments: "inline",
    plugins });
  return made.outputFiles[0].text;
}

// import code from "worker": the bundled worker as a string.
const worker = {
  name: "worker",
  setup(b) {
    b.onResolve({ filter: /^worker$/ }, () => ({ path: "worker", namespace: "text" }));
    b.onLoad({ filter: /.*/, namespace: "text" }, async () => ({
      contents: await bundle("worker.js"), loader: "text" }));
  },
};

const notice = ["three", "fflate"].map((name) =>
  `${name}: ${readFileSync(`node_modules/${name}/LICENSE`, "utf8").trim()}`)
  .join("\n\n");
const script = (await bundle("main.js", [worker])).replaceAll("</script", "<\\/script");
const style = readFileSync("player.css", "utf8");
const page = readFileSync("player.html", "utf8")
  .replace("/*STYLE*/", () => style)
  .replace("/*SCRIPT*/", () => `/* Parts of this script are other people's:\n\n${notice} */\n${script}`);
if (page.split("<!--AVATAR-->").length !== 2)
  throw new Error("the page has no single place for the avatar");
writeFileSync(process.argv[2], page);
