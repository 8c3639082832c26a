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
    [[ $output =~ '"msssim":'[[:space:]]*null ]]
    [[ $output =~ '"frames":'[[:space:]]*3,[[:space:]]*'"failed":'[[:space:]]*3 ]]
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

# stripes DIR NUMBER MIDDLE HEIGHT: a picture of vertical stripes, MIDDLE plus
# and minus half of HEIGHT.
stripes() {
    mkdir -p "$DIR/$1"
    python3 -c '
import sys
middle, height = int(sys.argv[1]), int(sys.argv[2])
row = b"".join(bytes([middle + (height // 2 if x % 2 else -(height // 2))] * 3) for x in range(64))
sys.stdout.buffer.write(b"P6\n64 48\n255\n" + row * 48)' "$3" "$4" >"$DIR/$1/$2.ppm"
}

# figure COLUMN ROW: of a tab-separated table.
figure() {
    awk -F '\t' -v column="$1" -v row="$2" 'NR == 1 { for (i = 1; i <= NF; i++) c[$i] = i }
        $1 == row { printf "%.2f", $c[column] }' <<<"$output"
}

@test "a list's frames stand beside their first frame, unchanged" {
    # truth at 100, 104, 108; result at 103, 110, 110, half as sharp
    for i in 1 2 3; do stripes truth $i $((96 + 4 * i)) 40; done
    stripes result 1 103 20; stripes result 2 110 20; stripes result 3 110 20
    printf 'x\tframes\t%s\t%s\tself\nx\tframes\t%s\t%s\tcross\n' "$DIR/truth" "$DIR/result" \
        "$DIR/truth" "$DIR/result" >"$DIR/null"
    run spid-eval -q -f tsv --pairs "$DIR/null"
    [ "$status" = 0 ]
    # off by 3 and by half of the stripes, 10: mean square 109; then 136, 104
    [ "$(figure psnr_first 'x, self')" = 27.76 ]
    [ "$(figure psnr_later 'x, self')" = 27.38 ]
    # off by 4 and by 8
    [ "$(figure psnr_later 'frame 0 unchanged, self')" = 33.08 ]
    [ "$(figure beats_0_pct 'x, self')" = 0.00 ]
    [ "$(figure edge_ratio 'x, self')" = 0.50 ]
    [ "$(figure edge_ratio 'frame 0 unchanged, self')" = 1.00 ]
    # another's clip has no first frame of this person
    [[ $output != *"frame 0 unchanged, cross"* ]]
    [[ $output == *"# frame 0 unchanged: "* ]]
}

@test "the share of frames that beat the first one" {
    for i in 1 2 3; do stripes still $i $((96 + 4 * i)) 40; done
    stripes moved 1 103 40; stripes moved 2 110 40; stripes moved 3 110 40
    printf 'x\tframes\t%s\t%s\tself\n' "$DIR/still" "$DIR/moved" >"$DIR/half"
    run spid-eval -q -f tsv --pairs "$DIR/half"
    # 6 levels against 4, then 2 against 8
    [ "$(figure beats_0_pct 'x, self')" = 50.00 ]
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
