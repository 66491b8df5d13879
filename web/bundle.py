"""Joins the page's modules and styles when a wheel is built, so a first visit takes few requests.

In a clone, the modules are served unchanged. The modules of the drive screen become one file, and
those of the other screens a second file. Each further folder and each worker gets a file of its
own; small folders share a file, because each file costs a request and is compressed separately.
Each file's name begins with a hash of its content, so a browser may cache it indefinitely. Comments
and indentation are removed.

Modules may use only imports by `{names}` or of a default, and exports at the declaration. They must
not use `await` outside functions, or `export let`. An error names each form that is not allowed.
"""

from __future__ import annotations

import hashlib
import json
import posixpath
import re
import shutil
from functools import cache
from pathlib import Path

ENTRY = "js/main.js"
_SMALL = 6000
"""Number of characters below which a folder has no file of its own."""
_ICONS = (".png", ".svg", ".webmanifest")
STYLES = ("base.css", "drive.css", "screens.css")
_BLOCK = r"/\*(?:[^*]|\*(?!/))*\*/"
_COMMENT = re.compile(
    rf"^[ \t]*(?://[^\n]*|{_BLOCK}[ \t]*)\n|/\*(?=\*)(?:[^*\n]|\*(?!/))*\*/ ?", re.M
)
_TRAILING = re.compile(r"[ \t]+// [^\n'\"`]*$", re.M)
_INDENT = re.compile(r"^[ \t]+|\n(?=\n)", re.M)
_IMPORT = re.compile(r"^import (?:(?:\{([^}]*)\}|(\w+)) from )?'([^']+)';\n", re.M)
_EXPORT = re.compile(r"^export (default|(?:async )?function|class|const) ?(\w*)", re.M)
_DYNAMIC = re.compile(r"\bimport\(([^()]*)\)")
_WORKER = re.compile(r"new Worker\('([^']+)', \{ type: 'module' \}\)")
_CSS_COMMENT = re.compile(r"/\*.*?\*/", re.S)
_HTML_COMMENT = re.compile(r"<!--.*?-->\n?", re.S)
_CSS_SPACE = re.compile(r"\s*([{};])\s*|(?<=[:,]) ")
_SENTENCE = re.compile(r"^  (\S+): '(?:[^'\\]|\\.)*',\n", re.M)


class JoinError(ValueError):
    """A module contains code that cannot be joined."""


def bundle(folder: Path, target: Path) -> None:
    """Write the page of one folder to another folder, joined; other files are copied.

    The file `shell.json` lists what the service worker caches after the first visit.
    """
    shutil.copytree(folder, target, ignore=shutil.ignore_patterns("*.py", "__pycache__"))
    joiner = _Joiner(folder)
    style = "\n".join((folder / "css" / name).read_text("utf-8") for name in STYLES)
    style = _CSS_SPACE.sub(r"\1", _CSS_COMMENT.sub("", style)).strip() + "\n"
    languages = {
        path.stem: joiner.add(f"js/{path.name}", joiner.messages(path.name))
        for path in sorted((folder / "js/messages").glob("*.js"))
    }
    html = shrink(_HTML_COMMENT.sub("", (folder / "index.html").read_text("utf-8")))
    for place, put in {
        "'css/page.css'": f"'{joiner.add('css/page.css', style)}'",
        f"'{ENTRY}'": f"'{joiner.entry(languages)}'",
        "{/* messages */}": json.dumps(languages),
    }.items():
        html = html.replace(place, put)
    (target / "index.html").write_text(html, "utf-8")
    for name, data in joiner.files.items():
        (target / name).write_bytes(data)
    icons = sorted(path for path in folder.rglob("*") if path.suffix in _ICONS)
    shell = ["./", *joiner.files]
    shell += [path.relative_to(folder).as_posix() for path in icons]
    (target / "shell.json").write_text(json.dumps(shell), "utf-8")


def shrink(source: str) -> str:
    """Return a module without its comments and indentation."""
    return _INDENT.sub("", _TRAILING.sub("", _COMMENT.sub("", source))).strip() + "\n"


class _Joiner:
    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._source = cache(self._read)
        self.files: dict[str, bytes] = {}

    def add(self, name: str, text: str) -> str:
        """Add a file, named by its content; return its address."""
        data, (kind, base) = text.encode(), name.split("/")
        address = f"{kind}/{hashlib.sha256(data).hexdigest()[:10]}-{base}"
        self.files[address] = data
        return address

    def messages(self, name: str) -> str:
        """Return a language's sentences for the core and for the extensions.

        Sentences that the language lacks are in English, so the page needs only this file.
        """
        return self._sentences(name, "messages", "*/messages")

    def _later_messages(self, name: str) -> str:
        """Return the sentences in subfolders, which are fetched after the first picture.

        Sentences that the language lacks are in English here, too.
        """
        return self._sentences(name, "*/*/messages")

    def _sentences(self, name: str, *folders: str) -> str:
        sentences = dict[str, str]()
        for each in dict.fromkeys(("en.js", name)):
            for folder in folders:
                for path in sorted((self._folder / "js").glob(f"{folder}/{each}")):
                    found = _SENTENCE.finditer(path.read_text("utf-8"))
                    sentences |= {sentence[1]: sentence[0] for sentence in found}
        return shrink(f"export default {{\n{''.join(sentences.values())}}};\n")

    def entry(self, languages: dict[str, str]) -> str:
        """Join all modules; return the address of the first file."""
        known = self._closure([ENTRY])
        addresses = dict[str, list[str]]()
        for code, first in languages.items():
            name = f"{code}.js"
            later = self.add(f"js/later-{name}", self._later_messages(name))
            # If a language lacks a file, the file's address gives the English sentences.
            for path in sorted((self._folder / "js").rglob("messages/en.js")):
                module = path.with_name(name).relative_to(self._folder).as_posix()
                addresses[module] = [_beside(first if module.count("/") < 4 else later)]
        start, homes = self._text(known), dict[str, list[str]]()
        rooms = [path for path in (self._folder / "js").iterdir() if path.is_dir()]
        small: list[str] = []
        for room in sorted(rooms, key=lambda path: (path.name != "components", path.name)):
            below = [f"js/{room.name}/{path.name}" for path in sorted(room.glob("*.js"))]
            modules = [module for module in self._closure(below) if module not in known]
            if room.name == "messages" or not modules:
                continue
            if len(self._text(modules)) < _SMALL:
                small += below
                continue
            name = "screens" if room.name == "components" else room.name
            self._file(name, modules, addresses, homes)
            known += modules
        if modules := [module for module in self._closure(small) if module not in known]:
            self._file("small", modules, addresses, homes)
        fetched = re.compile("|".join(map(_pattern, self._fetched())))
        asked = {path: each for path, each in addresses.items() if fetched.fullmatch(path)}
        urls = [*dict.fromkeys(url for each in asked.values() for url in each)]
        places = {module: [*map(urls.index, each)] for module, each in asked.items()}
        loading = (
            f"const $urls = {json.dumps(urls)}, $files = {json.dumps(places)};\n"
            "if (globalThis.joined) throw new Error('the page is there already');\n"
            "const $m = {}, $tries = {};\n"
            "const $load = async (path) => {\nlet got;\n"
            "for (const url of $files[path].map((i) => $urls[i])) {\n"
            "got = await import($tries[url] ? `${url}?${$tries[url]}` : url).catch((error) => {\n"
            "$tries[url] = ($tries[url] || 0) + 1;\nthrow error;\n});\n}\n"
            "return $m[path] || got;\n};\n"
            "globalThis.joined = { modules: $m, load: $load };\n"
        )
        return self.add("js/drive.js", loading + start)

    def _file(
        self,
        name: str,
        modules: list[str],
        addresses: dict[str, list[str]],
        homes: dict[str, list[str]],
    ) -> None:
        """Join modules in a file, and note the files that each of them needs, in order."""
        text = "const { modules: $m, load: $load } = globalThis.joined;\n"
        own = _beside(self.add(f"js/{name}.js", text + self._text(modules)))
        # List the earlier files that contain imported modules, and then this file.
        wanted = [homes[m] for m in self._closure(modules) if m in homes]
        needed = [*dict.fromkeys(each for home in wanted for each in home), own]
        addresses |= dict.fromkeys(modules, needed)
        homes |= dict.fromkeys(modules, needed)

    def _fetched(self) -> set[str]:
        """Return the paths of the dynamic imports; `${name}` stands for any name."""
        return {
            _resolve(module, path[1:-1])
            for file in (self._folder / "js").rglob("*.js")
            for module in [file.relative_to(self._folder).as_posix()]
            for path in _DYNAMIC.findall(self._source(module))
        }

    def _worker(self, module: str) -> str:
        text = self._text(self._closure([module]))
        return self.add(
            f"js/{posixpath.basename(module)}", f"'use strict';\nconst $m = {{}};\n{text}"
        )

    def _read(self, module: str) -> str:
        try:
            source = (self._folder / module).read_text("utf-8")
        except FileNotFoundError:
            raise JoinError(f"no module {module}: is its import spelt right?") from None
        if found := re.search(r"^await .*", source, re.M):
            raise JoinError(f"{module}: cannot join {found[0]!r}: `await` is outside functions")
        return shrink(source)

    def _closure(self, wanted: list[str]) -> list[str]:
        """Return modules and their imports, in order of evaluation."""
        done: list[str] = []
        begun: set[str] = set()

        def visit(module: str) -> None:
            if module not in begun:
                begun.add(module)
                for _, _, path in _IMPORT.findall(self._source(module)):
                    visit(_resolve(module, path))
                done.append(module)

        for module in wanted:
            visit(module)
        return done

    def _text(self, modules: list[str]) -> str:
        return "".join(self._block(module) for module in modules)

    def _block(self, module: str) -> str:
        """Return one module as a block that puts its exports into the table of modules."""
        source = self._source(module)
        exports: dict[str, str] = {}

        def take(found: re.Match[str]) -> str:
            names, default, path = found.groups()
            if not names and not default:
                return ""
            picked = [part.strip().replace(" as ", ": ") for part in (names or "").split(",")]
            wanted = [f"default: {default}"] if default else filter(None, picked)
            return f"const {{ {', '.join(wanted)} }} = $m['{_resolve(module, path)}'];\n"

        def give(found: re.Match[str]) -> str:
            kind, name = found.groups()
            exports["default" if kind == "default" else name] = name or "$default"
            return "const $default = " if kind == "default" else f"{kind} {name}"

        def load(found: re.Match[str]) -> str:
            quote, path = found[1][0], found[1][1:-1]
            if quote not in "'`" or not path.startswith("."):
                raise JoinError(f"{module}: cannot join {found[0]!r}")
            target = _resolve(module, path)
            if "${" not in path:
                self._source(target)  # refuses a path that is spelt wrong
            return f"$load({quote}{target}{quote})"

        source = _EXPORT.sub(give, _IMPORT.sub(take, source))
        source = _DYNAMIC.sub(load, source)
        source = _WORKER.sub(lambda found: f"new Worker('{self._worker(found[1])}')", source)
        if left := re.search(r"^(?:import|export) .*", source, re.M):
            raise JoinError(f"{module}: cannot join {left[0]!r}")
        pairs = (name if name == own else f"{name}: {own}" for name, own in exports.items())
        given = ", ".join(pairs)
        return f"{{\n{source}$m['{module}'] = {{ {given} }};\n}}\n"


def _pattern(path: str) -> str:
    """Return the regular expression of the modules that an import by this path may mean."""
    return r"[\w-]+".join(map(re.escape, re.split(r"\$\{\w+\}", path)))


def _beside(address: str) -> str:
    """Return the address by which a file in the same folder imports it."""
    return f"./{posixpath.basename(address)}"


def _resolve(module: str, path: str) -> str:
    return posixpath.normpath(posixpath.join(posixpath.dirname(module), path))
