"""How good is the half of a face that its photograph hides: tests/bench/turned.sh.

    turned.py DIR PEOPLE

DIR/npyK: what spid-dump --npy made of person K's stream, its first frame the
photograph; DIR/run: what examples/reenact.sh made of it.  A pixel of a later
frame is hidden where the nearest point of the true head mesh faces away from
the photograph's camera, or lies behind another; of these those count that
truth labels as face (skin, lips, eyes, brows, nose, beard, lashes), and as hair
in a column of their own.
"""
import json
import os
import subprocess
import sys

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(__file__), "../../examples"))
from meshview import nearest, project, surface  # noqa: E402

FACE = [1, 2, 3, 4, 12, 13, 14]
HAIR = 5
FEW = 200               # pixels that are too few to judge by
GRID = 256              # side of the depth maps
STEPS = 7               # points along an edge of a face
GRAZING = 0.15          # cosine under which the photograph hardly shows skin
CLOSE = 0.03            # head units: two points at one depth


def mesh_points(verts, faces, cam):
    """Of points all over the mesh: cell, whether in the picture, and place for the
    camera; then depth and number of the nearest of each cell."""
    point = surface(verts, faces, (np.arange(STEPS) + .5) / STEPS)
    cell, inside, p = project(point, cam, GRID)
    return cell, inside, p, nearest(np.where(inside, cell, -1), p[:, 2],
                                    GRID * GRID)


def hidden_points(verts, faces, cam):
    """Which surface points this camera does not see."""
    cell, inside, p, (near, _) = mesh_points(verts, faces, cam)
    a, b, c = (verts[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True) + 1e-12
    normal = np.tile(normal, (len(p) // len(normal), 1))
    away = ((normal @ cam[:, :3].T) * p).sum(1) / np.linalg.norm(p, axis=1)
    return (-away < GRAZING) | ~inside | (p[:, 2] > near[cell] + CLOSE)


def pictures(folder, count):
    raw = subprocess.run(
        ["ffmpeg", "-v", "error", "-framerate", "1", "-i",
         f"{folder}/%05d.png", "-f", "rawvideo", "-pix_fmt", "rgb24", "-"],
        stdout=subprocess.PIPE, check=True).stdout
    side = int(round((len(raw) / 3 / count) ** .5))
    return np.frombuffer(raw, np.uint8).reshape(count, side, side, 3) / 255.


def window(path):
    out = subprocess.run(["spid-dump", "--json", "--only", "CONF", path],
                         stdout=subprocess.PIPE, check=True).stdout
    conf = json.loads(json.loads(out.splitlines()[0])["arrays"][0]["text"])
    w = conf["window"]
    x, y, size = w.values() if isinstance(w, dict) else w
    side = int(size / 2) * 2        # as reenact.sh cuts it
    return int(x - side / 2 + .5), int(y - side / 2 + .5), side


def cut(mask, x, y, side, n):
    """mask (GRID,GRID) of the whole picture, at n x n pixels of the window."""
    at = (np.arange(n) + .5) / n * side
    col = np.floor((at + x) * GRID / 512).astype(int)
    row = np.floor((at + y) * GRID / 512).astype(int)
    ok = ((row >= 0) & (row < GRID))[:, None] & ((col >= 0) & (col < GRID))
    return ok & mask[row.clip(0, GRID - 1)][:, col.clip(0, GRID - 1)]


def decibels(a, b, mask):
    return -10 * np.log10(((a - b)[mask] ** 2).mean() + 1e-12)


def person(folder, k):
    """Rows of (decibels of the hidden part, of the rest of the face, of both
    with the photograph unchanged, share of the face that is hidden, decibels of
    hidden hair or nan)."""
    run, npy = f"{folder}/run", f"{folder}/npy{k}"
    if not os.path.exists(f"{run}/self/scan{k}.spid"):
        return []
    verts, cams = np.load(f"{npy}/MESH.verts.npy"), np.load(f"{npy}/MESH.cam.npy")
    faces = np.load(f"{npy}/MESH.faces.npy").reshape(-1, 3)
    label = np.load(f"{npy}/IMAG.label.npy", mmap_mode="r")
    truth = pictures(f"{run}/truth/scan{k}", len(verts))
    made = pictures(f"{run}/self/scan{k}", len(verts))
    where = window(f"{run}/person/scan{k}.whole.spid")
    lost, rows = hidden_points(verts[0], faces, cams[0]), []
    for i in range(1, len(verts)):
        which = mesh_points(verts[i], faces, cams[i])[3][1]
        small = label[i][1::2, 1::2].ravel()
        skin = np.isin(small, FACE) & (which >= 0)
        unseen = (which >= 0) & lost[which]
        n = truth.shape[1]
        a, b, hair = (cut(m.reshape(GRID, GRID), *where, n)
                      for m in (skin & unseen, skin & ~unseen,
                                (small == HAIR) & unseen))
        if a.sum() < FEW or b.sum() < FEW:
            continue
        rows.append([decibels(made[i], truth[i], a),
                     decibels(made[i], truth[i], b),
                     decibels(truth[0], truth[i], a),
                     decibels(truth[0], truth[i], b), a.sum() / (a | b).sum(),
                     decibels(made[i], truth[i], hair)
                     if hair.sum() >= FEW else np.nan])
    return rows


def means(rows):
    """Of each column, without its nan."""
    return [np.mean([x for x in column if x == x] or [np.nan])
            for column in zip(*rows)]


ROW = "%6.2f   %6.2f   %6.2f   %6.2f   %.2f   %6.2f"


def main():
    folder, people = sys.argv[1], int(sys.argv[2])
    every = []
    print("person   hidden     seen  (frame 0: hidden, seen)  share hidden  hair")
    for k in range(people):
        rows = person(folder, k)
        if not rows:
            print(f"{k:6d}  no result")
            continue
        every.append(means(rows))
        print(f"{k:6d}  {ROW}" % tuple(every[-1]))
    if every:
        print(f"  mean  {ROW} dB" % tuple(means(every)))


if __name__ == "__main__":
    main()
