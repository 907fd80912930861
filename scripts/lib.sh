# shellcheck shell=bash
# What scripts/run and scripts/test share: finding and installing what a fresh Debian or Ubuntu lacks.

cd "$(dirname "${BASH_SOURCE[0]}")/.." || exit 2

# Mesa's layer that picks a default GPU complains on standard error where there is no session; nothing here needs it.
[ -n "${XDG_RUNTIME_DIR:-}" ] || export NODEVICE_SELECT=1

packages=()

say() { printf '%s\n' "$*" >&2; }
die() { say "error: $*"; exit 2; }

has_library() {
    local libraries
    libraries=$(PATH="$PATH:/usr/sbin:/sbin" ldconfig -p 2>/dev/null) || return 1
    [[ $libraries == *"$1"* ]]
}

has_vulkan_driver() {
    [ -n "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ] && return 0
    local file
    for file in /usr/share/vulkan/icd.d/*.json /usr/local/share/vulkan/icd.d/*.json /etc/vulkan/icd.d/*.json \
        "${XDG_DATA_HOME:-$HOME/.local/share}"/vulkan/icd.d/*.json; do
        [ -e "$file" ] && return 0
    done
    return 1
}

has_lavapipe() { compgen -G '/usr/share/vulkan/icd.d/lvp_icd*.json' >/dev/null; }

# want PACKAGE WHY: puts a package on the list.
want() {
    packages+=("$1")
    say "missing: $1 ($2)"
}

want_library() { has_library "$1" || want "$2" "$3"; }

want_build_tools() {
    command -v cargo >/dev/null || die "cargo is not on the PATH; install Rust from https://rustup.rs"
    if ! command -v cc >/dev/null; then
        want gcc "the linker that rustc calls"
        want libc6-dev "the C library that programs are linked with"
    fi
}

want_vulkan() {
    want_library libvulkan.so.1 libvulkan1 "loads Vulkan drivers"
    has_vulkan_driver || want mesa-vulkan-drivers "Vulkan drivers; lavapipe, which renders on the CPU, is one of them"
}

want_window() {
    want_library libX11.so.6 libx11-6 "X11 windows"
    want_library libX11-xcb.so.1 libx11-xcb1 "X11 windows"
    want_library libXcursor.so.1 libxcursor1 "pointer shapes under X11"
    want_library libXi.so.6 libxi6 "mouse input under X11"
    want_library libxkbcommon.so.0 libxkbcommon0 "keyboard layouts"
    want_library libxkbcommon-x11.so.0 libxkbcommon-x11-0 "keyboard layouts under X11"
    want_library libwayland-client.so.0 libwayland-client0 "Wayland windows"
}

# Installs what is on the list; says so, and how, where it cannot.
install_wanted() {
    [ ${#packages[@]} -eq 0 ] && return
    command -v apt-get >/dev/null ||
        die "this script installs on Debian and Ubuntu only; install what is listed above (Debian's names) and run it again"
    local as_root=()
    if [ "$(id -u)" -ne 0 ]; then
        command -v sudo >/dev/null || die "as root, run: apt-get install ${packages[*]}"
        as_root=(sudo)
    fi
    say "installing: ${packages[*]}"
    local log
    log=$(mktemp)
    if ! { "${as_root[@]}" apt-get update -qq &&
        "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${packages[@]}"; } \
        >"$log" 2>&1; then
        cat "$log" >&2
        rm -f "$log"
        die "apt-get could not install ${packages[*]}"
    fi
    rm -f "$log"
    packages=()
}

is_linux() { [ "$(uname -s)" = Linux ]; }
