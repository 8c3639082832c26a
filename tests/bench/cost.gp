# What a millisecond costs in accuracy: a stage's rows as a picture, PSNR over time,
# the Pareto front larger.
#     spid-bench --tsv -o rows.tsv splat
#     gnuplot -e "rows='rows.tsv'; stage='splat'" cost.gp > cost.png
set terminal pngcairo size 1200,800
set datafile separator tab
set datafile missing "NA"
set logscale x
set grid
set key off
set title stage
set xlabel "ms, least of the repetitions"
set ylabel "PSNR, dB"
plot rows using (strcol(1) eq stage ? $5 : NaN):9:(strcol(10) eq "1" ? 2 : 1) \
         with points pointtype 7 pointsize variable, \
     "" using (strcol(1) eq stage ? $5 : NaN):9:3 with labels left offset 1,0
