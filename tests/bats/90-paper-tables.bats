# examples/paper.sh: a trial of it, minutes long, with SPID_LONG=1 (make
# check-long).
load helper

@test "paper.sh makes every table, the latencies and the plot, and says what it lacks" {
    [ -n "${SPID_LONG:-}" ] || skip "long (make check-long)"
    command -v ffmpeg >/dev/null || skip "no ffmpeg (apt: ffmpeg)"
    for i in 1 2; do
        spid-synth -q -n 1 --frames 3 -s $i --effects 0 --size 256 -o clip$i.mp4
    done
    spid-synth -q -n 2 --frames 2 -s 5 --size 512 --without mesh -o people.spid
    status 0 env CLIP_FRAMES=2 PEOPLE=1 FRAMES=6 BENCH=0.2 RECORDS=people.spid STEPS=1 SEEDS=3 "$TOP/examples/paper.sh" out clip1.mp4 clip2.mp4
    for net in lpips arcface musiq topiq; do
        has "$net: not run: needs weights (--$net)"
    done
    has "GAGAvatar: not run: needs its checkpoint"
    has "LAM: not run: needs its checkpoint"
    # the paper's columns in its order, SpiD* and SpiD, whence each row is
    for n in 1 2; do
        [ "$(cut -f 1 out/table$n.tsv | grep -c '^SpiD')" = 2 ]
    done
    [ "$(head -n 1 out/table1.tsv | cut -f 2-11 | tr '\t' ' ')" = "akd aed apd lpips psnr ssim msssim l1 musiq topiq" ]
    [ "$(head -n 1 out/table2.tsv | cut -f 2-7 | tr '\t' ' ')" = "psnr ssim msssim lpips l1 musiq" ]
    # truth is nearer to what is driven by itself than by another's motion
    awk -F '\t' '$1 == "SpiD" { print FILENAME == "out/table1.tsv" ? $6 : $2 }' out/table1.tsv out/table2.tsv |
        awk '{ p[NR] = $1 } END { exit !(NR == 2 && p[1] > 5 && p[2] > p[1] + 5) }'
    # clips and made people: each part has a row for both, and the plane is missed in both
    awk -F '\t' '$1 == "full" { full = $2 } $1 == "w/o static" { n++; if (full < $2 + 1) exit 1 }
        END { if (n != 2) exit 1 }' out/table3.tsv
    for part in dynamic static interp mouth neck; do
        [ "$(cut -f 1 out/table3.tsv | grep -cx "w/o $part")" = 2 ]
        [ "$(cut -f 1 out/table3.tsv | grep -cx "w/o $part, trained on, seed 3")" = 1 ]
    done
    # a step does not bring back what the model lacks, nor take away what it has
    awk -F '\t' '$1 == "full" && !full { full = $2 } { p[$1] = $2 }
        END { all = p["w/o nothing, trained on, seed 3"]
              exit !(all > full - 1 && all > p["w/o static, trained on, seed 3"] + 1) }' out/table3.tsv
    for n in 1 2 3; do
        awk -F '\t' '{ if ($NF == "" || NF != (n += NR == 1 ? NF : 0)) exit 1 }' out/table$n.tsv
    done
    grep -q '^sum of the first four' out/latency.txt
    [ -s out/tradeoff.svg ] || [ -s out/tradeoff.gp ]
    grep -q 'Table 3' out/paper.txt
}

@test "paper.sh says what it wants" {
    status 64 "$TOP/examples/paper.sh"
    has 'paper.sh OUT [CLIP ...]'
    has 'table1.tsv'
}
