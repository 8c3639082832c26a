// node smiles.mjs DIR [PERSON...]: each person of the London set (or these: 012) from the
// neutral photograph, the avatar's source, to the smiling one, which drives it; results
// in DIR, by examples/reenact.sh, figures by the judge's landmarker.
//
// By split (examples/model/splits.tsv), and by the individual typology angle of the
// cheeks of the neutral photograph: people; decibels of the first frame, of the smile and
// of the neutral photograph in its place; how far the mouth's width, its opening, lids and
// brows (right, left) go where the truth goes 1 (least squares), and r over people; how
// far the openings of lids are off, mm.
import { execFileSync } from 'node:child_process';
import { existsSync, mkdirSync, readFileSync, readdirSync } from 'node:fs';
import { join } from 'node:path';

const top = join(import.meta.dirname, '../..'), shared = process.env.SHARED ?? join(top, '../shared');
const photos = join(shared, 'assets/photos/london'), [dir, ...chosen] = process.argv.slice(2);
if (!dir) {
  console.error('smiles.mjs DIR [PERSON...]');
  process.exit(64);
}
const { Models, frames } = await import(join(shared, 'tools/judge/models.mjs'));
const { features } = await import(join(shared, 'tools/judge/features.mjs'));
const models = await Models.start();
const WAYS = ['mouth_width', 'mouth_open', 'eye_r', 'eye_l', 'brow_r', 'brow_l'];
const CHEEKS = [50, 280];
const TONES = [[41, 'light, over 41 degrees'], [28, 'intermediate, 28 to 41'],
  [-30, 'tan to brown, -30 to 28'], [-Infinity, 'dark, under -30']];

const read = async path => {
  const all = [];
  for await (const frame of frames(path)) all.push(frame);
  return all;
};
const mean = v => v.reduce((a, b) => a + b, 0) / v.length;
const decibels = (a, b) => 10 * Math.log10(255 ** 2 / mean(Array.from(a.rgb, (x, i) => (x - b.rgb[i]) ** 2)));

/** Degrees (Chardon, Cretois and Hourseau 1991) of the mean colour of both cheeks. */
function typology(frame, points) {
  const radius = 0.05 * Math.hypot(points[263][0] - points[33][0], points[263][1] - points[33][1]);
  const at = [];
  for (const [x, y] of CHEEKS.map(i => points[i]))
    for (let v = Math.ceil(y - radius); v <= y + radius; v++)
      for (let u = Math.ceil(x - radius); u <= x + radius; u++) at.push(3 * (v * frame.w + u));
  const [r, g, b] = [0, 1, 2].map(k => mean(at.map(i => {
    const c = frame.rgb[i + k] / 255;
    return c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
  })));
  const cube = t => t > (6 / 29) ** 3 ? Math.cbrt(t) : t / 3 * (29 / 6) ** 2 + 4 / 29;
  const y = cube(0.2126 * r + 0.7152 * g + 0.0722 * b), z = cube((0.0193 * r + 0.1192 * g + 0.9505 * b) / 1.089);
  return Math.atan2(116 * y - 16 - 50, 200 * (y - z)) * 180 / Math.PI;
}

const splits = readFileSync(join(top, 'examples/model/splits.tsv'), 'utf8').split('\n').map(l => l.split('\t'));
const people = readdirSync(photos).filter(f => f.endsWith('_smiling.jpg')).map(f => f.slice(0, 3))
  .filter(p => existsSync(join(photos, `${p}_neutral.jpg`)) && (!chosen.length || chosen.includes(p)));
mkdirSync(join(dir, 'clips'), { recursive: true });
for (const p of people)
  execFileSync('ffmpeg', ['-nostdin', '-v', 'error', '-y', ...['neutral', 'smiling'].flatMap(f => ['-i', join(photos, `${p}_${f}.jpg`)]),
    '-filter_complex', '[0:v]format=rgb24[a];[1:v]format=rgb24[b];[a][b]concat=n=2', '-c:v', 'ffv1', '-pix_fmt', 'bgr0',
    join(dir, 'clips', `${p}.mkv`)]);
execFileSync(join(top, 'examples/reenact.sh'), ['-c', '-o', dir, ...people.map(p => join(dir, 'clips', `${p}.mkv`))],
  { env: { ...process.env, JUDGE: 'none', PATH: `${join(top, process.env.BUILD ?? 'build', 'bin')}:${process.env.PATH}` },
    stdio: ['ignore', 'ignore', 'inherit'] });

const rows = [];
for (const name of people) {
  const [truth, made] = await Promise.all(['truth', 'self'].map(kind => {
    const inside = join(dir, kind, `${name}.inside`);
    return read(existsSync(inside) ? inside : join(dir, kind, name));
  }));
  const points = [];
  for (const frame of [...truth, ...made]) points.push(await models.landmarks(frame));
  const [a, b, c, d] = points.map(features), way = (u, v) => WAYS.map(k => v[k] - u[k]);
  rows.push({ split: splits.find(s => s[1] === 'photos' && s[2].endsWith(`london/${name}_`))[0],
    angle: typology(truth[0], points[0]), truth: way(a, b), made: way(c, d),
    decibels: [decibels(truth[0], made[0]), decibels(truth[1], made[1]), decibels(truth[1], truth[0])],
    lids: 10 * mean(['eye_r', 'eye_l'].map(k => Math.abs(d[k] - b[k]))) });
}

function print(name, group) {
  if (!group.length) return;
  const dot = (a, b) => mean(a.map((x, i) => x * b[i])), moments = (a, b) => dot(a, b) - mean(a) * mean(b);
  const columns = key => WAYS.map((_, k) => group.map(row => row[key][k]));
  const t = columns('truth'), m = columns('made');
  console.log(name.padEnd(24), String(group.length).padStart(3),
    ...[0, 1, 2].map(k => mean(group.map(row => row.decibels[k])).toFixed(1)),
    '| share', ...t.map((x, k) => (dot(x, m[k]) / dot(x, x)).toFixed(2)),
    '| r', ...t.map((x, k) => (moments(x, m[k]) / Math.sqrt(moments(x, x) * moments(m[k], m[k]))).toFixed(2)),
    '| lids', mean(group.map(row => row.lids)).toFixed(1));
}
for (const split of ['training', 'validation', 'test']) print(split, rows.filter(row => row.split === split));
for (const [i, [least, name]] of TONES.entries())
  print(name, rows.filter(row => row.angle > least && !(i && row.angle > TONES[i - 1][0])));
