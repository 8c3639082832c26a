load helper

# Every file of import_hostile.py is refused: exit status 65, one line that
# names the file and what in it, no file written, nothing executed.
refuse_all() {
    local file message count=0 limit=
    python3 "$BATS_TEST_DIRNAME/import_hostile.py"
    # Memory stays small: address space, so not under a sanitizer.
    [ "${BUILD:-build}" = build ] && limit=300000
    while IFS=$'\t' read -r file message; do
        [ -z "$limit" ] || ulimit -v $limit
        status 65 timeout 20 spid-import "$file" -o out.safetensors
        one_line
        has "spid-import: $file: "
        has "$message"
        [ ! -e out.safetensors ]
        [ ! -e out.safetensors.part ]
        [ ! -e executed ]
        count=$((count + 1))
    done <hostile.txt
    echo "$count files refused"
    [ "$count" -ge 40 ]
}

@test "hostile pickles, zips and arrays are refused with one line each" {
    refuse_all
}

@test "hostile files are refused by --list too, or only listed" {
    python3 "$BATS_TEST_DIRNAME/import_hostile.py"
    while IFS=$'\t' read -r file message; do
        run timeout 20 spid-import "$file" --list
        [ "$status" -eq 65 ] || [ "$status" -eq 0 ]
        [ ! -e executed ]
    done <hostile.txt
}
