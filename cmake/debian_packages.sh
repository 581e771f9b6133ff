# Sourced by tests/run and examples/run: what they show, and install_missing, which installs the Debian packages of the
# arrays `required` and `optional` that are missing, when it may, and names them otherwise.

say() { printf '\n==== %s\n' "$*"; }

# What a build has done of what it has to do, [n/m] or [ p%], on one line of a terminal; elsewhere nothing.
show_progress() {
  if [[ -t 1 ]]; then
    awk '/^\[/ { sub(/\].*/, "]"); printf "\r%s  ", $0; fflush() } END { printf "\r" }'
  else
    cat >/dev/null
  fi
}

# Names on standard output, one per line: those of the arguments that dpkg does not know as installed.
missing_packages() {
  local package
  for package in "$@"; do
    [[ $(dpkg-query -W -f '${db:Status-Abbrev}' "$package" 2>/dev/null) == ii* ]] || echo "$package"
  done
}

install_missing() {
  if ! command -v apt-get >/dev/null; then
    say "not Debian or Ubuntu: assuming that a C++17 compiler, CMake, Eigen 3.4 and Catch2 are installed"
    return
  fi
  local as_root=() missing
  mapfile -t missing < <(missing_packages "${required[@]}" "${optional[@]}")
  ((${#missing[@]} > 0)) || return 0
  if [[ -z ${CFP_NO_INSTALL-} ]] && { ((EUID == 0)) || { as_root=(sudo -n) && sudo -n true 2>/dev/null; }; }; then
    say "installing ${missing[*]}"
    "${as_root[@]}" apt-get update -qq || true
    # One by one where all together fail: a release that lacks an optional package loses its tests only.
    local install=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends)
    if ! "${install[@]}" "${missing[@]}" >/dev/null; then
      local package
      for package in "${missing[@]}"; do "${install[@]}" "$package" >/dev/null || echo "could not install $package"; done
    fi
  else
    say "not installed: ${missing[*]}"
    echo "To install:  sudo apt-get install --no-install-recommends ${missing[*]}"
  fi
  mapfile -t missing < <(missing_packages "${required[@]}")
  # Compilers, CMake, Eigen or Catch2 from elsewhere are as good: CMake says what it misses.
  ((${#missing[@]} == 0)) || echo "continuing without ${missing[*]}; configuring fails if nothing else provides them"
}
