"""Pages that are made with every build of the site: commands, components, library, notebook, gallery, changes.

mkdocs calls the functions that begin with `on_` (mkdocs.yml, `hooks`).
"""

import inspect
import io
import os
import re
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from rich.console import Console

import gallery
import notebooks
import reference

WIDTH = 80
"""Width of the commands' help [characters]."""


def commands_page() -> str:
    """Return every command with its options, as `--help` prints it, in Markdown."""
    from trihedron.tools.cli import app

    lines = [
        "# Commands",
        "",
        "The texts of `--help`, made from the code. Every command has `--quiet`; exit status: 0 the work was done, "
        "with any verdict, 2 the input cannot be used (one line names why), 1 a fault of the program, 130 "
        "interrupted.",
        "",
    ]
    for name in sorted(name for name in app if not name.startswith("-")):
        lines += [f"## {name}", "", "```text", help_text(app, name), "```", ""]
    return "\n".join(lines)


def help_text(app: Any, name: str, width: int = WIDTH) -> str:
    """Return the output of `trihedron NAME --help`, without colours."""
    file = io.StringIO()
    app.help_print([name], console=Console(file=file, width=width, no_color=True, force_terminal=False))
    return "\n".join(line.rstrip() for line in file.getvalue().strip().splitlines())


def api_page() -> str:
    """Return the library in Markdown: signatures and docstrings."""
    import trihedron

    lines = ["# From Python", "", "`import trihedron as th`; made from the docstrings.", ""]
    for name in trihedron.__all__:
        thing = getattr(trihedron, name)
        if not (inspect.isfunction(thing) or inspect.isclass(thing)):
            continue
        lines += [f"## th.{name}", "", *definition(name, thing), *docstring_lines(inspect.getdoc(thing) or ""), ""]
    lines += [
        "## Results",
        "",
        "Results of the functions. Fields are the keys of the JSON, in SI units except where a name says otherwise.",
        "",
    ]
    for result in result_classes():
        lines += [f"### {result.__name__}", "", *class_lines(result), ""]
    return "\n".join(lines)


def result_classes() -> list[Any]:
    """Return every class of results that has a page, and its parts behind it."""
    from trihedron import tools
    from trihedron.tools.reports import PAGES
    from trihedron.tools.result import Result

    for module in walk_packages(tools.__path__, f"{tools.__name__}."):
        if not module.name.endswith("__main__"):
            import_module(module.name)
    by_name = {kind.__name__: kind for kind in subclasses(Result)}
    documented: dict[str, Any] = {}

    def add(kind: Any) -> None:
        documented[kind.__name__] = kind
        for field in kind.model_fields.values():
            if field.exclude:
                continue
            for part in parts_of(field.annotation):
                if issubclass(part, Result) and part.__name__ not in documented:
                    add(part)

    for name in PAGES:
        add(by_name[name])
    return list(documented.values())


def subclasses(kind: Any) -> list[Any]:
    """Return all subclasses of a class."""
    below = []
    for subclass in kind.__subclasses__():
        below.append(subclass)
        below.extend(subclasses(subclass))
    return below


def parts_of(annotation: Any) -> list[Any]:
    """Return the classes in an annotation: alone, in lists, in unions."""
    if isinstance(annotation, type) and not get_args(annotation):
        return [annotation]
    return [part for inner in get_args(annotation) for part in parts_of(inner)]


def class_lines(kind: Any) -> list[str]:
    """Return a class of results in Markdown: its docstring, and its published fields with types and units."""
    head, *sections = re.split(r"\n\n(?=\w+\n-{3,}\n)", inspect.getdoc(kind) or "")
    said: dict[str, str] = {}
    for section in sections:
        for names, text in re.findall(r"(?m)^([\w, ]+?)(?: :.*)?\n((?:    .*\n?)+)", section):
            said |= dict.fromkeys(names.split(", "), " ".join(text.split()))
    units = kind.model_fields["units"].default if "units" in kind.model_fields else {}
    lines = [head, "", "| Field | Type | |", "|---|---|---|"]
    for name, field in kind.model_fields.items():
        if not field.exclude:
            key, told = field.alias or name, said.get(name, "")
            unit = f" [{units[key]}]" if key in units and not told.endswith("]") else ""
            row = (f"`{key}`", f"`{type_text(field.annotation)}`", f"{told}{unit}")
            lines.append("| " + " | ".join(text.replace("|", "\\|") for text in row) + " |")
    return lines


def type_text(annotation: Any) -> str:
    """Return a type in words."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return type_text(parts[0])
    if origin is Literal:
        return " or ".join(map(repr, parts))
    if origin in (Union, UnionType):
        return " or ".join(type_text(part) for part in parts)
    name = "None" if annotation is type(None) else getattr(origin or annotation, "__name__", str(annotation))
    return name + (f"[{', '.join('...' if part is ... else type_text(part) for part in parts)}]" if parts else "")


def definition(name: str, thing: Any) -> list[str]:
    """Return the call, with the parameters' names and defaults."""
    if inspect.isclass(thing):
        return []
    signature = inspect.signature(thing)
    bare = [p.replace(annotation=inspect.Parameter.empty) for p in signature.parameters.values()]
    call = f"th.{name}{signature.replace(parameters=bare, return_annotation=inspect.Signature.empty)}"
    return ["```text", call, "```", ""]


def docstring_lines(text: str) -> list[str]:
    """Return a numpydoc docstring as Markdown: sections in bold, parameters as a list."""
    lines: list[str] = []
    section = ""
    rows = text.splitlines()
    k = 0
    while k < len(rows):
        row = rows[k]
        if k + 1 < len(rows) and rows[k + 1].strip() and set(rows[k + 1].strip()) == {"-"}:
            section = row.strip()
            lines += ["", f"**{section}**", ""]
            if section == "Examples":
                lines += ["```text", *(r for r in rows[k + 2 :] if r.strip()), "```"]
                return [re.sub(r"  # doctest: .*", "", line) for line in lines]
            k += 2
            continue
        if not section:
            lines.append(row)
        elif row and not row.startswith(" "):
            lines.append(f"- `{row.strip()}`  ")
        elif row.strip():
            lines.append(f"  {row.strip()}")
        k += 1
    return lines


def changes_page() -> str:
    """Return the changelog with links as seen from the folder of pages."""
    text = (Path(__file__).resolve().parents[2] / "CHANGELOG.md").read_text(encoding="utf-8")
    return text.replace("](docs/", "](")


def on_files(files: Any, config: Any) -> Any:
    """Add the pages to those of the folder; TRIHEDRON_SITE=quick leaves out slow ones, for tests."""
    from mkdocs.structure.files import File

    quick = os.environ.get("TRIHEDRON_SITE") == "quick"
    notebook = Path(config.docs_dir) / "first-look.ipynb"
    made = {
        "commands.md": commands_page(),
        "api.md": api_page(),
        "first-look.md": notebooks.page_of(notebook, execute=not quick),
        "gallery.md": gallery.gallery_page(),
        "changes.md": changes_page(),
        "components.md": reference.components_page(),
        **dict(gallery.pages(quick=quick)),
    }
    for name, text in made.items():
        files.append(File.generated(config, name, content=text))
    return files
