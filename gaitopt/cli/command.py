"""A command of the command line: its name, help, options and what it runs."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

from gaitopt.cli.lines import say_aside
from gaitopt.core.errors import GaitoptError, nearest
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
    """A parser of one line errors that knows its commands, and the long names and values of its options.

    Attributes:
        words: the long names of its options, in order.
        values: the values that arguments and options take, by their names: words, or a kind of words that
            `completion` knows, such as ``PROBLEM``.
        commands: the parsers of its commands, by name.
    """

    def __init__(self, *arguments: Any, **options: Any):
        self.words: list[str] = []
        self.values: dict[str, str | Sequence[str]] = {}
        self.commands: dict[str, Parser] = {}
        super().__init__(*arguments, **options)
        self.register("type", float, number)
        self.register("type", int, whole_number)

    def add_argument(self, *names: Any, values: str = "", **options: Any) -> argparse.Action:
        """Add an argument or an option; `values` is what it takes, if neither metavar nor choices say it."""
        action = super().add_argument(*names, **options)
        self.words += [name for name in action.option_strings if name.startswith("--")]
        self.values[names[0]] = values or list(action.choices or ()) or str(action.metavar)
        return action

    def add_commands(self, commands: Sequence[Command], title: str, **options: Any) -> None:
        """Add commands. Without one, the help is printed."""
        self.set_defaults(run=lambda _: self.print_help())
        subparsers = self.add_subparsers(title=title, **options)
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

    def _check_value(self, action: argparse.Action, value: object) -> None:
        """Refuse what is none of the choices, with the nearest one."""
        if action.choices is not None and value not in action.choices:
            names = [str(name) for name in action.choices]
            listed = "" if self.commands else f"; allowed: {', '.join(names)}"
            raise argparse.ArgumentError(action, f"found {value!r}{listed}{nearest(value, names)}")

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse everything, or name the option that is nearest to an unknown one."""
        options, unknown = self.parse_known_args(args, namespace)
        if unknown:
            parser = self
            for word in args or ():
                parser = parser.commands.get(word, parser)
            word = unknown[0]
            if not word.startswith("-"):
                parser.error(f"found one argument too many: {word!r}")
            parser.error(f"unknown option {word!r}{nearest(word.partition('=')[0], parser.words)}")
        return options

    def error(self, message: str) -> NoReturn:
        """Say what is wrong in one line and end with the exit code of wrong usage."""
        say_aside(f"gaitopt: {GaitoptError(message)}; see {self.prog} --help")
        raise SystemExit(WRONG_USAGE)
