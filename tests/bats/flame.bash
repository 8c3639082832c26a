# Public files made in a test: FLAME's of the built-in head, random networks.
# The built-in head $HEAD as FLAME's files are: flame.pkl in Python 2's manner
# with chumpy and scipy, the landmark embedding, the lids of SMIRK.
flame_files() {
    [ -e "$HEAD" ] || skip "no head model built"
    "$PYTHON" - "$HEAD" <<'P'
import pickle, sys
import numpy as np
import import_read
chumpy, sparse = import_read.classes()
r, _ = import_read.load(sys.argv[1])
d = lambda n: r[n].astype("f8")
pickle.dump({"v_template": chumpy(d("v_template")), "f": r["f"].astype("u4"),
    "shapedirs": chumpy(d("shapedirs")), "posedirs": d("posedirs"),
    "J_regressor": sparse(d("J_regressor")), "weights": chumpy(d("weights")),
    "kintree_table": np.array([[2**32 - 1, 0, 1, 1, 1], range(5)], "u4"),
    "J": np.zeros((5, 3)), "bs_type": "lrotmin", "bs_style": "lbs"},
    open("flame.pkl", "wb"), protocol=2)
faces, bary = r["landmark_faces"].astype("i8"), d("landmark_bary")
np.save("landmarks.npy", {"full_lmk_faces_idx": faces[None],
                          "full_lmk_bary_coords": bary[None]})
turned = np.stack([np.roll(faces[:17], k - 39) for k in range(79)])
np.save("parts.npy", {"static_lmk_faces_idx": faces[17:],
    "static_lmk_bary_coords": bary[17:], "dynamic_lmk_faces_idx": turned,
    "dynamic_lmk_bary_coords": np.stack([np.roll(bary[:17], k - 39, 0)
                                         for k in range(79)])})
np.save("l_eyelid.npy", d("l_eyelid"))
np.save("r_eyelid.npy", d("r_eyelid")[None])
P
}

# random_npz FILE: an array of random numbers for every name and shape of the
# JSON object on standard input.
random_npz() {
    "$PYTHON" -c '
import sys, json, numpy as np
rng = np.random.default_rng(1)
np.savez(sys.argv[1], **{n: rng.random(s, dtype="f4") - (0 if "var" in n else .5)
                         for n, s in json.load(sys.stdin).items()})' "$1"
}

# vit_names EMBED PREFIX: names and shapes of a DINOv2 checkpoint, as JSON.
vit_names() {
    "$PYTHON" - "$1" "$2" <<'P'
import json, sys
E = int(sys.argv[1])
names = {"cls_token": [1, 1, E], "pos_embed": [1, 1370, E], "mask_token": [1, E],
         "patch_embed.proj.weight": [E, 3, 14, 14], "patch_embed.proj.bias": [E], "norm.weight": [E], "norm.bias": [E]}
for i in range(12):
    b = f"blocks.{i}."
    names.update({b + "norm1.weight": [E], b + "norm1.bias": [E], b + "attn.qkv.weight": [3 * E, E], b + "attn.qkv.bias": [3 * E],
        b + "attn.proj.weight": [E, E], b + "attn.proj.bias": [E], b + "ls1.gamma": [E], b + "norm2.weight": [E], b + "norm2.bias": [E],
        b + "mlp.fc1.weight": [4 * E, E], b + "mlp.fc1.bias": [4 * E], b + "mlp.fc2.weight": [E, 4 * E], b + "mlp.fc2.bias": [E], b + "ls2.gamma": [E]})
print(json.dumps({sys.argv[2] + n: s for n, s in names.items()}))
P
}
