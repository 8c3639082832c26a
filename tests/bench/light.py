#!/usr/bin/env python3
"""Relit avatars beside the truth: people of scans under two lights.

    light.py [-n PEOPLE] DIR [ASSETS]

People of validation's seed from the front and turned by 20 degrees to both sides, 512 x 512
pixels, each under two of validation's panoramas (examples/model/splits.tsv).  The photograph
shows the first frame under one of them; the driver is the clip under the other, and so is the
truth.  Decibels of skin that the truth labels as the face's, and of all of the person, with
`--light` source (not relit), driver (as the network sees it) and the true l of that light
as angles and strength; and how far the network's l is off, on both.  DIR keeps the pictures.
Needs numpy, ffmpeg, `spid-animate` on PATH and ../shared/assets.
"""
import json
import os
import subprocess
import sys

import numpy as np

FACE = [1, 2, 3, 4, 12, 13, 14]
TURNS = '0,-20,20'
N = 512


def run(*args):
    return subprocess.run([str(a) for a in args], check=True, stdout=subprocess.PIPE).stdout


def splits(top):
    """Validation's first seed, and its panoramas."""
    with open(f'{top}/examples/model/splits.tsv') as f:
        rows = [line.rstrip('\n').split('\t') for line in f if line.startswith('validation')]
    seed = next(r[2].split('-')[0] for r in rows if r[1] == 'scans')
    return seed, [os.path.basename(r[2]) for r in rows if r[1] == 'scenery']


def values(path, record, name, what='data'):
    """An array of the first such record that has it."""
    for line in run('spid-dump', '--json', '--values', '--only', record, path).splitlines():
        for a in json.loads(line).get('arrays', []):
            if a['name'] == name:
                return np.array(a[what])


def film(assets, seed, k, light, at):
    """Person k's clip under a panorama: AT.spid, AT.mkv, and its arrays."""
    run('spid-synth', '-q', '--assets', assets, '--seed', seed, '--first', k, '--size', N,
        '--frames', 3, '--fps', 8, '--turn', TURNS, '--effects', 0, '--light',
        f'{assets}/hdri/{light}', '--without', 'mesh', '-o', f'{at}.spid')
    run('spid-dump', '-q', '--only', 'IMAG,MOTN', '--npy', at, '-o', os.devnull, f'{at}.spid')
    rgb, mask, label = (np.load(f'{at}/IMAG.{a}.npy') for a in ('rgb', 'mask', 'label'))
    subprocess.run(['ffmpeg', '-v', 'error', '-y', '-f', 'rawvideo', '-pix_fmt', 'rgb24', '-s',
                    f'{N}x{N}', '-r', '8', '-i', '-', '-c:v', 'ffv1', f'{at}.mkv'],
                   input=rgb.tobytes(), check=True)
    return rgb, mask, label, np.load(f'{at}/MOTN.light.npy')[0]


def window(image, crop, fill):
    """image (N,N,...) in a portrait window, bilinear; fill beyond it."""
    at = (np.arange(N) + 0.5) / N * crop[2] - 0.5
    x, y = crop[0] - crop[2] / 2 + at, crop[1] - crop[2] / 2 + at
    image = np.pad(image.astype(float), [(1, 1)] * 2 + [(0, 0)] * (image.ndim - 2),
                   constant_values=fill)
    x, y = np.clip(x + 1, 0, N), np.clip(y + 1, 0, N)
    for axis, p in ((0, y), (1, x)):
        low = p.astype(int)
        w = (p - low).reshape([-1 if i == axis else 1 for i in range(image.ndim)])
        image = image.take(low, axis) * (1 - w) + image.take(low + 1, axis) * w
    return image


def angles(l):
    """l as --light takes it."""
    x, y, z = l
    strength = np.linalg.norm(l)
    return '%.3f,%.3f,%.4f' % (np.degrees(np.arctan2(x, -z)),
                               np.degrees(np.arcsin(np.clip(-y / max(strength, 1e-6), -1, 1))),
                               min(strength, 1))


def animate(at, light, name, frames):
    out = f'{at}.{name}'
    run('spid-animate', '-q', '--absolute', '--light', light, f'{at}.me.spid', f'{at}.motion.spid',
        '-o', f'{out}.y4m.mkv')
    raw = run('ffmpeg', '-v', 'error', '-i', f'{out}.y4m.mkv', '-f', 'rawvideo', '-pix_fmt', 'rgb24', '-')
    return np.frombuffer(raw, np.uint8).reshape(frames, N, N, 3)


def decibels(a, b, where):
    return -10 * np.log10((((a - b)[where] / 255) ** 2).mean())


def person(assets, seed, k, lights, work):
    at = f'{work}/{k}'
    photo = film(assets, seed, k, lights[0], f'{at}.a')
    truth = film(assets, seed, k, lights[1], f'{at}.b')
    run('ffmpeg', '-v', 'error', '-y', '-i', f'{at}.a.mkv', '-frames:v', 1, f'{at}.a.png')
    run('spid-shape', '-q', f'{at}.a.png', '-o', f'{at}.me.spid')
    crop = values(f'{at}.me.spid', 'SRCI', 'crop')
    run('spid-motion', '-q', '--light', '--no-align', '--window', ','.join(map(str, crop)),
        f'{at}.b.mkv', '-o', f'{at}.motion.spid')
    found = [values(f'{at}.{f}.spid', 'MOTN', 'light') for f in ('me', 'motion')]
    off = [np.linalg.norm(f - t[3]) for f, t in zip(found, (photo, truth))]
    row = []
    for name, light in (('source', 'source'), ('driver', 'driver'), ('true', angles(truth[3]))):
        made = animate(at, light, name, len(truth[0]))
        for what in (lambda m, l: (m > 250) & np.isin(l, FACE), lambda m, l: m > 250):
            row.append(np.mean([
                decibels(made[i], window(truth[0][i], crop, 0),
                         window(what(truth[1][i], truth[2][i]), crop, 0) == 1)
                for i in range(len(made))]))
    return row + off


def main():
    args = sys.argv[1:]
    people = int(args[args.index('-n') + 1]) if '-n' in args else 8
    args = [a for i, a in enumerate(args) if a != '-n' and (i == 0 or args[i - 1] != '-n')]
    if not args:
        sys.exit(__doc__)
    top = os.path.dirname(os.path.abspath(__file__)) + '/../..'
    assets = args[1] if len(args) > 1 else f'{top}/../shared/assets'
    seed, panoramas = splits(top)
    os.makedirs(args[0], exist_ok=True)
    print('person  source: face, all    driver       true         l off: source, driver')
    every = []
    for k in range(people):
        lights = [panoramas[(k + i) % len(panoramas)] for i in (0, 1 + k // len(panoramas) % 3)]
        every.append(person(assets, seed, k, lights, args[0]))
        print(f'{k:6d}' + '  %6.2f' * 6 % tuple(every[-1][:6]) + '   %.2f %.2f' % tuple(every[-1][6:]),
              lights, flush=True)
    print('  mean' + '  %6.2f' * 6 % tuple(np.mean(every, 0)[:6]) +
          '   %.2f %.2f' % tuple(np.mean(every, 0)[6:]))


if __name__ == '__main__':
    main()
