#!/usr/bin/env python3
"""People as the programs find them, for training what comes after.

    found.py OUT STREAM...

STREAM: people with pictures, from spid-synth or spid-fit --plain, the first
picture of each the source.  OUT: the same people in the portrait window of their
source, with the shape, motions and light that spid-shape and spid-motion find.  A
refiner that learned from true ones would meet other faults in use.  Whom the
programs do not find is left out, and named.  Programs are those on PATH; needs
ffmpeg and NumPy.
"""
import json
import os
import subprocess
import sys
import tempfile

import numpy as np

from spidstream import read_stream

SIZE = 512              # pictures of OUT; the model's
BEYOND = 15             # label of what is not the person's, which counts nowhere
RIM = (8, 247)          # mattes of a rim, whose own colours photographs do not tell


def run(*command):
    return subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout


def records(kind, path):
    """Arrays of a stream's records of one type."""
    with open(path, "rb") as f:
        return [{name: a.numpy() for name, a in rec.arrays.items()}
                for rec in read_stream(f) if rec.type == kind]


def cut(pictures, window, how):
    """What the window, corner and side, shows of pictures (n,h,w) or (n,h,w,3), black
    beyond."""
    n, h, w = pictures.shape[:3]
    x, y, side = window
    form = "rgb24" if pictures.ndim == 4 else "gray"
    raw = subprocess.run(
        ["ffmpeg", "-v", "error", "-f", "rawvideo", "-pix_fmt", form, "-s",
         f"{w}x{h}", "-i", "-", "-vf",
         f"pad=iw+2*{side}:ih+2*{side}:{side}:{side},crop={side}:{side}:{x + side}:{y + side},"
         f"scale={SIZE}:{SIZE}:flags={how}", "-f", "rawvideo", "-pix_fmt", form,
         "-"], input=np.ascontiguousarray(pictures).tobytes(), check=True,
        stdout=subprocess.PIPE).stdout
    return np.frombuffer(raw, np.uint8).reshape((n, SIZE, SIZE) +
                                                pictures.shape[3:])


def save(pictures, folder):
    """As PNG files, whose names are returned."""
    os.makedirs(folder, exist_ok=True)
    n, h, w = pictures.shape[:3]
    subprocess.run(
        ["ffmpeg", "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24",
         "-s", f"{w}x{h}", "-i", "-", "-start_number", "0",
         f"{folder}/%03d.png"],
        input=np.ascontiguousarray(pictures).tobytes(), check=True)
    return [f"{folder}/{i:03d}.png" for i in range(n)]


def find(images, landmarks, number, tmp):
    """The files of a person's records, of the arrays of its IMAG records and of
    landmarks (n,68,2) in them."""
    source = save(images["rgb"][:1], f"{tmp}/source")[0]
    run("spid-shape", "-q", source, "-o", f"{tmp}/me.spid")
    conf = json.loads(bytes(records("CONF", f"{tmp}/me.spid")[0]["json"]))
    x, y, side = conf["window"]         # the middle; in whole pixels from here on
    window = [round(x - side / 2), round(y - side / 2), round(side)]
    seen = {name: cut(a, window, "neighbor" if name == "label" else "area")
            for name, a in images.items()}
    label = seen.get("label", np.zeros_like(seen["mask"])).copy()
    label[cut(np.full_like(images["mask"], 255), window, "neighbor") == 0] = BEYOND
    if "alone" not in seen:
        label[(seen["mask"] > RIM[0]) & (seen["mask"] < RIM[1])] = BEYOND
    seen["label"] = label

    whole = f"{SIZE // 2},{SIZE // 2},{SIZE}"
    shots = save(seen["rgb"], f"{tmp}/shots")
    run("spid-motion", "-q", "--window", whole, *shots, "-o", f"{tmp}/all.spid")
    motions, lights = records("MOTN", f"{tmp}/all.spid"), []
    for i, shot in enumerate(shots):        # each may be a source
        run("spid-shape", "-q", "--window", whole, shot, "-o", f"{tmp}/me.spid")
        own = records("MOTN", f"{tmp}/me.spid")[0]
        lights.append(own["light"])
        if i == 0:
            shape = records("SHAP", f"{tmp}/me.spid")[0]["shape"]
            motions[0] = own
    if len(motions) != len(shots) or any("lost" in m for m in motions):
        raise ValueError("no face in a picture")

    at = (landmarks - np.array(window[:2])) * SIZE / window[2]
    files = []
    for i, m in enumerate(motions):
        frame = 1000 * number + i
        m = {k: m[k] for k in ("rot", "trans", "exp", "jaw", "lid", "eye", "crop")}
        m = {k: a.tolist() for k, a in
             (m | {"light": lights[i], "lmk": at[i]}).items()}
        new = [{"type": "SHAP", "frame": frame, "time": float(frame), "arrays":
                {"shape": shape.tolist(), "person": [number]}}] if i == 0 else []
        with open(f"{tmp}/motion.json", "w", encoding="ascii") as f:
            json.dump(new + [{"type": "MOTN", "frame": frame,
                              "time": float(frame), "arrays": m}], f)
        arrays = []
        for name, a in seen.items():
            np.save(f"{tmp}/{name}.npy", a[i])
            arrays.append(f"{name}={tmp}/{name}.npy")
        files.append(f"{tmp}/{i}.spid")
        run("spid-pack", "-q", *(["--raw"] if i else []), "-t", "IMAG", "--frame",
            str(frame), f"{tmp}/motion.json", *arrays, "-o", files[-1])
    return files


def people(path):
    """Pictures (name to (n,...)) and landmarks of each person of a stream."""
    images, landmarks = [], []
    with open(path, "rb") as f:
        for rec in read_stream(f):
            if rec.type == "SHAP" and images:
                yield images, landmarks
                images, landmarks = [], []
            elif rec.type == "MOTN":
                landmarks.append(rec.arrays["lmk"].numpy())
            elif rec.type == "IMAG":
                images.append({k: a.numpy() for k, a in rec.arrays.items()})
    if images:
        yield images, landmarks


def main():
    out, number, kept = sys.argv[1], 0, []
    with tempfile.TemporaryDirectory() as top:
        for path in sys.argv[2:]:
            for images, landmarks in people(path):
                number += 1
                names = {"rgb", "mask", "label", "alone"}.intersection(
                    *(set(i) for i in images))
                try:
                    files = find({k: np.stack([i[k] for i in images])
                                  for k in sorted(names)},
                                 np.stack(landmarks), number, f"{top}/now")
                except (ValueError, subprocess.CalledProcessError) as e:
                    print(f"found.py: {path}: person {number}: {e}",
                          file=sys.stderr)
                    continue
                kept.append(f"{top}/{number}.spid")
                run("spid-pack", "-q", *files, "-o", kept[-1])
        if not kept:
            sys.exit("found.py: nobody was found")
        run("spid-pack", "-q", *kept, "-o", out)


if __name__ == "__main__":
    main()
