#!/usr/bin/env python3
"""SpiD, SpiD*, GAGAvatar and LAM at their full sizes, one run each: from an
identity to an avatar (spid-branches --bake), and a frame of it on one core.

    tests/bench/systems.py [-j N] [--photo FILE] [--keep DIR] [SYSTEM...]

Programs are those of $BUILD (build), weights of GAGAvatar and LAM are formulas
(tests/unit/*_model): time does not depend on them, but for how many Gaussians
cover a pixel.  Needs 7 GB of disk and 12 of memory; --keep goes on from an
earlier run's files, avatars among them, whose making is not measured then.
Processor time counts all threads; a frame's is what 40 more of them cost
spid-animate -j 1, driven by motions that are there already.
"""
import argparse
import math
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


def motions(n, place):
    """A made person's motions in n frames."""
    clip = make(os.path.join(place, "drive%d.y4m" % n), "spid-synth", "-q",
                "-n", "1", "--frames", str(n), "-s", "5", "--size", "256",
                "-o", "OUT")
    return make(os.path.join(place, "drive%d.spid" % n), "spid-motion", "-q",
                "-m", MODEL, "--head", HEAD, clip, "-o", "OUT")


def measure(system, place, opt):
    model, head = model_of(system, place)
    use = ["-q", "-m", model, "--head", head]
    me, avatar, out = (os.path.join(place, n) for n in (
        system + ".me", system + ".avatar", "out.y4m"))
    make(me, "spid-shape", *use, "--size", "512", opt.photo, "-o", "OUT")
    bake = (math.nan,) * 3
    if not os.path.exists(avatar):
        bake = run("spid-branches", *use, "-j", opt.threads, "--bake", me,
                   "-o", avatar)
    star = ["--star"] if system == "SpiD*" else []
    few, many = (run("spid-animate", *use, "-j", "1", *star, avatar,
                     motions(n, place), "-o", out) for n in (8, 48))
    return bake, 1e3 * (many[1] - few[1]) / 40, many[2]


def main():
    p = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    p.add_argument("-j", dest="threads", default="2")
    p.add_argument("--photo", default=os.path.join(TOP, "examples/photo.jpg"))
    p.add_argument("--keep")
    p.add_argument("systems", nargs="*", metavar="SYSTEM",
                   default=["SpiD", "SpiD*", "GAGAvatar", "LAM"])
    opt = p.parse_args()
    with tempfile.TemporaryDirectory() as own:
        place = opt.keep or own
        print("system\tbake_s\tbake_processor_s\tbake_MB\tframe_ms\tdrive_MB")
        for system in opt.systems:
            bake, frame, memory = measure(system, place, opt)
            print("%s\t%.1f\t%.1f\t%.0f\t%.1f\t%.0f" % (
                system, *bake, frame, memory), flush=True)


main()
