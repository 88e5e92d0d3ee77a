#!/usr/bin/env python3
"""Refuses dependencies between folders that docs/architecture.md does not list (run by ctest).

usage: check_layers.py [ROOT]

Two things are held against the table "Folders and layers": what a folder's files #include, and
what its plumb_add_module() links. A folder may use what its row lists and what those folders may
use in turn; a third party only where the row itself lists it, but for Eigen, which is part of
geometry's interface. A header that shows a third party hands it to everyone who includes it. Exit
status 1 and one line a violation if there is any.
"""
import pathlib
import re
import sys

TABLE_ROW = re.compile(r"^\|\s*`([\w/]+)`\s*\|[^|]*\|([^|]*)\|\s*$", re.M)
INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*([<"])([^>"]+)[>"]', re.M)
MODULE = re.compile(r"plumb_add_module\(\s*(\w+)(.*?)\)", re.S)
SOURCE_SUFFIXES = {".h", ".cc", ".c", ".cpp", ".hpp"}

# Name in the table -> how its headers and its CMake targets start.
THIRD_PARTIES = {
    "Eigen": (("Eigen/", "unsupported/Eigen/"), ("Eigen3::",)),
    "Ceres": (("ceres/",), ("Ceres::", "ceres")),
    "OpenCV": (("opencv2/", "opencv/"), ("opencv_", "OpenCV")),
    "Vulkan": (("vulkan/", "volk.h", "vk_mem_alloc"), ("Vulkan::", "volk", "plumb_volk")),
    "JSON": (("nlohmann/",), ("nlohmann_json",)),
    "xxHash": (("xxhash.h", "xxh3.h"), ("xxhash", "xxHash::")),
}
INHERITED = {"Eigen"}  # third parties in the interface of a folder


def third_party(name, kind):
    """The third party of a header (kind 0) or a CMake target (kind 1), or None."""
    matches = (party for party, starts in THIRD_PARTIES.items() if name.startswith(starts[kind]))
    return next(matches, None)


class Table:
    """The rows of docs/architecture.md."""

    def __init__(self, text):
        self.uses = {}  # folder -> names in its last column
        for path, cell in TABLE_ROW.findall(text):
            names = {re.sub(r"[`*]", "", name).strip() for name in cell.split(",")} - {""}
            if any(name.startswith("everything") for name in names):
                parties = set().union(*self.uses.values()) & set(THIRD_PARTIES)
                names = set(self.uses) | parties
            self.uses[path.split("/")[-1]] = names

    def unknown_names(self):
        known = set(self.uses) | set(THIRD_PARTIES) | {"nothing"}
        return [(folder, name) for folder, names in self.uses.items() for name in names - known]

    def folders(self, folder):
        """Folders that `folder` may use, itself and the indirect ones included."""
        found, todo = set(), [folder]
        while todo:
            name = todo.pop()
            if name in self.uses and name not in found:
                found.add(name)
                todo.extend(self.uses[name])
        return found

    def third_parties(self, folder):
        inherited = set().union(*(self.uses[name] for name in self.folders(folder))) & INHERITED
        return (self.uses.get(folder, set()) & set(THIRD_PARTIES)) | inherited


class Sources:
    """Every first-party file, the folder it belongs to, and what it includes."""

    def __init__(self, root):
        self.includes, self.folder_of, self.by_name = {}, {}, {}
        for base in ("src", "runtime/src", "runtime/include", "shaders"):
            for path in sorted((root / base).rglob("*")):
                if path.suffix not in SOURCE_SUFFIXES:
                    continue
                shown = path.relative_to(root).as_posix()
                top = shown.split("/")[0]
                name = shown if top == "shaders" else path.relative_to(root / base).as_posix()
                self.folder_of[shown] = name.split("/")[1] if top == "src" else top
                self.includes[shown] = INCLUDE.findall(path.read_text(errors="replace"))
                self.by_name[name] = shown

    def shown_parties(self, path, seen=None):
        """Third parties that including `path` brings in, with the header that shows each."""
        seen = set() if seen is None else seen
        if path in seen:
            return {}
        seen.add(path)
        parties = {}
        for _, target in self.includes[path]:
            party = third_party(target, 0)
            if party:
                parties.setdefault(party, path)
            elif target in self.by_name:
                for name, header in self.shown_parties(self.by_name[target], seen).items():
                    parties.setdefault(name, header)
        return parties


def include_errors(table, sources):
    for path, includes in sources.includes.items():
        folder = sources.folder_of[path]
        if folder not in table.uses:
            yield f"{path}: folder {folder} has no row in docs/architecture.md"
            continue
        for quote, target in includes:
            if quote == '"' and target in sources.by_name:
                other = sources.folder_of[sources.by_name[target]]
                if other not in table.folders(folder):
                    yield f'{path}: {folder} must not use {other} (#include "{target}")'
            elif quote == '"' and not (folder == "shaders" or is_elsewhere(target)):
                yield f'{path}: #include "{target}" is no file of src, runtime or shaders'
        for party, header in sources.shown_parties(path).items():
            if party not in table.third_parties(folder):
                through = "" if header == path else f" (through {header})"
                yield f"{path}: {folder} must not use {party}{through}"


def is_elsewhere(target):
    """Third parties, and what the build generates."""
    return third_party(target, 0) is not None or target.endswith(".inc")


def link_errors(table, root):
    lists = [*root.glob("src/**/CMakeLists.txt"), *root.glob("runtime/**/CMakeLists.txt")]
    for path in sorted(lists):
        shown = path.relative_to(root).as_posix()
        text = re.sub(r"#[^\n]*", "", path.read_text())
        for module, body in MODULE.findall(text):
            if module not in table.uses:
                yield f"{shown}: module {module} has no row in docs/architecture.md"
                continue
            links = re.split(r"\b(?:PUBLIC|PRIVATE)\b", body, maxsplit=1)[1:]
            for target in re.findall(r"[\w:]+", links[0]) if links else []:
                other = target.removeprefix("plumb::")
                party = third_party(target, 1)
                if other != target and other not in table.folders(module):
                    yield f"{shown}: {module} must not link {target}"
                if party and party not in table.third_parties(module):
                    yield f"{shown}: {module} must not link {target} ({party})"


def check(root):
    """All violations below the directory `root`, as text."""
    table = Table((root / "docs/architecture.md").read_text())
    if not table.uses:
        return ["docs/architecture.md: no table of folders"]
    errors = [f"docs/architecture.md: row {folder} lists {name}, no folder or third party"
              for folder, name in table.unknown_names()]
    sources = Sources(root)
    if not sources.includes:
        errors.append("no sources found")
    return errors + list(include_errors(table, sources)) + list(link_errors(table, root))


def main():
    here = pathlib.Path(__file__).resolve().parent.parent
    errors = check(pathlib.Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else here)
    print("\n".join(errors) if errors else "layers: every dependency is in docs/architecture.md")
    return bool(errors)


if __name__ == "__main__":
    sys.exit(main())
