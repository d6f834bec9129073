#!/usr/bin/env bash
# Debian's Chromium, in which tests look at the pages. Where it can't be installed they are skipped, and that is said.
set -euo pipefail

for name in chromium chromium-browser google-chrome; do
  if command -v "$name" >/dev/null; then exit; fi
done

skip() {
  echo "browser: no Chromium here ($*): the tests that look at pages are skipped" >&2
  exit 0
}

command -v apt-get >/dev/null || skip "no apt-get"
as_root=()
if ((EUID != 0)); then
  sudo -n true 2>/dev/null || skip "install with: sudo apt-get install chromium"
  as_root=(sudo -n)
fi
echo "browser: installing from Debian: chromium"
"${as_root[@]}" apt-get -qq update >/dev/null 2>&1 || skip "apt-get update failed"
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qqy install --no-install-recommends chromium >/dev/null 2>&1 ||
  skip "apt-get install failed"
