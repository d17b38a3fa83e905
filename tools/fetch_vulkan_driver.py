#!/usr/bin/env python3
"""Fetch a software Vulkan driver into a folder of the project, where SAPIEN finds no render device.

SAPIEN needs the device extension VK_KHR_external_semaphore_fd, which Mesa's software driver (lavapipe) has
since version 24.3. The Debian packages are downloaded with package lists of the project's own and unpacked
into the folder: no root, and nothing on the machine changes. Where no driver can be had, one sentence says
so and the exit status is still 0.

Run it with the project's Python (it asks SAPIEN): ``.venv/bin/python tools/fetch_vulkan_driver.py``.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from urllib.parse import unquote

from private_apt import Apt, UnavailableError, own_sources, release

PROJECT = Path(__file__).resolve().parents[1]
DRIVER_LIBRARY = "libvulkan_lvp.so"
PACKAGES = ["mesa-vulkan-drivers", "libx11-6"]
"""The driver, and the one library that SAPIEN's wheel expects of the machine."""

BASE = ("libc6", "libgcc-s1", "libstdc++6", "gcc-")
"""Packages that every Debian machine has; a second copy of them in one process would break it."""

BACKPORTS = {"bookworm": "bookworm-backports"}
"""Releases whose own Mesa is too old, and the suite that has a newer one."""

PROBE = """
import sapien
scene = sapien.Scene()
scene.set_ambient_light([0.5, 0.5, 0.5])
box = scene.create_actor_builder()
box.add_box_visual(half_size=[0.2, 0.2, 0.2], material=[1.0, 0.0, 0.0])
box.build_kinematic(name="box")
camera = scene.add_camera("probe", 16, 16, 1.0, 0.1, 10.0)
camera.entity.set_pose(sapien.Pose([-1.0, 0.0, 0.0]))
scene.update_render()
camera.take_picture()
red, green, blue, _ = camera.get_picture("Color")[8, 8]
assert red > 0.1 and green < 0.5 * red, (red, green, blue)
"""


def lacking() -> str:
    """Name what this machine goes without when no driver was fetched."""
    loads = subprocess.run([sys.executable, "-W", "ignore", "-c", "import sapien"], capture_output=True)
    return (
        "rendering"
        if loads.returncode == 0
        else "simulation ('apt install libx11-6' brings it) and no rendering"
    )


def load_runtime_module(folder: Path) -> str:
    """Return Python lines that make a process use the driver in ``folder``, without importing the package."""
    module = PROJECT / "bt_tasksim" / "engines" / "vulkan.py"
    return (
        "import importlib.util, os\n"
        f"os.environ['BT_TASKSIM_VULKAN'] = {str(folder)!r}\n"
        f"spec = importlib.util.spec_from_file_location('vulkan', {str(module)!r})\n"
        "vulkan = importlib.util.module_from_spec(spec)\n"
        "spec.loader.exec_module(vulkan)\n"
        "assert vulkan.use_software_driver()\n"
    )


def renders(folder: Path | None = None) -> tuple[bool, str]:
    """Draw a small red box with SAPIEN in a process of its own.

    Args:
        folder: a fetched driver to use, or None for what the machine has by itself.

    Returns:
        Whether the picture is right, and the last line of the error where it is not.
    """
    code = (load_runtime_module(folder) if folder else "") + PROBE
    try:
        done = subprocess.run(
            [sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, timeout=180
        )
    except subprocess.TimeoutExpired:
        return False, "SAPIEN did not answer within 180 s"
    lines = done.stderr.strip().splitlines()
    return done.returncode == 0, lines[-1] if lines else f"exit status {done.returncode}"


def closure(printed: str) -> list[str]:
    """Pick the packages to fetch from what ``apt-get --print-uris install`` printed.

    Returns:
        ``name=version`` of every package that can hold a library and is not part of every machine.
    """
    wanted = []
    for line in printed.splitlines():
        words = line.split()
        if len(words) < 2 or not words[1].endswith(".deb"):
            continue
        name, version, architecture = unquote(words[1][: -len(".deb")]).split("_")
        if architecture != "all" and not name.startswith(BASE):
            wanted.append(f"{name}={version}")
    return wanted


def needed(library: Path, folder: Path) -> list[Path]:
    """Return the libraries in ``folder`` that the dynamic loader would bring in for ``library``."""
    done = subprocess.run(
        ["ldd", str(library)],
        capture_output=True,
        text=True,
        env={**os.environ, "LD_LIBRARY_PATH": str(folder), "LC_ALL": "C"},
    )
    found, missing = [], []
    for line in done.stdout.splitlines():
        words = line.split()
        if "=> not found" in line:
            missing.append(words[0])
        elif len(words) > 2 and Path(words[2]).parent == folder:
            found.append(folder / words[0])
    if missing:
        raise UnavailableError(f"the fetched driver lacks {', '.join(missing)}")
    return found


def unpack(debs: Path, root: Path, into: Path) -> None:
    """Unpack packages, keep what the driver needs, and write the two files that the runtime reads.

    Args:
        debs: the folder of ``.deb`` files.
        root: an empty folder for everything that is in them.
        into: the driver's folder; gets ``lib/``, ``libraries.txt`` and ``lvp_icd.json``.
    """
    for deb in sorted(debs.glob("*.deb")):
        subprocess.run(["dpkg", "-x", str(deb), str(root)], check=True, capture_output=True)
    every = root / "every"
    every.mkdir()
    for library in sorted(path for path in root.rglob("*.so*") if path.parent != every):
        if library.is_file() and library.parent.parent.name == "lib" and not (every / library.name).exists():
            shutil.copy2(library, every / library.name)
    if not (every / DRIVER_LIBRARY).is_file():
        raise UnavailableError("the packages of this release hold no lavapipe")
    asked = {every / DRIVER_LIBRARY, every / "libX11.so.6"}
    keep = asked.union(*(needed(library, every) for library in asked))
    # A library needs more libraries than any of those it needs, so counting puts them in a loadable order.
    order = sorted(keep, key=lambda library: (len(needed(library, every)), library.name))
    (into / "lib").mkdir(parents=True)
    for library in order:
        shutil.copy2(library, into / "lib" / library.name)
    description = json.loads(next(root.rglob("lvp_icd*.json")).read_text(encoding="utf-8"))
    description["ICD"]["library_path"] = f"./lib/{DRIVER_LIBRARY}"
    (into / "lvp_icd.json").write_text(json.dumps(description, indent=2) + "\n", encoding="utf-8")
    names = [library.name for library in order]
    (into / "libraries.txt").write_text("\n".join(names) + "\n", encoding="utf-8")


def fetch(folder: Path) -> None:
    """Bring the driver into ``folder``, whole or not at all.

    Raises:
        UnavailableError: it cannot be had, or SAPIEN does not render with it.
    """
    for tool in ("apt-get", "dpkg", "ldd"):
        if shutil.which(tool) is None:
            raise UnavailableError(f"this machine has no {tool} to fetch a software driver with")
    system, codename = release()
    suite = BACKPORTS.get(codename)
    sources = own_sources(Path("/etc/apt"), codename, suite) if codename else {}
    if not sources:
        raise UnavailableError(
            f"no package source of this release ({system} {codename}) is configured".replace("  ", " ")
        )
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".vulkan-fetch-") as name:
        work = Path(name)
        apt = Apt(work / "apt", sources, suite)
        apt("update")
        packages = closure(apt("--no-install-recommends", "--print-uris", "-qq", "-y", "install", *PACKAGES))
        print(
            f"Fetching Mesa's software Vulkan driver and its libraries ({len(packages)} packages) ...",
            flush=True,
        )
        apt("-qq", "download", *packages)
        (work / "root").mkdir()
        unpack(apt.debs, work / "root", work / "driver")
        ok, why = renders(work / "driver")
        if not ok:
            raise UnavailableError(f"SAPIEN does not render with the fetched driver ({why})")
        shutil.rmtree(folder, ignore_errors=True)
        os.replace(work / "driver", folder)


def main(arguments: list[str] | None = None) -> int:
    """Say what renders here, fetching it if need be. Returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--folder", type=Path, default=PROJECT / ".vulkan", help="where the driver goes")
    parser.add_argument("--stamp", type=Path, help="a file to touch once something renders")
    parser.add_argument("--force", action="store_true", help="fetch even where the machine renders by itself")
    options = parser.parse_args(arguments)
    folder: Path = options.folder.resolve()
    if importlib.util.find_spec("sapien") is None:
        print("No rendering: sapien is not installed in this Python.")
        return 0
    if not options.force and renders()[0]:
        print("Rendering with the machine's own Vulkan device.")
    elif not options.force and (folder / "libraries.txt").is_file() and renders(folder)[0]:
        print(f"Rendering with the software driver in {folder.name}.")
    else:
        try:
            fetch(folder)
        except (UnavailableError, OSError, subprocess.SubprocessError) as error:
            print(f"No {lacking()}: {error}; what does not need it works without.")
            return 0
        print(f"Rendering with the software driver in {folder.name}.")
    if options.stamp:
        options.stamp.parent.mkdir(parents=True, exist_ok=True)
        options.stamp.touch()
    return 0


if __name__ == "__main__":
    sys.exit(main())
