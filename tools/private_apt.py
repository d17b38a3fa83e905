"""Debian packages without root: apt-get with sources, lists and package state of its own in one folder."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path


class UnavailableError(Exception):
    """What was asked for cannot be had on this machine; the message is a clause that says why."""


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
            UnavailableError: it failed, with its own last complaint.
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
            raise UnavailableError(f"apt-get {arguments[0]} did not finish within 600 s") from None
        if done.returncode != 0:
            complaints = [line for line in done.stderr.splitlines() if line.startswith("E:")]
            said = complaints[0][2:].strip() if complaints else f"exit status {done.returncode}"
            raise UnavailableError(f"apt-get {arguments[0]} said '{said}'")
        return done.stdout
