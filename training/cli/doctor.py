"""`fowt doctor`: a check of the installation, of missing parts and of the results of a short run."""

from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from fowt_env.errors import InputError
from fowt_env.training.cli import requirements
from fowt_env.training.cli.console import command

out = Console(emoji=False)


@command()
def doctor(test: Annotated[bool, typer.Option("--test/--no-test", help="Run the self-test.")] = True):
    """Check this installation.

    Versions, optional parts, the cache of compiled kernels, and a short run with known results.

    Examples:
    fowt doctor  # all of it; the self-test compiles kernels if it must, up to a minute
    fowt doctor --no-test  # versions, optional parts and the cache alone

    [bold]Exit code[/bold]: 0 if versions and the self-test (unless left out) are right, 1 if not.
    """
    _print_versions()
    _print_extras()
    needed = [package for package in requirements.versions() if package.name != "Python"]
    faults = [package.advice for package in needed if not package.fits]
    if not faults:
        try:
            from fowt_env.training.cli import (
                health,  # numba and what it needs, which other commands' help can do without
            )
        except ImportError as error:  # raised by numba, e.g. for a NumPy that is too new
            faults = [str(error)]
    _print_notebook()
    if faults:
        for fault in faults:
            out.print(f"[red]{escape(fault)}[/red]", soft_wrap=True, highlight=False)
        raise typer.Exit(1)
    _heading("machine")
    out.print(f"  {escape(health.machine())}", highlight=False, soft_wrap=True)
    _print_cache(health.cache_state())
    if test and not _self_test(health).passed:
        raise typer.Exit(1)


def _heading(text):
    out.print(f"[bold]{text}[/bold]")


def _print_versions():
    _heading("versions")
    for package in requirements.versions():
        found = package.version or "missing"
        state = found if package.fits else f"[red]{found}[/red], needed: {escape(package.needed)}"
        out.print(f"  {package.name:14} {state}", highlight=False)


def _print_extras():
    _heading("optional parts")
    try:
        extras = requirements.optional_parts()
    except InputError as error:
        out.print(f"  [yellow]{escape(str(error))}[/yellow]", soft_wrap=True, highlight=False)
        return
    for extra, packages in extras.items():
        names = ", ".join(_named(package) for package in packages)
        if any(package.version is None for package in packages):
            state = "[yellow]missing[/yellow]"
        elif all(package.fits for package in packages):
            state = "[green]found[/green]"
        else:
            state = "[yellow]another version[/yellow]"
        advice = "" if "green" in state else f': pip install "{requirements.DISTRIBUTION}[{extra}]"'
        out.print(f"  {extra:14} {state}  {escape(names + advice)}", highlight=False, soft_wrap=True)
    apart = "docs hydro".split()  # which `all` leaves out
    if any(one.version is None for name, found in extras.items() if name not in apart for one in found):
        advice = f'  all but docs and hydro: pip install "{requirements.DISTRIBUTION}[all]"'
        out.print(escape(advice), highlight=False, soft_wrap=True)


def _print_notebook():
    """Print a line if notebooks with this Python cannot show progress."""
    if requirements.installed("ipykernel") and not requirements.installed("ipywidgets"):
        advice = (
            'Jupyter is here without ipywidgets, which progress bars need: pip install "fowt-env[notebook]"'
        )
        out.print(f"  [yellow]{escape(advice)}[/yellow]", highlight=False, soft_wrap=True)


def _named(package):
    """Return name and version, with the needed one if it differs."""
    if package.version is None or package.fits:
        return f"{package.name} {package.version or 'missing'}"
    return f"{package.name} {package.version} (needed: {package.needed})"


def _print_cache(state):
    _heading("kernel cache")
    kernels = f"{state.megabytes:.1f} MB of compiled kernels" if state.compiled else "nothing compiled yet"
    others = f", {state.others} folders of other versions" if state.others else ""
    folder = state.folder or "no home folder, and no FOWT_CACHE_DIR"
    out.print(f"  {escape(str(folder))}: {kernels}{others}", highlight=False, soft_wrap=True)
    if state.advice:
        out.print(f"  [yellow]{escape(state.advice)}[/yellow]", highlight=False, soft_wrap=True)


def _self_test(health):
    """Run and print the SelfTest, and return it."""
    _heading("self-test")
    result = health.self_test()
    for name, expected in health.EXPECTED.items():
        text = f"{name.replace('_', ' '):16} {result.found[name]:12.5f}   expected {expected:12.5f}"
        out.print(f"  {escape(text)}", highlight=False)
    verdict = "[green]passed[/green]" if result.passed else "[red]FAILED[/red]"
    out.print(
        f"  {verdict}: largest difference {result.worst:.1e} (allowed {health.TOLERANCE:g});"
        f" {health.TEST_DURATION:g} s simulated in {result.seconds:.2f} s",
        highlight=False,
        soft_wrap=True,
    )
    return result
