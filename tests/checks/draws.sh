#!/usr/bin/env bash
# The arguments of a call hold one draw of random numbers at most: C leaves their
# order open, and two compilers would draw different people from one seed.
set -uo pipefail
cd "${TOP:-$(dirname "$0")/../..}"
command -v python3 >/dev/null || exit 77
exec python3 - <<'P'
import glob, re, sys

draw = re.compile(r"\brandom_(u64|uniform|range|float|normal|below|chance)\(")
files = glob.glob("lib/**/*.[ch]", recursive=True) + glob.glob("tests/**/*.[ch]", recursive=True)
failed = 0
for name in files:
    # comments become blanks, so that lines keep their numbers
    text = re.sub(r"/\*.*?\*/", lambda c: re.sub(r"[^\n]", " ", c[0]), open(name).read(), flags=re.S)
    for call in re.finditer(r"\b(?!(?:if|for|while|switch)\b)\w+\(", text):
        at, depth, draws, this = call.end(), 1, 0, 0
        while at < len(text) and depth:
            c = text[at]
            depth += (c in "([{") - (c in ")]}")
            if draw.match(text, at) and not text[at - 1].isalnum():
                this = 1
            if (c == "," and depth == 1) or depth == 0:
                draws, this = draws + this, 0
            at += 1
        if draws > 1:
            print(f"FAILED {name}:{text.count(chr(10), 0, call.start()) + 1}: {draws} draws in {call[0]}...)")
            failed = 1
print(len(files), "files")
sys.exit(failed)
P
