#!/bin/sh
# socketcan.sh CMD [ARG...]: run a command where vcan0 is a real SocketCAN interface: this kernel's where it has CAN, else
# under User-Mode Linux (can_uml.sh). Exit status of the command; 3 and what to install if neither is to be had.
set -u
here=$(dirname "$0")
if ip link show vcan0 >/dev/null 2>&1; then
    exec "$@"
fi
if [ "$(id -u)" = 0 ] && { modprobe vcan; ip link add dev vcan0 type vcan && ip link set vcan0 up; } >/dev/null 2>&1; then
    exec "$@"
fi
uml=${CAN_UML:-/usr/bin/linux.uml}
if [ -x "$uml" ]; then
    echo "no vcan0 in this kernel: under User-Mode Linux ($uml)"
    exec "$here/can_uml.sh" -m "${CAN_UML_MEM:-4G}" -t "${CAN_UML_TIMEOUT:-3600}" -- "$@"
fi
cat >&2 <<EOF
No SocketCAN here. One of these:
  a kernel with CAN:   modprobe vcan; ip link add dev vcan0 type vcan; ip link set vcan0 up    (as root)
  User-Mode Linux:     apt install user-mode-linux busybox-static can-utils
                       on a processor with AMX a newer version than 6.1, which stops at once; 7.2 runs
  unpacked packages:   dpkg-deb -x FILE DIR for each, then CAN_UML=DIR/usr/bin/linux.uml
EOF
exit 3
