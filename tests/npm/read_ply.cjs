// node read_ply.cjs FILE: read a PLY with loaders.gl, an independent reader,
// and print the number of vertices and the means of some properties.
const fs = require("fs");
const path = require("path");
const top = process.env.TOP || path.join(__dirname, "../..");
const modules = path.join(top, "build/npm/node_modules");
const { parse } = require(path.join(modules, "@loaders.gl/core"));
const { PLYLoader } = require(path.join(modules, "@loaders.gl/ply"));

(async () => {
  const bytes = fs.readFileSync(process.argv[2]);
  const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
  const scene = await parse(buffer, PLYLoader, { worker: false });
  const positions = scene.attributes.POSITION.value;
  let sum = 0;
  for (const x of positions) sum += x;
  console.log(`${positions.length / 3} vertices, mean ${(sum / positions.length).toFixed(6)}`);
})().catch((e) => { console.error(e); process.exit(1); });
