// node onnx.cjs DIR: runs each network of DIR/cases.json with onnxruntime on
// its inputs and compares what it gives with ours.  A line for each output:
// the largest difference, over the larger of 1 and the output's own size.
const fs = require("fs");
const path = require("path");
const ort = require("onnxruntime-node");

const LIMIT = 1e-4;

const floats = (file) => {
  const b = fs.readFileSync(file);
  return new Float32Array(b.buffer.slice(b.byteOffset, b.byteOffset + b.length));
};

async function main(dir) {
  let failed = 0;
  for (const { file, inputs, outputs } of
       JSON.parse(fs.readFileSync(path.join(dir, "cases.json")))) {
    const session = await ort.InferenceSession.create(path.join(dir, file),
      { intraOpNumThreads: 1, logSeverityLevel: 3 });
    const feeds = {};
    for (const [name, dims] of Object.entries(inputs))
      feeds[name] = new ort.Tensor("float32",
        floats(path.join(dir, `${file}.${name}`)), dims);
    const found = await session.run(feeds);
    for (const name of outputs) {
      const ours = floats(path.join(dir, `${file}.${name}`));
      const theirs = found[name].data;
      let most = 0, size = 1;
      for (let i = 0; i < ours.length; i++) {
        most = Math.max(most, Math.abs(ours[i] - theirs[i]));
        size = Math.max(size, Math.abs(ours[i]));
      }
      const ok = theirs.length === ours.length && most / size <= LIMIT;
      console.log(`${file} ${name} ${ours.length} numbers: ${(most / size).toExponential(1)}` +
                  `, limit ${LIMIT}: ${ok ? "ok" : "FAILED"}`);
      failed += !ok;
    }
  }
  process.exit(failed ? 1 : 0);
}

main(process.argv[2]);
