"""What is true of every page."""

from gaitopt.report.page import typeset


def test_a_page_keeps_figures_and_units_together() -> None:
    assert typeset("5% of -3 mm < 2 N m") == "5\u00a0% of −3\u00a0mm &lt; 2\u00a0N\u00a0m"
    assert typeset("square-1s.") == '<span class="whole">square-1s</span>.'
    assert typeset("--budget 30 -v") == "--budget 30 -v"


def test_commands_in_backticks_are_set_as_code_and_names_stay() -> None:
    assert typeset("`gaitopt check` finds `x`") == "<code>gaitopt check</code> finds `x`"
