#!/usr/bin/env python3
"""SpiD, SpiD*, GAGAvatar and LAM at their full sizes, one run each: from an
identity to an avatar (spid-branches --bake), and a frame of it on one core.

    tests/bench/systems.py [-j N] [--photo FILE] [--clip FILE] [--keep DIR]
        [SYSTEM...]

Programs are those of $BUILD (build), weights of GAGAvatar and LAM are formulas
(tests/unit/*_model): time does not depend on them, but for how many Gaussians
cover a pixel.  Needs 7 GB of disk and 12 of memory; --keep goes on from an
earlier run's files.  Processor time counts all threads, draw is the sum of the
stages mesh, update, render and refine of spid-animate -j 1 --stats (the
tracker is the same for all).
"""
import argparse
import os
import subprocess
import sys
import tempfile
import time

TOP = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
BUILD = os.path.join(TOP, os.environ.get("BUILD", "build"))
MODEL = os.path.join(TOP, "examples", "model", "model.safetensors")
HEAD = os.path.join(BUILD, "share", "spid", "head.safetensors")


def run(name, *args):
    """Clock, processor seconds and MB of a program of ours."""
    path = os.path.join(BUILD, name if "/" in name else "bin/" + name)
    begun = time.monotonic()
    child = subprocess.Popen([path, *args])
    _, status, used = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        sys.exit("systems: %s ended with %d" % (name, child.returncode))
    return (time.monotonic() - begun, used.ru_utime + used.ru_stime,
            used.ru_maxrss / 1024)


def make(path, *command):
    """What a command writes to its -o, unless it is there."""
    if not os.path.exists(path):
        run(*(path if a == "OUT" else a for a in command))
    return path


def model_of(system, place):
    """Model and head of a system."""
    if system in ("SpiD", "SpiD*"):
        return MODEL, HEAD
    kind, head = system.lower(), HEAD
    raw, out = (os.path.join(place, kind + s) for s in (".raw", ".safetensors"))
    config = os.path.join(TOP, "examples", "config", kind + ".json")
    if kind == "lam":
        head = make(os.path.join(place, "fine.safetensors"), "spid-head",
                    "--head", HEAD, "--subdivide", "-o", "OUT")
    if not os.path.exists(out):
        make(raw, "tests/unit/%s_model" % kind, "OUT", config,
             *([HEAD] if kind == "gagavatar" else []))
        make(out, "spid-import", raw, "--as", kind, "--encoders", MODEL,
             "--from-head", HEAD, "--head", head, "-o", "OUT")
        os.unlink(raw)
    return out, head


def measure(system, place, opt):
    model, head = model_of(system, place)
    use = ["-q", "-m", model, "--head", head]
    me, avatar, clip, stats = (os.path.join(place, n) for n in (
        system + ".me", system + ".avatar", "out.y4m", "stats.tsv"))
    run("spid-shape", *use, "--size", "512", opt.photo, "-o", me)
    bake = run("spid-branches", *use, "-j", opt.threads, "--bake", me, "-o",
               avatar)
    star = ["--star"] if system == "SpiD*" else []
    memory = run("spid-animate", *use, "-j", "1", "--stats", stats, *star,
                 avatar, opt.clip, "-o", clip)[2]
    with open(stats) as f:
        draw = sum(float(row[3]) for row in (line.split("\t") for line in f)
                   if row[0] in ("mesh", "update", "render", "refine"))
    return bake, draw, memory


def main():
    p = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    p.add_argument("-j", dest="threads", default="2")
    p.add_argument("--photo", default=os.path.join(TOP, "examples/photo.jpg"))
    p.add_argument("--clip", help="24 frames of spid-synth by default")
    p.add_argument("--keep")
    p.add_argument("systems", nargs="*", metavar="SYSTEM",
                   default=["SpiD", "SpiD*", "GAGAvatar", "LAM"])
    opt = p.parse_args()
    with tempfile.TemporaryDirectory() as own:
        place = opt.keep or own
        opt.clip = opt.clip or make(
            os.path.join(place, "drive.y4m"), "spid-synth", "-q", "-n", "1",
            "--frames", "24", "-s", "5", "--size", "512", "-o", "OUT")
        print("system\tbake_s\tbake_processor_s\tbake_MB\tdraw_ms\tdrive_MB")
        for system in opt.systems:
            bake, draw, memory = measure(system, place, opt)
            print("%s\t%.1f\t%.1f\t%.0f\t%.1f\t%.0f" % (
                system, *bake, draw, memory), flush=True)


main()
