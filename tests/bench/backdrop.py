#!/usr/bin/env python3
"""The background behind a person, beside the truth.

    backdrop.py DIR [ASSETS]

Four people of scans (validation's seed), 512 x 512 pixels, put before five backgrounds with a
noise of 1.5 levels: two plain ones, bricks, and two of Poly Haven's panoramas.  Of what
`spid-shape` on PATH makes of the 20 pictures: how far the matte is off, thousandths, and the
decibels of its background where there is no person within 10 pixels of the outline (rim),
within 3 of it on both sides (line), and the first 40 pixels behind the person (hidden).  DIR
keeps the pictures.  Needs numpy, ImageMagick and ../shared/assets.
"""
import os
import subprocess
import sys

import numpy as np

N = 512
PEOPLE = 1, 7, 15, 18
HALL, GARDEN = ('dancing_hall_1k', 300, 128), ('chinese_garden_1k', 200, 160)


def run(*args):
    subprocess.run([str(a) for a in args], check=True)


def write(path, rgb):
    rgb = np.clip(np.rint(rgb), 0, 255).astype(np.uint8)
    with open(path, 'wb') as f:
        f.write(b'P6 %d %d 255\n' % rgb.shape[1::-1] + rgb.tobytes())


def panorama(assets, work, name, x, y):
    ppm = f'{work}/{name}.ppm'
    run('convert', f'{assets}/hdri/{name}.hdr', '-auto-level', '-evaluate', 'Multiply', 4,
        '-gamma', 1.5, '-crop', f'256x256+{x}+{y}', '+repage', '-resize', '200%',
        '-gamma', 1 / 0.7, '-depth', 8, ppm)
    with open(ppm, 'rb') as f:
        return np.frombuffer(f.read()[-3 * N * N:], np.uint8).reshape(N, N, 3).astype(float)


def backgrounds(assets, work, noise):
    y, x = np.mgrid[:N, :N]
    mortar = (y % 24 < 3) | ((x + 24 * (y // 24 % 2)) % 48 < 3)
    bricks = np.where(mortar[..., None], (185, 180, 170), (140, 70, 55))
    bricks = bricks + noise.normal(0, 8, (N // 8, N // 8, 1)).repeat(8, 0).repeat(8, 1)
    return {'white': np.full((N, N, 3), 235.), 'dark': np.full((N, N, 3), 25.),
            'bricks': bricks, 'hall': panorama(assets, work, *HALL),
            'garden': panorama(assets, work, *GARDEN)}


def person(assets, work, k):
    """Colours over black, and coverage 0..1."""
    run('spid-synth', '-q', '--assets', assets, '--seed', 90000, '--first', k, '-n', 1, '--size', N,
        '--effects', 0, '--without', 'mesh', '-o', f'{work}/person.spid')
    run('spid-dump', '-q', '--only', 'IMAG', '--npy', f'{work}/person', '-o', os.devnull,
        f'{work}/person.spid')
    alone, mask = (np.load(f'{work}/person/IMAG.{a}.npy')[0] / 1. for a in ('alone', 'mask'))
    return alone, mask[..., None] / 255


def near(mask, r):
    """Where a square of r to each side meets mask."""
    for axis in 0, 1:
        pad = np.pad(mask, [(r, r) if a == axis else (0, 0) for a in (0, 1)])
        mask = np.any([np.take(pad, range(i, i + mask.shape[axis]), axis)
                       for i in range(2 * r + 1)], 0)
    return mask


def window(plane, crop, n):
    """plane as the n x n pixels of a window see it, and which of them lie in it."""
    at = (np.arange(n) + 0.5) / n - 0.5
    x, y = (c + at * crop[2] - 0.5 for c in crop[:2])
    inside = np.outer((y >= 0) & (y < N - 1), (x >= 0) & (x < N - 1))
    x, y = x.clip(0, N - 1.001), y.clip(0, N - 1.001)
    u, v, s, t = x.astype(int), y.astype(int), (x % 1)[None, :, None], (y % 1)[:, None, None]
    row = lambda v: plane[v][:, u] * (1 - s) + plane[v][:, u + 1] * s
    return row(v) * (1 - t) + row(v + 1) * t, inside


def score(work, picture, truth, cover):
    run('spid-shape', '-q', picture, '-o', f'{work}/me.spid')
    run('spid-dump', '-q', '--only', 'SRCI', '--npy', f'{work}/me', '-o', os.devnull,
        f'{work}/me.spid')
    back, matte, crop = (np.load(f'{work}/me/SRCI.{a}.npy') for a in ('back', 'matte', 'crop'))
    n = matte.shape[-1]
    truth, inside = window(truth, crop.ravel(), n)
    cover = window(cover, crop.ravel(), n)[0][..., 0]
    is_person = cover > 0.5
    error = ((back.reshape(n, n, 3) - truth) ** 2).mean(-1)
    parts = (~is_person & near(is_person, 10), near(~is_person, 3) & near(is_person, 3),
             is_person & near(~is_person, 40))
    off = np.abs(matte.reshape(n, n) / 255 - cover)[inside].mean()
    return [1000 * off] + [10 * np.log10(255 ** 2 / error[p & inside].mean()) for p in parts]


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    work = sys.argv[1]
    shared = os.environ.get('SHARED', os.path.dirname(os.path.abspath(__file__)) + '/../../../shared')
    assets = sys.argv[2] if len(sys.argv) > 2 else f'{shared}/assets'
    if not os.path.exists(f'{assets}/ict'):
        print(f'backdrop.py: skipped: no assets in {assets}', file=sys.stderr)
        sys.exit(77)
    os.makedirs(work, exist_ok=True)
    noise = np.random.default_rng(3)
    walls = backgrounds(assets, work, noise)
    rows = {name: [] for name in walls}
    for k in PEOPLE:
        alone, cover = person(assets, work, k)
        for name, wall in walls.items():
            picture = f'{work}/{k:02}-{name}.ppm'
            write(picture, alone + (1 - cover) * wall + noise.normal(0, 1.5, alone.shape))
            rows[name].append(score(work, picture, wall, cover))
    print(f'{"":8}{"matte":>8}{"rim":>8}{"line":>8}{"hidden":>8}')
    for name, row in rows.items():
        print(f'{name:8}' + ''.join(f'{v:8.2f}' for v in np.mean(row, 0)))


main()
