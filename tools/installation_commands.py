"""The commands for the installation: whether it works, and the shell's completion."""

from typing import Annotated, Literal

from cyclopts import App, Parameter

from .answers import Answer, answer
from .options import JsonFile


def installed_version() -> str:
    """The version of the distribution, looked up when it is asked for."""
    from importlib.metadata import version

    return version("trihedron")


def doctor(*, json: JsonFile = None) -> Answer:
    """Say what is installed and for which platforms FMUs can be exported, and try a run.

    Example: trihedron doctor
    """
    from .installation import doctor as look

    found = look()
    return answer(found.lines(), json, found.to_json(), complaint="" if found.works else found.lines()[0], status=1)


def add_completion(app: App) -> None:
    """Add the command that prints the completion of `app` for a shell."""

    @app.command
    def completion(
        shell: Annotated[Literal["bash", "zsh", "fish"], Parameter(help="Of which shell.")],
        /,
        *,
        json: JsonFile = None,
    ) -> Answer:
        """Print the shell's completion of commands and options; put it where your shell looks for it.

        Example: trihedron completion bash > ~/.local/share/bash-completion/completions/trihedron
        """
        script = app.generate_completion(prog_name="trihedron", shell=shell)
        return answer(script.rstrip("\n"), json, {"schema": "trihedron.completion/1", "shell": shell, "script": script})
