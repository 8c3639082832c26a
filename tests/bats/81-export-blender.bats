# Blender opens what spid-export writes: the head is where ours is, its shape
# keys move, and its picture of it is ours.
load helper

prepare() {
    command -v blender >/dev/null || skip "no blender (apt: blender)"
    [ -e /usr/lib/python3/dist-packages/numpy ] || skip "no numpy (apt: python3-numpy)"
    MODEL=$TOP/examples/model
}

# Our mesh of frame N drawn as tests/blender/head.py has it drawn, four rays a
# pixel; how far Blender's vertices and picture are.
compare() {
    cat >compare.py <<'P'
import subprocess, sys
import numpy as np
verts, cams, faces = (np.load(f"ours/MESH.{k}.npy") for k in ("verts", "cam", "faces"))
faces = faces.reshape(-1, 3)
S, sub = 256, 2
for frame in map(int, sys.argv[1:]):
    R, t = cams[frame][:, :3].astype("f8"), cams[frame][:, 3].astype("f8")
    x = (verts[frame] @ R.T + t) / 5 * [1, -1, -1]      # metres, glTF's axes
    theirs = np.load(f"frame-{frame}.npy")
    off = np.linalg.norm(x - theirs, axis=1).max()
    colour = 0.5 + 3 * (x - (x.min(0) + x.max(0)) / 2)
    n = S * sub
    p = n / 2 + 12 * n / 2 * x[:, :2] / -x[:, 2:] * [1, -1]
    depth = np.full((n, n), np.inf)
    image = np.zeros((n, n, 3))
    for f in faces:
        q, z = p[f], -x[f, 2]
        area = np.cross(q[1] - q[0], q[2] - q[0])
        lo, hi = np.floor(q.min(0)).astype(int), np.ceil(q.max(0)).astype(int) + 1
        lo, hi = np.clip(lo, 0, n), np.clip(hi, 0, n)
        if area == 0 or (hi <= lo).any():
            continue
        g = np.stack(np.meshgrid(np.arange(lo[0], hi[0]), np.arange(lo[1], hi[1])), -1) + 0.5
        w = np.stack([np.cross(q[(k + 2) % 3] - q[(k + 1) % 3], g - q[(k + 1) % 3]) for k in range(3)], -1) / area
        d = w @ z
        y, s = slice(lo[1], hi[1]), slice(lo[0], hi[0])
        near = (w >= 0).all(-1) & (d < depth[y, s])
        depth[y, s][near] = d[near]
        image[y, s][near] = (w @ colour[f])[near]
    ours = np.clip(image, 0, 1).reshape(S, sub, S, sub, 3).mean((1, 3)) * 255
    raw = subprocess.run(["ffmpeg", "-v", "error", "-i", f"frame-{frame}.png", "-f", "rawvideo",
                          "-pix_fmt", "rgb24", "-"], stdout=subprocess.PIPE).stdout
    seen = np.frombuffer(raw, "u1").reshape(S, S, 3).astype("f8")
    db = 10 * np.log10(255 ** 2 / np.mean((ours - seen) ** 2))
    print(f"frame {frame}: {1e6 * off:.0f} micrometres, {db:.1f} dB")
    assert off < 2e-3 and db > 30
    if frame == 0:              # as far as spid-export said of its first frame
        said = float(open("said").read())
        assert abs(1e6 * off - said) < 20, said
    assert (seen.sum(-1) > 60).mean() > 0.05            # there is a head
P
    /usr/bin/python3 compare.py "$@"
}

@test "Blender opens head.glb: places, picture and shape keys" {
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    spid-shape -q -m "$MODEL" "$TOP/examples/photo.jpg" -o me.spid
    spid-synth -q -n 1 --frames 9 -s 4 --size 256 -o clip.y4m
    spid-motion -q -m "$MODEL" clip.y4m -o motion.spid
    spid-flame -q -m "$MODEL" -i me.spid motion.spid -o mesh.spid
    spid-dump -q --npy ours mesh.spid
    spid-export -m "$MODEL" -i me.spid motion.spid --glb-head head.glb |
        sed -n 's/.*read back and drawn: \([0-9.]*\) micrometres.*/\1/p' >said
    blender -b --factory-startup --python-exit-code 1 --python "$TOP/tests/blender/head.py" -- head.glb 25 0 4 8 >log 2>&1 ||
        { cat log; false; }
    compare 0 4 8
    # 41 of ARKit's shapes are the skin's (the others turn joints) and two lids
    awk '$2 > 0.001' shapes.txt | sort -k2 -n | tail -n 3
    [ "$(awk '$2 > 0.001' shapes.txt | wc -l)" -ge 40 ]
}
