"""Shell completion: a static script made from the commands and options, so that it always has them all."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from gaitopt.cli.command import Parser
from gaitopt.core.errors import GaitoptError, nearest

SHELLS = ("bash", "zsh", "fish")

_GAIT = "GAIT"
"""The kind of values that depend on another word, the problem."""


def completion_script(parser: Parser, shell: str) -> str:
    """Return the script that completes commands, options, their values and file names.

    Raises:
        GaitoptError: the shell is none of `SHELLS`.
    """
    if shell not in SHELLS:
        raise GaitoptError(
            f"completion: found {shell!r}; allowed: {', '.join(SHELLS)}{nearest(shell, SHELLS)}"
        )
    words = {name: _Following.of(sub) for name, sub in parser.commands.items()}
    gaits = _gaits()
    return _fish(words, gaits) if shell == "fish" else _bash(words, gaits, for_zsh=shell == "zsh")


@dataclass(frozen=True)
class _Following:
    """What may follow a command.

    Attributes:
        options: the long names of its options, and of those of its actions.
        words: its actions, and the values of its arguments.
        values: the values of each of its options that has some.
        gaits: the options that take a gait; an empty name stands for an argument.
    """

    options: Sequence[str]
    words: Sequence[str]
    values: Mapping[str, Sequence[str]]
    gaits: Sequence[str]

    @staticmethod
    def of(parser: Parser) -> _Following:
        """Return what may follow the command of a parser."""
        words: list[str] = list(parser.commands)
        values: dict[str, Sequence[str]] = {}
        gaits: list[str] = []
        for each in (parser, *parser.commands.values()):
            for name, kind in each.values.items():
                found = _values(kind)
                if kind == _GAIT:
                    gaits.append(name if name.startswith("-") else "")
                elif name.startswith("-"):
                    values |= {name: found} if found else {}
                else:
                    words += found
        options = [word for each in (parser, *parser.commands.values()) for word in each.words]
        return _Following(list(dict.fromkeys(options)), list(dict.fromkeys(words)), values, gaits)


def _values(kind: str | Sequence[str]) -> Sequence[str]:
    """Return the words of a kind of values; none where they are free."""
    if not isinstance(kind, str):
        return [str(word) for word in kind]
    return KINDS[kind]() if kind in KINDS else []


def _problems() -> Sequence[str]:
    from gaitopt.problem.lookup import bundled_names

    return bundled_names()


def _methods() -> Sequence[str]:
    from gaitopt.optimise.stages import method_names

    return method_names()


def _formats() -> Sequence[str]:
    from gaitopt.export.formats import FORMATS

    return list(FORMATS)


def _boards() -> Sequence[str]:
    from gaitopt.export.formats import FORMATS

    return list(dict.fromkeys(board for one in FORMATS.values() for board in one.boards))


KINDS: Mapping[str, Callable[[], Sequence[str]]] = {
    "PROBLEM": _problems,
    "METHOD": _methods,
    "EXECUTOR": lambda: ("threads", "processes", "serial"),
    "FORMAT": _formats,
    "BOARD": _boards,
    "SHELL": lambda: SHELLS,
}
"""The kinds of values that options name, beside gaits."""


def _gaits() -> dict[str, Sequence[str]]:
    """Return the baselines of each bundled problem that has some."""
    from gaitopt.problem.problem import load_problem

    found = {name: list(load_problem(name).baselines) for name in _problems()}
    return {name: gaits for name, gaits in found.items() if gaits}


def _bash(words: Mapping[str, _Following], gaits: Mapping[str, Sequence[str]], for_zsh: bool) -> str:
    cases = "\n".join(
        f'    {name}) options="{" ".join(one.options)}" words="{" ".join(one.words)}" ;;'
        for name, one in words.items()
    )
    values = "\n".join(
        f'    "{name} {option}") words="{" ".join(some)}" options="" ;;'
        for name, one in words.items()
        for option, some in one.values.items()
    )
    takers = [f'"{name} {option}"' if option else f'"{name} "*' for name, option in _taking_gaits(words)]
    of_problem = "\n".join(f'    *" {name} "*) gaits="{" ".join(some)}" ;;' for name, some in gaits.items())
    head = "autoload -U +X bashcompinit && bashcompinit\n" if for_zsh else ""
    return f"""{head}_gaitopt() {{
  local word="${{COMP_WORDS[COMP_CWORD]}}" words="" options="" gaits=""
  local command="${{COMP_WORDS[1]}}" before="${{COMP_WORDS[COMP_CWORD-1]}}"
  if [ "$COMP_CWORD" -eq 1 ]; then
    COMPREPLY=($(compgen -W "{" ".join(words)}" -- "$word"))
    return
  fi
  case "$command" in
{cases}
  esac
  case " ${{COMP_WORDS[*]}} " in
{of_problem}
  esac
  case "$command $before" in
{values}
    {"|".join(takers)}) words="$words $gaits" ;;
  esac
  case "$word" in
    -*) COMPREPLY=($(compgen -W "$options" -- "$word")) ;;
    *) COMPREPLY=($(compgen -W "$words" -- "$word") $(compgen -f -- "$word")) ;;
  esac
}}
complete -o filenames -F _gaitopt gaitopt
"""


def _taking_gaits(words: Mapping[str, _Following]) -> Iterator[tuple[str, str]]:
    """Yield the commands that take a gait, each with the option that does; options come first."""
    pairs = [(name, option) for name, one in words.items() for option in one.gaits]
    yield from sorted(pairs, key=lambda pair: not pair[1])


def _fish(words: Mapping[str, _Following], gaits: Mapping[str, Sequence[str]]) -> str:
    lines = [f"complete -c gaitopt -n __fish_use_subcommand -f -a '{' '.join(words)}'"]
    for name, one in words.items():
        seen = f"__fish_seen_subcommand_from {name}"
        if one.words:
            lines.append(f"complete -c gaitopt -n '{seen}' -a '{' '.join(one.words)}'")
        for word in one.options:
            takes = f" -r -a '{' '.join(one.values[word])}'" if word in one.values else ""
            lines.append(f"complete -c gaitopt -n '{seen}' -l {word.removeprefix('--')}{takes}")
    for name, option in _taking_gaits(words):
        for problem, some in gaits.items():
            typed = f"__fish_seen_subcommand_from {name}; and contains -- {problem} (commandline -opc)"
            what = f"-l {option.removeprefix('--')} -r " if option else ""
            lines.append(f"complete -c gaitopt -n '{typed}' {what}-a '{' '.join(some)}'")
    return "\n".join(lines) + "\n"
