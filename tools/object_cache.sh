#!/bin/sh
# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0
# Compile Verilator's own C++ once a folder instead of once a build: `object_cache.sh FOLDER COMPILER ARGUMENT...`.
# Its objects are kept, named by the checksum of the whole command. The model of a build, Vtop__ALL.cpp, and cocotb's main
# take Verilator's headers precompiled, which are most of what there is to compile; what a model runs once at its start,
# the __Slow.cpp behind the rest, is not optimized. Everything else is compiled as it is asked for.
set -eu
folder=$1
shift
source= object= before= flags=
for argument in "$@"; do
    case $argument in
    -o | -c | -MMD | *.cpp) ;;
    *)  # no path that a checkout may have holds a space
        if [ "$before" = -o ]; then object=$argument; else flags="$flags $argument"; fi
        ;;
    esac
    before=$argument
    source=$argument
done
case $source in
*/verilator/include/verilated*.cpp)
    kept=$folder/$(printf '%s\n' "$*" | cksum | tr ' ' '-')-$object
    if [ ! -f "$kept" ]; then
        "$@"
        mkdir -p "$folder"
        cp "$object" "$kept.$$"
        mv "$kept.$$" "$kept"
    else
        cp "$kept" "$object"
    fi
    ;;
Vtop__ALL.cpp | */cocotb/share/lib/verilator/verilator.cpp)
    headers=$folder/headers-$(printf '%s\n' "$flags" | cksum | tr ' ' '-')
    if [ ! -f "$headers/all.h.gch" ]; then
        mkdir -p "$headers"
        printf '#include "%s"\n' verilated.h verilated_dpi.h verilated_syms.h verilated_sym_props.h verilated_vpi.h >"$headers/$$.h"
        # shellcheck disable=SC2086
        $flags -x c++-header "$headers/$$.h" -o "$headers/$$.gch"
        mv "$headers/$$.h" "$headers/all.h"
        mv "$headers/$$.gch" "$headers/all.h.gch"
    fi
    [ "$source" != Vtop__ALL.cpp ] || sed -i '/__Slow\.cpp"/s/^#include/#pragma GCC optimize (0)\n&/' "$source"
    exec "$@" -include "$headers/all.h"
    ;;
*) exec "$@" ;;
esac
