#!/bin/sh
# Compile Verilator's own C++ once a folder instead of once a build: `object_cache.sh FOLDER COMPILER ARGUMENT...`.
# The objects are named by the checksum of the whole command. Everything else is compiled as it is asked for.
set -eu
folder=$1
shift
source= object= before=
for argument in "$@"; do
    [ "$before" = -o ] && object=$argument
    before=$argument
    source=$argument
done
case $source in
*/verilator/include/verilated*.cpp) ;;
*) exec "$@" ;;
esac
kept=$folder/$(printf '%s\n' "$*" | cksum | tr ' ' '-')-$object
if [ ! -f "$kept" ]; then
    "$@"
    mkdir -p "$folder"
    cp "$object" "$kept.$$"
    mv "$kept.$$" "$kept"
else
    cp "$kept" "$object"
fi
