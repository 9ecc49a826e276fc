"""What each library exports, needs and expects of its system, held against what is allowed."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

EXPORT = re.compile(r"\bFMI2_Export\s+\w+\s+(fmi2\w+)\s*;")
WINDOWS_RUNTIME = re.compile(r"(KERNEL32|ucrtbase|api-ms-win-crt-[a-z0-9-]+)\.dll", re.IGNORECASE)
"""System libraries of Windows 10 and newer: the C library is part of the system there."""

ALLOWED_LIBRARIES = {
    "linux64": re.compile(r"(libc|libm|libdl|libpthread|librt)\.so\.\d|ld-linux-x86-64\.so\.2"),
    "aarch64-linux": re.compile(r"(libc|libm|libdl|libpthread|librt)\.so\.\d|ld-linux-aarch64\.so\.1"),
    "win64": WINDOWS_RUNTIME,
    "darwin64": re.compile(r"/usr/lib/libSystem\.B\.dylib"),
}
HIGHEST_BASELINE = {
    "linux64": ("glibc", (2, 17)),
    "aarch64-linux": ("glibc", (2, 17)),
    "win64": ("Windows", (10, 0)),
    "darwin64": ("macOS", (11, 0)),
}
PROCESSORS = {
    "linux64": {"x86_64"},
    "win64": {"x86_64"},
    "darwin64": {"x86_64", "arm64"},
    "aarch64-linux": {"arm64"},
}


@dataclass(frozen=True)
class Image:
    """The library of one processor."""

    platform: str
    processor: str
    exports: tuple[str, ...]
    libraries: tuple[str, ...]
    """Shared libraries that it needs."""
    system: str
    baseline: tuple[int, ...]
    """Oldest version of the system."""
    signed: bool | None
    """Whether a macOS library carries a signature."""
    size: int
    """Bytes of the whole file."""

    @property
    def words(self) -> str:
        """The oldest system, for people."""
        return f"{self.system} {'.'.join(map(str, self.baseline))}"


def functions_of_the_standard(headers: Path) -> set[str]:
    """All functions that FMI 2.0 asks for, from fmi2Functions.h."""
    return set(EXPORT.findall((headers / "fmi2Functions.h").read_text(encoding="utf-8")))


def images(platform: str, library: Path) -> Iterator[Image]:
    """Every processor's part of a library."""
    import lief  # type: ignore[import-not-found,unused-ignore] # in the build's folder alone

    lief.logging.disable()
    size = library.stat().st_size
    if platform == "darwin64":
        whole = lief.MachO.parse(str(library))  # must outlive its parts
        for k in range(whole.size):
            yield _mac(platform, whole.at(k), size)
    elif platform == "win64":
        yield _windows(platform, lief.PE.parse(str(library)), size)
    else:
        yield _linux(platform, lief.ELF.parse(str(library)), size)


def complaints(image: Image, functions: set[str]) -> list[str]:
    """What is wrong with one image; nothing if all is well."""
    found = []
    if missing := sorted(functions - set(image.exports)):
        found.append(f"does not export {', '.join(missing)}")
    if surplus := [name for name in image.exports if name not in functions]:
        found.append(f"exports {', '.join(surplus)}")
    allowed = ALLOWED_LIBRARIES[image.platform]
    if foreign := [name for name in image.libraries if not allowed.fullmatch(name)]:
        found.append(f"needs {', '.join(foreign)}")
    system, highest = HIGHEST_BASELINE[image.platform]
    if image.system != system or image.baseline > highest:
        found.append(f"needs {image.words}, expected at most {system} {'.'.join(map(str, highest))}")
    if image.processor not in PROCESSORS[image.platform]:
        found.append(f"is for {image.processor}")
    if image.platform == "darwin64" and image.processor == "arm64" and not image.signed:
        found.append("is not signed, and Apple's processors run no unsigned code")
    return [f"{image.platform} ({image.processor}) {complaint}" for complaint in found]


def table(rows: list[Image]) -> str:
    """The images as a table in Markdown."""
    lines = [
        "| platform | processor | size | exports | needs | oldest system |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        of = f"{row.platform} | {row.processor} | {row.size / 1e6:.2f} MB"
        ours = sum(name.startswith("fmi2") for name in row.exports)
        other = len(row.exports) - ours
        exports = f"{ours} fmi2*" + (f" and {other} others" if other else ", nothing else")
        needs = ", ".join(_short(row.libraries))
        lines.append(f"| {of} | {exports} | {needs} | {row.words} |")
    return "\n".join(lines)


def _short(libraries: tuple[str, ...]) -> list[str]:
    family = re.compile(r"api-ms-win-crt-.*")
    parts = [name for name in libraries if family.fullmatch(name)]
    rest = [name for name in libraries if name not in parts]
    return rest + ([f"{len(parts)} of api-ms-win-crt-*.dll (C library of Windows)"] if parts else [])


def _linux(platform: str, binary: Any, size: int) -> Image:
    exports = [s.name for s in binary.dynamic_symbols if s.exported and s.name]
    versions = [
        auxiliary.name
        for needed in binary.symbols_version_requirement
        for auxiliary in needed.get_auxiliary_symbols()
    ]
    numbers = [
        tuple(map(int, name.removeprefix("GLIBC_").split("."))) for name in versions if "GLIBC_" in name
    ]
    return Image(
        platform,
        {"X86_64": "x86_64", "AARCH64": "arm64"}[binary.header.machine_type.name],
        tuple(sorted(exports)),
        tuple(binary.libraries),
        "glibc",
        max(numbers),
        None,
        size,
    )


def _windows(platform: str, binary: Any, size: int) -> Image:
    libraries = tuple(sorted((entry.name for entry in binary.imports), key=str.lower))
    header = binary.optional_header
    declared = (header.major_subsystem_version, header.minor_subsystem_version)
    own_c_library = any(name.lower().startswith(("api-ms-win-crt", "ucrtbase")) for name in libraries)
    return Image(
        platform,
        {"AMD64": "x86_64", "ARM64": "arm64"}[binary.header.machine.name],
        tuple(sorted(entry.name for entry in binary.get_export().entries)),
        libraries,
        "Windows",
        max(declared, (10, 0)) if own_c_library else declared,
        None,
        size,
    )


def _mac(platform: str, binary: Any, size: int) -> Image:
    table = binary.dyld_info if binary.has_dyld_info else binary.dyld_exports_trie
    exports = [export.symbol.name.removeprefix("_") for export in table.exports]
    return Image(
        platform,
        {"X86_64": "x86_64", "ARM64": "arm64"}[binary.header.cpu_type.name],
        tuple(sorted(exports)),
        tuple(sorted(library.name for library in binary.libraries if library.command.name == "LOAD_DYLIB")),
        "macOS",
        tuple(binary.build_version.minos[:2]),
        binary.has_code_signature,
        size,
    )
