"""Shell scripts for a brick, as strings: start the agent, keep it running, install the server.

The scripts can be run twice, and leave the old version in place until the new one is complete.
"""

from __future__ import annotations

AGENT_SCRIPT = """\
set -eu
umask 077
mkdir -p drivelesson
cd drivelesson
tar -xf -
python3 -c 'import ev3dev2' 2>/dev/null || {
  echo 'python3-ev3dev2 is missing; on the brick: sudo apt-get install python3-ev3dev2' >&2
  exit 1
}
if [ -f agent.pid ]; then kill "$(cat agent.pid)" 2>/dev/null || true; sleep 1; fi
: >agent.log
keeper=
if ! systemctl is-active --quiet drivelesson-agent 2>/dev/null; then
  setsid sh ./keep-agent >/dev/null 2>&1 </dev/null &
  keeper=$!
fi
for i in 1 2 3 4 5 6 7 8 9 10; do
  if grep -q listening agent.log; then tail -n 1 agent.log; exit 0; fi
  sleep 1
  [ -z "$keeper" ] || kill -0 "$keeper" 2>/dev/null || break
done
cat agent.log >&2
exit 1
"""
"""Script that reads a tar archive with the files agent.pyz, keep-agent, autostart and secret. The
script then starts the agent."""

KEEP_SCRIPT = """\
#!/bin/sh
# Starts the agent, and restarts it when it ends, except after status 2, which a person must fix.
cd "$(dirname "$0")" || exit 2
echo $$ >agent.pid.new && mv -f agent.pid.new agent.pid  # atomic: nobody reads half a file
trap 'kill $agent 2>/dev/null; exit 0' TERM INT
while :; do
  python3 agent.pyz --secret-file secret --port @PORT@ --root "${DRIVELESSON_ROOT:-/}" \\
    >>agent.log 2>&1 </dev/null &
  agent=$!
  wait $agent
  status=$?
  [ $status = 2 ] && exit 2
  [ "$(wc -c <agent.log)" -lt 200000 ] || : >agent.log
  echo "the agent ended with status $status; restarting it" >>agent.log
  sleep 1
done
"""

AUTOSTART_SCRIPT = """\
#!/bin/sh
# Makes the brick start the agent at each boot. Run it as root.
set -eu
[ "$(id -u)" = 0 ] || { echo 'run this as root: sudo sh drivelesson/autostart' >&2; exit 1; }
folder=$(cd "$(dirname "$0")" && pwd)
if [ -f "$folder/agent.pid" ]; then kill "$(cat "$folder/agent.pid")" 2>/dev/null || true; fi
units=${DRIVELESSON_PREFIX:-}/etc/systemd/system
mkdir -p "$units"
cat >"$units/drivelesson-agent.service" <<END
[Unit]
Description=Drivelesson's agent
After=network.target
Conflicts=drivelesson.service

[Service]
User=$(stat -c %U "$folder")
ExecStart=/bin/sh $folder/keep-agent
Restart=always
RestartSec=1
RestartPreventExitStatus=2

[Install]
WantedBy=multi-user.target
END
systemctl daemon-reload
systemctl disable --now drivelesson 2>/dev/null || true
systemctl enable drivelesson-agent
systemctl restart drivelesson-agent
echo 'the brick will start the agent at each boot'
"""

START_SCRIPT = """\
#!/bin/sh
# Mounts the folders, and shows "starting" while Python loads, which takes half a minute.
root=/opt/drivelesson/root
for folder in proc sys dev; do
  mountpoint -q $root/$folder || mount --rbind /$folder $root/$folder
done
data=var/lib/drivelesson
mountpoint -q $root/$data || mount --bind /$data $root/$data
cp /etc/resolv.conf /etc/hosts /etc/drivelesson.toml $root/etc/ 2>/dev/null
printf '\\033[2J\\033[HDrivelesson\\r\\n\\nstarting ...\\r\\n' >/dev/tty6 && chvt 6
for light in /sys/class/leds/led0:*:brick-status; do
  cat $light/max_brightness >$light/brightness
done
exit 0
"""

ENVIRONMENT = {
    "PYTHONPATH": "/opt/drivelesson",
    "PYTHONDONTWRITEBYTECODE": "1",
    "MALLOC_ARENA_MAX": "1",
    "MALLOC_MMAP_THRESHOLD_": "100000",
    "LC_ALL": "C.UTF-8",
    "HOME": "/root",
    "PATH": "/usr/bin:/bin",
}
"""The environment variables of the server on a brick. The two malloc settings save memory. By
default, the C library has several arenas of free memory for threads; one is enough, because
Python's threads take turns. If the mmap threshold is fixed, the learner's snapshots leave no gaps
in the heap."""
_ENV = " \\\n  ".join(f"{name}={value}" for name, value in ENVIRONMENT.items())
UNIT = f"""\
[Unit]
Description=Drivelesson
After=network.target

[Service]
ExecStartPre=/opt/drivelesson/start
ExecStart=/usr/sbin/chroot /opt/drivelesson/root /usr/bin/env \\
  {_ENV} \\
  /usr/bin/python3 -OO -m server.bodies.lean serve --robot ev3 --lan --learner integer \\
  --max-nodes 32 --data /var/lib/drivelesson --config /etc/drivelesson.toml
Restart=on-failure
RestartSec=5
RestartPreventExitStatus=2
OOMScoreAdjust=-500

[Install]
WantedBy=multi-user.target
"""

INSTALL_SCRIPT = """\
set -eu
top=${DRIVELESSON_PREFIX:-}
home=$top/opt/drivelesson
[ "$(id -u)" = 0 ] || { echo 'log in as root: drivelesson brick install root@ADDRESS' >&2; exit 1; }
free=$(df -Pk "${top:-/}" | awk 'NR==2 {print $4}')
[ "$free" -gt 400000 ] || { echo "the card has only $free kB free; 400000 are needed" >&2; exit 1; }
mkdir -p "$home" "$top/var/lib/drivelesson" "$top/etc/systemd/system"
rm -rf "$home/incoming"
mkdir "$home/incoming"
tar -xf - -C "$home/incoming"
systemctl stop drivelesson 2>/dev/null || true
systemctl disable --now drivelesson-agent 2>/dev/null || true
for folder in var/lib/drivelesson proc sys dev; do
  umount -l "$home/root/$folder" 2>/dev/null || true
done
if [ -d "$home/incoming/root" ]; then
  # Folders that are still mounted must not be deleted with the old root file system.
  if mount | grep -q " $home/root/"; then echo 'restart the brick and try again' >&2; exit 1; fi
  rm -rf "$home/root.old"
  if [ -d "$home/root" ]; then mv "$home/root" "$home/root.old"; fi
  mv "$home/incoming/root" "$home/root"
  rm -rf "$home/root.old"
fi
mkdir -p "$home/root/proc" "$home/root/sys" "$home/root/dev" "$home/root/var/lib/drivelesson"
rm -rf "$home/root/opt/drivelesson"
mkdir -p "$home/root/opt"
mv "$home/incoming/program" "$home/root/opt/drivelesson"
if [ ! -f "$home/incoming/compiled" ]; then
  echo 'compiling on the brick, which takes a quarter of an hour'
  chroot "$home/root" /bin/sh -c "/usr/bin/python3 -OO -m compileall -q /usr/lib/python3.* \\
    /usr/lib/python3/dist-packages /opt/drivelesson" >/dev/null || true
fi
mv "$home/incoming/start" "$home/start"
chmod 755 "$home/start"
mv "$home/incoming/drivelesson.service" "$top/etc/systemd/system/drivelesson.service"
config=$top/etc/drivelesson.toml
[ -f "$config" ] || echo '# drivelesson serve --help lists what can be set' >"$config"
mv "$home/incoming/packages" "$home/packages"
rm -rf "$home/incoming"
systemctl daemon-reload
systemctl enable drivelesson
systemctl restart drivelesson
echo 'installed; the page is there when the brick no longer says "starting"'
"""
"""Script that reads a tar archive with everything that the server needs, and installs it: program,
`start`, the systemd unit and, if it has changed, the Debian root file system."""
