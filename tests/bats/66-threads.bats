# Every program with any number of threads on any number of processors: it runs
# and writes the same bytes.
load helper
load animate

prepare() {
    animate_files
}

# Allowed processors: the first, and the first two where there are two.
processors() {
    local all
    all=$(taskset -cp $$ | sed 's/.*: //; s/,/ /g')
    all=$(for r in $all; do seq "${r%-*}" "${r#*-}"; done | head -n 2)
    head -n 1 <<<"$all"
    paste -sd, <<<"$all"
}

# any PROGRAM ARGUMENT ... OPTION OUTPUT: all counts give what one thread gives;
# of a folder its records and weights.
any() {
    local out=${*: -1} cpus j
    timeout 60 "${@:1:$#-1}" "one-$out" -j 1
    for cpus in $(processors); do
        for j in 2 3 8 64 ''; do
            timeout 60 taskset -c "$cpus" "$@" ${j:+-j $j} || {
                echo "exit status $?: taskset -c $cpus $* ${j:+-j $j}"
                return 1
            }
            diff -rq -x '*.tsv' -x '*.json' -x '*.png' "one-$out" "$out"
            rm -r "$out"
        done
    done
}

@test "a photograph and a clip to pictures, in one process" {
    any spid-animate -q -m model -s source.png drive.y4m -o star.y4m
    any spid-animate -q -m model avatar.spid drive.y4m -o full.y4m
}

@test "a camera" {
    local cpus j
    for cpus in $(processors); do
        for j in 1 2 3 64; do
            timeout 60 taskset -c "$cpus" spid-live -q -m model -s -j $j \
                avatar.spid - -o live.y4m <drive.y4m
        done
    done
}

@test "the programs of the pipe" {
    any spid-shape -q -m model source.png -o shape.spid
    any spid-motion -q -m model drive.y4m -o motion.spid
    any spid-flame -q -m model -i avatar.spid one-motion.spid -o mesh.spid
    any spid-branches -q -m model --bake me.spid -o baked.spid
    any spid-branches -q -i avatar.spid one-mesh.spid -o gaussians.spid
    any spid-splat -q --size 128 --channels 8 --covered one-gaussians.spid \
        -o features.spid
    any spid-refine -q -m model one-features.spid -o pictures.y4m
    any spid-dump -q one-motion.spid -o motion.txt
    motion 2
    any spid-pack -q motion-src.json -o packed.spid
}

@test "the programs that make people, clips and models" {
    any spid-synth -q -n 3 --frames 1 --size 64 -s 5 --head "$HEAD" \
        -o people.spid
    any spid-export -q -m model avatar.spid --ply avatar.ply
    any spid-eval -q -f tsv drive.y4m drive.y4m -o table.tsv
    any spid-prepare -q -m model --frames 3 --least 2 --min-face 20 \
        drive.y4m -o records
    cat >m.json <<'J'
{"stage": "motion", "steps": 2, "batch": 4, "micro": 2, "rate": 1e-3, "pool": 2}
J
    any spid-train -q --head "$HEAD" -c m.json one-people.spid -o run
}
