#!/usr/bin/env bats
# spid-motion: frames of every kind in, one motion for each out.
load helper

setup_file() {
    "$TOP/${BUILD:-build}/tests/unit/track_motion" --model \
        "$BATS_FILE_TMPDIR/model.safetensors"
    export SPID_MODEL=$BATS_FILE_TMPDIR/model.safetensors
}

# ppm W H [SEED]: a picture of stripes that show no face.
ppm() {
    printf 'P6 %d %d 255\n' "$1" "$2"
    yes "spid ${3:-0} stripes" | tr '\n' ' ' | head -c $((3 * $1 * $2))
}

# clip N: N such pictures in one stream.
clip() {
    local i
    for ((i = 0; i < $1; i++)); do ppm 64 48 "$i"; done
}

crop=--crop=32,24,40

@test "every frame gives one motion record, after CONF and before END" {
    clip 5 >clip.ppm
    spid-motion $crop --fps 10 clip.ppm -o out.spid
    spid-dump --check out.spid
    run spid-dump --json out.spid
    [ "$(grep -c '"type":"MOTN"' <<<"$output")" -eq 5 ]
    [[ ${lines[0]} == *CONF* ]]
    has '"frame":4,"time":0.4'
}

@test "a pipe, a file, a directory and a list give the same motion" {
    mkdir pictures
    for i in 1 2 10; do ppm 64 48 $i | tee "pictures/p$i.ppm"; done >clip.ppm
    ls -v pictures | sed 's|^|pictures/|' >list
    spid-motion $crop clip.ppm -o file.spid
    spid-motion $crop <clip.ppm >pipe.spid
    spid-motion $crop pictures -o folder.spid
    spid-motion $crop @list -o list.spid
    cmp file.spid pipe.spid
    cmp file.spid folder.spid
    cmp file.spid list.spid
}

@test "one thread and two give the same bits" {
    clip 3 >clip.ppm
    spid-motion $crop -j 1 clip.ppm -o one.spid
    spid-motion $crop -j 2 clip.ppm -o two.spid
    cmp one.spid two.spid
}

@test "the motion poses the head as many times as there are frames" {
    clip 4 | spid-motion $crop | spid-flame >mesh.spid
    [ "$(spid-dump --json mesh.spid | grep -c '"type":"MESH"')" -eq 4 ]
}

@test "a face crop given is the crop in every record" {
    ppm 64 48 >one.ppm
    spid-motion $crop --window 32,24,64 one.ppm -o out.spid
    run spid-dump --json --values --only MOTN out.spid
    has '"data":[256,256,320]'
}

@test "a stream cut short delivers its frames, then ends with 65" {
    clip 4 | head -c -100 >cut.ppm
    status 65 spid-motion $crop cut.ppm -o out.spid
    one_line
    has 'cut.ppm: frame 3: picture cut short'
    [ ! -e out.spid ]
    run spid-dump --json out.spid.part
    [ "$(grep -c '"type":"MOTN"' <<<"$output")" -eq 3 ]
}

@test "pictures without a face end with 65 and suggest --crop" {
    clip 2 >clip.ppm
    status 65 spid-motion clip.ppm -o out.spid
    one_line
    has 'clip.ppm: no face in 2 frames of 64 x 48 pixels'
    has -- '--crop X,Y,SIZE'
    [ ! -e out.spid ]
    status 65 spid-motion -o out.spid < <(ppm 1 1)
    has 'no face'
}

@test "impossible inputs get one line and the right status" {
    printf 'P6 20000 20000 255\n' >huge.ppm
    status 65 spid-motion $crop huge.ppm -o out.spid
    one_line
    has '20000 x 20000'
    : >empty.mp4
    status 65 spid-motion $crop empty.mp4 -o out.spid
    has 'empty file'
    echo nonsense >bad.mp4
    status 65 spid-motion $crop bad.mp4 -o out.spid
    one_line
    status 66 spid-motion $crop missing.mp4 -o out.spid
}

@test "a wrong square names the option, the value and what would do" {
    status 64 spid-motion --crop 1,2 x.ppm
    has '--crop=1,2'
    has 'X,Y,SIZE'
    status 64 spid-motion --precision int3 x.ppm
}

@test "a model that is none, cut, or of NaN is refused by name" {
    ppm 64 48 >one.ppm
    head -c 100000 "$SPID_MODEL" >cut.safetensors
    status 65 spid-motion $crop -m cut.safetensors one.ppm -o out.spid
    one_line
    has cut.safetensors
    head=$TOP/${BUILD:-build}/share/spid/head.safetensors
    run spid-motion $crop -m "$head" --head "$head" one.ppm -o out.spid
    [ "$status" -ne 0 ]
    one_line
    has 'not a SpiD model'
    cp "$SPID_MODEL" nan.safetensors
    printf '\377\377\377\377' |
        dd of=nan.safetensors bs=1 seek=1000000 conv=notrunc status=none
    status 65 spid-motion $crop -m nan.safetensors one.ppm -o out.spid
    one_line
    has nan.safetensors
}

@test "smoothing changes the motion but not the first frame" {
    clip 3 >clip.ppm
    spid-motion $crop clip.ppm -o raw.spid
    spid-motion $crop --smooth 1.5 clip.ppm -o smooth.spid
    spid-dump --frames 0:1 --json --values --only MOTN raw.spid >a
    spid-dump --frames 0:1 --json --values --only MOTN smooth.spid >b
    cmp a b
    status 1 cmp -s raw.spid smooth.spid
}

@test "the overlay is a picture for every frame" {
    clip 3 >clip.ppm
    spid-motion $crop clip.ppm -o out.spid --overlay seen-%02d.png
    [ "$(ls seen-*.png | wc -l)" -eq 3 ]
    status 64 spid-motion $crop clip.ppm -o out.spid --overlay seen.txt
}

@test "--stats tells the stages apart" {
    t=$(printf "\t")
    clip 3 | spid-motion $crop --stats times.tsv -o out.spid
    for stage in decode crop network heads encode; do
        grep -q "^$stage$t" times.tsv
    done
    grep -q ^decode times.tsv
}

@test "a full disk and a reader that leaves are noticed" {
    clip 3 >clip.ppm
    status 74 bash -c "spid-motion $crop clip.ppm -o - >/dev/full"
    status 0 bash -c "spid-motion $crop clip.ppm | head -c 1 >/dev/null"
}

# person N SIZE: N frames of a made person, as PAM pictures.
person() {
    spid-synth -q --frames "$1" --size "$2" --effects 0 --format pam -s 3
}

@test "a face is found without help, lost in the dark, and found again" {
    {
        person 4 256
        for i in 1 2 3; do
            printf 'P6 256 256 255\n'
            head -c 196608 /dev/zero
        done
        person 4 256
    } >clip.pam
    run spid-motion clip.pam -o out.spid
    [ "$status" -eq 0 ]
    has 'frame 4: face lost (the picture is blank there)'
    has 'frame 7: face found again'
    has 'no face in 3 frames in all'
    spid-dump --check out.spid
    run spid-dump --json out.spid
    [ "$(grep -c '"type":"MOTN"' <<<"$output")" -eq 11 ]
    [ "$(grep -c '"name":"lost"' <<<"$output")" -eq 3 ]
}

@test "frames before the first face take its motion and are marked" {
    {
        for i in 1 2; do
            printf 'P6 256 256 255\n'
            head -c 196608 /dev/zero
        done
        person 2 256
    } >clip.pam
    run spid-motion clip.pam -o out.spid --overlay seen-%d.png
    [ "$status" -eq 0 ]
    has 'no face in the first 2 frames'
    run spid-dump --json out.spid
    [ "$(grep -c '"type":"MOTN"' <<<"$output")" -eq 4 ]
    [ "$(grep -c '"name":"lost"' <<<"$output")" -eq 2 ]
    [ "$(ls seen-*.png | wc -l)" -eq 4 ]
}

@test "a clip by <, in a folder with blanks and letters, of another locale" {
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    mkdir "ein Ordner ü"
    clip 4 | ffmpeg -v error -f ppm_pipe -i - -pix_fmt yuv420p "ein Ordner ü/ein Clip.mp4"
    spid-motion -q $crop - <"ein Ordner ü/ein Clip.mp4" -o a.spid
    LC_ALL=de_DE.UTF-8 spid-motion -q $crop "ein Ordner ü/ein Clip.mp4" -o b.spid
    cmp <(spid-dump -q a.spid) <(spid-dump -q b.spid)
    [ "$(spid-dump -q a.spid | grep -c '^MOTN')" -eq 4 ]
}

@test "a full disk is said with the picture's name" {
    ln -s /dev/full seen-00000.png
    clip 1 >in.ppm
    status 74 spid-motion $crop in.ppm -o /dev/null --overlay seen-%05d.png
    has 'seen-00000.png: cannot write: No space left on device'
}

@test "a sound file is no clip, whatever picture lies in it" {
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    ffmpeg -v error -f lavfi -i sine=d=0.2 -i "$TOP/examples/photo.jpg" -map 0 \
        -map 1 -c:v mjpeg -disposition:v attached_pic cover.mp3
    status 65 spid-motion cover.mp3 -o out.spid
    one_line
    has 'cover.mp3: not a video or picture'
    [ ! -e out.spid ]
}
