"""Another landmarker's opinion of rendered people against their truth.

    realism.py --pictures NPY FOLDER
    realism.py TITLE NPY LABELS MAP

NPY: what spid-dump --npy made of the people's stream; LABELS: the landmarker's
safetensors, pictures in the stream's order; MAP: mediapipe_to_ict.json.
"""
import json
import os
import sys

import numpy as np

# Which of the landmarker's blendshapes are compared, and the true weights that
# go with each: components of exp (lib/head/arkit.h), or a joint's or a lid's.
GROUPS = {
    "jawOpen": {"jawOpen": "jaw"},
    "smiles": {"mouthSmileLeft": [45], "mouthSmileRight": [46]},
    "blinks": {"eyeBlinkLeft": "left", "eyeBlinkRight": "right"},
    "brows": {"browDownLeft": [0], "browDownRight": [1],
              "browInnerUp": [2, 3], "browOuterUpLeft": [4],
              "browOuterUpRight": [5]},
    "pucker": {"mouthPucker": [39]},
}
# Landmarks that correspond: bound to the mesh within 0.25 cm, and neither brow
# nor face oval, whose places differ by what they mean (labels/README.md).
LOOSE = 0.25
BROWS = [70, 63, 105, 66, 107, 46, 53, 52, 65, 55,
         300, 293, 334, 296, 336, 276, 283, 282, 295, 285]
OVAL = [10, 338, 297, 332, 284, 251, 389, 356, 454, 323, 361, 288, 397, 365,
        379, 378, 400, 377, 152, 148, 176, 149, 150, 136, 172, 58, 132, 93,
        234, 127, 162, 21, 54, 103, 67, 109]
HIDDEN = 0.15           # of the face crop behind something: left out


def tensors(path):
    with open(path, "rb") as f:
        size = int.from_bytes(f.read(8), "little")
        head = json.loads(f.read(size))
        data = f.read()
    kind = {"F32": np.float32, "I32": np.int32, "U8": np.uint8}
    meta = head.pop("__metadata__")
    return meta, {k: np.frombuffer(data, kind[t["dtype"]],
                                   offset=t["data_offsets"][0],
                                   count=int(np.prod(t["shape"])))
                  .reshape(t["shape"]) for k, t in head.items()}


def eye_distance(motion, seen, corners):
    """Of the outer corners, as they would be seen from the front."""
    rot = np.load(f"{motion}/MOTN.rot.npy")[seen]
    across = np.hypot(rot[:, 0, 0], rot[:, 1, 0])
    return (np.linalg.norm(corners[:, 1] - corners[:, 0], axis=-1)
            / np.maximum(across, 0.3))


def correlation(a, b):
    flat = a.std() < 1e-6 or b.std() < 1e-6
    return np.nan if flat else float(np.corrcoef(a, b)[0, 1])


def true_weight(motion, which):
    if which == "jaw":
        return np.load(f"{motion}/MOTN.jaw.npy")[:, 0]
    if which in ("left", "right"):
        return np.load(f"{motion}/MOTN.lid.npy")[:, int(which == "right")]
    return np.load(f"{motion}/MOTN.exp.npy")[:, which].mean(1)


def print_points(title, motion, lab, seen, table):
    """Distance of its points from the truth, 100 for the eyes' distance."""
    mark = lab["landmarks"][seen, :, :2]
    lmk = np.load(f"{motion}/MOTN.lmk.npy")[seen]
    eyes = eye_distance(motion, seen, lmk[:, [36, 45]])
    two = [p if isinstance(p, list) else [p, p]
           for p in table["pairs_68"]["landmark"]]
    classic = mark[:, np.array(two)].mean(2)
    # of the 68, neither jaw nor brows
    sets = {"classic": (classic[:, 27:], lmk[:, 27:])}
    if os.path.exists(f"{motion}/MOTN.points.npy"):
        loose = np.zeros(468)
        loose[table["landmark"]] = np.maximum(table["spread_cm"],
                                              table["distance_cm"])
        loose[BROWS + OVAL] = np.inf
        tight = np.flatnonzero(loose < LOOSE)
        dense = np.load(f"{motion}/MOTN.points.npy")[seen]
        sets["dense"] = (mark[:, tight], dense[:, tight])
    for name, (a, b) in sets.items():
        d = 100 * np.linalg.norm(a - b, axis=-1) / eyes[:, None]
        bias = (a - b) / eyes[:, None, None]
        own = 100 * np.linalg.norm(bias - bias.mean(0), axis=-1).mean()
        print(f"{title}: {a.shape[1]} {name} points, mean distance "
              f"{d.mean():.2f} % of the eyes' (median picture "
              f"{np.median(d.mean(1)):.2f}, a tenth over "
              f"{np.percentile(d.mean(1), 90):.2f}; {own:.2f} without what "
              f"all pictures share)")


def print_weights(title, motion, lab, seen, names):
    """Correlation of its blendshapes with the true weights; nan for a weight
    that these people never move, which the mean leaves out."""
    mean = {}
    for group, members in GROUPS.items():
        mean[group] = np.mean([correlation(
            lab["blendshapes"][seen, names.index(name)],
            true_weight(motion, which)[seen])
            for name, which in members.items()])
    print(f"{title}: r of", ", ".join(f"{g} {m:.2f}"
                                      for g, m in mean.items()),
          f"mean {np.nanmean(list(mean.values())):.2f}")


def hidden(motion):
    """Whether something stands before each face: label 15 of its crop."""
    label = np.load(f"{motion}/IMAG.label.npy", mmap_mode="r")
    crop = np.load(f"{motion}/MOTN.crop.npy")
    share = np.zeros(len(label))
    for i, (x, y, side) in enumerate(crop):
        half = 0.31 * side      # the landmarks' box: lib/base/crop.h
        part = label[i, max(0, int(y - half)):int(y + half),
                     max(0, int(x - half)):int(x + half)]
        share[i] = (part == 15).mean() if part.size else 0
    return share > HIDDEN


def write_pictures(motion, folder):
    """IMAG's pictures as PPM files."""
    rgb = np.load(f"{motion}/IMAG.rgb.npy", mmap_mode="r")
    for i, picture in enumerate(rgb):
        with open(f"{folder}/{i:05d}.ppm", "wb") as f:
            f.write(b"P6 %d %d 255\n" % picture.shape[1::-1])
            f.write(picture.tobytes())


def main():
    if sys.argv[1] == "--pictures":
        write_pictures(*sys.argv[2:])
        return
    title, motion, labels, mapping = sys.argv[1:]
    meta, lab = tensors(labels)
    seen = lab["found"].astype(bool)
    behind = hidden(motion)
    print(f"{title}: face found in {seen.sum()} of {len(seen)}, "
          f"{100 * seen.mean():.1f} %; {100 * seen[~behind].mean():.1f} % of "
          f"the {(~behind).sum()} that nothing stands before")
    with open(mapping) as f:
        print_points(title, motion, lab, seen, json.load(f))
    print_weights(title, motion, lab, seen,
                  json.loads(meta["blendshape_names"]))


if __name__ == "__main__":
    main()
