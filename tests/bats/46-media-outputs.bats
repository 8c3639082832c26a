#!/usr/bin/env bats
# What an output's name promises, and what is never written over.
load helper
load animate

prepare() {
    animate_files
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
}

# animate DRIVER -o OUT ...: SpiD* on the baked avatar.
run_animate() { spid-animate -m model -s avatar.spid "$@"; }

# entries FILE WHAT: ffprobe's value of it.
probe() { ffprobe -v error -show_entries "$2" -of csv=p=0 "$1"; }

# A clip with sound: ten pictures a second, as long as they are.
with_sound() {
    ffmpeg -nostdin -v error -y -r 10 -i drive.y4m -f lavfi -i sine=d=0.4 \
        -c:v mpeg4 -q:v 2 -c:a aac "$@" clip.mp4
}

@test "the driver's sound goes along, unless it is not wanted" {
    with_sound
    for end in mp4 mkv webm; do
        status 0 run_animate clip.mp4 -o out.$end
        [ "$(probe out.$end stream=codec_type | sort | tr '\n' ' ')" = "audio video " ]
    done
    status 0 run_animate --no-sound clip.mp4 -o none.mp4
    [ "$(probe none.mp4 stream=codec_type)" = video ]
    status 0 run_animate clip.mp4 -o out.gif
    has 'out.gif: without the sound of clip.mp4'
}

@test "sound goes through the pipe, and with recorded motion" {
    with_sound
    spid-motion -q -m model clip.mp4 -o motion.spid
    spid-flame -q -m model -i avatar.spid motion.spid |
        spid-branches -q -i avatar.spid | spid-splat -q --size 128 --channels 8 |
        spid-refine -q -m model -o out.mp4
    [ "$(probe out.mp4 stream=codec_type | sort | tr '\n' ' ')" = "audio video " ]
    [ "$(probe out.mp4 stream=avg_frame_rate | head -n 1)" = 10/1 ]
    status 0 run_animate motion.spid -o take.mp4
    [ "$(probe take.mp4 stream=codec_type | sort | tr '\n' ' ')" = "audio video " ]
    [ "$(probe take.mp4 stream=nb_frames,r_frame_rate | head -n 1)" = 10/1,4 ]
    status 0 run_animate --no-sound motion.spid -o none.mp4
    [ "$(probe none.mp4 stream=codec_type)" = video ]
    rm clip.mp4
    status 0 run_animate motion.spid -o quiet.mp4
    has 'quiet.mp4: without sound: the clip that motion.spid was made of is not there'
    [ "$(probe quiet.mp4 stream=codec_type)" = video ]
}

@test "a sound that starts before the pictures starts before them again" {
    ffmpeg -nostdin -v error -y -r 10 -i drive.y4m -c:v mpeg4 -q:v 2 v.mp4
    ffmpeg -nostdin -v error -y -itsoffset 0.7 -i v.mp4 -f lavfi \
        -i sine=d=1.1 -c:v copy -c:a aac late.mp4
    status 0 run_animate late.mp4 -o out.mp4
    [ "$(probe out.mp4 stream=codec_type,start_time | sort | tr '\n' ' ')" = \
        "audio,0.000000 video,0.700000 " ]
}

@test "animations in and out, their size told" {
    ffmpeg -nostdin -v error -y -r 10 -i drive.y4m in.gif
    for end in gif webp apng; do
        status 0 run_animate in.gif -o out.$end
        has "out.$end: 4 frames in "
        # The small model's matte is untrained: whether a face is left to be
        # found in its picture is chance, so the test says where it is.
        status 0 spid-motion -q -m model --crop 20,0,96 out.$end -o out.spid
        [ "$(spid-dump out.spid | grep -c '^MOTN')" -eq 4 ]
    done
    status 0 run_animate --alpha in.gif -o out.webm
    probe out.webm stream_tags=alpha_mode | grep -q 1
    status 0 run_animate --alpha in.gif -o out.mov
    [ "$(probe out.mov stream=codec_name)" = prores ]
    status 64 run_animate --alpha in.gif -o out.mp4
    has 'no alpha in such a video'
}

@test "a stream never takes the name of a picture or a clip" {
    for name in x.jpg x.JPG x.heic x.wmv x.xyz; do
        status 64 run_animate drive.y4m -o $name
        has "$name: such a file cannot be written"
        [ ! -e $name ]
        [ ! -e $name.part ]
    done
    mkdir no.ending
    status 0 run_animate drive.y4m -f stream -o x.xyz
    status 0 run_animate drive.y4m -o .hidden
    status 0 run_animate drive.y4m -o no.ending/x
    for name in x.xyz .hidden no.ending/x; do
        spid-dump $name | grep -q ^IMAG
    done
    for command in "spid-shape -m model source.png" "spid-motion -m model drive.y4m"; do
        status 64 $command -o x.webp
        has 'x.webp: records would be written under the name of a picture'
    done
    status 0 run_animate -f stream drive.y4m -o x.jpg
    spid-dump x.jpg | grep -q '^IMAG'
    status 0 run_animate drive.y4m -o x.spid
}

@test "what is read is not written, under whatever name" {
    with_sound
    cp clip.mp4 before.mp4
    ln clip.mp4 other.mp4
    ln -s clip.mp4 third.mp4
    for name in clip.mp4 ./clip.mp4 other.mp4 third.mp4; do
        status 64 run_animate clip.mp4 -o $name
        has 'the same file as'
        status 64 spid-motion -m model clip.mp4 --overlay $name -o m.spid
    done
    cmp clip.mp4 before.mp4
    mkdir frames
    ffmpeg -nostdin -v error -y -i drive.y4m -start_number 0 frames/%03d.png
    status 64 run_animate frames/%03d.png -o frames/%03d.png
    has 'is read, too'
    status 64 run_animate frames -o frames/%03d.png
    status 0 run_animate frames/%03d.png -o frames/out-%03d.png
    printf 'avatar.spid\tclip.mp4\tout.mp4\navatar.spid\tclip.mp4\tother.mp4\n' >list
    status 0 spid-animate -m model -s --list list
    cmp clip.mp4 before.mp4
}

@test "numbered pictures are a clip, and a lost one is named" {
    mkdir frames
    ffmpeg -nostdin -v error -y -i drive.y4m -start_number 7 frames/%03d.png
    status 0 spid-motion -q -m model frames/%03d.png -o m.spid
    [ "$(spid-dump m.spid | grep -c '^MOTN')" -eq 4 ]
    rm frames/009.png
    status 66 spid-motion -q -m model frames/%03d.png -o m.spid
    has 'frames/009.png is missing'
}

@test "live --frames writes so many, on any number of threads" {
    for j in 1 2 3; do
        ffmpeg -nostdin -v error -stream_loop 9 -i drive.y4m -f yuv4mpegpipe - |
            spid-live -q -m model -s -j $j --frames 5 avatar.spid - >out.y4m || true
        [ "$(grep -ao FRAME out.y4m | wc -l)" -le 5 ]
    done
    ffmpeg -nostdin -v error -re -stream_loop 9 -r 10 -i drive.y4m -f yuv4mpegpipe - |
        spid-live -q -m model -s -j 3 --frames 5 avatar.spid - >out.y4m
    [ "$(grep -ao FRAME out.y4m | wc -l)" -eq 5 ]
}

@test "files that stand for what people report: all their frames, in step, with 0" {
    wild=${SPID_ASSETS:-$TOP/../shared/assets}/../wild
    [ -d "$wild" ] || skip "no clips of ../shared/wild (a folder beside this one)"
    local n
    while read -r name n; do
        status 0 spid-motion -q -m "$TOP/examples/model" "$wild/$name" -o m.spid
        [ "$(spid-dump m.spid | grep -c '^MOTN')" -eq "$n" ] || {
            echo "$name: $(spid-dump m.spid | grep -c '^MOTN') frames, not $n"
            false
        }
    done <<'L'
trim-copy.mp4 27
trim-editlist.mp4 25
animated.gif 12
animated.webp 12
animated.png 6
matrix-hflip.mp4 24
sar2.mp4 50
video-starts-late.mp4 50
L
    status 0 run_animate "$wild/video-starts-late.mp4" -o out.mp4
    [ "$(probe out.mp4 stream=codec_type,start_time | sort | tr '\n' ' ')" = \
        "audio,0.000000 video,0.700000 " ]
    # pixels twice as wide as high: as the same clip with square ones
    status 0 spid-motion -q -m "$TOP/examples/model" "$wild/sar2.mp4" -o a.spid
    ffmpeg -nostdin -v error -y -i "$wild/sar2.mp4" -vf scale=320:320,setsar=1 \
        -c:v libx264 -crf 8 square.mp4
    status 0 spid-motion -q -m "$TOP/examples/model" square.mp4 -o b.spid
    status 0 spid-eval --motion --format json a.spid b.spid
    [[ $output =~ \"pose_deg\":[[:space:]]*([0-9.]+) ]]
    awk "BEGIN { exit !(${BASH_REMATCH[1]} < 1) }"
}
