#!/bin/sh
# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0
# Create or update .venv with the named dependency groups from uv.lock: tools/setup.sh GROUP...
# Says what is missing on the machine and which package brings it. Needs no root.
set -eu
cd "$(dirname "$0")/.."
tools/place.sh
UV_VERSION=0.13.8

missing=""
command -v git >/dev/null 2>&1 || missing="\n  git: install git (Debian, Ubuntu) or git (Fedora)"
python=""
for candidate in ${PYTHON:-python3} python3.14 python3.13 python3.12 python3.11; do
    if "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; then
        python=$candidate
        break
    fi
done
[ -n "$python" ] || missing="$missing\n  Python 3.11 or newer: install python3, or set PYTHON"
tools/needs.sh "$missing"

echo "environment: $*; the first time up to a minute"
# An environment that holds no path of its own: scripts find the interpreter beside them, so that a copy of the checkout
# runs what is in the copy.
if ! grep -qs '^relocatable = true' .venv/pyvenv.cfg || ! .venv/bin/uv --version 2>/dev/null | grep -q "^uv $UV_VERSION"; then
    rm -rf .venv
    "$python" -m venv .venv || {
        echo "error: $python cannot make a virtual environment: install python3-venv (Debian, Ubuntu)" >&2
        exit 2
    }
    .venv/bin/python -m pip install --quiet --disable-pip-version-check "uv==$UV_VERSION" || {
        echo "error: pip could not install uv $UV_VERSION: is a Python package index reachable?" >&2
        exit 2
    }
    mkdir -p build
    mv .venv/bin/uv build/uv
    build/uv venv --quiet --clear --relocatable --python "$(command -v "$python")" .venv
    mv build/uv .venv/bin/uv
fi
groups=""
for group in "$@"; do
    # What a run needs is what the package needs: no group.
    [ "$group" = run ] || groups="$groups --group $group"
done
# --inexact: a target adds its group and leaves those of others in place.
# shellcheck disable=SC2086
.venv/bin/uv sync --quiet --frozen --inexact $groups
# uv names the sources by their absolute path; relative, it is counted from the file's own folder.
for path in .venv/lib/python3*/site-packages/*fluxlock*.pth; do echo ../../../../sim >"$path"; done
for group in "$@"; do touch ".venv/.group-$group"; done
