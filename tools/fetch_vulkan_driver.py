#!/usr/bin/env python3
"""Fetch a software Vulkan driver into a folder of the project, where SAPIEN finds no render device.

SAPIEN needs the device extension VK_KHR_external_semaphore_fd, which Mesa's software driver (lavapipe) has
since version 24.3. The Debian packages are downloaded with package lists of the project's own and unpacked
into the folder: no root, and nothing on the machine changes. Where no driver can be had, one sentence says
so and the exit status is still 0: everything but pictures works without.

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


class NoDriver(Exception):
    """No driver can be had here; the message ends the sentence 'No rendering: ...'."""


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


def release(os_release: Path = Path("/etc/os-release")) -> tuple[str, str]:
    """Return the distribution's id and the code name of its release ('debian', 'bookworm')."""
    values = {}
    if os_release.is_file():
        for line in os_release.read_text(encoding="utf-8").splitlines():
            key, _, value = line.partition("=")
            values[key] = value.strip().strip("\"'")
    return values.get("ID", ""), values.get("VERSION_CODENAME", "")


def own_sources(apt: Path, codename: str, backports: str | None) -> dict[str, str]:
    """Copy the machine's package sources of its own release, with a further suite where one is asked for.

    Both of apt's formats are read: one-line ``.list`` files and ``.sources`` paragraphs. Sources of other
    origin (a suite that is not named after the release) are left out.

    Returns:
        File names and their contents, for a ``sourceparts`` folder.
    """

    def ours(suite: str) -> bool:
        return suite == codename or suite.startswith((codename + "-", codename + "/"))

    lines: list[str] = []
    paragraphs: list[str] = []
    listed = [apt / "sources.list", *sorted((apt / "sources.list.d").glob("*.list"))]
    for file in (file for file in listed if file.is_file()):
        for line in file.read_text(encoding="utf-8").splitlines():
            words = line.partition("#")[0].split()
            if not words or words[0] != "deb":
                continue
            start = 1
            if words[1].startswith("["):
                start = next((i for i, word in enumerate(words) if word.endswith("]")), 0) + 1
            suite = words[start + 1] if len(words) > start + 1 else ""
            if ours(suite):
                lines.append(" ".join(words))
                if backports and suite == codename:
                    lines.append(" ".join([*words[: start + 1], backports, *words[start + 2 :]]))
    for file in sorted((apt / "sources.list.d").glob("*.sources")):
        text = "\n".join(
            line for line in file.read_text(encoding="utf-8").splitlines() if not line.startswith("#")
        )
        for paragraph in text.split("\n\n"):
            fields = paragraph.strip().splitlines()
            for i, field in enumerate(fields):
                if field.lower().startswith("suites:"):
                    suites = [suite for suite in field.split()[1:] if ours(suite)]
                    if backports and codename in suites and backports not in suites:
                        suites.append(backports)
                    if suites:
                        fields[i] = "Suites: " + " ".join(suites)
                        paragraphs.append("\n".join(fields))
    files = {}
    if lines:
        files["own.list"] = "\n".join(lines) + "\n"
    if paragraphs:
        files["own.sources"] = "\n\n".join(paragraphs) + "\n"
    return files


class Apt:
    """apt-get with lists, cache and package state of its own in one folder."""

    def __init__(self, folder: Path, sources: dict[str, str], suite: str | None) -> None:
        """Lay out the folder.

        Args:
            folder: an empty folder.
            sources: files of the sources folder, as ``own_sources`` gives them.
            suite: the suite to prefer, or None for the release's own.
        """
        self.debs = folder / "debs"
        for name in ("sources", "lists/partial", "archives/partial", "cache", "debs"):
            (folder / name).mkdir(parents=True)
        (folder / "status").touch()
        for name, text in sources.items():
            (folder / "sources" / name).write_text(text, encoding="utf-8")
        # Read after the machine's own settings (proxies stay), so that its hooks can be taken out.
        (folder / "apt.conf").write_text(
            "#clear APT::Update::Post-Invoke;\n"
            "#clear APT::Update::Post-Invoke-Success;\n"
            "#clear DPkg::Post-Invoke;\n"
            f'Dir::Etc::sourcelist "/dev/null";\nDir::Etc::sourceparts "{folder}/sources";\n'
            f'Dir::State::Lists "{folder}/lists";\nDir::State::status "{folder}/status";\n'
            f'Dir::Cache "{folder}/cache";\nDir::Cache::archives "{folder}/archives";\n'
            'APT::Sandbox::User "root";\nDebug::NoLocking "1";\nAcquire::Languages "none";\n'
            'Acquire::Retries "1";\nAcquire::http::Timeout "20";\nAcquire::https::Timeout "20";\n',
            encoding="utf-8",
        )
        self._command = ["apt-get", "-c", str(folder / "apt.conf"), *(["-t", suite] if suite else [])]

    def __call__(self, *arguments: str) -> str:
        """Run apt-get and return what it prints.

        Raises:
            NoDriver: it failed, with its own last complaint.
        """
        try:
            done = subprocess.run(
                [*self._command, *arguments],
                cwd=self.debs,
                capture_output=True,
                text=True,
                timeout=600,
                env={**os.environ, "LC_ALL": "C", "DEBIAN_FRONTEND": "noninteractive"},
            )
        except subprocess.TimeoutExpired:
            raise NoDriver(f"apt-get {arguments[0]} did not finish within 600 s") from None
        if done.returncode != 0:
            complaints = [line for line in done.stderr.splitlines() if line.startswith("E:")]
            said = complaints[0][2:].strip() if complaints else f"exit status {done.returncode}"
            raise NoDriver(f"apt-get {arguments[0]} said '{said}'")
        return done.stdout


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
        raise NoDriver(f"the fetched driver lacks {', '.join(missing)}")
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
        raise NoDriver("the packages of this release hold no lavapipe")
    keep = {every / DRIVER_LIBRARY, every / "libX11.so.6"}
    for library in list(keep):
        keep.update(needed(library, every))
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
        NoDriver: it cannot be had, or SAPIEN does not render with it.
    """
    for tool in ("apt-get", "dpkg", "ldd"):
        if shutil.which(tool) is None:
            raise NoDriver(f"this machine has no {tool} to fetch a software driver with")
    system, codename = release()
    suite = BACKPORTS.get(codename)
    sources = own_sources(Path("/etc/apt"), codename, suite) if codename else {}
    if not sources:
        raise NoDriver(f"no package source of this release ({system} {codename}) is configured".replace("  ", " "))
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".vulkan-fetch-") as name:
        work = Path(name)
        apt = Apt(work / "apt", sources, suite)
        apt("update")
        packages = closure(apt("--no-install-recommends", "--print-uris", "-qq", "-y", "install", *PACKAGES))
        print(f"Fetching Mesa's software Vulkan driver and its libraries ({len(packages)} packages) ...", flush=True)
        apt("-qq", "download", *packages)
        (work / "root").mkdir()
        unpack(apt.debs, work / "root", work / "driver")
        ok, why = renders(work / "driver")
        if not ok:
            raise NoDriver(f"SAPIEN does not render with the fetched driver ({why})")
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
        except (NoDriver, OSError, subprocess.SubprocessError) as error:
            print(f"No rendering: {error}; everything else works, pictures and videos are left out.")
            return 0
        print(f"Rendering with the software driver in {folder.name}.")
    if options.stamp:
        options.stamp.parent.mkdir(parents=True, exist_ok=True)
        options.stamp.touch()
    return 0


if __name__ == "__main__":
    sys.exit(main())
