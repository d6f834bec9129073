#!/usr/bin/env bash
# Runs the steps of Containerfile in a bare Debian root, where there is no container engine: scripts/container.sh FOLDER
# Needs root, debootstrap and some 3 GB. ENTRYPOINT is tried with --version. The folder is left for a look.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

main() {
  local root=${1:?"usage: scripts/container.sh FOLDER, which is made"} place=/ line
  [[ ! -e $root ]] || { echo "container: $root is there already" >&2; exit 1; }
  while IFS= read -r line; do
    case $line in
      "" | "#"*) ;;
      "FROM debian:12") bare "$root" ;;
      "COPY . "*) copied "$root${line#COPY . }" ;;
      "WORKDIR "*) place=${line#WORKDIR } && mkdir -p "$root$place" ;;
      "RUN "*) inside "$root" "$place" "${line#RUN }" ;;
      "ENTRYPOINT "*) inside "$root" "$place" "$(tr -d '[]",' <<<"${line#ENTRYPOINT }") --version" ;;
      *) echo "container: unknown step: $line" >&2 && exit 1 ;;
    esac
  done < <(sed -e ':a' -e '/\\$/N; s/\\\n//; ta' Containerfile)
}

bare() {
  echo "container: a bare Debian 12 in $1"
  debootstrap --variant=minbase bookworm "$1" >/dev/null
  # The root has this machine's names, mirrors and settings of pip, as a container has its host's network.
  cp /etc/resolv.conf /etc/hosts "$1/etc/"
  cp -rT /etc/apt "$1/etc/apt"
  # A machine behind a proxy trusts certificates of its own.
  cp /etc/ssl/certs/ca-certificates.crt "$1/etc/host-certificates.crt"
  mount --bind /proc "$1/proc"
  trap 'umount "'"$1"'/proc"' EXIT
}

copied() {
  mkdir -p "$1"
  git archive HEAD | tar -x -C "$1"
}

inside() {
  echo "container: $3"
  chroot "$1" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root DEBIAN_FRONTEND=noninteractive \
    PIP_CERT=/etc/host-certificates.crt \
    sh -c "cd '$2' && $3"
}

main "$@"
