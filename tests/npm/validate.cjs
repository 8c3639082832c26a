// node validate.cjs FILE...: the Khronos validator; exit 1 on any error or
// warning it reports.
const fs = require("fs");
const path = require("path");
const top = process.env.TOP || path.join(__dirname, "../..");
const validator = require(path.join(top, "build/npm/node_modules/gltf-validator"));

(async () => {
  let bad = 0;
  for (const file of process.argv.slice(2)) {
    const report = await validator.validateBytes(
      new Uint8Array(fs.readFileSync(file)), { maxIssues: 20 });
    const found = report.issues;
    console.log(`${file}: ${found.numErrors} errors, ${found.numWarnings} warnings`);
    for (const m of found.messages.filter((m) => m.severity < 2))
      console.log(`  ${m.code} ${m.pointer}: ${m.message}`);
    bad += found.numErrors + found.numWarnings;
  }
  process.exit(bad ? 1 : 0);
})();
