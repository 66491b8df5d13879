#!/bin/sh
# VLC 3.0.24 (Debian 12): the demuxer of MJPEG streams holds a picture back until 15 KiB have arrived since the
# picture's beginning, even if the part has a Content-Length and the next boundary has arrived.
#
# Guess before running: pictures of a live stream are delayed by the network cache (1 s), and by at most one more
# picture, because a part ends when the next begins.
# Outcome: wrong. Without the cache, none of ten pictures of 1 kB is passed on while the stream pauses. The same
# pictures, padded with zeros to 15,348 bytes each, are passed on immediately.
#
# VLC needs its shared libraries: apt-get install vlc-bin vlc-plugin-base
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
for package in vlc-bin vlc-plugin-base libvlc5 libvlc-bin libvlccore9; do
  apt-get download --quiet --quiet "$package=3.0.24-0+deb12u1"
done
for package in *.deb; do dpkg -x "$package" .; done
python3 -m venv env
env/bin/pip install --quiet pillow==12.0.0
chmod 755 "$folder"
env/bin/python - "$folder" <<'EOF'
import io
import os
import socket
import subprocess
import sys
import time
from pathlib import Path

from PIL import Image

home = Path(sys.argv[1])
lib = next(home.glob("usr/lib/*-linux-gnu"))
environ = {"HOME": str(home / "home"), "LD_LIBRARY_PATH": str(lib), "VLC_PLUGIN_PATH": str(lib / "vlc/plugins"), "PATH": os.environ["PATH"]}
user = {"user": 65534, "group": 65534} if os.geteuid() == 0 else {}
(home / "home").mkdir()
(home / "home").chmod(0o777)
data = io.BytesIO()
Image.effect_noise((48, 32), 60).save(data, "JPEG", quality=50)
jpeg = data.getvalue()


def passed_on(n_bytes: int) -> int:
    """Return how many of ten pictures VLC passes on while the stream pauses."""
    target = home / "home" / f"{n_bytes}.bin"
    body = jpeg.ljust(n_bytes, b"\0")
    with socket.create_server(("127.0.0.1", 0)) as listener:
        url = f"http://127.0.0.1:{listener.getsockname()[1]}/video.mjpg"
        words = [home / "usr/bin/vlc", "-I", "dummy", "--network-caching=0", "--sout-mux-caching=0", url, "--sout", f"#std{{access=file,mux=dummy,dst={target}}}"]
        player = subprocess.Popen(words, env=environ, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, **user)
        connection, _ = listener.accept()
        with connection:
            connection.recv(4096)
            connection.sendall(b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=frame\r\n\r\n")
            head = b"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % n_bytes
            connection.sendall((head + body + b"\r\n") * 10 + head)
            time.sleep(10)
            count = target.read_bytes().count(jpeg) if target.exists() else 0
        player.kill()
        player.wait()
    return count


found = {"as they are": passed_on(len(jpeg)), "with zeros": passed_on(15 * 1024 - 12)}
print(len(jpeg), found)
assert len(jpeg) < 1500 and found["as they are"] == 0 and found["with zeros"] >= 9
EOF
