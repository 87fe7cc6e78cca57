"""Shell completion: a static script made from the commands and options, so that it always has them all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gaitopt.cli.command import Parser
from gaitopt.core.errors import GaitoptError, nearest

SHELLS = ("bash", "zsh", "fish")


def completion_script(parser: Parser, shell: str) -> str:
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


def _words(parser: Parser) -> dict[str, list[str]]:
    """Return what may follow each command: its options, and its actions with theirs."""
    return {name: _following(sub) for name, sub in parser.commands.items()}


def _following(parser: Parser) -> list[str]:
    actions = [word for sub in parser.commands.values() for word in _following(sub)]
    return list(dict.fromkeys([*parser.commands, *parser.words, *actions]))


def _bash(words: Mapping[str, Sequence[str]], for_zsh: bool) -> str:
    cases = "\n".join(f"    {name}) {_bash_words(following)} ;;" for name, following in words.items())
    head = "autoload -U +X bashcompinit && bashcompinit\n" if for_zsh else ""
    return f"""{head}_gaitopt() {{
  local word="${{COMP_WORDS[COMP_CWORD]}}" words="" actions=""
  if [ "$COMP_CWORD" -eq 1 ]; then
    COMPREPLY=($(compgen -W "{" ".join(words)}" -- "$word"))
    return
  fi
  case "${{COMP_WORDS[1]}}" in
{cases}
  esac
  case "$word" in
    -*) COMPREPLY=($(compgen -W "$words" -- "$word")) ;;
    *) COMPREPLY=($(compgen -W "$actions" -- "$word") $(compgen -f -- "$word")) ;;
  esac
}}
complete -o filenames -F _gaitopt gaitopt
"""


def _bash_words(following: Sequence[str]) -> str:
    options = [word for word in following if word.startswith("--")]
    actions = [word for word in following if not word.startswith("--")]
    return f'words="{" ".join(options)}"' + (f' actions="{" ".join(actions)}"' if actions else "")


def _fish(words: Mapping[str, Sequence[str]]) -> str:
    lines = [f"complete -c gaitopt -n __fish_use_subcommand -f -a '{' '.join(words)}'"]
    for name, options in words.items():
        seen = f"'__fish_seen_subcommand_from {name}'"
        for word in options:
            what = f"-l {word.removeprefix('--')}" if word.startswith("--") else f"-a {word}"
            lines.append(f"complete -c gaitopt -n {seen} {what}")
    return "\n".join(lines) + "\n"
