# Sourced by the commands in tools/: makes .venv and installs the package into it where needed.
# Sets root, the repository's folder, venv and venv_python; who wants another folder than .venv sets the latter two anew.
# Messages go to stderr.

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
venv=$root/.venv
venv_python=$venv/bin/python
# Compiled Python is kept, or every process of pytest compiles all tests again: 8 s of processor time.
unset PYTHONDONTWRITEBYTECODE

fail() {
    echo "$(basename "$0"): $1" >&2
    exit 1
}

is_new_enough() { "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; }

# The interpreter to make .venv with: $PYTHON, or the first on the path that is new enough.
find_python() {
    local candidate
    for candidate in ${PYTHON:-python3 python3.14 python3.13 python3.12 python3.11}; do
        if is_new_enough "$candidate"; then
            echo "$candidate"
            return
        fi
    done
    fail "needs Python 3.11 or newer, found $("${PYTHON:-python3}" --version 2>&1 | head -n 1); set PYTHON to another"
}

make_venv() {
    local python
    python=$(find_python)
    echo "creating ${venv##*/} with $("$python" --version)" >&2
    local said
    if ! said=$("$python" -m venv "$venv" 2>&1); then
        rm -rf "$venv"
        fail "cannot create ${venv##*/}: ${said##*$'\n'} (on Debian and Ubuntu: apt install python3-venv)"
    fi
}

# Installs the package, editable, with the given extra ("" or "test"), unless that was done for this pyproject.toml.
ensure_installed() {
    local extra=$1 wanted log
    [ -x "$venv_python" ] || { rm -rf "$venv"; make_venv; }
    wanted="$root $("$venv_python" --version) $(cksum <"$root/pyproject.toml")"
    if [ "$wanted" = "$(cat "$venv/.installed-${extra:-run}" 2>/dev/null)" ] ||
        [ "$wanted" = "$(cat "$venv/.installed-test" 2>/dev/null)" ]; then
        return
    fi
    is_new_enough "$venv_python" || fail "${venv##*/} has $("$venv_python" --version), needs 3.11 or newer; delete ${venv##*/}"
    echo "installing irtscots-cl into ${venv##*/}" >&2
    log=$venv/install.log
    if ! "$venv_python" -m pip install --quiet --no-input --disable-pip-version-check \
        --editable "$root${extra:+[$extra]}" </dev/null >"$log" 2>&1; then
        cat "$log" >&2
        fail "pip could not install the package; its messages are above and in ${venv##*/}/install.log"
    fi
    echo "$wanted" >"$venv/.installed-${extra:-run}"
}

# Says why this machine cannot do it.
refuse() {
    echo "$(basename "$0"): $1" >&2
    exit 3
}

need_linux_x86_64() {
    [ "$(uname -s) $(uname -m)" = "Linux x86_64" ] ||
        refuse "$1 exists for Linux on x86_64 only, this is $(uname -s) on $(uname -m)"
}

# Installs packages with an OpenCL driver beside the package, unless that was done, and runs a kernel on its device.
ensure_driver() {
    local device=$1 wanted log=$venv/driver.log
    shift
    wanted="$root $*"
    if [ "$wanted" = "$(cat "$venv/.installed-driver" 2>/dev/null)" ]; then
        return
    fi
    echo "installing $* into ${venv##*/}" >&2
    "$venv_python" -m pip install --quiet --no-input --disable-pip-version-check "$@" </dev/null >"$log" 2>&1 ||
        refuse "pip cannot install $*: $(grep -m 1 '^ERROR' "$log" || tail -n 1 "$log")"
    "$venv_python" -c '
import sys
import numpy as np
import pyopencl as cl
from irtscots_cl.opencl.device import select_device
device, one = select_device(sys.argv[1]), np.zeros(1, np.int32)
program = cl.Program(device.context, "__kernel void f(__global int *a) { a[0] = 1; }").build(cache_dir=False)
buffer = cl.Buffer(device.context, cl.mem_flags.READ_WRITE, 4)
program.f(device.queue, (1,), None, buffer)
cl.enqueue_copy(device.queue, one, buffer)
assert one[0] == 1' "$device" >>"$log" 2>&1 || refuse "$1 does not run on this machine: $(tail -n 1 "$log")"
    echo "$wanted" >"$venv/.installed-driver"
}
