#!/usr/bin/env bash
# `pip install intel-opencl-rt` gives no OpenCL device. Three faults of the package, each enough by itself:
# - etc/OpenCL/vendors/intel-cpu.icd names the library under a path of the machine that built the package
#   (/opt/anaconda1anaconda2anaconda3/lib/libintelocl.so), so no loader finds it, even if shown that folder.
# - The library needs libimf.so, libsvml.so, libirng.so and libintlc.so.5 of intel-cmplr-lib-rt, which the package does
#   not require.
# - Its RUNPATH is $ORIGIN and then 60 empty entries; an empty entry is the current folder. So where those are missing
#   they are taken from the folder in which a program happens to run: anyone who can put a libimf.so there runs code.
#
# intel-opencl-rt 2026.2.0, Linux x86-64. Needs readelf (binutils). Exit status 0: as stated; 1: changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "intel-opencl-rt==2026.2.0"
lib=$folder/venv/lib/libintelocl.so
icd=$(cat "$folder/venv/etc/OpenCL/vendors/intel-cpu.icd")
echo "registered: $icd; installed: ${lib#"$folder/"}"
[ ! -e "$icd" ] && [ -e "$lib" ] || { echo "changed"; exit 1; }
missing=$(ldd "$lib" | awk '/not found/ {print $1}' | sort -u | xargs)
echo "not found: $missing"
grep -q libimf.so <<<"$missing" || { echo "changed"; exit 1; }
runpath=$(readelf -d "$lib" | sed -n 's/.*RUNPATH.*\[\(.*\)\]/\1/p')
echo "RUNPATH: $runpath"
[[ $runpath == *::* ]] || { echo "changed"; exit 1; }
mkdir "$folder/elsewhere"
cp "$folder/venv/lib/libtbb.so.12" "$folder/elsewhere/libimf.so" # any library will do to see who is asked
line=$(cd "$folder/elsewhere" && ldd "$lib" 2>/dev/null | grep -m 1 libimf.so)
echo "with a libimf.so in the current folder: ${line#$'\t'}"
[[ $line != *"not found"* ]] && echo "as stated" || { echo "changed"; exit 1; }
