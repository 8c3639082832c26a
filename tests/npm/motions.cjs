// node motions.cjs PAGE.json found|driven OURS.json: motions of a page (live.cjs)
// against those of spid-dump --json --values: for every number that varies, the
// difference as a share of its range over the clip, at the worst frame.  The first
// crop comes from another face finder here than there; what differs because of
// that is gone after a few frames, which are left out.
const fs = require("fs");

const LIMIT = 0.02, SETTLED = 5;
const [page, which, ours] = process.argv.slice(2);
const found = JSON.parse(fs.readFileSync(page))[which];
const rows = fs.readFileSync(ours, "utf8").trim().split("\n").map((l) => JSON.parse(l))
  .filter((r) => r.type === "MOTN").map(({ arrays }) =>
    ["rot", "trans", "jaw", "lid", "eye", "exp"].flatMap((name) =>
      arrays.find((a) => a.name === name).data));
const groups = { rotation: [0, 9], translation: [9, 12], jaw: [12, 15], lids: [15, 17],
                 eyes: [17, 23], expression: [23, 123] };

console.log(`${found.length} frames of the page, ${found.filter((r) => !r).length} lost; ` +
            `${rows.length} of spid-motion`);
let failed = found.length !== rows.length || found.some((r) => !r);
for (const [name, [from, to]] of Object.entries(groups)) {
  let worst = 0, most = 0, span = 0, moved = 0;
  for (let k = from; k < to && !failed; k++)
    span = Math.max(span, Math.max(...rows.map((r) => r[k])) - Math.min(...rows.map((r) => r[k])));
  for (let k = from; k < to && !failed; k++) {
    const ends = rows.map((r) => r[k]);
    const range = Math.max(...ends) - Math.min(...ends);
    // numbers that stay within a twentieth of the group's movement do not move
    if (range < span / 20) continue;
    const off = rows.map((r, i) => Math.abs(r[k] - found[i][k]) / range).slice(SETTLED);
    moved++;
    worst = Math.max(worst, off.reduce((s, v) => s + v, 0) / off.length);
    most = Math.max(most, ...off);
  }
  const ok = moved > 0 && most <= LIMIT;
  console.log(`${name}, ${moved} numbers: mean ${(100 * worst).toFixed(2)} % of the range at the worst number, ` +
              `${(100 * most).toFixed(2)} % at the worst frame: ${ok ? "ok" : "FAILED"}`);
  failed ||= !ok;
}
process.exit(failed ? 1 : 0);
