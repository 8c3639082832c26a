// node module.mjs AVATAR DRIVE.json MEANS.json: the module of examples/web
// (spid-avatar, resolved from the working directory) in node: driven by the
// MOTN records of DRIVE, its Gaussians are where those of MEANS (spid-branches
// --full) are.
import fs from "node:fs";
import { Avatar } from "spid-avatar";

const [file, drive, means] = process.argv.slice(2);
const records = (path, type) => fs.readFileSync(path, "utf8").trim().split("\n")
  .map((l) => JSON.parse(l)).filter((r) => r.type === type)
  .map((r) => (name) => r.arrays.find((a) => a.name === name).data);
const bytes = fs.readFileSync(file);
const avatar = new Avatar(bytes);
const rows = records(drive, "MOTN").map((r) =>
  ["rot", "trans", "jaw", "lid", "eye", "exp"].flatMap(r));
const ours = records(means, "GAUS").map((r) => r("mean"));

let worst = 0;
if (rows.length < 3 || ours.length !== rows.length) throw new Error("no drive to compare");
rows.forEach((row, n) => {
  avatar.drive(row);
  const found = avatar.pose().means;
  for (let i = 0; i < ours[n].length / 3; i++)
    for (let c = 0; c < 3; c++)
      worst = Math.max(worst, Math.abs(found[4 * i + c] - ours[n][3 * i + c]));
});
// 16 bits of a head two units wide, through the blendshapes: 20 micrometres
console.log(`${rows.length} frames, ${avatar.count} Gaussians: ${worst.toExponential(1)} head ` +
            "units at most, limit 1e-4");
const before = avatar.pose().means.slice();
avatar.set("jawOpen", 0.8);
const moved = avatar.pose().means.some((v, i) => Math.abs(v - before[i]) > 0.05);
avatar.set("jawOpen", null);
const back = avatar.pose().means.every((v, i) => v === before[i]);
const says = (f, pattern) => {
  try { f(); } catch (e) { return pattern.test(e.message); }
  return false;
};
const told = says(() => avatar.set("jawopen", 1), /no such value/) &&
             says(() => new Avatar(bytes.subarray(0, 5000)), /not all of it/);
if (!(worst < 1e-4 && moved && back && told)) {
  console.log("FAILED", { worst, moved, back, told });
  process.exitCode = 1;
}
