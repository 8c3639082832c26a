#!/usr/bin/env bash
# Mattes of spid-shape beside the truth of people of scans, and beside a
# segmentation that nobody here trained, on scans and on photographs.
#
#   matte.sh [PEOPLE [SEED [FOLDER]]]
#
# Needs ../shared/assets, python3 with numpy, ffmpeg, node, chromium, and in
# $NPM_MATTE (a folder in which `npm install playwright-core
# @mediapipe/selfie_segmentation` has run) the segmentation, without which its
# columns are missing.  Ends with status 77 where the rest is.  MODEL is the
# model, HEAD its head; FOLDER keeps pictures and mattes.
set -euo pipefail
top=$(cd "$(dirname "$0")/../.." && pwd)
people=${1:-14} seed=${2:-96001} work=${3:-}
assets=${SHARED:-$top/../shared}/assets
model=${MODEL:-$top/examples/model/model.safetensors}
head=${HEAD:-$top/examples/model/head.safetensors}
PATH=${BIN:-$top/${BUILD:-build}/bin}:$PATH

skip() {
    echo "matte.sh: skipped: $*" >&2
    exit 77
}
[ -e "$assets/ict" ] || skip "no assets in $assets"
for python in python3 /usr/bin/python3 ''; do
    [ -n "$python" ] || skip "no python3 with numpy"
    "$python" -c 'import numpy' 2>/dev/null && break
done
[ -n "$work" ] || { work=$(mktemp -d); trap 'rm -rf "$work"' EXIT; }
mkdir -p "$work/scan" "$work/photo"

spid-synth -q --assets "$assets" --people "$people" --frames 1 --size 1024 \
    --seed "$seed" --effects 0.6 --without mesh --head "$head" \
    -o "$work/scan.spid"
spid-dump -q --only IMAG --npy "$work/scan" "$work/scan.spid"
"$python" - "$work/scan" <<'PY'
import sys, numpy as np
rgb = np.load(sys.argv[1] + '/IMAG.rgb.npy')
for k, p in enumerate(rgb):
    with open(f'{sys.argv[1]}/{k:02}.ppm', 'wb') as f:
        f.write(b'P6 %d %d 255\n' % p.shape[1::-1] + p.tobytes())
PY
for file in "$work"/scan/*.ppm "$assets"/photos/cc0/*.jpg; do
    name=$(basename "${file%.*}") to=$work/scan
    [[ $file == *.ppm ]] || to=$work/photo
    ffmpeg -v error -y -i "$file" "$to/$name.png"
    mkdir -p "$to/$name"
    if spid-shape -q -m "$model" --head "$head" "$to/$name.png" \
        -o "$to/$name.spid" 2>/dev/null; then
        spid-dump -q --only SRCI --npy "$to/$name" "$to/$name.spid"
    fi
done
for to in scan photo; do
    [ -z "${NPM_MATTE:-}" ] ||
        node "$top/tests/bench/segment.mjs" "$NPM_MATTE" "$work/$to"
done
"$python" - "$work" <<'PY'
import glob, os, sys, numpy as np

def window(plane, crop, n):
    """What a picture has in the n x n pixels of a window, NaN beyond it."""
    at = (np.arange(n) + 0.5) / n - 0.5
    x, y = (np.floor(c + at * crop[2]).astype(int) for c in crop[:2])
    ok = np.outer((y >= 0) & (y < plane.shape[0]), (x >= 0) & (x < plane.shape[1]))
    part = plane[y.clip(0, plane.shape[0] - 1)][:, x.clip(0, plane.shape[1] - 1)]
    return np.where(ok, part, np.nan)

def pgm(path):
    data = open(path, 'rb').read()
    w, h = (int(v) for v in data.split(None, 3)[1:3])
    return np.frombuffer(data[-w * h:], np.uint8).reshape(h, w) / 255

def compare(a, b):
    ok = ~np.isnan(a) & ~np.isnan(b)
    a, b = a[ok], b[ok]
    both, any_ = ((a > .5) & (b > .5)).sum(), ((a > .5) | (b > .5)).sum()
    return 1000 * np.abs(a - b).mean(), both / max(any_, 1)

def row(title, pairs):
    if pairs:
        e, iou = np.array(pairs).T
        print(f'{title:44}{e.mean():8.2f}{iou.mean():9.4f}{iou.min():9.4f}'
              f'{len(pairs):5}')

print(f'{"":44}{"error":>8}{"IoU":>9}{"worst":>9}{"of":>5}')
for kind in 'scan', 'photo':
    true, other, also = [], [], []
    masks = np.load(sys.argv[1] + '/scan/IMAG.mask.npy') / 255.
    for k, png in enumerate(sorted(glob.glob(f'{sys.argv[1]}/{kind}/*.png'))):
        d = png[:-4]
        if not os.path.exists(d + '/SRCI.matte.npy'):
            continue
        got = np.load(d + '/SRCI.matte.npy') / 255.
        got = got.reshape(got.shape[-2:])
        crop = np.load(d + '/SRCI.crop.npy').ravel()
        look = lambda plane: window(plane, crop, len(got))
        seen = pgm(d + '.other.pgm') if os.path.exists(d + '.other.pgm') else None
        if kind == 'scan':
            true.append(compare(got, look(masks[k])))
        if seen is not None:
            other.append(compare(got, look(seen)))
            if kind == 'scan':
                also.append(compare(look(seen), look(masks[k])))
    row(f'{kind}s: ours beside the truth', true)
    row(f'{kind}s: the other beside the truth', also)
    row(f'{kind}s: ours beside the other', other)
PY
