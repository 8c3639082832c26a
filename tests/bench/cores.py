#!/usr/bin/env python3
"""What more cores would bring: the serial share of each stage by Amdahl's law
from one and two threads, and what it says of 4, 8, 16 and 64.

    tests/bench/cores.py [--rounds N] PHOTOGRAPH CLIP

Runs the toolkit's programs from PATH with -j 1 and -j 2 in turn and reads the
times of their stages (--stats); "frames" are whole ones of spid-animate, which
has as many under way as threads: the time from its second to its last.  A
stage whose time is t1 and t2 has the serial share s = 2 t2 / t1 - 1, and n
threads make it 1 / (s + (1 - s) / n) times as fast.  The range is that of the
rounds.  What a forecast leaves out: memory that cores share, and cores that
other programs have.
"""
import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time

CORES = 4, 8, 16, 64


def stages(command, stats):
    """Run it; median milliseconds of each stage, of its frames if any."""
    subprocess.run(command + ["-q", "--stats", stats], check=True)
    with open(stats) as f:
        rows = [line.rstrip("\n").split("\t") for line in f][1:]
    many = [r for r in rows if int(r[1]) > 1]
    return {r[0]: float(r[4]) for r in many or rows}


def frame_ms(command):
    """Milliseconds of a frame: raw pictures arrive as they are finished."""
    with subprocess.Popen(command + ["-q", "--format", "pam", "-o", "-"],
                          stdout=subprocess.PIPE) as p:
        begun = frames = 0
        while p.stdout.readline() == b"P7\n":
            head = {}
            for line in iter(p.stdout.readline, b"ENDHDR\n"):
                key, value = line.split()
                head[key] = value
            p.stdout.read(int(head[b"WIDTH"]) * int(head[b"HEIGHT"]) *
                          int(head[b"DEPTH"]))
            frames += 1
            begun = begun or time.monotonic()
        last = time.monotonic()
    if p.returncode or frames < 2:
        sys.exit("cores.py: %s failed" % command[0])
    return 1e3 * (last - begun) / (frames - 1)


def measure(folder, photo, clip, threads):
    at = lambda name: os.path.join(folder, name)
    j = ["-j", str(threads)]
    take = lambda *command: stages([*command, *j], at("stats.tsv"))
    out = {}
    s = take("spid-shape", photo, "-o", at("me.spid"))
    out["spid-shape"] = sum(s.values())
    s = take("spid-branches", "--bake=" + at("me.spid"), "-o", at("a.spid"))
    out["spid-branches --bake"] = sum(s.values())
    s = take("spid-motion", "--relative", at("me.spid"), clip, "-o", at("m"))
    out["spid-motion, a frame"] = sum(s.values())
    subprocess.run(["spid-flame", "-q", "-i", at("a.spid"), at("m"), "-o",
                    at("mesh")], check=True)
    subprocess.run(["spid-branches", "-q", "-i", at("a.spid"), at("mesh"),
                    "-o", at("g")], check=True)
    out["spid-splat, a frame"] = take("spid-splat", at("g"), "-o",
                                      "/dev/null")["splat"]
    out["spid-splat --channels 32"] = take(
        "spid-splat", "--channels", "32", "--covered", at("g"), "-o",
        at("f"))["splat"]
    out["spid-refine, a frame"] = take("spid-refine", at("f"), "-o",
                                       "/dev/null")["refine"]
    os.remove(at("f"))
    out["SpiD*, frames"] = frame_ms(["spid-animate", "--star", *j, photo, clip])
    out["SpiD, frames"] = frame_ms(["spid-animate", *j, photo, clip])
    return out


def speedup(share, n):
    return 1 / (share + (1 - share) / n)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("photograph")
    parser.add_argument("clip")
    args = parser.parse_args()
    one, two = [], []
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(args.rounds):
            one.append(measure(folder, args.photograph, args.clip, 1))
            two.append(measure(folder, args.photograph, args.clip, 2))
    print("| what | 1 thread, ms | 2 | serial share | " +
          " | ".join("%d cores" % n for n in CORES) + " |")
    print("|---" * (4 + len(CORES)) + "|")
    for key in one[0]:
        share = sorted(min(max(2 * b[key] / a[key] - 1, 0), 1)
                       for a, b in zip(one, two))
        low, mid, high = share[0], statistics.median(share), share[-1]
        print("| %s | %.1f | %.1f | %.0f %% (%.0f to %.0f) | %s |" % (
            key, statistics.median(a[key] for a in one),
            statistics.median(b[key] for b in two), 100 * mid, 100 * low,
            100 * high, " | ".join("%.1f (%.1f to %.1f)" % (
                speedup(mid, n), speedup(high, n), speedup(low, n))
                for n in CORES)))


if __name__ == "__main__":
    main()
