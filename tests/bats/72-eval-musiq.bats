# spid-import --as musiq, spid-eval --musiq: the network of formula weights
# against torch's functions in double precision.
load helper

# Once: weights.npz under the PyTorch port's names; pictures a/0.ppm (wide) and
# b/0.ppm (tall), in folders; want: torch's quality of each.
prepare() {
    PYTHON=/usr/bin/python3
    "$PYTHON" -c 'import torch, numpy' 2>/dev/null || skip "no torch to compare with (apt: python3-torch)"
    local made=$BATS_FILE_TMPDIR
    [ -e "$made/want" ] || (cd "$made" && make_network)
    ln -s "$made"/{a,b,want,weights.npz} .
}

make_network() {
    cat >net.py <<'PY'
import numpy as np, os, torch
import torch.nn.functional as F
torch.manual_seed(3)
enc = "transformer_encoder."
shape = {"conv_root.weight": (64, 3, 7, 7), "embedding.weight": (384, 16384), "embedding.bias": (384,),
    enc + "posembed_input.position_emb": (1, 100, 384), enc + "scaleembed_input.scale_emb": (3, 384),
    enc + "cls": (1, 1, 384), "head.weight": (1, 384), "head.bias": (1,)}
def norm(name, n): shape.update({name + ".weight": (n,), name + ".bias": (n,)})
def linear(name, o, i): shape.update({name + ".weight": (o, i), name + ".bias": (o,)})
norm("gn_root", 64), norm(enc + "encoder_norm", 384)
for name, gn, o, i, k in (("conv1", "gn1", 64, 64, 1), ("conv2", "gn2", 64, 64, 3), ("conv3", "gn3", 256, 64, 1), ("conv_proj", "gn_proj", 256, 64, 1)):
    shape[f"block1.{name}.weight"] = (o, i, k, k)
    norm("block1." + gn, o)
blocks = [f"{enc}transformer.encoderblock_{i}." for i in range(14)]
for b in blocks:
    norm(b + "norm1", 384), norm(b + "norm2", 384)
    for n in ("query", "key", "value", "out"): linear(b + "attention." + n, 384, 384)
    linear(b + "mlp.fc1", 1152, 384), linear(b + "mlp.fc2", 384, 1152)
w = {}
for name, s in shape.items():
    t = torch.randn(s)
    if len(s) == 1 and name.endswith("weight"): t = 1 + .3 * t
    elif len(s) == 1: t = .2 * t
    elif "query" in name or "key" in name: t = t * 2 / s[-1] ** .5
    elif name.endswith("weight") and len(s) == 2: t = t / s[-1] ** .5
    w[name] = t
np.savez("weights.npz", **{n: t.numpy() for n, t in w.items()})
w = {n: t.double() for n, t in w.items()}

def same(x, k, s):
    h, v = ((-(-n // s) - 1) * s + k - n for n in (x.shape[-1], x.shape[-2]))
    return F.pad(x, (h // 2, h - h // 2, v // 2, v - v // 2))
def conv(x, name, s=1):
    k = w[name + ".weight"]
    k = (k - k.mean((1, 2, 3), keepdim=True)) / (k.std((1, 2, 3), keepdim=True) + 1e-5)
    return F.conv2d(same(x, k.shape[-1], s), k, stride=s)
def group(x, name, eps): return F.group_norm(x, 32, w[name + ".weight"], w[name + ".bias"], eps)
def layer(x, name): return F.layer_norm(x, (384,), w[name + ".weight"], w[name + ".bias"], 1e-6)
def lin(x, name): return F.linear(x, w[name + ".weight"], w[name + ".bias"])
def cells(n): return F.interpolate(torch.arange(10.)[None, None], n, mode="nearest")[0, 0].long()

def quality(rgb):
    x = torch.tensor(rgb).double().permute(2, 0, 1)[None] / 255 * 2 - 1
    H, W = x.shape[2:]
    tokens = [w[enc + "cls"][0]]
    for scale, side in enumerate((224, 384, max(H, W))):
        ratio = side / max(H, W)
        p = x if scale == 2 else F.interpolate(x, (round(H * ratio), round(W * ratio)), mode="bicubic")
        p = same(p, 32, 32)
        rows, cols = p.shape[2] // 32, p.shape[3] // 32
        p = p[0].reshape(3, rows, 32, cols, 32).permute(1, 3, 0, 2, 4).reshape(-1, 3, 32, 32)
        y = F.max_pool2d(same(F.relu(group(conv(p, "conv_root", 2), "gn_root", 1e-6)), 3, 2), 3, 2)
        z = F.relu(group(conv(y, "block1.conv1"), "block1.gn1", 1e-4))
        z = F.relu(group(conv(z, "block1.conv2"), "block1.gn2", 1e-4))
        z = group(conv(z, "block1.conv3"), "block1.gn3", 1e-4) + group(conv(y, "block1.conv_proj"), "block1.gn_proj", 1e-4)
        t = lin(F.relu(z).permute(0, 2, 3, 1).reshape(len(p), -1), "embedding")
        at = (cells(rows)[:, None] * 10 + cells(cols)[None]).reshape(-1)
        tokens.append(t + w[enc + "posembed_input.position_emb"][0, at] + w[enc + "scaleembed_input.scale_emb"][scale])
    x = torch.cat(tokens)
    for b in blocks:
        n = layer(x, b + "norm1")
        q, k, v = (lin(n, b + "attention." + a).reshape(-1, 6, 64).transpose(0, 1) for a in ("query", "key", "value"))
        x = x + lin((torch.softmax(q @ k.transpose(1, 2) / 8, -1) @ v).transpose(0, 1).reshape(-1, 384), b + "attention.out")
        x = x + lin(F.gelu(lin(layer(x, b + "norm2"), b + "mlp.fc1")), b + "mlp.fc2")
    return float(lin(layer(x[:1], enc + "encoder_norm"), "head"))

rng = np.random.default_rng(2)
with open("want", "w") as f, torch.no_grad():
    for name, h, v in (("a", 150, 100), ("b", 90, 421)):
        os.mkdir(name)
        p = (np.add.outer(np.arange(v), 2 * np.arange(h))[..., None] * (1, 2, 3) // 4 + rng.integers(0, 60, (v, h, 3))) % 256
        open(name + "/0.ppm", "wb").write(b"P6\n%d %d\n255\n" % (h, v) + p.astype("u1").tobytes())
        f.write(f"{quality(p)}\n")
PY
    "$PYTHON" net.py
}

@test "MUSIQ is torch's, of a wide and a tall picture" {
    status 0 spid-import weights.npz --as musiq -o musiq.safetensors
    [ -z "$output" ]
    for p in a b; do
        spid-eval -q -f tsv --musiq musiq.safetensors $p $p |
            awk -F '\t' 'NR == 1 { for (i = 1; i <= NF; i++) c[$i] = i } NR == 2 { print $c["musiq"] }'
    done >have
    # two pictures of different quality, or nothing was compared
    awk 'NR == 1 { a = $1 } END { d = a - $1; exit !(d > 0.05 || d < -0.05) }' want
    paste have want | awk '{ d = $1 - $2; if (d < 0) d = -d; if (d > 1e-4) exit 1; n++ } END { exit n != 2 }'
}

@test "weights without a layer, and of something else, are refused" {
    "$PYTHON" -c '
import numpy as np
w = dict(np.load("weights.npz"))
del w["transformer_encoder.transformer.encoderblock_3.attention.key.bias"]
w["head.weight"] = w["head.weight"].repeat(10, 0)
np.savez("less.npz", **w)'
    status 65 spid-import less.npz --as musiq -o less.safetensors
    has "encoderblock_3.attention.key.bias"
    has "head.weight"
    status 65 spid-eval -q --musiq "$TOP/examples/model/head.safetensors" a a
    has "conv_root.weight"
}
