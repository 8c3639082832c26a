// node validate.cjs FILE...: the Khronos validator; exit 1 on any error or
// warning it reports.  Its newest release (2.0.0-dev.3.10) does not know
// KHR_gaussian_splatting and calls that extension's attribute names invalid:
// those four findings, and no others, are counted apart.
const fs = require("fs");
const path = require("path");
const top = process.env.TOP || path.join(__dirname, "../..");
const validator = require(path.join(top, "build/npm/node_modules/gltf-validator"));

(async () => {
  let bad = 0;
  for (const file of process.argv.slice(2)) {
    const report = await validator.validateBytes(
      new Uint8Array(fs.readFileSync(file)), { maxIssues: 20 });
    const found = report.issues.messages.filter((m) => m.severity < 2);
    const names = found.filter((m) =>
      m.code === "MESH_PRIMITIVE_INVALID_ATTRIBUTE" &&
      /attributes\/KHR_gaussian_splatting:[A-Z0-9_]+$/.test(m.pointer));
    const rest = found.filter((m) => !names.includes(m));
    console.log(`${file}: ${rest.length} errors or warnings, ` +
      `${names.length} names of KHR_gaussian_splatting it does not know`);
    for (const m of rest)
      console.log(`  ${m.code} ${m.pointer}: ${m.message}`);
    bad += rest.length;
  }
  process.exit(bad ? 1 : 0);
})();
