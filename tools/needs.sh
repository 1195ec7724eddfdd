#!/bin/sh
# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0
# Name the programs that a build of the chip needs and this machine lacks, with the package that brings each; exit code 2.
# tools/needs.sh [LINE]: LINE names something else that is missing.
set -eu
missing="${1-}"
need() { # command, Debian package, Fedora package
    command -v "$1" >/dev/null 2>&1 || missing="$missing\n  $1: install $2 (Debian, Ubuntu) or $3 (Fedora)"
}
need perl perl perl
need make make make
command -v "${CXX:-g++}" >/dev/null 2>&1 ||
    missing="$missing\n  ${CXX:-g++}: install g++ (Debian, Ubuntu) or gcc-c++ (Fedora), or set CXX"
if [ -n "$missing" ]; then
    printf 'error: this machine lacks:%b\n' "$missing" >&2
    exit 2
fi
