"""What a wheel must and must not contain; prints its size and engine version.

python .ci/wheel_contents.py WHEEL     (with pyelftools, which auditwheel installs)
"""

import io
import re
import sys
import zipfile
from pathlib import Path

from elftools.elf.elffile import ELFFile

wheel = Path(sys.argv[1])
with zipfile.ZipFile(wheel) as archive:
    names = archive.namelist()
    (metadata,) = (name for name in names if name.endswith(".dist-info/METADATA"))
    required = re.search(
        r"^Requires-Dist: mujoco==(\S+)$", archive.read(metadata).decode(), re.M
    )
    (plugin,) = (name for name in names if name.endswith("libswgjoint_plugin.so"))
    (loops,) = (
        name for name in names if "/kernels/compiled." in name and name.endswith(".so")
    )
    elf = ELFFile(io.BytesIO(archive.read(plugin)))
    dynamic = list(elf.get_section_by_name(".dynamic").iter_tags())

needed = [tag.needed for tag in dynamic if tag.entry.d_tag == "DT_NEEDED"]
paths = [tag.runpath for tag in dynamic if tag.entry.d_tag == "DT_RUNPATH"]
assert "manylinux" in wheel.name, f"{wheel.name} is for this machine only"
assert required, "the metadata pins no version of mujoco"
assert f"libmujoco.so.{required[1]}" in needed, f"{plugin} is linked to {needed}"
assert "$ORIGIN/../../mujoco" in paths, f"{plugin} looks for libmujoco in {paths}"
assert not any("libmujoco" in name for name in names), "libmujoco is in the wheel"
# keys of the cache contain the text of the loops, so the wheel needs their sources
assert "swgjoint/kernels/flank.cc" in names, "no sources of the compiled loops"
size = wheel.stat().st_size / 1e6
print(f"{wheel.name}: {size:.1f} MB, {len(names)} files, for MuJoCo {required[1]}")
