#!/bin/sh
# train-model.sh [DIR]: the shipped model from a seed, start to end.  What
# `make model` runs.  Everything lands in DIR (default build/train; 35 GB); a
# run that was stopped goes on where it was.  SEED, PEOPLE and STEPS (of every
# stage, for a trial) change the size.
set -eu

here=$(dirname "$0")
dir=${1:-build/train}
seed=${SEED:-1}
people=${PEOPLE:-16000}
mkdir -p "$dir"

# People to learn from and others to be judged by: never the same seeds.  A
# second and a quarter between frames: each shows another pose.
synth() { # FILE PEOPLE FRAMES SIZE SEED EFFECTS
    [ -e "$dir/$1" ] || spid-synth --people "$2" --frames "$3" --size "$4" \
        --seed "$5" --effects "$6" --fps 0.8 --without mesh -o "$dir/$1"
}
synth faces.spid "$people" 4 256 "$((1000 + seed))" 1
synth faces-validation.spid 48 8 256 "$((900000 + seed))" 1
synth people.spid "$((people / 8))" 6 512 "$((2000 + seed))" 0.7
synth people-validation.spid 12 6 512 "$((910000 + seed))" 1

config() { # NAME
    echo "$here/config/small-$1.json"
}
train() { # NAME VALIDATION OPTIONS AND DATA
    name=$1 validation=$2
    shift 2
    spid-train -c "$(config "$name")" -o "$dir/$name" --validation "$dir/$validation" \
        ${STEPS:+--steps "$STEPS"} "$@"
}
join() { # FILE CONFIG STAGE...
    file=$1 model=$2
    shift 2
    for stage; do
        set -- "$@" "$dir/$stage/model.safetensors"
        shift
    done
    spid-train -c "$(config "$model")" --join "$file" "$@"
}

# pose and expression; then the shape, from the same features
train motion faces-validation.spid "$dir/faces.spid"
train shape faces-validation.spid \
    --init "$dir/motion/model.safetensors:shape.encoder.=motion.encoder." \
    "$dir/faces.spid"
# from here on everybody has the shape that E_beta sees in them; E_m grows wider,
# and at last learns without the noise of batch statistics
join "$dir/seen.safetensors" shape motion shape
train motion-shapes faces-validation.spid --shapes "$dir/seen.safetensors" \
    --grow "$dir/motion/model.safetensors" "$dir/faces.spid"
train motion-fine faces-validation.spid --shapes "$dir/seen.safetensors" \
    --init "$dir/motion-shapes/model.safetensors" "$dir/faces.spid"
# the branches and the refiner: small pictures, large ones, and at last with
# the shapes and motions that the encoders see
train avatar people-validation.spid "$dir/people.spid"
train avatar-512 people-validation.spid --init "$dir/avatar/model.safetensors" \
    "$dir/people.spid"
join "$dir/apart.safetensors" all avatar-512 motion-fine
train all people-validation.spid --shapes "$dir/seen.safetensors" \
    --init "$dir/apart.safetensors" "$dir/people.spid"
# how sure the finished E_m is of a face
train sure faces-validation.spid \
    --init "$dir/all/model.safetensors:motion.encoder." "$dir/faces.spid"

join "$dir/model.safetensors" all all shape sure
