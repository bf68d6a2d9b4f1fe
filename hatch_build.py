"""Build hook of the wheel: where DS47_COMPILE=1 asks for it, compiles what every frame and call goes through.

Otherwise everything stays plain Python: the same answers, slower, and installed in seconds. Two compilers,
each fed with the plain Python files themselves:

* Cython takes the files that look at the bytes of frames (BYTES), each with the types in the `.pxd`
  beside it;
* mypyc takes the record path (RECORD_PATH), whose annotations the type checker has proved.

They are fetched only then. Where one of them or the C compiler fails, the build fails and says why. The wheel
always gets the tables of `ds47/spec` as JSON too, because TOML takes longer to parse than a small capture to
analyse; an editable install writes them into the sources. DS47_COMPILE_LEVEL=0 tells the C compiler not to
optimise, which takes a fraction of the time: for tests, which ask whether both packages say the same.

`python hatch_build.py FOLDER PART` compiles a part of the copy of `ds47` in FOLDER in place.

The long description of the package is README.md without what leads out of it: an index of packages has neither its
pictures nor the files that it links to.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import zlib
from pathlib import Path
from typing import Any

BYTES = {"scan": "capture/scan"}
RECORD_PATH = (
    "spec/plain", "model", "analysis", "spec/units", "capture/frame", "capture/walk", "capture/pcap",
    "capture/pcapng",
    "profinet/rpc", "profinet/link", "profinet/ip", "profinet/calls", "profinet/records", "profinet/completeness",
    "profinet/stations", "profidrive/model", "profidrive/parameter",
    "profidrive/formats", "profidrive/drive_objects", "report/json",
    "profibus/telegram", "profibus/dp", "profibus/line", "profibus/bus", "profibus/stations",
    "profibus/judge", "cyclic/ppo", "cyclic/channels", "cyclic/timeline", "cyclic/operation", "cyclic/trips",
    "cyclic/handshake", "cyclic/relations", "cyclic/pkw", "cyclic/pzd",
    "acyclic/services", "acyclic/ms1_calls", "acyclic/index47", "acyclic/record_calls",
    "acyclic/record_events", "acyclic/pairing", "acyclic/lines",
    "acyclic/transactions", "acyclic/judge", "acyclic/readback", "acyclic/learning",
    "findings/remark", "findings/times", "findings/collection", "findings/grouping",
    "s7/model", "s7/tcp", "s7/tpkt", "s7/pdu", "s7/jobs", "s7/transfers", "s7/addresses", "s7/consistency",
    "s7/memory", "s7/areas", "s7/notes", "s7/moments", "s7/blocks", "s7/judge", "s7/connections",
    "s7/transactions", "s7/communication", "s7/late",
    "diagnosis/__init__", "diagnosis/capture", "diagnosis/length", "diagnosis/order",
    "diagnosis/refusal", "diagnosis/repair", "diagnosis/repetition",
)  # fmt: skip
READ = (
    "*.py", "capture/*.p*", "profinet/*.p*", "profidrive/*.py", "spec/*.py", "report/__init__.py",
    "report/json.py", "profibus/*.py", "cyclic/*.py", "acyclic/*.py", "findings/*.py", "diagnosis/*.py",
    "s7/*.py",
)  # fmt: skip
"""What the compilers read."""
DIRECTIVES = {
    "language_level": 3,
    "annotation_typing": False,  # the .pxd files have the types, in C
    "boundscheck": False,
    "wraparound": False,
    "initializedcheck": False,
}
MOST_SECONDS = 1800
COMPILERS = ["Cython>=3.1", "mypy>=1.15", "setuptools>=77"]


def level(usual: str) -> str:
    """How much the C compiler optimises, 0 to 3: as usual, or as somebody asks for."""
    return os.environ.get("DS47_COMPILE_LEVEL", usual)


def tables(spec: Path) -> str:
    """The tables of `ds47/spec`, a line for each file: `{"NAME CHECKSUM": CONTENT}`. Nobody needs all of them."""
    lines = []
    for file in sorted(spec.rglob("*.toml")):
        text = file.read_bytes()
        name = file.relative_to(spec).as_posix()
        table = {f"{name} {zlib.crc32(text):08x}": tomllib.loads(text.decode("utf-8"))}
        lines.append(json.dumps(table, ensure_ascii=False, separators=(",", ":")) + "\n")
    return "".join(lines)


def write(spec: Path, target: Path) -> None:
    """Write the tables of `spec` into `target`, at once: another build or a command may be reading it."""
    draft = target.with_name(f"tables-{os.getpid()}.ndjson")
    draft.write_text(tables(spec), encoding="utf-8", newline="\n")
    draft.replace(target)


def digest(sources: Path) -> str:
    """A name for what the compilers would make of the package `sources`."""
    found = hashlib.sha256(f"{sysconfig.get_platform()} {sys.version} {level('')}".encode())
    for pattern in READ:
        for file in sorted(sources.glob(pattern)):
            found.update(file.read_bytes())
    found.update(Path(__file__).read_bytes())
    return found.hexdigest()[:16]


def compiled(sources: Path, work: Path) -> Path:
    """A folder in `work` with the package `sources` and the extension modules made of it.

    That of the same sources is used again: a checkout is often built more than once.

    Raises RuntimeError with the reason where something does not compile.
    """
    folder = work / digest(sources)
    if not folder.exists():
        draft = work / f"draft-{os.getpid()}"
        shutil.copytree(sources, draft / "ds47", ignore=shutil.ignore_patterns("*.so", "*.pyd"))
        try:
            for part in (*BYTES, "record-path"):
                sys.stderr.write(f"ds47: compiling {part}, up to some minutes ...\n")
                command = [sys.executable, __file__, str(draft), part]
                done = subprocess.run(command, capture_output=True, text=True, timeout=MOST_SECONDS)
                if done.returncode:
                    reason = _reason(done.stderr or done.stdout)
                    raise RuntimeError(
                        f"{part} does not compile: {reason}. Without DS47_COMPILE=1 nothing is compiled."
                    )
            shutil.rmtree(draft / "build", ignore_errors=True)
            if not folder.exists():  # else another build was faster
                draft.rename(folder)
        finally:
            shutil.rmtree(draft, ignore_errors=True)
    return folder


def _reason(output: str) -> str:
    lines = [line for line in output.splitlines() if line.strip()]
    errors = [line for line in lines if ": error: " in line]
    return (errors or lines or ["no reason given"])[-1]


def compile_part(folder: Path, part: str) -> None:
    """Compile a part of the package in `folder`, in place. Raises whatever the tools raise."""
    os.chdir(folder)
    from setuptools import Extension, setup

    if part in BYTES:
        from Cython.Build import cythonize

        path = f"ds47/{BYTES[part]}.py"
        module = f"ds47.{BYTES[part].replace('/', '.')}"
        flags = [] if sys.platform == "win32" else [f"-O{level('3')}", "-g0"]
        extension = Extension(module, [path], extra_compile_args=flags)
        extensions = cythonize([extension], compiler_directives=DIRECTIVES, quiet=True)
    else:
        from mypyc.build import mypycify

        paths = [f"ds47/{name}.py" for name in RECORD_PATH]
        os.environ["MYPYPATH"] = str(folder)
        # what else they import is the type checker's business, not the build's
        extensions = mypycify(
            ["--follow-imports=silent", *paths],
            opt_level=level("2"),
            debug_level="0",
            group_name="ds47",
        )
        if sys.platform != "win32":
            # To judge how a line is indented gcc reads the file up to it, and this one has 70 MB.
            for extension in extensions:
                extension.extra_compile_args.append("-Wno-misleading-indentation")
    setup(
        name="ds47-compiled",
        ext_modules=extensions,
        script_args=["--quiet", "build_ext", "--inplace"],
    )


_FENCED = re.compile(r"(^```.*?^```$)", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"\[([^\[\]]*)\]\((?!https?:)([^()\s]*)\)")
_ONLY = re.compile(rf"\({_LINK.pattern}\)")


def long_description(readme: str) -> str:
    """README.md for a reader elsewhere: no pictures, no comments, the names of files instead of links to them."""
    parts = _FENCED.split(re.sub(r"<!--.*?-->\n", "", readme))
    for at in range(0, len(parts), 2):  # what lies between is code
        blocks = (
            block
            for block in parts[at].split("\n\n")
            if "![" not in block and not _LINK.fullmatch(block)
        )
        parts[at] = _LINK.sub(_named, _ONLY.sub(r"(\2)", "\n\n".join(blocks)))
    return "".join(parts)


def _named(link: re.Match[str]) -> str:
    return link[2] if link[1] == link[2] else f"{link[1]} [{link[2]}]"


try:
    from hatchling.builders.hooks.plugin.interface import BuildHookInterface
    from hatchling.metadata.plugin.interface import MetadataHookInterface
except ImportError:  # run as a program, by an interpreter without hatchling
    BuildHookInterface = MetadataHookInterface = object  # type: ignore[assignment,misc]


class CustomMetadataHook(MetadataHookInterface):
    """Sets the long description."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Called by hatchling with the project table of pyproject.toml."""
        text = Path(self.root, "README.md").read_text("utf-8")
        metadata["readme"] = {"content-type": "text/markdown", "text": long_description(text)}


def wanted() -> bool:
    """Whether somebody asked for compiled parts."""
    return os.environ.get("DS47_COMPILE") == "1"


class CustomBuildHook(BuildHookInterface):  # type: ignore[type-arg]
    """Adds extension modules and tables.ndjson to a wheel; an editable install gets the tables alone."""

    def dependencies(self) -> list[str]:
        """What the build needs besides: the compilers, where they are asked for."""
        return COMPILERS if self.target_name == "wheel" and wanted() else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called by hatchling before a wheel is put together."""
        if self.target_name != "wheel":
            return
        sources = Path(self.root, "python", "ds47")
        if version == "editable":
            write(sources / "spec", sources / "spec" / "tables.ndjson")
            return
        work = Path(self.root, "build", "compiled")
        work.mkdir(parents=True, exist_ok=True)
        included = build_data["force_include"]
        if wanted():
            folder = compiled(sources, work)
            suffix = sysconfig.get_config_var("EXT_SUFFIX")
            for file in sorted(folder.rglob(f"*{suffix}")):
                included[str(file)] = file.relative_to(folder).as_posix()
                build_data["pure_python"] = False
                build_data["infer_tag"] = True
        else:
            sys.stderr.write("ds47: plain Python; DS47_COMPILE=1 compiles its hot path\n")
        target = work.with_name("tables.ndjson")
        write(sources / "spec", target)
        included[str(target)] = "ds47/spec/tables.ndjson"


if __name__ == "__main__":
    compile_part(Path(sys.argv[1]).resolve(), sys.argv[2])
