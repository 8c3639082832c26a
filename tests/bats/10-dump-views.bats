load helper

prepare() { motion 5; }

@test "every record and array is listed with shape and statistics" {
    status 0 spid-dump motion.spid
    has 'CONF frame 0, 0 s: 1 array'
    has 'MOTN frame 4, 0.16 s: 6 arrays'
    has 'jaw      f32[3]           min 0            mean 0.0133333    max 0.04'
    [ "$(grep -c '^MOTN' <<<"$output")" -eq 5 ]
}

@test "JSON is one object per record" {
    status 0 spid-dump --json motion.spid
    [ "${#lines[@]}" -eq 6 ]
    spid-dump --json motion.spid >all.json
    python3 -c '
import json
rows = [json.loads(line) for line in open("all.json")]
assert rows[2]["type"] == "MOTN" and rows[2]["frame"] == 1
jaw = [a for a in rows[2]["arrays"] if a["name"] == "jaw"][0]
assert jaw["shape"] == [3] and jaw["nonfinite"] == 0
assert abs(jaw["max"] - 0.01) < 1e-8'
}

@test "--check says one line for a good stream, nothing with -q" {
    status 0 spid-dump --check motion.spid
    has 'motion.spid: 6 records, frames 0 to 4'
    one_line
    status 0 spid-dump -cq motion.spid
    [ -z "$output" ]
}

@test "--check names record, array and index of a number that is not finite" {
    sed 's/"jaw":\[0.03,0,0\]/"jaw":[0.03,"nan",0]/' motion-src.json >bad.json
    spid-pack bad.json -o bad.spid
    status 65 spid-dump --check bad.spid
    [ "$output" = 'spid-dump: bad.spid: frame 3: MOTN jaw[1] is not finite' ]
    status 0 spid-dump bad.spid
    has '1 not finite'
}

@test "--check names the array of a known record that has the wrong shape" {
    sed 's/"lid":\[0,0\]/"lid":[0,0,0]/' motion-src.json >bad.json
    spid-pack bad.json -o bad.spid
    status 65 spid-dump --check bad.spid
    [ "$output" = \
        'spid-dump: bad.spid: frame 0: MOTN lid is f32[3] (expected f32[2])' ]
}

@test "--frames and --only choose records" {
    status 0 spid-dump --json --frames 1:3 motion.spid
    [ "${#lines[@]}" -eq 2 ]
    status 0 spid-dump --json --frames 4 motion.spid
    [ "${#lines[@]}" -eq 1 ]
    status 0 spid-dump --json --frames :2 --only MOTN motion.spid
    [ "${#lines[@]}" -eq 2 ]
    status 0 spid-dump --json --only CONF,SHAP motion.spid
    [ "${#lines[@]}" -eq 1 ]
}

@test "misuse names the option, the value and what would do" {
    status 64 spid-dump --frames x motion.spid
    has 'spid-dump: --frames=x: not a range of frames (expected FIRST:END'
    status 64 spid-dump --frames 3:1 motion.spid
    status 64 spid-dump --max-bytes=lots motion.spid
    has '--max-bytes=lots: not a size'
    status 64 spid-dump --values motion.spid
    status 64 spid-dump --nonsense
    has '--nonsense is not an option'
    status 64 spid-dump motion.spid motion.spid
    status 64 spid-dump -j 0 motion.spid
    has '--threads=0: out of range (expected a whole number, 1 to 1024)'
}

@test "--stats writes a table of times" {
    status 0 spid-dump -cq --stats times.tsv motion.spid
    [ "$(head -n 1 times.tsv | tr '\t' ' ')" = \
        "stage calls total_ms mean_ms median_ms p95_ms" ]
    grep -q '^read.7.' times.tsv
    grep -q '^check.6.' times.tsv
}

@test "a named output never replaces its input, nor a device" {
    cp motion.spid a
    ln -s a b
    status 64 spid-dump -o a a
    one_line
    status 64 spid-dump -o b a
    cmp motion.spid a
    ln -s /dev/null nothing
    spid-dump -o nothing --safetensors nothing motion.spid
    [ -c /dev/null ]
    [ -L nothing ]
    [ ! -e nothing.part ]
    spid-pack motion.spid -o nothing
    [ -c /dev/null ] && [ -L nothing ] && [ ! -e nothing.part ]
}

@test "where nothing was read nothing is left, neither folder nor file" {
    motion 2 m.spid
    head -c 100 m.spid >cut.spid
    status 65 spid-dump --npy d --safetensors t -o text cut.spid
    one_line
    [ ! -e d ]
    [ ! -e t ]
    [ ! -e text ]
    [ ! -e text.part ]
    status 73 spid-dump --npy d -o none/text m.spid
    [ ! -e d ]
    mkdir d
    status 73 spid-dump --npy d -o none/text m.spid
    [ -d d ]
}

@test "--help and --version end well on standard output" {
    for p in spid-dump spid-pack; do
        status 0 $p --help
        [[ $output == "Usage: $p "* ]]
        status 0 $p --version
        [[ $output == "$p (SpiD toolkit) "* ]]
    done
}
