load helper

# Three Gaussians: the red one in front, the green behind it, a blue one behind
# the camera.
prepare() {
    cat >scene.json <<'J'
{"type":"GAUS","arrays":[
 {"name":"mean","dtype":"f32","shape":[3,3],"data":[0,0,0.1,0,0,0,0,0,20]},
 {"name":"scale","dtype":"f32","shape":[3,3],"data":[0.9,0.9,0.9,0.9,0.9,0.9,1,1,1]},
 {"name":"quat","dtype":"f32","shape":[3,4],"data":[1,0,0,0,1,0,0,0,1,0,0,0]},
 {"name":"opacity","dtype":"f32","shape":[3],"data":[0.98,0.98,0.98]},
 {"name":"color","dtype":"f32","shape":[3,3],"data":[1,0,0,0,1,0,0,0,1]},
 {"name":"branch","dtype":"u8","shape":[3],"data":[1,0,0]},
 {"name":"cam","dtype":"f32","shape":[3,4],"data":[1,0,0,0,0,-1,0,0,0,0,-1,12]}]}
J
    spid-pack scene.json -o scene.spid
}

# pixel FILE X Y: R G B of a binary PPM or PAM.
pixel() {
    python3 - "$@" <<'P'
import re, sys
b = open(sys.argv[1], "rb").read()
if b[:2] == b"P7":
    h, d = b.split(b"ENDHDR\n", 1)
    w, n = (int(re.search(k + rb" (\d+)", h)[1]) for k in (b"WIDTH", b"DEPTH"))
else:
    m = re.match(rb"P6\s+(\d+)\s+\d+\s+255\s", b)
    w, n, d = int(m[1]), 3, b[m.end():]
o = (int(sys.argv[3]) * w + int(sys.argv[2])) * n
print(*d[o:o + n])
P
}

@test "the nearer Gaussian covers the farther, none behind the camera shows" {
    spid-splat -s 32 -o a.pam scene.spid
    read -r r g b < <(pixel a.pam 16 16)
    [ "$r" -ge 245 ] && [ "$g" -le 8 ] && [ "$b" -eq 0 ]
}

@test "a branch drawn alone leaves the others out" {
    spid-splat -s 32 --branch dynamic -o a.pam scene.spid
    read -r r g b < <(pixel a.pam 16 16)
    [ "$r" -eq 0 ] && [ "$g" -ge 245 ]
}

@test "no Gaussians give the background" {
    sed 's/"shape":\[3\([],]\)/"shape":[0\1/; s/"data":.*\]\([},]\)/"data":[]\1/' \
        scene.json | grep -v '"cam"' | sed '$ s/,$//' >none.json
    sed -i 's/"branch".*/"branch","dtype":"u8","shape":[0],"data":[]}]}/' none.json
    spid-pack none.json -o none.spid
    spid-splat -s 8 --camera 1,0,0,0,0,-1,0,0,0,0,-1,12 -b 10,20,30 \
        -o a.pam none.spid
    [ "$(pixel a.pam 3 3)" = "10 20 30" ]
}

@test "the picture does not depend on the number of threads" {
    spid-splat -s 100 -j 1 -o a.spid scene.spid
    spid-splat -s 100 -j 3 -o b.spid scene.spid
    cmp a.spid b.spid
}

@test "--exact and the kernels agree to a cut-off" {
    spid-splat -s 32 -o a.pam scene.spid
    spid-splat -s 32 --exact -o b.pam scene.spid
    python3 - <<'P'
a, b = (open(n, "rb").read() for n in ("a.pam", "b.pam"))
assert len(a) == len(b) and max(abs(x - y) for x, y in zip(a, b)) <= 3
P
}

@test "FEAT has the channels, alpha and depth asked for" {
    spid-splat -s 8 --depth -o a.spid scene.spid
    run spid-dump a.spid
    has 'f32[8,8,3]'
    has 'depth'
    spid-dump --check a.spid
}

@test "more than 4 channels are half floats, unless it is the truth" {
    sed 's/"shape":\[3,3\],"data":\[1,0,0,0,1,0,0,0,1\]/"shape":[3,5],"data":[1,0,0,2,3,0,1,0,4,5,0,0,1,6,7]/' \
        scene.json >gaus5.json
    spid-pack gaus5.json -o gaus5.spid
    run bash -c 'spid-splat -s 8 -c 5 gaus5.spid | spid-dump'
    has 'f16[8,8,5]'
    run bash -c 'spid-splat -s 8 -c 5 --covered gaus5.spid | spid-dump'
    has 'f16[64,5]'
    run bash -c 'spid-splat -s 8 -c 5 --exact gaus5.spid | spid-dump'
    has 'f32[8,8,5]'
}

@test "straight alpha is written on request" {
    spid-splat -s 32 --alpha -o a.pam scene.spid
    head -c 90 a.pam | grep -aq RGB_ALPHA
}

@test "a number that is not finite is named with record, array and index" {
    sed 's/"data":\[0,0,0.1,/"data":[0,"nan",0.1,/' scene.json >bad.json
    spid-pack bad.json -o bad.spid
    status 65 spid-splat -s 8 -o a.pam bad.spid
    one_line
    has mean
    has 1
    [ ! -e a.pam ]
}

@test "impossible options and cameras are refused in one line" {
    for o in --channels=0 --channels=33 --size=0 --size=100000 --focal=-1 \
        --focal=0 --camera=1,2; do
        status 64 spid-splat "$o" -o a.pam scene.spid
        one_line
    done
    status 65 spid-splat -s 8 --camera 1,0,0,0,0,0,0,0,0,0,1,12 -o a.pam \
        scene.spid
    one_line
    has singular
    status 65 spid-splat -s 8 -c 4 -o a.pam scene.spid
    has channels
    [ ! -e a.pam ]
}

@test "lengths that do not agree are refused" {
    sed 's/"shape":\[3\],"data":\[0.98,0.98,0.98\]/"shape":[2],"data":[0.98,0.98]/' \
        scene.json >bad.json
    spid-pack bad.json -o bad.spid
    status 65 spid-splat -s 8 -o a.pam bad.spid
    one_line
    has opacity
}
