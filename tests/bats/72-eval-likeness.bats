# spid-eval --arcface: the network against torch, the faces it finds.
load helper

# weights.safetensors: a small iresnet of random numbers under the public
# names; clips a and b of aligned faces; want: torch's cosines, a line a frame.
prepare() {
    PYTHON=/usr/bin/python3
    "$PYTHON" -c 'import torch, numpy' 2>/dev/null || skip "no torch to compare with (apt: python3-torch)"
    cat >net.py <<'PY'
import json, struct, sys
import numpy as np, torch
import torch.nn as nn, torch.nn.functional as F

class Block(nn.Module):
    def __init__(s, i, o, stride):
        super().__init__()
        s.bn1 = nn.BatchNorm2d(i); s.conv1 = nn.Conv2d(i, o, 3, 1, 1, bias=False)
        s.bn2 = nn.BatchNorm2d(o); s.prelu = nn.PReLU(o)
        s.conv2 = nn.Conv2d(o, o, 3, stride, 1, bias=False); s.bn3 = nn.BatchNorm2d(o)
        s.downsample = None if stride == 1 else nn.Sequential(
            nn.Conv2d(i, o, 1, stride, bias=False), nn.BatchNorm2d(o))
    def forward(s, x):
        y = s.bn3(s.conv2(s.prelu(s.bn2(s.conv1(s.bn1(x))))))
        return y + (x if s.downsample is None else s.downsample(x))

class Net(nn.Module):
    def __init__(s, widths, blocks, size):
        super().__init__()
        c = widths[0]
        s.conv1 = nn.Conv2d(3, c, 3, 1, 1, bias=False); s.bn1 = nn.BatchNorm2d(c); s.prelu = nn.PReLU(c)
        for k, (o, n) in enumerate(zip(widths, blocks)):
            setattr(s, f"layer{k + 1}", nn.Sequential(*[Block(c if j == 0 else o, o, 2 if j == 0 else 1) for j in range(n)]))
            c = o
        s.bn2 = nn.BatchNorm2d(c); s.fc = nn.Linear(c * 49, size); s.features = nn.BatchNorm1d(size)
    def forward(s, x):
        x = s.prelu(s.bn1(s.conv1(x)))
        x = s.bn2(s.layer4(s.layer3(s.layer2(s.layer1(x)))))
        return F.normalize(s.features(s.fc(x.flatten(1))))

torch.manual_seed(1)
net = Net((8, 16, 24, 40), (2, 1, 3, 2), 32).double().eval()
for n, t in net.state_dict().items():
    if "running_mean" in n or n.endswith("bias"): t.normal_(0, .2)
    elif "running_var" in n: t.uniform_(.5, 2)
    elif t.dim() == 1 and t.numel() > 1: t.uniform_(.3, 1.2)
# codes spread about 0, or every cosine is almost 1
net.bn_hook = []
net.fc.register_forward_hook(lambda m, i, o: net.bn_hook.append(o))
with torch.no_grad():
    net(torch.rand(16, 3, 112, 112).double() * 2 - 1)
    net.features.running_mean.copy_(net.bn_hook[0].mean(0)); net.features.running_var.copy_(net.bn_hook[0].var(0))
    net.features.bias.zero_()
out, head = b"", {}
for n, t in net.state_dict().items():
    if t.dim():
        raw = t.float().numpy().tobytes()
        head[n] = {"dtype": "F32", "shape": list(t.shape), "data_offsets": [len(out), len(out) + len(raw)]}
        out += raw
j = json.dumps(head).encode()
open("weights.safetensors", "wb").write(struct.pack("<Q", len(j)) + j + out)
net.load_state_dict({n: t.float().double() if t.dim() else t for n, t in net.state_dict().items()})
rng = np.random.default_rng(2)
import os
os.makedirs("a"), os.makedirs("b")
with open("want", "w") as f:
    for i in range(3):
        code = []
        for d in "ab":
            p = rng.integers(0, 256, (112, 112, 3), "u1")
            if i == 2 and d == "b": p = first
            if i == 2 and d == "a": first = p
            open(f"{d}/{i}.ppm", "wb").write(b"P6\n112 112\n255\n" + p.tobytes())
            with torch.no_grad():
                code.append(net(torch.tensor(p / 127.5 - 1).permute(2, 0, 1)[None]))
        f.write(f"{float((code[0] * code[1]).sum())}\n")
PY
    "$PYTHON" net.py
}

@test "the cosines of aligned faces are torch's" {
    spid-eval -q --arcface weights.safetensors --frames-tsv f.tsv a b >table
    grep -q arcface table
    cut -f 9 f.tsv | tail -n +2 >have
    paste have want
    # no two strangers alike, or nothing was compared
    awk '$1 < 0.9' want | grep -q .
    paste have want | awk '{ d = $1 - $2; if (d < 0) d = -d; if (d > 1e-4) exit 1; n++ } END { exit n != 3 }'
    # somebody is like himself
    spid-eval -q -f tsv --arcface weights.safetensors --source a/0.ppm a a |
        awk -F '\t' 'NR == 1 { for (i = 1; i <= NF; i++) c[$i] = i }
                     NR == 2 { exit !($c["arcface"] > 0.999999 && $c["arcface_src"] < 1) }'
}

@test "weights of something else, and faces that need a model, are refused" {
    status 65 spid-eval -q --arcface "$TOP/${BUILD:-build}/share/spid/head.safetensors" a b
    has "expected an iresnet"
    mkdir c d
    for i in 0 1; do
        { printf 'P6\n64 64\n255\n'; head -c 12288 /dev/urandom; } >c/$i.ppm
        cp c/$i.ppm d
    done
    status 64 spid-eval -q --source a/0.ppm c d
    # noise has no face: counted as failed, not as a likeness of 0
    export SPID_MODEL=$TOP/examples/model
    run spid-eval -q -f json --arcface weights.safetensors \
        --head "$TOP/${BUILD:-build}/share/spid/head.safetensors" c d
    [[ $output =~ '"arcface":'[[:space:]]*null ]]
}
