#!/usr/bin/env python3
"""Reads every #include and compares it with the arrows of the house: nothing lower names anything higher."""

import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]

# room: rooms it may include (itself always)
CORE = {
    "common/base": set(),
    "common/lie": {"common/base"},
    "common/model": {"common/base", "common/lie"},
    "common/rbd": {"common/base", "common/lie", "common/model"},
    "common/geometry": {"common/base", "common/lie"},
    "common/scene": {"common/base", "common/lie", "common/model", "common/rbd", "common/geometry"},
}
BELOW_CORES = set(CORE)
for service in ("dynamics", "planner", "perception"):
    CORE[f"services/{service}/core"] = set(BELOW_CORES)
SHELL = {
    "idl": set(),
    "common/bus": {"common/base", "idl"},
    "common/wire": {"common/base", "common/lie", "common/geometry", "common/bus", "idl"},
    "common/record": {"common/base"},
    "common/files": BELOW_CORES | {"services/perception/core", "common/wire", "common/record"},
    "common/runtime": BELOW_CORES | {"idl", "common/bus", "common/wire", "common/files"},
}
for service in ("dynamics", "planner", "perception"):
    SHELL[f"services/{service}"] = BELOW_CORES | set(SHELL) | {"common/runtime", f"services/{service}/core"}
SHELL["clients/hamel"] = set(CORE) | set(SHELL)
ROOMS = CORE | SHELL

# Foreign headers a core may name: the language and Eigen.
CORE_FOREIGN = re.compile(r"^(Eigen/.*|[a-z_0-9]+)$")
CORE_BANNED = {"iostream", "thread", "mutex", "chrono", "ctime", "fstream", "atomic", "condition_variable"}
# Where foreign names may be named at all.
ONLY_IN = {
    r"^(fastdds|fastrtps|fastcdr|dds)/": ("common/bus", "common/wire"),
    r"^hamel_v1": ("common/wire",),
    r"^(google/protobuf|urdf_|tinyxml2)": ("common/files",),
    r"^(lz4|zstd|zlib)": ("common/record", "common/runtime"),
    r"^fcl/": ("clients/hamel",),
    r"^spdlog/": ("common/runtime", "clients/hamel"),
}


def room_of(path):
    best = [r for r in ROOMS if path == r or path.startswith(r + "/")]
    return max(best, key=len) if best else None


def problems():
    for f in sorted([*ROOT.glob("common/**/*.*"), *ROOT.glob("services/**/*.*"), *ROOT.glob("clients/**/*.*"), *ROOT.glob("idl/*.h")]):
        if f.suffix not in (".h", ".cpp") or f.name == "core.h":
            continue
        path = f.relative_to(ROOT).as_posix()
        room = room_of(path)
        if room is None:
            yield f"{path}: in no room of the table"
            continue
        for number, line in enumerate(f.read_text().splitlines(), 1):
            m = re.match(r'\s*#\s*include\s*([<"])([^">]+)[">]', line)
            if not m:
                continue
            quoted, name = m[1] == '"', m[2]
            at = f"{path}:{number}: "
            target = room_of(name)
            if quoted and target:
                if target != room and target not in ROOMS[room]:
                    yield at + f"{room} may not include {target}"
            for pattern, rooms in ONLY_IN.items():
                if re.match(pattern, name) and room not in rooms:
                    yield at + f"<{name}> belongs in {', '.join(rooms)} alone"
            if room in CORE and not quoted and (name in CORE_BANNED or not CORE_FOREIGN.match(name)):
                yield at + f"a core may not include <{name}>"


if __name__ == "__main__":
    found = list(problems())
    print("\n".join(found) or "every include follows the arrows")
    sys.exit(bool(found))
