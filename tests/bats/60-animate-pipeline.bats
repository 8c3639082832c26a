# spid animate against the piped programs, lists, recipes, bad input.
load helper
load animate

prepare() { animate_files; }

@test "SpiD*: one process and the pipe give the same bytes" {
    spid-animate -q --absolute -m model -s -b black source.png drive.y4m -o one.y4m
    set -o pipefail
    spid-motion -q -m model drive.y4m | spid-flame -m model -i avatar.spid |
        spid-branches -i avatar.spid | spid-splat -q --size 128 -o pipe.y4m
    cmp one.y4m pipe.y4m
}

@test "SpiD: one process and the pipe give the same bytes" {
    spid-animate -q --absolute -m model -b black source.png drive.y4m -o one.y4m
    set -o pipefail
    spid-motion -q -m model drive.y4m | spid-flame -m model -i avatar.spid |
        spid-branches -i avatar.spid |
        spid-splat -q --size 128 --channels 8 |
        spid-refine -q -m model -o pipe.y4m
    cmp one.y4m pipe.y4m
}

@test "the driver may be a pipe with a name: no byte of it is lost" {
    spid-animate -q -m model -s avatar.spid drive.y4m -o file.y4m
    spid-animate -q -m model -s avatar.spid <(cat drive.y4m) -o pipe.y4m
    cmp file.y4m pipe.y4m
}

@test "the pipe's features say how the head has turned" {
    spid-synth -q -n 1 --frames 3 -s 7 --fps 1 --size 64 --without mesh \
        --head "$HEAD" -o truth.spid
    spid-flame -q -m model -i avatar.spid truth.spid |
        spid-branches -i avatar.spid |
        spid-splat -q --size 64 --channels 8 -o features.spid
    spid-dump features.spid | grep '  turn' >turns
    [ "$(wc -l <turns)" -eq 3 ]
    [ "$(sort -u turns | wc -l)" -eq 3 ]
    ! grep -q 'min 0 .*max 0$' turns
}

@test "programs of a pipe with two threads each" {
    spid-animate -q --absolute -m model avatar.spid drive.y4m -o one.y4m
    set -o pipefail
    spid-motion -q -j 2 -m model drive.y4m |
        spid-flame -m model -i avatar.spid | spid-branches -i avatar.spid |
        spid-splat -q -j 2 --size 128 --channels 8 --covered |
        spid-refine -q -j 2 -m model -o pipe.y4m
    cmp one.y4m pipe.y4m
}

@test "the number of threads does not change a byte" {
    spid-animate -q --absolute -m model -s -j 1 me.spid drive.y4m -o a.y4m
    spid-animate -q --absolute -m model -s -j 3 avatar.spid drive.y4m -o b.y4m
    cmp a.y4m b.y4m
}

@test "the summary puts the stages beside the paper's" {
    status 0 spid-animate -m model -s avatar.spid drive.y4m -o a.y4m \
        --stats t.tsv
    has "4 frames"
    has "paper, A100"
    grep -q "^encoder" t.tsv
    grep -q "^render" t.tsv
}

@test "live reports latency and what it dropped" {
    status 0 spid-live -m model -s avatar.spid - -o a.y4m <drive.y4m
    has "latency p50"
    has "dropped"
}

@test "a list goes on where it stopped and survives a bad clip" {
    printf '# clips\navatar.spid\tdrive.y4m\ta.y4m\n' >list
    printf 'missing.png\tdrive.y4m\tb.y4m\navatar.spid\tdrive.y4m\tc.y4m\n' \
        >>list
    echo kept >a.y4m
    status 65 spid-animate -m model -s --list list
    has "3 clips: 1 made, 1 were there, 1 failed"
    [ "$(cat a.y4m)" = kept ]
    [ -s c.y4m ]
    [ ! -e b.y4m ]
    printf 'one\ttwo\n' >short
    status 65 spid-animate -m model --list short
    has "line 1"
    status 74 spid-animate -m model --list .    # a read that fails
    has "cannot be read"
}

@test "the recipes make every pair once" {
    export SPID_ANIMATE_FLAGS="-s -m $PWD/model"
    printf '%s\n' $'avatar.spid\tdrive.y4m\tout/a.y4m' \
        $'me.spid\tdrive.y4m\tout/b.y4m' >list
    "$TOP/examples/parallel.sh" list 2
    cmp out/a.y4m out/b.y4m
    rm -r out
    for i in 0 1; do
        SLURM_ARRAY_TASK_ID=$i SLURM_ARRAY_TASK_COUNT=2 \
            "$TOP/examples/slurm.sh" list
    done
    cmp out/a.y4m out/b.y4m
}

@test "a driver without a face is one line and status 65" {
    { printf 'YUV4MPEG2 W64 H64 F25:1 C420jpeg\n'
      for i in 1 2 3; do printf 'FRAME\n'; head -c 6144 /dev/zero; done
    } >empty.y4m
    status 65 spid-animate -q -m model -s avatar.spid empty.y4m -o a.y4m
    one_line
    has "no face"
    [ ! -e a.y4m ]
}

@test "of a source and a model that lacks weights the model is named" {
    mkdir broken
    cp model/head.safetensors broken/
    LC_ALL=C sed 's/"static\.gaussian_conv\.0\.w/"static.gaussian_conv.0.x/' \
        model/model.safetensors >broken/model.safetensors
    status 65 spid-animate -m broken source.png drive.y4m -o x.y4m
    [[ $output == "spid-animate: broken/model.safetensors: no tensor"* ]]
    [ ! -e x.y4m ]
}

@test "a driver that breaks off keeps complete frames and says so" {
    head -c 250000 drive.y4m >cut.y4m
    status 65 spid-animate -q -m model -s avatar.spid cut.y4m -o f-%02d.png
    [ -e f-00.png ] && [ ! -e f-03.png ]
}

@test "misuse names what was expected" {
    status 64 spid-animate -m model source.png
    has "SOURCE and DRIVER"
    status 66 spid-animate -q -m model nobody.png drive.y4m -o a.y4m
    status 64 spid nothing
    has "verbs:"
    status 0 spid doctor -m model
    has "kernels"
}
