// node lips.mjs [-s SPLIT] DIR [OPTION...]: how a source's lips follow a driver's, as the
// judge's landmarker sees both.  OPTIONs are spid-animate's.
//
// The first two clips of a split (validation; examples/model/splits.tsv) drive every
// person of its photographs and the first frames of both clips; results in DIR.  Opening
// and width of the inner lips, in percent of the distance of the outer eye corners:
// driver's and result's mean, r, gain (how far the result goes where the driver goes 1,
// by least squares), and the root mean square of what is left of the difference of their
// courses.  Frames whose driver opens by less than 3 %: the opening's mean there.
//
// Lines to beat: the result held still has r 0, gain 0 and the driver's own spread as
// error ("still"); "other" is the same source's result of the other driver.
import { execFileSync } from 'node:child_process';
import { existsSync, mkdirSync, readFileSync, readdirSync } from 'node:fs';
import { basename, dirname, join } from 'node:path';

const top = join(import.meta.dirname, '../..'), shared = process.env.SHARED ?? join(top, '../shared');
const args = process.argv.slice(2), split = args[0] === '-s' ? args.splice(0, 2)[1] : 'validation';
const [dir, ...options] = args;
if (!dir) {
  console.error('lips.mjs [-s SPLIT] DIR [OPTION...]');
  process.exit(64);
}
const { Models, frames } = await import(join(shared, 'tools/judge/models.mjs'));
const models = await Models.start();
const named = kind => readFileSync(join(top, 'examples/model/splits.tsv'), 'utf8').split('\n')
  .map(l => l.split('\t')).filter(l => l[0] === split && l[1] === kind).map(l => join(shared, l[2]));

/** Opening and width of the inner lips of every frame, percent; null where no face is. */
async function lips(path) {
  const track = [];
  let p = null;
  for await (const frame of frames(path)) {
    p = await models.landmarks(frame, p);
    const far = (i, j) => Math.hypot(...p[i].map((v, k) => v - p[j][k]));
    track.push(p && [13, 78].map((i, k) => 100 * far(i, [14, 308][k]) / far(33, 263)));
  }
  return track;
}

const mean = v => v.reduce((a, b) => a + b, 0) / v.length;
const moments = (a, b) => mean(a.map((x, i) => (x - mean(a)) * (b[i] - mean(b))));
function compare(driver, result, k) {
  const both = driver.map((d, i) => [d, result[i]]).filter(([d, r]) => d && r);
  const a = both.map(q => q[0][k]), b = both.map(q => q[1][k]), shut = both.filter(q => q[0][0] < 3);
  const aa = moments(a, a), ab = moments(a, b), bb = moments(b, b);
  return [mean(a), mean(b), ab / Math.sqrt(aa * bb), ab / aa, Math.sqrt(aa + bb - 2 * ab), Math.sqrt(aa),
    ...k ? [] : [mean(shut.map(q => q[0][0])), mean(shut.map(q => q[1][0]))]];
}

const print = (name, v) => console.log(name.padEnd(24) + v.map(x => x.toFixed(2).padStart(8)).join(''));
const clips = named('clip').slice(0, 2);
mkdirSync(dir, { recursive: true });
const firsts = clips.map(clip => {
  const file = join(dir, basename(clip, '.mpg') + '.png');
  execFileSync('ffmpeg', ['-nostdin', '-v', 'error', '-y', '-i', clip, '-frames:v', '1', file]);
  return file;
});
const photos = named('photos').map(prefix => join(dirname(prefix),
  readdirSync(dirname(prefix)).filter(f => f.startsWith(basename(prefix)) && f.endsWith('.jpg')).sort()[0]));
const drivers = await clips.reduce(async (all, clip) => [...await all, await lips(clip)], []);
const rows = clips.map(() => []);
console.log(' '.repeat(24) + ['driver', 'result', 'r', 'gain', 'error', 'still', 'shut', 'result',
  'driver', 'result', 'r', 'gain', 'error', 'still', 'other r'].map(s => s.padStart(8)).join(''));
for (const source of [...photos, ...firsts]) {
  const tracks = [];
  for (const clip of clips) {
    const out = join(dir, `${basename(source, '.jpg').replace('.png', '')}-${basename(clip, '.mpg')}.mkv`);
    if (!existsSync(out))
      execFileSync(join(top, process.env.BUILD ?? 'build', 'bin/spid-animate'),
        ['-q', ...options, source, clip, '-o', out], { stdio: 'inherit' });
    tracks.push(await lips(out));
  }
  tracks.forEach((track, i) => {
    const row = [...compare(drivers[i], track, 0), ...compare(drivers[i], track, 1),
      compare(drivers[i], tracks[1 - i], 0)[2]];
    rows[i].push(row);
    print(`${basename(source).replace(/\..*/, '')} ${basename(clips[i], '.mpg')}`, row);
  });
}
rows.forEach((r, i) => print(`mean ${basename(clips[i], '.mpg')}`, r[0].map((_, k) => mean(r.map(v => v[k])))));
