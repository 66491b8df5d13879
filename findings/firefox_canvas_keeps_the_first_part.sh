#!/bin/sh
# Firefox 153.8 ESR (Debian 12): a canvas keeps drawing the first picture of an <img> whose pictures replace each
# other (multipart/x-mixed-replace), while the page shows the newest picture.
#
# Guess before running: drawImage() draws the picture that the element shows, as in Chromium 156.
# Outcome: wrong. drawImage(image) always draws the first part. drawImage() of the result of createImageBitmap(image),
# called at the same moment, draws the newest part.
#
# Firefox needs its shared libraries: apt-get install firefox-esr
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
apt-get download --quiet --quiet firefox-esr=153.8.0esr-1~deb12u1
dpkg -x firefox-esr_*.deb .
python3 -m venv env
env/bin/pip install --quiet pillow==12.0.0
env/bin/python - "$folder" <<'EOF'
import io
import json
import queue
import subprocess
import sys
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from PIL import Image

home = Path(sys.argv[1])
told = queue.Queue()
PAGE = b"""<!doctype html><img src="/video"><script>
const image = document.querySelector('img'), seen = {element: [], bitmap: []};
const context = Object.assign(document.createElement('canvas'), {width: 8, height: 8}).getContext('2d');
const grey = drawn => { context.drawImage(drawn, 0, 0); return context.getImageData(4, 4, 1, 1).data[0]; };
const look = async () => {
  if (image.naturalWidth) {
    seen.element.push(grey(image));
    seen.bitmap.push(grey(await createImageBitmap(image)));
  }
};
const looking = setInterval(look, 200);
setTimeout(() => { clearInterval(looking); fetch('/', {method: 'POST', body: JSON.stringify(seen)}); }, 15000);
</script>"""


class Site(BaseHTTPRequestHandler):
    def do_GET(self):
        self.send_response(200)
        if self.path != "/video":
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(PAGE)
            return
        self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
        self.end_headers()
        head = b"--frame\r\nContent-Type: image/jpeg\r\n\r\n"
        self.wfile.write(head)
        for number in range(60):
            data = io.BytesIO()
            Image.new("L", (16, 16), 40 * (number % 6)).save(data, "JPEG")
            try:
                self.wfile.write(data.getvalue() + b"\r\n" + head)
            except OSError:
                return
            time.sleep(1)

    def do_POST(self):
        told.put(self.rfile.read(int(self.headers["Content-Length"])))
        self.send_response(204)
        self.end_headers()

    def log_message(self, *words):
        pass


with ThreadingHTTPServer(("127.0.0.1", 0), Site) as site:
    site.daemon_threads = True
    threading.Thread(target=site.serve_forever, daemon=True).start()
    (home / "profile").mkdir()
    words = [home / "usr/lib/firefox-esr/firefox-esr", "--headless", "--no-remote", "--profile", home / "profile", f"http://127.0.0.1:{site.server_port}/"]
    browser = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        seen = json.loads(told.get(timeout=180))
    finally:
        browser.terminate()
        browser.wait()
        site.shutdown()
found = {name: sorted(set(greys)) for name, greys in seen.items()}
print(found)
assert len(found["element"]) == 1 and len(found["bitmap"]) > 2
EOF
