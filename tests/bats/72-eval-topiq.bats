# spid-import --as topiq, spid-eval --topiq: the network of formula weights
# against torch's functions in double precision.
load helper

# Once: weights.npz under pyiqa's names; pictures a/0.ppm (wide), b/0.ppm (tall)
# and c/0.ppm (as narrow as may be), in folders; want: torch's quality of each.
prepare() {
    PYTHON=/usr/bin/python3
    "$PYTHON" -c 'import torch, numpy' 2>/dev/null || skip "no torch to compare with (apt: python3-torch)"
    local made=$BATS_FILE_TMPDIR
    [ -e "$made/want" ] || (cd "$made" && make_network)
    ln -s "$made"/{a,b,c,want,weights.npz} .
}

make_network() {
    cat >net.py <<'PY'
import numpy as np, os, torch
import torch.nn.functional as F
torch.manual_seed(3)
shape = {"h_emb": (1, 128, 32, 1), "w_emb": (1, 128, 1, 32)}
def norm(name, n): shape.update({name + ".weight": (n,), name + ".bias": (n,)})
def linear(name, o, i, *k): shape.update({name + ".weight": (o, i, *k), name + ".bias": (o,)})
def conv_bn(name, bn, o, i, k):
    shape[name + ".weight"] = (o, i, k, k)
    norm(bn, o), shape.update({bn + ".running_mean": (o,), bn + ".running_var": (o,), bn + ".num_batches_tracked": ()})
def block(name, cross=False):
    for a in ("self_attn", "multihead_attn")[:1 + cross]:
        shape.update({f"{name}.{a}.in_proj_weight": (768, 256), f"{name}.{a}.in_proj_bias": (768,)})
        linear(f"{name}.{a}.out_proj", 256, 256)
    for i in range(2 + cross): norm(f"{name}.norm{i + 1}", 256)
    linear(name + ".linear1", 1024, 256), linear(name + ".linear2", 256, 1024)

conv_bn("semantic_model.conv1", "semantic_model.bn1", 64, 3, 7)
blocks, wide = [], 64
for l, n in enumerate((3, 4, 6, 3)):
    for i in range(n):
        at, narrow = f"semantic_model.layer{l + 1}.{i}.", 64 << l
        conv_bn(at + "conv1", at + "bn1", narrow, wide, 1)
        conv_bn(at + "conv2", at + "bn2", narrow, narrow, 3)
        conv_bn(at + "conv3", at + "bn3", 4 * narrow, narrow, 1)
        if not i: conv_bn(at + "downsample.0", at + "downsample.1", 4 * narrow, wide, 1)
        wide = 4 * narrow
for i, c in enumerate((64, 256, 512, 1024, 2048)):
    linear(f"weight_pool.{i}.splitconv", 2 * c, c, 1, 1)
    for k, o, n, s in ((0, 64, c, 1), (2, 64, 64, 3), (4, 1, 64, 3)): linear(f"weight_pool.{i}.weight_blk.{k}", o, n, s, s)
    linear(f"dim_reduce.{i}.0", 256, c, 1, 1)
    block(f"sa_attn_blks.{i}.layers.0")
    if i < 4: block(f"attn_blks.{i}.layers.0", True)
block("attn_pool")
for k, o in ((1, 256), (4, 256), (6, 1)): linear(f"score_linear.{k}", o, 256)
norm("score_linear.0", 256), norm("score_linear.3", 256)

w = {}
for name, s in shape.items():
    t = torch.randn(s)
    if name.endswith("var"): t = .5 + t.abs()
    elif len(s) == 1 and name.endswith("weight"): t = (1 + .3 * t) * (.4 if "bn3" in name else 1)
    elif len(s) == 1: t = .2 * t
    elif "in_proj" in name: t = t * 2 / s[1] ** .5
    elif len(s) > 1 and not name.endswith("emb"): t = t * (2 / np.prod(s[1:])) ** .5
    w[name] = t
np.savez("weights.npz", **{"params." + n: t.numpy() for n, t in w.items()})
w = {n: t.double() for n, t in w.items()}

def conv(x, name, s=1):
    k = w[name + ".weight"]
    return F.conv2d(x, k, w.get(name + ".bias"), s, k.shape[-1] // 2)
def batch(x, name): return F.batch_norm(x, *(w[f"{name}.{p}"] for p in ("running_mean", "running_var", "weight", "bias")))
def layer(x, name): return F.layer_norm(x, (256,), w[name + ".weight"], w[name + ".bias"])
def lin(x, name): return F.linear(x, w[name + ".weight"], w[name + ".bias"])

def pyramid(x):
    x = F.relu(batch(conv(x, "semantic_model.conv1", 2), "semantic_model.bn1"))
    maps = [x]
    x = F.max_pool2d(x, 3, 2, 1)
    for l, n in enumerate((3, 4, 6, 3)):
        for i in range(n):
            at, s = f"semantic_model.layer{l + 1}.{i}.", 2 if l and not i else 1
            y = F.relu(batch(conv(x, at + "conv1"), at + "bn1"))
            y = F.relu(batch(conv(y, at + "conv2", s), at + "bn2"))
            y = batch(conv(y, at + "conv3"), at + "bn3")
            x = F.relu(y + (x if i else batch(conv(x, at + "downsample.0", s), at + "downsample.1")))
        maps.append(x)
    return maps

def attend(q, kv, name):
    W, b = w[name + ".in_proj_weight"].chunk(3), w[name + ".in_proj_bias"].chunk(3)
    q, k, v = (F.linear(t, W[i], b[i]).reshape(-1, 4, 64).transpose(0, 1) for i, t in enumerate((q, kv, kv)))
    return lin((torch.softmax(q @ k.transpose(1, 2) / 8, -1) @ v).transpose(0, 1).reshape(-1, 256), name + ".out_proj")
def feed(x, name, last): return x + lin(F.gelu(lin(layer(x, f"{name}.norm{last}"), name + ".linear1")), name + ".linear2")
def self_block(x, name):
    n = layer(x, name + ".norm1")
    return feed(x + attend(n, n, name + ".self_attn"), name, 2)

def quality(rgb):
    mean, deviation = (torch.tensor(v)[:, None, None].double() for v in ((.485, .456, .406), (.229, .224, .225)))
    maps = pyramid(((torch.tensor(rgb).double().permute(2, 0, 1) / 255 - mean) / deviation)[None])
    size = maps[-1].shape[2:]
    places = torch.cat((w["h_emb"].expand(-1, -1, 32, 32), w["w_emb"].expand(-1, -1, 32, 32)), 1)
    places = F.interpolate(places, size, mode="bicubic")[0].flatten(1).T
    tokens = []
    for i, x in enumerate(maps):
        kept, asked = conv(x, f"weight_pool.{i}.splitconv").chunk(2, 1)
        for k in (0, 2): asked = F.gelu(conv(asked, f"weight_pool.{i}.weight_blk.{k}"))
        x = F.gelu(kept) * torch.sigmoid(conv(asked, f"weight_pool.{i}.weight_blk.4"))
        x = F.gelu(conv(F.adaptive_avg_pool2d(x, size), f"dim_reduce.{i}.0"))
        tokens.append(self_block(x[0].flatten(1).T + places, f"sa_attn_blks.{i}.layers.0"))
    x = tokens[4]
    for i, t in enumerate(tokens[3::-1]):
        name = f"attn_blks.{i}.layers.0"
        x = feed(x + attend(layer(x, name + ".norm1"), layer(t, name + ".norm2"), name + ".multihead_attn"), name, 3)
    x = self_block(x, "attn_pool").mean(0)
    for k in (0, 3): x = F.gelu(lin(layer(x, f"score_linear.{k}"), f"score_linear.{k + 1}"))
    return float(lin(x, "score_linear.6"))

rng = np.random.default_rng(2)
with open("want", "w") as f, torch.no_grad():
    for name, h, v in (("a", 150, 100), ("b", 90, 421), ("c", 17, 40)):
        os.mkdir(name)
        p = (np.add.outer(np.arange(v), 2 * np.arange(h))[..., None] * (1, 2, 3) // 4 + rng.integers(0, 60, (v, h, 3))) % 256
        open(name + "/0.ppm", "wb").write(b"P6\n%d %d\n255\n" % (h, v) + p.astype("u1").tobytes())
        f.write(f"{quality(p)}\n")
PY
    "$PYTHON" net.py
}

# figure OF FRAMES: that column of frames compared with themselves.
figure() {
    spid-eval -q -f tsv --topiq topiq.safetensors "$2" "$2" |
        awk -F '\t' -v of="$1" 'NR == 1 { for (i = 1; i <= NF; i++) c[$i] = i } NR == 2 { print $c[of] }'
}

@test "TopIQ is torch's, of a wide, a tall and a narrow picture" {
    status 0 spid-import weights.npz --as topiq -o topiq.safetensors
    [ -z "$output" ]
    for p in a b c; do
        figure topiq $p
    done >have
    # pictures of different quality, or nothing was compared
    awk 'NR > 1 { d = a - $1; if (d < 0.05 && d > -0.05) exit 1 } { a = $1 }' want
    # 1e-5: ours is off by 4e-6 at most, for any instruction set, and a norm's eps of 1e-6 for 1e-5 by 1.5e-5
    paste have want | awk '{ d = $1 - $2; if (d < 0) d = -d; if (d > 1e-5) exit 1; n++ } END { exit n != 3 }'
    mkdir d && { printf 'P6\n16 40\n255\n'; head -c 1920 /dev/zero; } >d/0.ppm
    [ "$(figure topiq d)" = - ]
}

@test "a table says which weights its columns want" {
    status 0 spid-import weights.npz --as topiq -o topiq.safetensors
    printf 'x\tframes\ta\ta\n' >pairs.tsv
    status 0 spid-eval -q -f tsv --pairs pairs.tsv
    for net in lpips arcface musiq topiq; do
        has "# $net: not run: needs weights (--$net)"
    done
    status 0 spid-eval -q -f tsv --topiq topiq.safetensors --pairs pairs.tsv
    [[ $output != *"topiq: not run"* ]]
    has "# musiq: not run: needs weights (--musiq)"
}

@test "weights without a layer, and of something else, are refused" {
    "$PYTHON" -c '
import numpy as np
w = dict(np.load("weights.npz"))
del w["params.attn_blks.3.layers.0.multihead_attn.in_proj_bias"]
w["params.score_linear.6.weight"] = w["params.score_linear.6.weight"].repeat(10, 0)
np.savez("less.npz", **w)'
    status 65 spid-import less.npz --as topiq -o less.safetensors
    has "missing: params.attn_blks.3.layers.0.multihead_attn.in_proj_bias (expected [768])"
    has "wrong shape: params.score_linear.6.weight [10, 256] (expected [1, 256])"
    [ ! -e less.safetensors ]
    status 65 spid-eval -q --topiq "$TOP/examples/model/head.safetensors" a a
    has "semantic_model.conv1.weight"
}
