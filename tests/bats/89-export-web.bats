#!/usr/bin/env bats
# spid-export --web and the module of examples/web, in node and in a browser.
load helper

MODULE=$TOP/${BUILD:-build}/web-module
NPM=$TOP/${BUILD:-build}/web/node_modules

setup_file() {
    cd "$BATS_FILE_TMPDIR"
    spid-synth -q --seed 32 --first 0 --people 1 --frames 1 --effects 0 -o me.png
    spid-shape -q me.png -o me.spid
    spid-branches -q --bake me.spid -o avatar.spid
    spid-synth -q --seed 31 --first 2 --people 1 --frames 3 --effects 0 --without mesh -o driver.spid
    spid-dump --only MOTN driver.spid --json --values >drive.json
    spid-pack drive.json -o motion.spid
    spid-export -q avatar.spid --web me.safetensors
}

setup() {
    cd "$BATS_TEST_TMPDIR"
    ln -s "$BATS_FILE_TMPDIR"/*.* .
}

need_module() {
    [ -e "$MODULE/spid-avatar.js" ] || skip "no web-module (apt: npm, then make web)"
    mkdir -p site/node_modules
    cp "$MODULE"/* site
    ln -s "$NPM/three" site/node_modules/three
    ln -s "$MODULE" site/node_modules/spid-avatar
    cp "$(readlink -f me.safetensors)" site/me.safetensors
}

@test "the module in node moves the Gaussians to where spid-branches moves them" {
    need_module
    cp "$TOP/tests/npm/module.mjs" site
    spid-flame -i avatar.spid motion.spid | spid-branches -i avatar.spid --full |
        spid-dump --only GAUS --json --values >means.json
    node --preserve-symlinks site/module.mjs me.safetensors drive.json means.json
}

@test "its example drives an avatar in a browser's three.js scene" {
    need_module
    CHROMIUM=$(command -v chromium || command -v chromium-browser) || skip "no chromium (apt: chromium)"
    export CHROMIUM
    [ -d "$TOP/build/npm/node_modules/playwright-core" ] || skip "no playwright-core (apt: npm, then make deps)"
    timeout 300 node "$TOP/tests/npm/site.cjs" site >out 2>&1 || { cat out; false; }
    cat out
}

@test "the file is the same bytes twice, and what makes none is one line" {
    spid-export -q avatar.spid --web again.safetensors
    cmp me.safetensors again.safetensors
    status 65 spid-export -q me.spid --web no.safetensors
    one_line
    has "no GAUS record"
    [ ! -e no.safetensors ]
    status 64 spid-export -q avatar.spid --web 'x%d.safetensors'
    one_line
}
