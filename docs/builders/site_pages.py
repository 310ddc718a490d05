"""Pages of the documentation that are made from the code whenever the site is built: commands, and the library.

mkdocs calls the functions that begin with `on_` (mkdocs.yml, `hooks`).
"""

import inspect
import io
import re
from typing import Any

from rich.console import Console

WIDTH = 100
"""Of the commands' help, in letters."""


def commands_page() -> str:
    """Every command with its options, as `--help` prints it, in Markdown."""
    from trihedron.tools.cli import app

    lines = [
        "# Commands",
        "",
        "As `--help` says it; made from the code. Every command has `--quiet`; exit status: 0 the work was done, "
        "whatever the verdict, 2 the input cannot be used (said in one line), 1 a fault of the program, 130 "
        "interrupted.",
        "",
    ]
    for name in sorted(name for name in app if not name.startswith("-")):
        lines += [f"## {name}", "", "```text", help_text(app, name), "```", ""]
    return "\n".join(lines)


def help_text(app: Any, name: str) -> str:
    """What `trihedron NAME --help` prints, without colours."""
    file = io.StringIO()
    app.help_print([name], console=Console(file=file, width=WIDTH, no_color=True, force_terminal=False))
    return "\n".join(line.rstrip() for line in file.getvalue().strip().splitlines())


def api_page() -> str:
    """What `import trihedron as th` offers, in Markdown: signatures and docstrings."""
    import trihedron

    lines = ["# From Python", "", "`import trihedron as th`; made from the docstrings.", ""]
    for name in trihedron.__all__:
        thing = getattr(trihedron, name)
        if not (inspect.isfunction(thing) or inspect.isclass(thing)):
            continue
        lines += [f"## th.{name}", "", *definition(name, thing), *docstring_lines(inspect.getdoc(thing) or ""), ""]
    return "\n".join(lines)


def definition(name: str, thing: Any) -> list[str]:
    """The call, with the parameters' names and defaults."""
    if inspect.isclass(thing):
        return []
    signature = inspect.signature(thing)
    bare = [p.replace(annotation=inspect.Parameter.empty) for p in signature.parameters.values()]
    call = f"th.{name}{signature.replace(parameters=bare, return_annotation=inspect.Signature.empty)}"
    return ["```text", call, "```", ""]


def docstring_lines(text: str) -> list[str]:
    """A numpydoc docstring as Markdown: sections in bold, parameters as a list."""
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


def on_files(files: Any, config: Any) -> Any:
    """Add the pages to those of the folder."""
    from mkdocs.structure.files import File

    for name, text in (("commands.md", commands_page()), ("api.md", api_page())):
        files.append(File.generated(config, name, content=text))
    return files


def on_post_page(output: str, page: Any, config: Any) -> str:
    """A page without the script that the theme would fetch from elsewhere, to search in files on the disk."""
    return without_foreign_scripts(output)


def on_post_template(output_content: str, template_name: str, config: Any) -> str:
    """The same of pages that are not in the folder, as the one for what is not found."""
    return without_foreign_scripts(output_content)


def without_foreign_scripts(text: str) -> str:
    """HTML without scripts of other places."""
    return re.sub(r'<script src="https://[^"]*"></script>', "", text)
