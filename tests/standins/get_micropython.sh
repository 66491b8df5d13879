#!/bin/sh
# Gets Debian's micropython: installs it if the release has it; otherwise unpacks the package of
# Debian 13 and its libraries into the given folder.
set -eu
if command -v micropython > /dev/null || apt-get install -y -qq micropython > /dev/null 2>&1; then exit 0; fi
folder=$1
[ -x "$folder/run" ] && exit 0
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p "$work/lists/partial" "$work/cache/archives/partial"
echo "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] http://deb.debian.org/debian trixie main" > "$work/sources"
set -- -o Dir::Etc::sourcelist="$work/sources" -o Dir::Etc::sourceparts=- -o Dir::State::lists="$work/lists" \
  -o Dir::Cache="$work/cache" -o APT::Sandbox::User=root
apt-get "$@" update -qq
cd "$work"
apt-get "$@" download -qq micropython libc6 libffi8 libmbedcrypto16 libmbedtls21 libmbedx509-7
cd - > /dev/null
mkdir -p "$folder"
for package in "$work"/*.deb; do dpkg -x "$package" "$folder"; done
cat > "$folder/run" <<'RUN'
#!/bin/sh
here=$(dirname "$(readlink -f "$0")")
exec "$here"/usr/lib/*-linux-gnu/ld-linux-*.so.* --library-path "$(echo "$here"/usr/lib/*-linux-gnu)" "$here/usr/bin/micropython" "$@"
RUN
chmod +x "$folder/run"
