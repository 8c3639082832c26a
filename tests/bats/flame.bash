# Public files made in a test: FLAME's of the built-in head, random networks.
# The built-in head $HEAD as FLAME's files are: flame.pkl in Python 2's manner
# with chumpy and scipy, the landmark embedding, the lids of SMIRK.
flame_files() {
    [ -e "$HEAD" ] || skip "no head model built (make)"
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

# fan_names STACKS WIDTH: the tensors of a face alignment network, as JSON.
fan_names() {
    "$PYTHON" - "$1" "$2" <<'P'
import json, sys
stacks, W = map(int, sys.argv[1:])
out = {}
def norm(n, c):
    for k in ("weight", "bias", "running_mean", "running_var"): out[f"{n}.{k}"] = [c]
    out[n + ".num_batches_tracked"] = []
def conv(n, o, i, k, bias=False):
    out[n + ".weight"] = [o, i, k, k]
    if bias: out[n + ".bias"] = [o]
def block(n, i, o):
    for k, (a, b) in enumerate(((i, o // 2), (o // 2, o // 4), (o // 4, o // 4)), 1):
        norm(f"{n}.bn{k}", a); conv(f"{n}.conv{k}", b, a, 3)
    if i != o:
        norm(n + ".downsample.0", i); conv(n + ".downsample.2", o, i, 1)
conv("conv1", W // 4, 3, 7, True); norm("bn1", W // 4)
block("conv2", W // 4, W // 2); block("conv3", W // 2, W // 2); block("conv4", W // 2, W)
for k in range(stacks):
    for level in 1, 2, 3, 4:
        for b in 1, 2, 3: block(f"m{k}.b{b}_{level}", W, W)
    block(f"m{k}.b2_plus_1", W, W); block(f"top_m_{k}", W, W)
    conv(f"conv_last{k}", W, W, 1, True); norm(f"bn_end{k}", W); conv(f"l{k}", 68, W, 1, True)
    if k < stacks - 1:
        conv(f"bl{k}", W, W, 1, True); conv(f"al{k}", W, 68, 1, True)
print(json.dumps(out))
P
}
