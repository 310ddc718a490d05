"""Shell completion of commands and options: for PowerShell written here, for other shells by cyclopts."""

from json import dumps
from typing import Annotated, Literal

from cyclopts import App, Parameter

from .answer import Answer, JsonFile, answer

SCRIPT = """Register-ArgumentCompleter -Native -CommandName trihedron -ScriptBlock {
    param($word, $line, $cursor)
    $tree = ConvertFrom-Json @'
%s
'@
    $words = @($line.CommandElements | Select-Object -Skip 1 | ForEach-Object { $_.ToString() })
    $at = $tree
    foreach ($part in $words) {
        if ($part -ne $word -and $at.commands.PSObject.Properties.Name -contains $part) { $at = $at.commands.$part }
    }
    @($at.commands.PSObject.Properties.Name) + @($at.options) |
        Where-Object { $_ -like "$word*" } | Sort-Object |
        ForEach-Object { [System.Management.Automation.CompletionResult]::new($_, $_, 'ParameterValue', $_) }
}"""
"""Words of commands and options come first; where none fits PowerShell completes names of files."""


def add_completion(app: App, group: str) -> None:
    """Add the command that prints the completion of `app` for a shell to a group of commands."""

    @app.command(group=group)
    def completion(
        shell: Annotated[Literal["bash", "zsh", "fish", "powershell"], Parameter(help="Name of the shell.")],
        /,
        *,
        json: JsonFile = None,
    ) -> Answer:
        """Print the completion of commands and options for a shell; save it where the shell looks for it.

        Example: trihedron completion bash > ~/.bash_completion
        """
        script = (
            powershell(app) if shell == "powershell" else app.generate_completion(prog_name="trihedron", shell=shell)
        )
        return answer(script.rstrip("\n"), json, {"schema": "trihedron.completion/1", "shell": shell, "script": script})


def powershell(app: App) -> str:
    """The script that a profile of PowerShell takes."""
    return SCRIPT % dumps(_tree(app), sort_keys=True)


def _tree(app: App) -> dict[str, object]:
    """The commands below one, each likewise, and its own options."""
    commands = {name: _tree(app[name]) for name in app if not name.startswith("-")}
    options = ["--help"]
    if app.default_command:
        for argument in app.assemble_argument_collection():
            options.extend(name for name in argument.names if name.startswith("--"))
    return {"commands": commands, "options": sorted(options)}
