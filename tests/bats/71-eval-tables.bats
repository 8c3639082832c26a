# spid-eval: figures of frames and motions; bad input is named and counted.

setup_file() {
    export DIR=$BATS_FILE_TMPDIR
    mkdir "$DIR/a" "$DIR/b" "$DIR/c"
    for i in 1 2 3; do
        head -c $((15 + 64 * 48 * 3)) /dev/zero > "$DIR/z"
        { printf 'P6\n64 48\n255\n'; head -c 9216 /dev/zero | tr '\0' '\144'; } > "$DIR/a/$i.ppm"
        { printf 'P6\n64 48\n255\n'; head -c 9216 /dev/zero | tr '\0' '\152'; } > "$DIR/b/$i.ppm"
        { printf 'P6\n48 64\n255\n'; head -c 9216 /dev/zero; } > "$DIR/c/$i.ppm"
    done
}

@test "the psnr of a known difference" {
    # 6 grey levels: -20 log10(6 / 255) = 32.5673
    run spid-eval -q -f tsv "$DIR/a" "$DIR/b"
    [ "$status" = 0 ]
    [[ ${lines[0]} == method*psnr*ssim*l1*frames*failed ]]
    [[ ${lines[1]} == result*32.567* ]]
}

@test "ms-ssim of small frames is counted as failed, not averaged in" {
    run spid-eval -q -f json "$DIR/a" "$DIR/b"
    [[ $output == *'"msssim": null'* ]]
    [[ $output == *'"frames": 3, "failed": 3'* ]]
}

@test "frames of another size are refused" {
    run spid-eval -q "$DIR/a" "$DIR/c"
    [ "$status" = 65 ]
    [[ $output == *48x64*expected\ 64x48* ]]
}

@test "another number of frames is refused, what was measured is kept" {
    mkdir "$DIR/d"; cp "$DIR/b/1.ppm" "$DIR/b/2.ppm" "$DIR/d"
    run spid-eval -q -f tsv "$DIR/a" "$DIR/d"
    [ "$status" = 65 ]
    [[ $output == *"ends after 2 frames"* ]]
    [[ $output == *32.567* ]]
}

@test "a pairs file puts methods and protocols into one table" {
    printf 'ours\tframes\t%s\t%s\tself\nours\tframes\t%s\t%s\tcross\n' \
        "$DIR/a" "$DIR/b" "$DIR/a" "$DIR/a" > "$DIR/pairs"
    run spid-eval -q -f latex --pairs "$DIR/pairs"
    [ "$status" = 0 ]
    [[ $output == *"ours, self & \\textbf{32.57}"* ]]
    [[ $output == *"ours, cross"* ]]
}

@test "a missing clip fails its pair and is counted" {
    printf 'x\tframes\t%s\t%s\nx\tframes\t%s\t/nowhere\n' "$DIR/a" "$DIR/b" \
        "$DIR/a" > "$DIR/pairs"
    run spid-eval --pairs "$DIR/pairs"
    [ "$status" = 66 ]
    [[ $output == *"1 of 2 pairs"* ]]
}

@test "the figures of every frame" {
    spid-eval -q --frames-tsv "$DIR/t.tsv" "$DIR/a" "$DIR/b" > /dev/null
    [ "$(wc -l < "$DIR/t.tsv")" = 4 ]
}

@test "misuse" {
    run spid-eval "$DIR/a"
    [ "$status" = 64 ]
    run spid-eval -f xml "$DIR/a" "$DIR/b"
    [ "$status" = 64 ]
}
