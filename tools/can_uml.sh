#!/bin/bash
# SPDX-FileCopyrightText: 2026 Fluxlock contributors
# SPDX-License-Identifier: Apache-2.0
# can_uml.sh [-i] [-w DIR]... [-d] [-m MEM] [-t SEC] [--] CMD [ARG...]
# Runs CMD under a User-Mode-Linux kernel (Debian package user-mode-linux): no KVM, no root, user code at native speed,
# real AF_CAN with vcan0 + vcan1 up.  / = tmpfs overlay over the host's / (host untouched), except the -w dirs
# (default: $PWD), which are the host's, read-write.  -d: no overlay, host / read-write (as the calling user).
# cwd + exported environment kept; stdout and stderr separate and binary clean; exit status returned;
# stdin /dev/null.  -i: interactive bash on this terminal.  124 = timeout, 125 = UML itself failed.
# Packages unpacked with dpkg-deb -x FILE DIR serve too: CAN_UML=DIR/usr/bin/linux.uml, with DIR/bin/busybox beside it.
set -u
UML=${CAN_UML:-/usr/bin/linux.uml}; BB=${CAN_BUSYBOX:-${UML%/usr/bin/*}/bin/busybox}
MODS=${CAN_UML_MODULES:-$(echo "${UML%/bin/*}"/lib/uml/modules/*/)}
mem=${CAN_UML_MEM:-2G}; tmo=${CAN_UML_TIMEOUT:-600}; inter=0; direct=0; rw=()
while [ $# -gt 0 ]; do case $1 in -i) inter=1; shift;; -d) direct=1; shift;; -w) rw+=("$(readlink -f "$2")"); shift 2;;
  -m) mem=$2; shift 2;; -t) tmo=$2; shift 2;; --) shift; break;; *) break;; esac; done
[ ${#rw[@]} = 0 ] && rw=("$PWD")
[ -x "$UML" ] && [ -x "$BB" ] || { echo "can_uml: no $UML or $BB (apt install user-mode-linux busybox-static)" >&2; exit 125; }
ctl=$(mktemp -d "${TMPDIR:-/tmp}/can_uml.XXXXXX"); trap 'rm -rf "$ctl"' EXIT
printf '%s\n' "${rw[@]}" >"$ctl/rw"
{ export -p | grep -vE '^declare -x (OLDPWD|SHLVL|_)='; printf 'umask %s\ncd %q || exit 125\nset --' "$(umask)" "$PWD"
  if [ $inter = 1 ]; then printf ' bash -i'; else printf ' %s' "${@@Q}"; fi; echo; } >"$ctl/cmd"
{ printf '#!/bin/bash\nctl=%q mods=%q direct=%s inter=%s bb=%q\n' "$ctl" "$MODS" $direct $inter "$BB"; cat <<'EOI'
export PATH=/usr/sbin:/usr/bin:/sbin:/bin
bye() { sync; echo o >/proc/sysrq-trigger; while :; do sleep 1; done; }
$bb mount -t proc p /proc || bye; $bb mount -t hostfs -o "$ctl" h "$ctl" || bye; exec 2>"$ctl/log"
$bb grep -q ' /dev devtmpfs' /proc/mounts || $bb mount -t devtmpfs d /dev || bye
for m in fs/overlayfs/overlay net/can/can net/can/can-raw net/can/can-bcm net/can/can-gw drivers/net/can/dev/can-dev \
  drivers/net/can/vcan drivers/net/can/vxcan drivers/net/can/slcan/slcan; do $bb insmod $mods/kernel/$m.ko; done
N=/
if [ $direct = 0 ]; then N=/mnt/n
  $bb mount -t tmpfs -o size=90% t /mnt || bye; mkdir /mnt/u /mnt/w /mnt/n
  $bb mount -t overlay -o lowerdir=/,upperdir=/mnt/u,workdir=/mnt/w o $N || bye
  while read -r d; do $bb mount -t hostfs -o "$d" h "$N$d" || bye; done <"$ctl/rw"
  mkdir -p "$N$ctl"; $bb mount -t hostfs -o "$ctl" h "$N$ctl" || bye
  $bb mount --move /proc $N/proc; $bb mount --move /dev $N/dev || bye; fi
exec $bb chroot $N /bin/bash "$ctl/init2"
EOI
} >"$ctl/init"
{ printf 'ctl=%q inter=%s bb=%q\n' "$ctl" $inter "$BB"; cat <<'EOI'
bye() { sync; echo o >/proc/sysrq-trigger; while :; do sleep 1; done; }
$bb mount -t tmpfs r /run || bye; $bb mount -t sysfs s /sys; mkdir -p /run/lock /dev/pts /dev/shm
$bb mount -t devpts -o mode=620,ptmxmode=666 p /dev/pts; $bb mount -t tmpfs m /dev/shm
ln -sfn /proc/self/fd /dev/fd; ln -sf fd/0 /dev/stdin; ln -sf fd/1 /dev/stdout; ln -sf fd/2 /dev/stderr
$bb hostname canuml; $bb ip link set lo up
for c in vcan0 vcan1; do $bb ip link add dev $c type vcan && $bb ip link set $c mtu 72 && $bb ip link set $c up; done
if [ $inter = 1 ]; then setsid -c bash -c ". $ctl/cmd; exec \"\$@\"" </dev/tty0 >/dev/tty0 2>&1; echo $? >$ctl/rc; bye; fi
stty -F /dev/tty1 raw -echo; stty -F /dev/tty2 raw -echo
mkfifo /run/o /run/e || bye; cat /run/o >/dev/tty1 & a=$!; cat /run/e >/dev/tty2 & b=$!
( . $ctl/cmd; exec "$@" ) </dev/null >/run/o 2>/run/e; r=$?
( sleep 3; kill $a $b ) & wait $a $b; sleep 0.1; echo $r >$ctl/rc     # 3 s: a daemon left behind may hold the fifos
bye
EOI
} >"$ctl/init2"
chmod +x "$ctl/init"
skip=raid6_select_algo,calibrate_xor_blocks,init_btrfs_fs,init_zswap,strp_dev_init      # unused; 2-3 s of boot time
args=(mem=$mem root=/dev/root rootfstype=hostfs rootflags=/ $([ $direct = 1 ] && echo rw || echo ro) init="$ctl/init"
      quiet initcall_blacklist=$skip con=null ssl=null umid="${ctl##*/}" uml_dir="$ctl/")
if [ $inter = 1 ]; then timeout --foreground "$tmo" "$UML" "${args[@]}" con0=fd:0,fd:1 2>"$ctl/klog"; urc=$?
else
  exec 8> >(exec cat); po=$!; exec 9> >(exec cat >&2); pe=$!    # pipes: UML cannot epoll a regular file
  timeout "$tmo" "$UML" "${args[@]}" con0=null,null con1=null,fd:8 con2=null,fd:9 </dev/null >"$ctl/klog" 2>&1; urc=$?
  exec 8>&- 9>&-; wait $po $pe
fi
[ -s "$ctl/rc" ] && exit "$(cat "$ctl/rc")"
{ echo "can_uml: no exit status (uml/timeout rc $urc)"; cat "$ctl/log"; tail -15 "$ctl/klog"; } >&2 2>/dev/null
[ $urc = 124 ] && exit 124; exit 125
