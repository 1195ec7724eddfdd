#!/bin/sh
# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0
# socketcan.sh CMD [ARG...]: run a command where vcan0 is a real SocketCAN interface: this kernel's where it has CAN, else
# under User-Mode Linux (can_uml.sh). Exit status of the command; 3 and what to install if neither is to be had.
# socketcan.sh --unpack: Debian's packages for it into build/uml, which is looked at too; needs apt, but no root.
set -eu
here=$(dirname "$0")
unpacked=$(cd "$here/.." && pwd)/build/uml
if [ "${1:-}" = --unpack ]; then
    rm -rf "$unpacked"
    mkdir -p "$unpacked"
    cd "$unpacked"
    apt-get download -qq user-mode-linux busybox-static can-utils
    for package in *.deb; do dpkg-deb -x "$package" .; done
    rm -f ./*.deb
    exit 0
fi
PATH=$PATH:$unpacked/usr/bin  # candump, cansend, cangen
export PATH
if ip link show vcan0 >/dev/null 2>&1; then
    exec "$@"
fi
if [ "$(id -u)" = 0 ] && { modprobe vcan; ip link add dev vcan0 type vcan && ip link set vcan0 up; } >/dev/null 2>&1; then
    exec "$@"
fi
for uml in ${CAN_UML:+"$CAN_UML"} /usr/bin/linux.uml "$unpacked/usr/bin/linux.uml"; do
    [ -x "$uml" ] || continue
    echo "no vcan0 in this kernel: under User-Mode Linux ($uml)"
    export CAN_UML="$uml"
    exec "$here/can_uml.sh" -m "${CAN_UML_MEM:-4G}" -t "${CAN_UML_TIMEOUT:-3600}" -- "$@"
done
cat >&2 <<EOF
No SocketCAN here. One of these:
  a kernel with CAN:   modprobe vcan; ip link add dev vcan0 type vcan; ip link set vcan0 up    (as root)
  User-Mode Linux:     apt install user-mode-linux busybox-static can-utils
                       on a processor with AMX a newer version than 6.1, which stops at once; 7.2 runs
  unpacked packages:   tools/socketcan.sh --unpack (Debian), or dpkg-deb -x FILE DIR, CAN_UML=DIR/usr/bin/linux.uml
EOF
exit 3
