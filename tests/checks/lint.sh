#!/usr/bin/env bash
# Form: no tabs, no trailing blanks, short lines; manual pages that mandoc
# accepts, one for every program, whose SYNOPSIS is the usage line of --help.
set -uo pipefail
cd "${TOP:-$(dirname "$0")/../..}"
bin=${BUILD:-build}/bin
export LC_ALL=C.UTF-8
fail=0
bad() { sed "s|^|FAILED $1: |"; fail=1; }
# report WHAT: a failure for every line on standard input.
report() { local lines; lines=$(cat); [ -z "$lines" ] || bad "$1" <<<"$lines"; }

files=$(git ls-files 2>/dev/null || find . -type f -not -path './build/*' -not -path './.git/*')
files=$(grep -E '\.(c|h|cc|hh|sh|bats|bash|py|[15]|md)$|^Makefile$|^tests/run$|^\.ci/run$' <<<"$files" |
    while read -r f; do [ -e "$f" ] && echo "$f"; done)
report "tab" < <(grep -vE '^Makefile$' <<<"$files" | xargs grep -nP '\t')
report "trailing blank" < <(xargs grep -nE '[[:blank:]]+$' <<<"$files")
# 80 columns is the aim: under 1 % of lines longer, none over 100.
sources=$(grep -E '\.(c|h|cc|hh)$' <<<"$files")
report "over 100 columns" < <(xargs grep -nE '^.{101,}$' <<<"$sources" | cut -c 1-70)
long=$(xargs cat <<<"$sources" | grep -cE '^.{81,}$') all=$(xargs cat <<<"$sources" | wc -l)
[ $((100 * long)) -lt "$all" ] || bad "over 80 columns" <<<"$long of $all lines (expected under 1 %)"
# C17 6.5p7: uint8_t *p is no float *, and a compiler may rely on it.
report "a pointer through another type" < <(xargs grep -nE '\(\w+ \*\*\) ?&' <<<"$sources")
# longer LINES FILTER: files of more lines.
longer() { grep -E "$2" <<<"$files" | xargs wc -l | awk -v n="$1" '$1 > n && $2 != "total" { print $2, $1 }'; }
report "longer than 300 lines" < <(longer 300 '^cmd/.*\.c$')
report "longer than 600 lines" < <(longer 600 '^(lib|formats)/.*\.(c|cc|h)$')
report "longer than 700 lines" < <(longer 700 '^tests/.*\.c$')

# make check prints why a test was skipped, so that must say what would run it.
report "skip without (what would run it)" < <(grep -nE '\bskip "[^"]*"' tests/bats/*.ba* | grep -v '("\?[^")]*)"')

# Of "[ a ] && [ b ]" and "! command" a test sees no failure unless they are its last line: a line
# for each check, and `no command` (helper.bash).
report "a check that cannot fail" < <(awk '
    FNR == 1 { held = "" }
    held != "" && !/^}/ { print held }
    { held = "" }
    /^ +(\[.*\] && \[|! )/ && !/\|\| |(\\|&&)$/ || /^ +status .*\|\| (true|:)$/ {
        held = FILENAME ":" FNR ": " $0
    }' tests/bats/*.bats)

# The words of SYNOPSIS on one line, as --help prints them after "Usage:".
synopsis() {
    mandoc -T utf8 -O width=1000 "$1" | col -bx | sed 's/‐/-/g' |
        sed -n '/^SYNOPSIS$/,/^[A-Z]/{/^ /p}' | tr -s ' \n' ' ' | sed 's/^ //; s/ $//'
}

usage() {
    "$1" --help | sed -n '/^Usage: /,/^$/p' | sed 's/^Usage: //' | tr -s ' \n' ' ' | sed 's/^ //; s/ $//'
}

for page in man/*.[135]; do
    report "mandoc" < <(mandoc -T lint -W warning "$page")
done
for program in $(ls cmd/spid*.c cmd/lab/spid*.c | sed 's/.*\///; s/\.c$//'); do
    page=man/$program.1
    [ -e "$page" ] || { bad "$program" <<<"has no manual page"; continue; }
    for section in NAME SYNOPSIS DESCRIPTION OPTIONS "EXIT STATUS" EXAMPLES "SEE ALSO"; do
        grep -qiE "^\.S[hH] \"?$section\"?$" "$page" || bad "$page" <<<"has no section $section"
    done
    [ -x "$bin/$program" ] || { bad "$program" <<<"is not built"; continue; }
    # A second form is a line of its own in the page, behind " | " in --help.
    a=$(synopsis "$page" | sed "s/ $program / | /g") b=$(usage "$bin/$program")
    [ "$a" = "$b" ] || printf '%s\n' "SYNOPSIS: $a" "   --help: $b" | bad "$page"
    text=$(mandoc -T utf8 -O width=1000 "$page" | col -bx | sed 's/‐/-/g')
    # Every long option of --help is in the page (shared ones are in spid.1).
    for option in $("$bin/$program" --help | grep -oE '^  (-., |    )--[a-z0-9-]+' | grep -oE '[a-z0-9][a-z0-9-]+$'); do
        case $option in output|threads|model|quiet|head|precision|stats|max-bytes|no-mark|help|version) continue ;; esac
        grep -qE -e "--$option( |=|,|$|\\]|\\))" <<<"$text" || bad "$page" <<<"does not have --$option"
    done
done
# What spid.1 lists is there, and the other way round.
report "man/spid.1" < <(diff <(grep -oE '^\.It Xr spid-[a-z]+' man/spid.1 | sed 's/.* //' | sort) \
    <(ls cmd/spid-*.c cmd/lab/spid-*.c | sed 's/.*\///; s/\.c$//' | sort) | grep '^[<>]' |
    sed 's/^</listed but not there:/; s/^>/not listed:/')
echo "$(wc -l <<<"$files") files, $all lines of C and C++ ($long over 80 columns), $(ls man/*.[135] | wc -l) pages"
exit $fail
