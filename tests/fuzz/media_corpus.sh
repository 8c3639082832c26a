#!/bin/sh
# media_corpus.sh DIR: small clips of every container and of the odd things in
# them, for fuzz_video and fuzz_pictures to begin from.  Needs ffmpeg.
set -eu
mkdir -p "$1"
cd "$1"
make() { ffmpeg -v error -y "$@" || echo "media_corpus.sh: not made: $*" >&2; }
test="-f lavfi -i testsrc2=s=32x24:r=10:d=0.5"
tone="-f lavfi -i sine=d=0.6"
for codec in mpeg4:mp4 libx264:mp4 mjpeg:avi mpeg2video:mpg mpeg2video:ts \
    libvpx:webm flv1:flv wmv2:wmv ffv1:mkv prores_ks:mov png:mov gif:gif \
    apng:apng libwebp_anim:webp rawvideo:nut libx265:mkv theora:ogv; do
    make $test -c:v "${codec%:*}" -f "$(
        case ${codec#*:} in
        mpg) echo mpeg ;; ts) echo mpegts ;; mkv) echo matroska ;;
        wmv) echo asf ;; ogv) echo ogg ;; *) echo "${codec#*:}" ;;
        esac)" "${codec%:*}.${codec#*:}"
done
make $test $tone -c:v mpeg4 -c:a aac -shortest sound.mp4
make $test -vf setsar=2 -c:v mpeg4 sar.mp4
make $test -c:v mpeg4 -movflags frag_keyframe+empty_moov fragments.mp4
make $test -c:v mpeg4 -movflags faststart faststart.mp4
make -i faststart.mp4 -c copy -metadata:s:v:0 rotate=90 turned.mp4
make -ss 0.2 -i faststart.mp4 -c copy trimmed.mp4
make -itsoffset 0.3 -i faststart.mp4 $tone -map 0:v -map 1:a -c:v copy \
    -c:a aac late.mp4
make $test -vf tinterlace=interleave_top -flags +ilme+ildct -c:v mpeg2video \
    interlaced.mpg
make $test -pix_fmt yuv420p10le -c:v libx265 -color_trc smpte2084 \
    -color_primaries bt2020 -colorspace bt2020nc -x265-params log-level=none \
    hdr.mp4
make $test -vf setpts=N*N/10/TB -vsync vfr -c:v libx264 variable.mkv
head -c 1500 faststart.mp4 >cut.mp4
