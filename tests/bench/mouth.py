"""mouth.py LABELS RUN [EVERY]: what is drawn between open lips, in a folder of
reenact.sh -c (-e EVERY) whose clips are in LABELS (the landmarker's points).

For each clip the frames whose lips are apart by 3 % of the eyes' distance or more:
decibels inside the true inner lips, and mean luma there, truth and result, of three
openings (to 8, to 14 % and beyond) in thirds from the upper to the lower lip, the
middle 70 % of the width.
"""
import json
import subprocess
import sys
from pathlib import Path

import numpy as np

LOWER = [78, 95, 88, 178, 87, 14, 317, 402, 318, 324, 308]
UPPER = [78, 191, 80, 81, 82, 13, 312, 311, 310, 415, 308]
OPENINGS = [0.03, 0.08, 0.14, 9]
LUMA = [0.299, 0.587, 0.114]


def labels(path):
    """Points (478,2) of "clip#frame", clip without folder and ending."""
    data = Path(path).read_bytes()
    size = int.from_bytes(data[:8], "little")
    head = json.loads(data[8:8 + size])
    begin, end = head["landmarks"]["data_offsets"]
    points = np.frombuffer(data[8 + size + begin:8 + size + end], "<f4")
    points = points.reshape(head["landmarks"]["shape"])[:, :, :2]
    names = json.loads(head["__metadata__"]["names"])
    return {f"{Path(n.split('#')[0]).stem}#{n.split('#')[1]}": p
            for n, p in zip(names, points)}


def conf(path):
    text = subprocess.run(["spid-dump", "--json", "--only", "CONF", path], check=True,
                          capture_output=True, text=True).stdout
    return json.loads(json.loads(text.splitlines()[0])["arrays"][0]["text"])


def numbers(value):
    return list(value.values() if isinstance(value, dict) else value)


def into_window(run, name):
    """Corner and scale of reenact.sh's window, in the clip's pixels; its side."""
    x, y, side = numbers(conf(run / f"person/{name}.whole.spid")["window"])
    size = numbers(conf(run / f"truth/{name}.spid")["camera"])[0]
    side = int(side / 2) * 2
    return np.array([int(x - side / 2 + 0.5), int(y - side / 2 + 0.5)]), size / side, int(size)


def pictures(folder, size):
    """All of a folder's frames (n,size,size,3)."""
    raw = subprocess.run(["ffmpeg", "-v", "error", "-pattern_type", "glob", "-i",
                          f"{folder}/*.png", "-f", "rawvideo", "-pix_fmt", "rgb24", "-"],
                         check=True, capture_output=True).stdout
    return np.frombuffer(raw, np.uint8).reshape(-1, size, size, 3)


def inside(polygon, size):
    """Rows and columns of the pixels whose centres lie in it: an odd number of
    its edges to their right."""
    (x0, y0), (x1, y1) = polygon.min(0).astype(int), polygon.max(0).astype(int) + 1
    y, x = np.mgrid[max(y0, 0):min(y1, size), max(x0, 0):min(x1, size)]
    odd = np.zeros(x.shape, bool)
    for (ax, ay), (bx, by) in zip(polygon, np.roll(polygon, -1, 0)):
        if ay != by:
            cross = ax + (y + 0.5 - ay) * (bx - ax) / (by - ay)
            odd ^= ((ay > y + 0.5) != (by > y + 0.5)) & (x + 0.5 < cross)
    return y[odd], x[odd]


def clip(run, name, points, every):
    corner, scale, size = into_window(run, name)
    square, count, rows = 0, 0, {}
    frames = zip(pictures(run / "truth" / name, size), pictures(run / "self" / name, size))
    for i, (a, b) in enumerate(frames):
        p = (points[f"{name}#{i * every}"] - corner) * scale
        gap = np.linalg.norm(p[13] - p[14]) / np.linalg.norm(p[33] - p[263])
        if gap < OPENINGS[0]:
            continue
        y, x = inside(p[LOWER + UPPER[-2:0:-1]], size)
        a, b = a[y, x].astype(float), b[y, x].astype(float)
        square, count = square + ((a - b) ** 2).sum(), count + a.size
        top, bottom = (np.interp(x, p[lip, 0], p[lip, 1]) for lip in (UPPER, LOWER))
        down = (y - top) / np.maximum(bottom - top, 1)
        across = np.abs(2 * (x - p[78, 0]) / (p[308, 0] - p[78, 0]) - 1)
        kind = np.searchsorted(OPENINGS, gap, "right") - 1
        for third in range(3):
            here = (across < 0.7) & (down >= third / 3) & (down < (third + 1) / 3)
            row = rows.setdefault((kind, third), np.zeros(3))
            row += [here.sum(), (a[here] @ LUMA).sum(), (b[here] @ LUMA).sum()]
    print(f"{name}: {10 * np.log10(65025 * count / square):.2f} dB")
    for kind in sorted({k for k, _ in rows}):
        mean = np.array([rows[kind, t][1:] / max(1, rows[kind, t][0]) for t in range(3)])
        print(f"  lips apart by {100 * OPENINGS[kind]:.0f} % and more: true",
              *(f"{v:.0f}" for v in mean[:, 0]), " made", *(f"{v:.0f}" for v in mean[:, 1]))


def main():
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    points, run = labels(sys.argv[1]), Path(sys.argv[2])
    for folder in sorted((run / "self").iterdir()):
        if folder.is_dir() and not folder.name.endswith(".inside"):
            clip(run, folder.name, points, int(sys.argv[3]) if len(sys.argv) > 3 else 1)


if __name__ == "__main__":
    main()
