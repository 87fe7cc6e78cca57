"""`gaitopt completion`: a script that completes commands and options in a shell."""

from __future__ import annotations

from gaitopt.cli.command import Command, Options, Parser


def add_options(parser: Parser) -> None:
    """Add the options."""
    parser.add_argument("shell", metavar="SHELL", help="bash, zsh or fish")


def run(options: Options) -> None:
    """Print the script."""
    from gaitopt.cli.completion import completion_script

    print(completion_script(options.program, options.shell), end="")


COMMAND = Command(
    name="completion",
    summary="print a script that completes commands and options in a shell",
    example="gaitopt completion bash > ~/.local/share/bash-completion/completions/gaitopt",
    add_options=add_options,
    run=run,
)
