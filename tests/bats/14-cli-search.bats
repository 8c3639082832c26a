load helper

prepare() {
    motion 1
    mkdir m x x/spid
    echo bad >m/head.safetensors
    echo bad >x/spid/head.safetensors
    echo bad >m/other.safetensors
    export HOME=$PWD
    unset SPID_MODEL XDG_DATA_HOME
}

@test "the model's directory comes from -m, then SPID_MODEL, then XDG" {
    XDG_DATA_HOME=$PWD/x run spid-flame motion.spid
    has "$PWD/x/spid/head.safetensors"
    SPID_MODEL=$PWD/m XDG_DATA_HOME=$PWD/x run spid-flame motion.spid
    has "$PWD/m/head.safetensors"
    cp -r m m2
    SPID_MODEL=$PWD/m run spid-flame -m m2 motion.spid
    has "m2/head.safetensors"
}

@test "a model file given by name has its head beside it" {
    run spid-flame -m m/other.safetensors motion.spid
    [ "$status" -ne 0 ]
    has "m/head.safetensors"
}

@test "no model: every place that was tried is named" {
    cp "$(command -v spid-flame)" ./spid-flame
    XDG_DATA_HOME=$PWD/none run ./spid-flame -m nowhere motion.spid
    [ -e /usr/local/share/spid/head.safetensors ] || {
        [ "$status" -eq 66 ]
        has 'head.safetensors not found (tried nowhere/head.safetensors'
        has "$PWD/none/spid/head.safetensors"
    }
}

@test "-j takes a number of threads" {
    status 64 spid-dump -j two motion.spid
    has '--threads=two: not a number (expected a whole number, 1 to 1024)'
    status 0 spid-dump -cq -j 2 motion.spid
}

@test "an option without its value, and an unknown letter" {
    status 64 spid-dump --only
    has '--only needs a value'
    status 64 spid-dump -o
    has '-o needs a value'
    status 64 spid-dump -Z
    has '-Z is not an option'
}

@test "an output without a name is refused before anything is done" {
    for option in output stats; do
        status 64 spid-dump --$option= motion.spid
        one_line
        has "--$option=: no name"
    done
}

@test "a message is one line whatever is in a name" {
    status 66 spid-dump $'two\nlines.spid'
    one_line
    has 'two?lines.spid: cannot open'
}

@test "SPID_CPU names a level" {
    SPID_CPU=avx1024 status 64 spid-dump motion.spid
    one_line
    has 'SPID_CPU=avx1024: not a level (expected baseline, avx2 or avx512)'
    SPID_CPU= status 0 spid-dump -q motion.spid
}
