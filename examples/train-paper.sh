#!/bin/sh
# train-paper.sh FLAME.pkl DINOV2.pth CLIPS OUT: the paper's model from FLAME, a
# DINOv2 ViT-B/14 checkpoint and a folder (or @LIST) of talking-head videos.
# Everything lands in OUT; a run that was stopped goes on where it was.  In the
# end `spid animate -m OUT PICTURE VIDEO` runs what was trained.
#
#   LANDMARKS  FLAME's landmark embedding (beside FLAME.pkl)
#   EYELIDS    the lids' displacements (made from the landmarks without)
#   MODEL, HEAD  the model, and its head, whose encoders look at the clips first
#   PERCEPTUAL for L_perc: torchvision's AlexNet, with LINEAR, LPIPS's alex.pth;
#              or its SqueezeNet 1.0 alone (without, a pyramid stands in)
#   ALIGNMENT  for L_lmk: 2D-FAN (without, the head's landmarks stand in)
#   CONFIG     what is trained (config/paper.json); STEPS of every stage, for a
#              trial; BATCH of the last one (8), a quarter of the others'
#   RUN        before every spid-train: mpirun -n 8
#   JOBS       parts that the clips are prepared in at once (1)
set -eu

[ $# = 4 ] || { sed -n '2,17s/^# \{0,1\}//p' "$0" >&2; exit 64; }
flame=$1 dino=$2 clips=$3 out=$4
here=$(dirname "$0")
landmarks=${LANDMARKS:-$(dirname "$flame")/landmark_embedding.npy}
model=${MODEL:-$here/model/model.safetensors}
config=${CONFIG:-$here/config/paper.json}
batch=${BATCH:-8}
from=${HEAD:-$(dirname "$(command -v spid-import)")/../share/spid/head.safetensors}
jobs=${JOBS:-1}
mkdir -p "$out"

# public weights
[ -e "$out/head.safetensors" ] || spid-import -q "$flame" --as flame \
    --landmarks "$landmarks" ${EYELIDS:+--eyelids "$EYELIDS"} \
    -o "$out/head.safetensors"
[ -e "$out/dino.safetensors" ] || spid-import -q "$dino" --as dinov2 \
    -o "$out/dino.safetensors"
if [ -n "${PERCEPTUAL:-}" ] && [ ! -e "$out/perceptual.safetensors" ]; then
    if [ -n "${LINEAR:-}" ]; then
        set -- --as lpips --linear "$LINEAR"
    else
        set -- --as squeezenet
    fi
    spid-import -q "$PERCEPTUAL" "$@" -o "$out/perceptual.safetensors"
fi
[ -z "${ALIGNMENT:-}" ] || [ -e "$out/alignment.safetensors" ] ||
    spid-import -q "$ALIGNMENT" --as fan -o "$out/alignment.safetensors"
# our encoders in FLAME's coefficients
[ -e "$out/start.safetensors" ] || spid-import "$model" --as model \
    --from-head "$from" --head "$out/head.safetensors" \
    -o "$out/start.safetensors"

# the clips, once, at the size of the model
size=$(sed -n 's/.*"size": *\([0-9]*\).*/\1/p' "$config")
part=1 parts=
while [ "$part" -le "$jobs" ]; do
    spid-prepare -m "$out/start.safetensors" --head "$out/head.safetensors" \
        --size "$size" ${FRAMES:+--frames "$FRAMES" --least 2} --part "$part/$jobs" \
        -o "$out/records" "$clips" &
    parts="$parts $!"
    part=$((part + 1))
done
for pid in $parts; do
    wait "$pid" || [ $? = 65 ] || exit 1      # a part of bad clips only
done

train() { # STAGE OPTIONS
    stage=$1
    shift
    ${RUN:-} spid-train -c "$out/$stage.json" -o "$out/$stage" \
        --head "$out/head.safetensors" ${STEPS:+--steps "$STEPS"} "$@" \
        "$out/records"
}
# The encoders learn what ours say of the clips, 32 crops a step; then, with the
# anchors on that fading, everything learns from the pictures.
for stage in motion shape; do
    sed 's/"stage": "all"/"stage": "'$stage'"/; s/"micro": 1,/"micro": '$batch',/
         s/"batch": [0-9]*/"batch": '$((4 * batch))'/
         s/"steps": [0-9]*/"steps": 20000/; s/"rate": 1e-4/"rate": 1e-3/' \
        "$config" > "$out/$stage.json"
done
sed "s/\"batch\": [0-9]*/\"batch\": $batch/
     ${PERCEPTUAL:+s|\"seed\"|\"perceptual\": \"$out/perceptual.safetensors\", &|}
     ${ALIGNMENT:+s|\"seed\"|\"alignment\": \"$out/alignment.safetensors\", &|}" \
    "$config" > "$out/all.json"
train motion
train shape
train all --init "$out/dino.safetensors:backbone.dino_model." \
    --init "$out/motion/model.safetensors:motion."
spid-train -c "$out/all.json" --head "$out/head.safetensors" \
    --join "$out/model.safetensors" "$out/all/model.safetensors" \
    "$out/shape/model.safetensors"
