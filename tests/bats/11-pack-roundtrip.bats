load helper

# A stream with every dtype, odd shapes, an unknown record and extra arrays.
prepare() {
    motion 4
    cat >odd.json <<'J'
{"type":"CONF","arrays":{"json":"{\"note\":\"\u00e9 \\\" x\"}"}}
{"type":"ABCD","frame":7,"time":1e-3,"arrays":[
 {"name":"a","dtype":"u8","shape":[2,2],"data":[0,255,7,1]},
 {"name":"b","dtype":"i32","shape":[1,1,3],"data":[-2147483648,0,2147483647]},
 {"name":"c","dtype":"f16","shape":[3],"data":[0.5,"inf",6e-8]},
 {"name":"d","dtype":"f32","shape":[4],"data":[1e-45,"nan",3.4e38,0.1]},
 {"name":"e","dtype":"f64","shape":[],"data":[0.1]},
 {"name":"none","dtype":"f32","shape":[0,3],"data":[]}]}
{"type":"ABCD","frame":9007199254740991,"arrays":[]}
[{"type":"SHAP","arrays":{"shape":[1,2,3],"person":[4]}}]
J
    spid-pack odd.json motion.spid -o odd.spid
}

@test "JSON with values makes the same bytes" {
    spid-dump --json --values odd.spid >again.json
    spid-pack again.json -o again.spid
    cmp odd.spid again.spid
}

@test "a JSON file of --max-bytes is read, a larger one refused" {
    local bytes
    bytes=$(wc -c <odd.json)
    status 0 spid-pack --max-bytes "$bytes" odd.json -o least.spid
    status 65 spid-pack --max-bytes $((bytes - 1)) odd.json -o least.spid
    has "more than $((bytes - 1)) bytes"
}

@test "safetensors makes the same bytes" {
    spid-dump --safetensors a.safetensors odd.spid
    [ ! -e a.safetensors.part ]
    spid-pack a.safetensors -o again.spid
    cmp odd.spid again.spid
}

@test "a directory of npy files makes the same bytes" {
    spid-dump --npy dir odd.spid
    spid-pack dir -o again.spid
    cmp odd.spid again.spid
    [ -z "$(find dir -name '*.part')" ]
}

@test "a stream through pack is the same, from a file and from a pipe" {
    spid-pack odd.spid -o again.spid
    cmp odd.spid again.spid
    spid-pack - <odd.spid | cmp - odd.spid
    cat odd.spid | spid-pack - | cmp - odd.spid
}

@test "numpy opens what dump wrote, and pack takes what numpy wrote" {
    need_numpy
    spid-dump --npy dir --only MOTN motion.spid
    "$PYTHON" - <<'P'
import json, struct
import numpy as np
jaw = np.load("dir/MOTN.jaw.npy")
assert jaw.dtype == np.float32 and jaw.shape == (4, 3), jaw.shape
assert np.allclose(jaw[:, 0], [0, 0.01, 0.02, 0.03])
assert np.load("dir/MOTN.rot.npy").shape == (4, 3, 3)
np.save("jaw.npy", np.asfortranarray(jaw[::-1].astype(">f4")))
np.save("count.npy", np.arange(4))
np.save("flag.npy", np.array([True, False, True, True]))
P
    spid-pack --raw -t TEST -s --frame 10 --fps 10 jaw.npy n=count.npy \
        flag.npy -o t.spid
    status 0 spid-dump --json --values t.spid
    [ "${#lines[@]}" -eq 4 ]
    has '"frame":13,"time":1.3'
    [[ ${lines[0]} == *'"name":"jaw","dtype":"f32","shape":[3]'* ]]
    [[ ${lines[0]} == *'"data":[0.0299999993,0,0]'* ]]
    [[ ${lines[3]} == *'"name":"n","dtype":"i32","shape":[]'*'"data":[3]'* ]]
    [[ ${lines[1]} == *'"name":"flag","dtype":"u8","shape":[]'*'"data":[0]'* ]]
}

@test "a plain safetensors file becomes one record" {
    need_numpy
    "$PYTHON" - <<'P'
import json, struct
import numpy as np
a = np.arange(6, dtype="<f4").reshape(2, 3)
b = np.array([5, 6], dtype="<i8")
c = (np.array([1.5, -2.0], dtype="<f4").view("<u4") >> 16).astype("<u2")
head, data = {}, b""
for name, kind, x in (("a", "F32", a), ("b", "I64", b), ("c", "BF16", c)):
    head[name] = {"dtype": kind, "shape": list(x.shape),
                  "data_offsets": [len(data), len(data) + x.nbytes]}
    data += x.tobytes()
text = json.dumps(head).encode()
open("p.safetensors", "wb").write(struct.pack("<Q", len(text)) + text + data)
P
    spid-pack -t TEST p.safetensors -o p.spid
    status 0 spid-dump --json --values --only TEST p.spid
    has '"name":"a","dtype":"f32","shape":[2,3]'
    has '"name":"b","dtype":"i32","shape":[2]'
    has '"data":[1.5,-2]'
}

@test "an input without CONF gets one, unless --raw" {
    spid-pack motion-src.json -o a.spid
    spid-pack --raw motion-src.json -o b.spid
    [ "$(spid-dump --json a.spid | wc -l)" -eq 5 ]
    [ "$(spid-dump --json b.spid | wc -l)" -eq 4 ]
}

@test "sources that do not fit are refused with their names" {
    echo '{"type":"MOTN","arrays":{"jaw":[[1,2],[3]]}}' >ragged.json
    status 65 spid-pack ragged.json -o x.spid
    has 'ragged.json: line 1: frame 0: MOTN: jaw is ragged'
    echo '{"type":"MOTN","arrays":{"jaw":["x"]}}' >text.json
    status 65 spid-pack text.json -o x.spid
    echo '{"type":"TOOLONG"}' >type.json
    status 65 spid-pack type.json -o x.spid
    printf '{}\n\n{"type":' >broken.json
    status 65 spid-pack broken.json -o x.spid
    echo hello >h.npy
    status 65 spid-pack -t TEST h.npy -o x.spid
    has 'h.npy: not an npy file'
    spid-dump --npy dir motion.spid
    status 64 spid-pack dir/MOTN.jaw.npy -o x.spid
    has '--type'
    status 64 spid-pack -t TOOLONG a=dir/MOTN.jaw.npy -o x.spid
    status 65 spid-pack -t MOTN -s a=dir/MOTN.jaw.npy c=dir/CONF.json.npy \
        -o x.spid
    has 'rows'
    rm dir/MOTN.lid.npy
    status 66 spid-pack dir -o x.spid
    status 66 spid-pack nothing.spid -o x.spid
    status 64 spid-pack
    [ ! -e x.spid ]
}
