"""`gaitopt campaign`: the loop on the real robot: which gait to film next, and what its film taught."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from gaitopt.cli.command import Command, Options, Parser
from gaitopt.cli.lines import print_json, say, say_aside
from gaitopt.cli.options import add_executor, add_json, add_problem, add_quiet, add_seed, problem_of

if TYPE_CHECKING:
    from gaitopt.core.progress import OnProgress
    from gaitopt.jobs.campaign import Campaign
    from gaitopt.jobs.campaign_status import Next, Status


def add_new_options(parser: Parser) -> None:
    """Add the options of ``campaign new``."""
    add_problem(parser)
    add = parser.add_argument
    about = "folder of the campaign; the same one again goes on"
    add("--out", type=Path, metavar="DIR", required=True, help=about)
    about = "gaits of the searches of each step (default: 400)"
    add("--budget", type=int, metavar="N", help=about)
    add_seed(parser)
    add("--player", metavar="FORMAT", help="format of the players (default: micropython; see export)")
    about = "share of the robots that may be slower than a gait's speed says (default: their mean counts)"
    add("--quantile", type=float, metavar="Q", help=about)
    _add_common(parser)


def _add_common(parser: Parser) -> None:
    add_json(parser)
    add_quiet(parser)
    add_executor(parser)


def add_folder_options(parser: Parser) -> None:
    """Add the options of ``campaign next`` and ``campaign status``."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="folder of the campaign")
    _add_common(parser)


def add_tell_options(parser: Parser) -> None:
    """Add the options of ``campaign tell``."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="folder of the campaign")
    parser.add_argument("dataset", type=Path, metavar="DATASET", help="folder with dataset.toml: the film")
    parser.add_argument("--trust", action="store_true", help="take a film that does not look like its gait")
    _add_common(parser)


def new(options: Options) -> None:
    """Begin a campaign, and print the first film."""
    from gaitopt.jobs.campaign import Campaign

    with _going_on(options, options.out) as on_progress:
        campaign = Campaign.new(
            problem_of(options),
            options.out,
            seed=options.seed,
            budget=options.budget,
            player=options.player,
            quantile=options.quantile,
            executor=options.executor,
            workers=options.workers,
            on_progress=on_progress,
        )
    _print_next(campaign.next(), campaign.path, options.json)


def next_film(options: Options) -> None:
    """Print what to film next."""
    with _going_on(options, options.folder) as on_progress:
        found = _opened(options, on_progress).next()
    _print_next(found, options.folder, options.json)


def tell(options: Options) -> None:
    """Take a film in, and print what it taught."""
    with _going_on(options, options.folder) as on_progress:
        campaign = _opened(options, on_progress)
        status = campaign.tell(options.dataset, options.trust)
        following = campaign.next()
    _print_status(status, following, options)


def status(options: Options) -> None:
    """Print what is known."""
    with _going_on(options, options.folder) as on_progress:
        campaign = _opened(options, on_progress)
        known = campaign.status()
        following = None if known.at_work else campaign.next()
    _print_status(known, following, options)


def _opened(options: Options, on_progress: OnProgress) -> Campaign:
    from gaitopt.jobs.campaign import Campaign

    return Campaign(
        options.folder, executor=options.executor, workers=options.workers, on_progress=on_progress
    )


@contextmanager
def _going_on(options: Options, folder: Path) -> Iterator[OnProgress]:
    """Show progress; where Ctrl-C or SIGTERM ends a step, say how it goes on."""
    from gaitopt.cli.progress import display
    from gaitopt.jobs.outputs import Stopped

    try:
        with display(options.quiet or options.json) as on_progress:
            yield on_progress
    except Stopped:
        say_aside(f"gaitopt: stopped; go on with: gaitopt campaign next {shlex.quote(str(folder))}")
        raise


def _print_next(found: Next, folder: Path, as_json: bool) -> None:
    if as_json:
        print_json(found.to_dict())
        return
    low, high = (1e3 * end for end in found.predicted.ci90)
    expected = f"{1e3 * found.predicted.mean:.1f} mm/s (90 % interval {low:.1f} to {high:.1f})"
    if found.done:
        say(f"Done: no film is expected to gain more than the robot's own repeatability. Walk with film "
            f"{found.film}: {folder / found.gait}, expected {expected}.")  # fmt: skip
    else:
        why = "the best gait that is known" if found.purpose == "walk" else "for what it tells"
        say(f"Film {found.film} next, {why}: {folder / found.gait}, expected {expected}.")
    if found.player:
        say(f"player: {folder / found.player}")
    if not found.done:
        say(f"then: gaitopt campaign tell {shlex.quote(str(folder))} DATASET")
    say(f"page: {folder / 'campaign.html'}")


def _print_status(known: Status, following: Next | None, options: Options) -> None:
    if options.json:
        print_json(known.to_dict())
        return
    from gaitopt.cli.display import print_table

    rows = []
    for film in known.films:
        low, high = (1e3 * end for end in film.predicted.ci90)
        speed = "–" if film.measured_m_s is None else f"{1e3 * film.measured_m_s:.1f}"
        expected = f"{1e3 * film.predicted.mean:.1f} ({low:.1f} to {high:.1f})"
        drift = "–" if film.drift is None else f"{film.drift:+.0%}"
        rows.append([f"{film.film}", expected, speed, drift, f"{film.recordings}"])
    print_table(["film", "predicted [mm/s]", "measured [mm/s]", "drift", "recordings"], rows)
    if known.answer:
        say(known.answer)
    for note in known.notes:
        say(f"- {note}")
    gain = known.still_to_gain
    low, high = (1e3 * end for end in gain.ci90)
    say(f"still to gain: {1e3 * gain.mean:.1f} mm/s (90 % interval {low:.1f} to {high:.1f})")
    if following is None:
        say("Another command works on the next step of this campaign; this is what was known before.")
    else:
        _print_next(following, options.folder, False)


_EXAMPLE = "gaitopt campaign new arcfold --out crawl"

COMMAND = Command(
    name="campaign",
    summary="film, learn and walk faster: which gait the real robot should be filmed with next",
    example=_EXAMPLE,
    actions=(
        Command(
            name="new",
            summary="search on the nominal robot, and propose the first film",
            example=_EXAMPLE,
            add_options=add_new_options,
            run=new,
        ),
        Command(
            name="next",
            summary="print what to film next, and why",
            example="gaitopt campaign next crawl",
            add_options=add_folder_options,
            run=next_film,
        ),
        Command(
            name="tell",
            summary="take a film in: diagnose all films, search again, propose the next one",
            example="gaitopt campaign tell crawl film-1",
            add_options=add_tell_options,
            run=tell,
        ),
        Command(
            name="status",
            summary="print films, best gait, causes and what is still to gain",
            example="gaitopt campaign status crawl",
            add_options=add_folder_options,
            run=status,
        ),
    ),
)
