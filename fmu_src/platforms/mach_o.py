"""What the linker leaves undone for macOS: exports of fmi2* alone, and one file for both processors."""

import hashlib
import struct
from collections.abc import Iterable, Mapping
from os.path import commonprefix

from .targets import PlatformError

PAGE_OF_SLICE = 14
"""Slices begin on pages of 2**14 bytes, the largest of any processor."""

MAGIC = 0xFEEDFACF
LC_DYLD_INFO_ONLY = 0x80000022
LC_DYLD_EXPORTS_TRIE = 0x80000033
LC_CODE_SIGNATURE = 0x1D
CODE_DIRECTORY = 0xFADE0C02
SHA256_HASH = 2
MORE = 0x80
"""Bit of a ULEB128 number's bytes: another one follows."""


def keep_exports(library: bytes, prefix: str) -> bytes:
    """The library of one processor with only those exported symbols whose names begin with `prefix`.

    The table of exports is written anew in its place and the hashes of an ad-hoc signature follow. Raises
    PlatformError if the file is not laid out as expected.
    """
    image = bytearray(library)
    magic, _, _, _, commands = struct.unpack_from("<5I", image)
    if magic != MAGIC:
        raise PlatformError("a 64-bit Mach-O library was expected")
    trie_fields = signature = None
    at = 32
    for _ in range(commands):
        command, size = struct.unpack_from("<2I", image, at)
        if command == LC_DYLD_INFO_ONLY:
            trie_fields = at + 40
        elif command == LC_DYLD_EXPORTS_TRIE:
            trie_fields = at + 8
        elif command == LC_CODE_SIGNATURE:
            signature = struct.unpack_from("<I", image, at + 8)[0]
        at += size
    if trie_fields is None:
        raise PlatformError("the library has no table of exports")
    offset, size = struct.unpack_from("<2I", image, trie_fields)
    exports = _read_trie(bytes(image[offset : offset + size]))
    kept = {name: value for name, value in exports.items() if name.startswith(prefix)}
    trie = _trie(kept)
    if not kept or len(trie) > size:
        raise PlatformError(f"the table of {len(kept)} exports does not fit into {size} bytes")
    image[offset : offset + size] = trie.ljust(size, b"\0")
    if signature is not None:
        _sign_again(image, signature)
    return bytes(image)


def universal(slices: Iterable[bytes]) -> bytes:
    """One file of several processors: a header of big-endian numbers, and the slices behind it."""
    slices = list(slices)
    page = 1 << PAGE_OF_SLICE
    result = bytearray(struct.pack(">2I", 0xCAFEBABE, len(slices)))
    offset = page
    for image in slices:
        processor, variant = struct.unpack_from("<2I", image, 4)
        result += struct.pack(">5I", processor, variant, offset, len(image), PAGE_OF_SLICE)
        offset = -(-(offset + len(image)) // page) * page
    for image in slices:
        result += bytes(-len(result) % page) + image
    return bytes(result)


def _number(data: bytes, at: int) -> tuple[int, int]:
    """A ULEB128 number, and the position behind it."""
    value = shift = 0
    while True:
        value |= (data[at] % MORE) << shift
        shift += 7
        at += 1
        if data[at - 1] < MORE:
            return value, at


def _uleb128(value: int) -> bytes:
    result = bytearray()
    while value >= MORE:
        result.append(value % MORE + MORE)
        value >>= 7
    return bytes([*result, value])


def _read_trie(data: bytes) -> dict[str, bytes]:
    """Exported names with what the table says of each."""
    found = {}
    waiting = [(0, "")]
    while waiting:
        node, name = waiting.pop()
        length, at = _number(data, node)
        if length:
            found[name] = data[at : at + length]
        at += length
        children, at = data[at], at + 1
        for _ in range(children):
            end = data.index(0, at)
            child, following = _number(data, end + 1)
            waiting.append((child, name + data[at:end].decode()))
            at = following
    return found


class _Node:
    def __init__(self, names: Mapping[str, bytes]) -> None:
        self.value = names.get("", b"")
        self.children = []
        rest = sorted(name for name in names if name)
        while rest:
            group = [name for name in rest if name[0] == rest[0][0]]
            edge = commonprefix(group)  # noqa: RUF071 (characters are meant)
            self.children.append((edge, _Node({name[len(edge) :]: names[name] for name in group})))
            rest = rest[len(group) :]
        self.offset = 0

    def all(self) -> Iterable["_Node"]:
        yield self
        for _, child in self.children:
            yield from child.all()

    def encoded(self) -> bytes:
        edges = (edge.encode() + b"\0" + _uleb128(child.offset) for edge, child in self.children)
        return _uleb128(len(self.value)) + self.value + bytes([len(self.children)]) + b"".join(edges)


def _trie(names: Mapping[str, bytes]) -> bytes:
    nodes = list(_Node(names).all())
    while True:  # offsets change their own lengths
        position = 0
        moved = False
        for node in nodes:
            moved = moved or node.offset != position
            node.offset = position
            position += len(node.encoded())
        if not moved:
            return b"".join(node.encoded() for node in nodes)


def _sign_again(image: bytearray, signature: int) -> None:
    """Hash every page of a library whose ad-hoc signature stands at `signature`."""
    _, _, count = struct.unpack_from(">3I", image, signature)
    blobs = [struct.unpack_from(">2I", image, signature + 12 + 8 * k)[1] for k in range(count)]
    for at in (signature + offset for offset in blobs):
        if struct.unpack_from(">I", image, at)[0] != CODE_DIRECTORY:
            continue
        hashes, _, _, slots, limit = struct.unpack_from(">5I", image, at + 16)
        hash_size, hash_type, _, page_shift = struct.unpack_from("4B", image, at + 36)
        if hash_type != SHA256_HASH:
            raise PlatformError("the signature of the library has an unknown hash")
        page = 1 << page_shift
        for slot in range(slots):
            content = image[slot * page : min((slot + 1) * page, limit)]
            start = at + hashes + slot * hash_size
            image[start : start + hash_size] = hashlib.sha256(content).digest()
