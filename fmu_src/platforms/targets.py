"""The platforms, and the compiler's name for each."""

from dataclasses import dataclass

ZIGLANG = "ziglang==0.17.1"
"""The cross compiler: clang, libc++, compiler-rt and the targets' C libraries in one package."""

LIEF = "lief==1.0.0"
"""Reads libraries of every format."""


@dataclass(frozen=True)
class Target:
    """One library to compile."""

    name: str
    triple: str
    platform: str
    """Folder in the archive."""
    library: str


TARGETS = (
    Target("linux64", "x86_64-linux-gnu.2.17", "linux64", "MixedOrderGame.so"),
    Target("win64", "x86_64-windows-gnu", "win64", "MixedOrderGame.dll"),
    Target("darwin64-x86_64", "x86_64-macos.11.0", "darwin64", "MixedOrderGame.dylib"),
    Target("darwin64-arm64", "aarch64-macos.11.0", "darwin64", "MixedOrderGame.dylib"),
    Target("aarch64-linux", "aarch64-linux-gnu.2.17", "aarch64-linux", "MixedOrderGame.so"),
)


class PlatformError(Exception):
    """A step that cannot be done; the text says what was expected and what to do."""
