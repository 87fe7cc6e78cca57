"""Shell completion: a static script made from the parser, so that it can never fall behind it."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence

from gaitopt.errors import GaitoptError, nearest

SHELLS = ("bash", "zsh", "fish")


def completion_script(parser: argparse.ArgumentParser, shell: str) -> str:
    """Return the script that completes commands, options and file names.

    Raises:
        GaitoptError: the shell is none of `SHELLS`.
    """
    if shell not in SHELLS:
        raise GaitoptError(
            f"completion: found {shell!r}; allowed: {', '.join(SHELLS)}{nearest(shell, SHELLS)}"
        )
    words = _words(parser)
    return _fish(words) if shell == "fish" else _bash(words, for_zsh=shell == "zsh")


def _words(parser: argparse.ArgumentParser) -> dict[str, list[str]]:
    """Return the options of each command."""
    commands: Mapping[str, argparse.ArgumentParser] = {}
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            commands = action.choices
    return {name: _options(sub) for name, sub in commands.items()}


def _options(parser: argparse.ArgumentParser) -> list[str]:
    return [name for action in parser._actions for name in action.option_strings if name.startswith("--")]


def _bash(words: Mapping[str, Sequence[str]], for_zsh: bool) -> str:
    cases = "\n".join(f'    {name}) words="{" ".join(options)}" ;;' for name, options in words.items())
    head = "autoload -U +X bashcompinit && bashcompinit\n" if for_zsh else ""
    return f"""{head}_gaitopt() {{
  local word="${{COMP_WORDS[COMP_CWORD]}}" words=""
  if [ "$COMP_CWORD" -eq 1 ]; then
    COMPREPLY=($(compgen -W "{" ".join(words)}" -- "$word"))
    return
  fi
  case "${{COMP_WORDS[1]}}" in
{cases}
  esac
  case "$word" in
    -*) COMPREPLY=($(compgen -W "$words" -- "$word")) ;;
    *) COMPREPLY=($(compgen -f -- "$word")) ;;
  esac
}}
complete -o filenames -F _gaitopt gaitopt
"""


def _fish(words: Mapping[str, Sequence[str]]) -> str:
    lines = [f"complete -c gaitopt -n __fish_use_subcommand -f -a '{' '.join(words)}'"]
    for name, options in words.items():
        seen = f"'__fish_seen_subcommand_from {name}'"
        lines += [f"complete -c gaitopt -n {seen} -l {option.removeprefix('--')}" for option in options]
    return "\n".join(lines) + "\n"
