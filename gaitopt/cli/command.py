"""A command of the command line: its name, help, options and what it runs."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

from gaitopt.cli.lines import say_aside
from gaitopt.core.errors import GaitoptError
from gaitopt.core.numbers import number, whole_number

WRONG_USAGE = 2

Options = argparse.Namespace
"""The options of a command as parsed."""


@dataclass(frozen=True)
class Command:
    """One command. A new one is a file with such a record, and one line in `commands.COMMANDS`.

    Attributes:
        name: what the user types.
        summary: what it does, without a full stop.
        example: an example, which the help shows and a test runs.
        add_options: adds its arguments and options to a parser.
        run: does the work and prints.
        description: what the help of the command says; its summary as a sentence by default.
        actions: commands of their own that it consists of, instead of options.
    """

    name: str
    summary: str
    example: str
    add_options: Callable[[Parser], object] = lambda parser: None
    run: Callable[[Options], None] | None = None
    description: str = ""
    actions: Sequence[Command] = ()


class Parser(argparse.ArgumentParser):
    """A parser of one line errors that knows its commands and the long names of its options.

    Attributes:
        words: the long names of its options, in order.
        commands: the parsers of its commands, by name.
    """

    def __init__(self, *arguments: Any, **options: Any):
        self.words: list[str] = []
        self.commands: dict[str, Parser] = {}
        super().__init__(*arguments, **options)
        self.register("type", float, number)
        self.register("type", int, whole_number)

    def add_argument(self, *names: Any, **options: Any) -> argparse.Action:
        """Add an argument or an option."""
        action = super().add_argument(*names, **options)
        self.words += [name for name in action.option_strings if name.startswith("--")]
        return action

    def add_commands(self, commands: Sequence[Command], title: str, **options: Any) -> None:
        """Add commands, one of which is required."""
        subparsers = self.add_subparsers(title=title, required=True, **options)
        for command in commands:
            parser = subparsers.add_parser(
                command.name,
                help=command.summary,
                description=command.description or f"{command.summary[0].upper()}{command.summary[1:]}.",
                epilog=f"example: {command.example}",
            )
            self.commands[command.name] = parser
            if command.actions:
                parser.add_commands(command.actions, "actions", metavar="ACTION")
            else:
                command.add_options(parser)
                parser.set_defaults(run=command.run)

    def error(self, message: str) -> NoReturn:
        """Say what is wrong in one line and end with the exit code of wrong usage."""
        say_aside(f"gaitopt: {GaitoptError(message)}; see {self.prog} --help")
        raise SystemExit(WRONG_USAGE)
