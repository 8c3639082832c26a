#!/usr/bin/env python3
r"""Where people have hair and cloth, and how far hair stands off, for a head's
template avatar.

    materials.py HEAD STREAM

STREAM: people of scans of the training split, each turned to SIDES sides.  The
head that ships has these:

    spid-synth --assets ASSETS --seed 61000 -n 160 --frames 9 --size 192 \
        --turn 0,30,60,90,-90,-60,-30,45:25,-45:25 -o people.spid

HEAD: a head's safetensors file, of which the tensors avatar.hair, avatar.relief,
avatar.cloth, avatar.hair_share and avatar.cloth_share (lib/head/head_avatar.h) are
written anew: STYLES ways to wear hair, each the chance of hair at every vertex, both
sides alike, how far it stands off there, and how many wear it so; and as many of
cloth where there is no hair.  They are mixtures of independent vertices (EM from
people in the order of how much they show of it), of hair by where it is and by where
it is as high as HIGH; the mean of all people counts as one more of each style, and
the scalp's density (hair) as one more of all.  Of hair the bald are left out: their
scalp goes on as hair does, in its own colour, and fair hair is easily taken for one.
Hair is as high as the person's visual hull along a vertex' normal (Laurentini 1994),
where all views that it faces show hair.  Needs NumPy.
"""
import sys

import numpy as np

import tensors
from meshview import nearest, project, surface
from spidstream import read_stream

SIDES = 9
STYLES = 6
TURNS = 60              # of EM
GRID = 128              # side of the depth map
CLOSE = 0.03            # head units: two points at one depth
HEIGHTS = np.arange(1, 31) * .025   # head units: 15 cm in all
HIGH = 0.1              # head units: more than short hair is
FACING, BESIDE = .2, -.15   # cosines: a view that shows a vertex, or its rim
SCALP = .5              # density of hair
SKIN = [1, 10, 11]      # of spid-synth's labels: skin, neck, ears
HAIR, CLOTH = 5, 8


def shown(verts, faces, cam):
    """Which vertices no part of the mesh lies before."""
    cell, _, p = project(surface(verts, faces, (.1, .4, .7)), cam, GRID)
    near, _ = nearest(cell, p[:, 2], GRID * GRID)
    cell, _, p = project(verts, cam, GRID)
    return p[:, 2] < near[cell] + CLOSE


def normals(verts, faces):
    a, b, c = (verts[faces[:, k]] for k in range(3))
    face, out = np.cross(b - a, c - a), np.zeros_like(verts)
    for k in range(3):
        np.add.at(out, faces[:, k], face)
    return out / (np.linalg.norm(out, axis=1, keepdims=True) + 1e-9)


def cosine(verts, normal, cam):
    """Of normals and the way to the camera."""
    p = verts @ cam[:, :3].T + cam[:, 3]
    return -((normal @ cam[:, :3].T) * p).sum(1) / np.linalg.norm(p, axis=1)


def height(views, faces):
    """How far a person's hair stands off each vertex (V), from (verts, cam,
    label) of each view."""
    normal = [normals(verts, faces) for verts, _, _ in views]
    best = np.max([cosine(verts, n, cam)
                   for (verts, cam, _), n in zip(views, normal)], 0)
    least = np.where(best > FACING, FACING, BESIDE)
    out, up = np.zeros(len(best)), np.ones(len(best), bool)
    for h in HEIGHTS:
        facing, hair = np.zeros(len(best), int), np.zeros(len(best), int)
        for (verts, cam, label), n in zip(views, normal):
            at = verts + h * n
            cell, inside, _ = project(at, cam, len(label))
            what = label.ravel()[cell]
            up &= ~inside | (what != 0)
            shows = inside & (cosine(at, n, cam) > least)
            facing += shows
            hair += shows & (what == HAIR)
        up &= (facing > 0) & (hair == facing)
        out[up] = h
    return out


def smooth(values, faces):
    """values (V,n), each the mean of itself and its neighbours, again and again:
    ears and the steps between HEIGHTS go."""
    edge = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    edge = np.unique(np.sort(edge, 1), axis=0)
    degree = np.bincount(edge.ravel(), minlength=len(values))[:, None]
    for _ in range(12):
        about = np.zeros_like(values)
        np.add.at(about, edge[:, 0], values[edge[:, 1]])
        np.add.at(about, edge[:, 1], values[edge[:, 0]])
        values = .4 * values + .6 * about / np.maximum(degree, 1)
    return values


def count(path, faces, count):
    """How often hair, cloth and skin is what each of `count` vertices shows
    (people,3,count), and how far hair stands off (people,count)."""
    picture, sums, views, high = {}, [], [], []
    with open(path, "rb") as f:
        for rec in read_stream(f):
            if rec.type in ("MESH", "IMAG"):
                picture[rec.type] = rec.arrays
            if len(picture) < 2:
                continue
            if not views:
                sums.append(np.zeros((3, count)))
            verts, cam = (picture["MESH"][k].numpy() for k in ("verts", "cam"))
            label = picture["IMAG"]["label"].numpy()
            views.append((verts, cam, label))
            at = label.ravel()[project(verts, cam, len(label))[0]]
            sums[-1] += shown(verts, faces, cam) & np.array(
                [at == HAIR, at == CLOTH, np.isin(at, SKIN)])
            if len(views) == SIDES:
                high.append(height(views, faces))
                views = []
            picture = {}
    return np.array(sums), np.array(high)


def mixture(shows, other, first, high=None):
    """Shares (1,STYLES), chances (V,STYLES) and heights (V,STYLES) of styles, from
    how often something and anything else is shown (people,V) and how high it is
    (people,V, or None); first (V): chances of one more."""
    sums = shows + other
    known = sums > 0
    hair = np.where(known, shows / np.maximum(sums, 1), 0)
    mean = (hair.sum(0) + first) / (known.sum(0) + 1)
    order = np.argsort((hair - mean * known).sum(1), kind="stable")
    part = np.zeros((len(shows), STYLES))
    if high is None:
        high = np.zeros_like(hair)
    off = (high / HIGH).clip(0, 1)
    part[order, np.arange(len(order)) * STYLES // len(order)] = 1
    for _ in range(TURNS):
        share = part.mean(0)
        chance = (part.T @ hair + mean) / (part.T @ known + 1)
        p = chance.clip(.02, .98)
        log = hair @ np.log(p).T + (known - hair) @ np.log(1 - p).T
        p = ((part.T @ off + off.mean(0)) /
             (part.sum(0)[:, None] + 1)).clip(.02, .98)
        log += off @ np.log(p).T + (1 - off) @ np.log(1 - p).T
        log += np.log(share + 1e-9)
        part = np.exp(log - log.max(1, keepdims=True))
        part /= part.sum(1, keepdims=True)
    print("shares of styles, and vertices with it:",
          *("%.2f %d" % (s, (c > .5).sum()) for s, c in zip(share, chance)))
    return (share[None], chance.T,
            ((part.T @ high + high.mean(0)) / (part.sum(0)[:, None] + 1)).T)


def main():
    if len(sys.argv) != 3:
        sys.exit("usage: materials.py HEAD STREAM")
    path = sys.argv[1]
    meta, kept = tensors.read(path)
    kinds = {"F32": "<f4", "F16": "<f2", "I32": "<i4"}

    def tensor(name):
        kind, shape, data = kept[name]
        return np.frombuffer(data, kinds[kind]).reshape(shape)

    faces, scalp = tensor("f"), tensor("hair")
    mirror = tensor("avatar.mirror")[:len(scalp)]
    shows, high = count(sys.argv[2], faces, len(scalp))
    shows += shows[:, :, mirror]
    high = (high + high[:, mirror]) / 2
    hair, cloth, skin = shows.transpose(1, 0, 2)
    bald = hair[:, scalp > SCALP].sum(1) <= skin[:, scalp > SCALP].sum(1)
    hair_share, hair_chance, relief = mixture(
        hair[~bald], (cloth + skin)[~bald], scalp, high[~bald])
    cloth_share, cloth_chance, _ = mixture(cloth, skin, 0 * scalp)
    made = {"avatar.hair": hair_chance, "avatar.hair_share": hair_share,
            "avatar.relief": smooth(relief, faces),
            "avatar.cloth": cloth_chance, "avatar.cloth_share": cloth_share}
    made = {name: value.astype("<f2") for name, value in made.items()}

    for name, value in made.items():
        kept.pop(name, None)
        kept[name] = "F16", value.shape, value.tobytes()
    tensors.write(path, kept, meta)


if __name__ == "__main__":
    main()
