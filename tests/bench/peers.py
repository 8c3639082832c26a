#!/usr/bin/env python3
"""The toolkit beside other people's programs: one run, the same number of
threads, and the ratio of times.

    tests/bench/peers.py [--seconds S] [--threads N] [--programs DIR]
        [--photo FILE --clip FILE] [STAGE...]

motion, refine: E_m and the full StyleUNet beside the same networks in eager
PyTorch, least times.  Weights are random: time does not depend on them.
splat: the photograph's Gaussians beside npm's @playcanvas/splat-transform,
whose shaders SwiftShader runs on the processor (the one that Debian's chromium
brings, or $VK_ICD_FILENAMES): it draws averages of pictures, of which more take
longer.  video: reading the clip and writing H.264 (x264, veryfast, CRF 20, one
thread) beside ffmpeg, processor time.
Exits 77 when what a stage compares with is not installed.  Nothing here is
needed to build or test the toolkit.
"""
import argparse
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time


def skip(what):
    print("peers: skipped: " + what)
    sys.exit(77)


try:
    import numpy
    import torch
    from torch import nn
    from torch.nn import functional as F
except ImportError:
    skip("python3 has no torch (Debian: python3-torch)")


# ---- the motion encoder: MobileNetV3-small and six linear heads ------------

class Squeeze(nn.Module):
    def __init__(self, width):
        super().__init__()
        inner = max(8, (width // 4 + 4) // 8 * 8)
        self.reduce = nn.Conv2d(width, inner, 1)
        self.expand = nn.Conv2d(inner, width, 1)

    def forward(self, x):
        s = x.mean((2, 3), keepdim=True)
        return x * F.hardsigmoid(self.expand(F.relu(self.reduce(s))))


def unit(n_in, n_out, kernel, stride=1, groups=1, act=None):
    layers = [nn.Conv2d(n_in, n_out, kernel, stride, kernel // 2,
                        groups=groups, bias=False), nn.BatchNorm2d(n_out)]
    return nn.Sequential(*layers, *([act()] if act else []))


class Block(nn.Module):
    def __init__(self, n_in, kernel, inner, n_out, squeeze, act, stride):
        super().__init__()
        parts = [unit(n_in, inner, 1, act=act)] if inner != n_in else []
        parts.append(unit(inner, inner, kernel, stride, inner, act))
        parts += [Squeeze(inner)] if squeeze else []
        parts.append(unit(inner, n_out, 1))
        self.body = nn.Sequential(*parts)
        self.residual = stride == 1 and n_in == n_out

    def forward(self, x):
        y = self.body(x)
        return x + y if self.residual else y


class MotionEncoder(nn.Module):
    TABLE = [  # kernel, inner, out, squeeze, act, stride
        (3, 16, 16, True, nn.ReLU, 2), (3, 72, 24, False, nn.ReLU, 2),
        (3, 88, 24, False, nn.ReLU, 1), (5, 96, 40, True, nn.Hardswish, 2),
        (5, 240, 40, True, nn.Hardswish, 1),
        (5, 240, 40, True, nn.Hardswish, 1),
        (5, 120, 48, True, nn.Hardswish, 1),
        (5, 144, 48, True, nn.Hardswish, 1),
        (5, 288, 96, True, nn.Hardswish, 2),
        (5, 576, 96, True, nn.Hardswish, 1),
        (5, 576, 96, True, nn.Hardswish, 1)]

    def __init__(self):
        super().__init__()
        parts, n_in = [unit(3, 16, 3, 2, act=nn.Hardswish)], 16
        for kernel, inner, n_out, squeeze, act, stride in self.TABLE:
            parts.append(Block(n_in, kernel, inner, n_out, squeeze, act,
                               stride))
            n_in = n_out
        parts.append(unit(96, 576, 1, act=nn.Hardswish))
        self.trunk = nn.Sequential(*parts)
        self.heads = nn.ModuleList(nn.Linear(576, n)
                                   for n in (6, 3, 100, 3, 2, 6))

    def forward(self, x):
        x = self.trunk(x).mean((2, 3))
        return [head(x) for head in self.heads]


# ---- StyleUNet at full width ------------------------------------------------

def lrelu(x):
    return F.leaky_relu(x, 0.2)


def resize(x, factor):
    return F.interpolate(x, scale_factor=factor, mode="bilinear",
                         align_corners=False)


def conv3(n_in, n_out):
    return nn.Conv2d(n_in, n_out, 3, padding=1)


class Residual(nn.Module):
    def __init__(self, n_in, n_out, factor):
        super().__init__()
        self.conv1, self.conv2 = conv3(n_in, n_in), conv3(n_in, n_out)
        self.skip = nn.Conv2d(n_in, n_out, 1, bias=False)
        self.factor = factor

    def forward(self, x):
        y = resize(lrelu(self.conv1(x)), self.factor)
        return lrelu(self.conv2(y)) + self.skip(resize(x, self.factor))


class Modulated(nn.Module):
    """StyleGAN2's convolution, weights rebuilt for every picture."""

    def __init__(self, n_in, n_out, kernel, latent, demodulate):
        super().__init__()
        self.weight = nn.Parameter(torch.randn(1, n_out, n_in, kernel, kernel)
                                   / (n_in * kernel ** 2) ** 0.5)
        self.style = nn.Linear(latent, n_in)
        self.demodulate = demodulate

    def forward(self, x, s):
        b, c, h, w = x.shape
        weight = self.weight * self.style(s).view(b, 1, c, 1, 1)
        if self.demodulate:
            size = weight.pow(2).sum((2, 3, 4), keepdim=True)
            weight = weight * torch.rsqrt(size + 1e-8)
        n = weight.shape[1]
        y = F.conv2d(x.reshape(1, b * c, h, w), weight.reshape(
            b * n, *weight.shape[2:]), padding=weight.shape[-1] // 2, groups=b)
        return y.view(b, n, h, w)


class Styled(nn.Module):
    def __init__(self, n_in, n_out, latent, up, side):
        super().__init__()
        self.conv = Modulated(n_in, n_out, 3, latent, True)
        self.gain = nn.Parameter(torch.zeros(1))
        self.bias = nn.Parameter(torch.zeros(1, n_out, 1, 1))
        self.register_buffer("noise", torch.randn(1, 1, side, side))
        self.up = up

    def forward(self, x, s):
        y = self.conv(resize(x, 2) if self.up else x, s) * 2 ** 0.5
        return lrelu(y + self.gain * self.noise + self.bias)


class ToRGB(nn.Module):
    def __init__(self, n_in, latent):
        super().__init__()
        self.conv = Modulated(n_in, 3, 1, latent, False)
        self.bias = nn.Parameter(torch.zeros(1, 3, 1, 1))

    def forward(self, x, s, previous):
        y = self.conv(x, s) + self.bias
        return y if previous is None else y + resize(previous, 2)


class StyleUNet(nn.Module):
    def __init__(self, channels=32, size=512):
        super().__init__()
        levels = (size // 4).bit_length() - 1

        def width(side):
            return 256 if side <= 32 else 8192 // side

        def condition(n):
            return nn.Sequential(conv3(n, n), nn.LeakyReLU(0.2),
                                 conv3(n, 2 * n))

        z, inner = 512, width(4)
        self.first = nn.Conv2d(channels, width(size), 1)
        self.down = nn.ModuleList(
            Residual(width(size >> i), width(size >> (i + 1)), 0.5)
            for i in range(levels))
        sides = [8 << i for i in range(levels)]
        self.up = nn.ModuleList(Residual(width(s // 2), width(s), 2)
                                for s in sides)
        self.scale = nn.ModuleList(condition(width(s)) for s in sides)
        self.shift = nn.ModuleList(condition(width(s)) for s in sides)
        self.final_conv = conv3(inner, inner)
        self.final_linear = nn.Linear(16 * inner, z)
        self.mlp = nn.ModuleList(nn.Linear(z, z) for _ in range(8))
        self.constant = nn.Parameter(torch.randn(1, 2 * inner, 4, 4))
        self.conv1 = Styled(2 * inner, 2 * inner, z, False, 4)
        self.rgb1 = ToRGB(2 * inner, z)
        self.enlarge = nn.ModuleList(
            Styled(2 * width(s // 2), 2 * width(s), z, True, s)
            for s in sides)
        self.same = nn.ModuleList(
            Styled(2 * width(s), 2 * width(s), z, False, s) for s in sides)
        self.rgb = nn.ModuleList(ToRGB(2 * width(s), z) for s in sides)

    def forward(self, x):
        maps, x = [], lrelu(self.first(x))
        for block in self.down:
            x = block(x)
            maps.append(x)
        f = lrelu(self.final_conv(x))
        s = self.final_linear(f.flatten(1))
        s = s * torch.rsqrt(s.pow(2).mean(1, keepdim=True) + 1e-8)
        for layer in self.mlp:
            s = lrelu(layer(s))
        x = self.conv1(self.constant.expand(f.shape[0], -1, -1, -1), s)
        rgb = self.rgb1(x, s, None)
        for i, block in enumerate(self.up):
            f = block(f + maps[-1 - i])
            x = self.enlarge[i](x, s) * self.scale[i](f) + self.shift[i](f)
            x = self.same[i](x, s)
            rgb = self.rgb[i](x, s, rgb)
        return torch.sigmoid(rgb)


# ---- timing -----------------------------------------------------------------

def torch_ms(net, shape, seconds):
    net.eval()
    x = torch.rand(shape)
    with torch.inference_mode():
        net(x)
        best, end, runs = 1e9, time.monotonic() + seconds, 0
        while runs < 3 or time.monotonic() < end:
            begun = time.perf_counter()
            net(x)
            best = min(best, time.perf_counter() - begun)
            runs += 1
    return 1e3 * best


def ours(args):
    out = subprocess.run([os.path.join(args.programs, "spid-bench"), "--json",
                          "-j", str(args.threads), "-s",
                          str(4 * args.seconds), *args.stages],
                         check=True, stdout=subprocess.PIPE).stdout
    return {(r["stage"], r["config"].split(",")[0].split()[0], r["knob"]):
            r["ms_min"] for r in json.loads(out)["rows"]
            if r["threads"] == args.threads}


# ---- whole programs ---------------------------------------------------------

def stage_ms(args, stage, program, *rest):
    """Run one of the toolkit's programs; median milliseconds of its stage."""
    with tempfile.TemporaryDirectory() as folder:
        stats = os.path.join(folder, "stats")
        subprocess.run([os.path.join(args.programs, program), "-q", "--stats",
                        stats, *rest], check=True)
        with open(stats) as f:
            return next(float(row.split("\t")[4]) for row in f
                        if row.startswith(stage + "\t"))


def splat_peer(args, folder, ply, view):
    """Seconds of two averages, of two and six pictures: four pictures."""
    R, t = view[:, :3], view[:, 3]
    at = -R.T @ t
    vec = lambda v: ",".join("%.6f" % x for x in v)
    tool = os.path.join(os.path.dirname(args.programs), "npm", "node_modules",
                        "@playcanvas", "splat-transform", "bin", "cli.mjs")
    env = {"VK_ICD_FILENAMES": "/usr/lib/chromium/vk_swiftshader_icd.json",
           **os.environ}
    if not os.path.exists(tool) or \
            not os.path.exists(env["VK_ICD_FILENAMES"]):
        skip("no splat-transform (make deps-tests) or no SwiftShader")
    took = []
    for n in 2, 6:
        begun = time.monotonic()
        subprocess.run(
            ["node", tool, "-q", "-w", "-g", "0", ply,
             os.path.join(folder, "peer.webp"), "--camera", vec(at),
             "--camera-end", vec(at + 1e-5), "--look-at=" + vec(at + 12 * R[2]),
             "--up", vec(-R[1]), "--fov",
             "%.6f" % math.degrees(2 * math.atan(1 / 12)), "--resolution",
             "512x512", "--near", "0.2", "--motion-samples", str(n)],
            check=True, env=env, stderr=subprocess.DEVNULL)
        took.append(time.monotonic() - begun)
    return 1e3 * (took[1] - took[0]) / 4


def compare_splat(args, folder):
    at = lambda name: os.path.join(folder, name)
    run = lambda program, *rest: subprocess.run(
        [os.path.join(args.programs, program), "-q", *rest], check=True)
    run("spid-shape", args.photo, "-o", at("me"))
    run("spid-branches", "--bake=" + at("me"), "-o", at("avatar"))
    run("spid-motion", args.clip, "-o", at("motion"))
    run("spid-flame", "-i", at("avatar"), at("motion"), "-o", at("mesh"))
    run("spid-branches", "-i", at("avatar"), at("mesh"), "-o", at("frames"))
    run("spid-export", at("avatar"), "--ply", at("face.ply"))
    run("spid-dump", "--npy", folder, at("avatar"))
    view = numpy.load(at("GAUS.view.npy")).reshape(3, 4)
    yield ("512x512, %d Gaussians, 3 channels" %
           numpy.load(at("GAUS.opacity.npy")).size,
           stage_ms(args, "splat", "spid-splat", "--no-photo", "-j",
                    str(args.threads), at("frames"), "-o", "/dev/null"),
           splat_peer(args, folder, at("face.ply"), view))


def ffmpeg_ms(clip, *rest):
    """Milliseconds of processor time of a frame."""
    if not shutil.which("ffmpeg"):
        skip("no ffmpeg")
    log = subprocess.run(["ffmpeg", "-hide_banner", "-nostdin", "-y",
                          "-benchmark", *rest[:2], "-i", clip, *rest[2:]],
                         check=True, stderr=subprocess.PIPE, text=True).stderr
    spent = re.search(r"bench: utime=([\d.]+)s stime=([\d.]+)s", log)
    frames = int(re.findall(r"frame= *(\d+)", log)[-1])
    return 1e3 * sum(map(float, spent.groups())) / frames


def compare_video(args, folder):
    at = lambda name: os.path.join(folder, name)
    made = [args.photo, args.clip, "--star", "-j", "1"]

    yield ("decode a frame", stage_ms(args, "decode", "spid-animate", *made,
                                      "-o", at("made.y4m")),
           ffmpeg_ms(args.clip, "-threads", "1", "-f", "null", "-"))
    yield ("encode a frame", stage_ms(args, "encode", "spid-animate", *made,
                                      "-o", at("made.mp4")),
           ffmpeg_ms(at("made.y4m"), "-threads", "1", "-c:v", "libx264",
                     "-preset", "veryfast", "-crf", "20", "-threads", "1",
                     at("peer.mp4")))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--seconds", type=float, default=5,
                        help="for each network (5)")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--programs", default="build/bin")
    parser.add_argument("--photo", default="examples/photo.jpg")
    parser.add_argument("--clip", help="of splat and video")
    parser.add_argument("stages", nargs="*", default=["motion", "refine"],
                        help="motion, refine (both), splat or video")
    args = parser.parse_args()
    args.programs = os.path.abspath(args.programs)
    for stage, compare, peer in (
            ("splat", compare_splat, "splat-transform on SwiftShader"),
            ("video", compare_video, "ffmpeg")):
        if stage not in args.stages:
            continue
        args.stages.remove(stage)
        with tempfile.TemporaryDirectory() as folder:
            for what, own, other in compare(args, folder):
                print("%s: %.2f ms, %s %.2f: %.4g times" % (
                    what, own, peer, other, other / own))
    if not args.stages:
        return
    torch.set_num_threads(args.threads)
    torch.set_flush_denormal(True)
    torch.manual_seed(1)
    nets = {"motion": (MotionEncoder, (1, 3, 224, 224)),
            "refine": (StyleUNet, (1, 32, 512, 512))}
    peers = {stage: torch_ms(nets[stage][0](), nets[stage][1], args.seconds)
             for stage in args.stages if stage in nets}
    print("%-34s %10s %10s %7s  %s" % ("network, %d threads" % args.threads,
                                       "ours ms", "torch ms", "ratio",
                                       "at most"))
    for (stage, name, knob), ms in ours(args).items():
        if stage not in peers or name == "narrow":
            continue
        print("%-34s %10.2f %10.2f %7.2f  %s" % (
            "%s %s" % (name, knob), ms, peers[stage], ms / peers[stage],
            {"motion": "0.45", "refine": "0.40"}[stage]))


if __name__ == "__main__":
    main()
