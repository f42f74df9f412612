"""`fowt doctor`: a check of the installation, of missing parts and of the results of a short run."""

from typing import Annotated

import typer
from rich.markup import escape

from fowt_env.errors import InputError
from fowt_env.training.cli import requirements
from fowt_env.training.cli.console import command, out


@command()
def doctor(test: Annotated[bool, typer.Option("--test/--no-test", help="Run the self-test.")] = True):
    """Check this installation.

    Versions, optional parts, the cache of compiled kernels, and a short run with known results.

    Examples:
    fowt doctor  # all of it; the self-test compiles kernels if it must, up to a minute
    fowt doctor --no-test  # versions, optional parts and the cache alone

    [bold]Exit code[/bold]: 0 if versions and the self-test (unless left out) are right, 1 if not.
    """
    packages = requirements.versions()
    _heading("versions")
    for package in packages:
        found = package.version or "missing"
        state = found if package.fits else f"[red]{found}[/red], needed: {escape(package.needed)}"
        out.print(f"  {package.name:14} {state}")
    _heading("optional parts")
    try:
        _print_extras(requirements.optional_parts())
    except InputError as error:
        _advise(error)
    faults = [package.advice for package in packages if package.name != "Python" and not package.fits]
    if not faults:
        try:
            from fowt_env.training.cli import (
                health,
            )  # and numba, without which other commands' help is faster
        except ImportError as error:  # raised by numba, e.g. for a NumPy that is too new
            faults = [str(error)]
    if requirements.installed("ipykernel") and not requirements.installed("ipywidgets"):
        _advise(
            'Jupyter is here without ipywidgets, which progress bars need: pip install "fowt-env[notebook]"'
        )
    if faults:
        for fault in faults:
            out.print(f"[red]{escape(fault)}[/red]")
        raise typer.Exit(1)
    _heading("machine")
    out.print(f"  {escape(health.machine())}")
    _heading("kernel cache")
    text, advice = health.cache_state()
    out.print(f"  {escape(text)}")
    if advice:
        _advise(advice)
    if test:
        _self_test(health)


def _heading(text):
    out.print(f"[bold]{text}[/bold]")


def _advise(text):
    out.print(f"  [yellow]{escape(str(text))}[/yellow]")


def _print_extras(extras):
    """Print each extra with its packages, and how to install what is missing."""
    for extra, packages in extras.items():
        if any(package.version is None for package in packages):
            state = "[yellow]missing[/yellow]"
        elif all(package.fits for package in packages):
            state = "[green]found[/green]"
        else:
            state = "[yellow]another version[/yellow]"
        names = ", ".join(map(_named, packages))
        advice = "" if "green" in state else f': pip install "{requirements.DISTRIBUTION}[{extra}]"'
        out.print(f"  {extra:14} {state}  {escape(names + advice)}")
    usual = [found for name, found in extras.items() if name not in "docs hydro".split()]  # as `all` has them
    if any(package.version is None for found in usual for package in found):
        out.print(escape(f'  all but docs and hydro: pip install "{requirements.DISTRIBUTION}[all]"'))


def _named(package):
    """Return name and version, with the needed one if it differs."""
    if package.version is None or package.fits:
        return f"{package.name} {package.version or 'missing'}"
    return f"{package.name} {package.version} (needed: {package.needed})"


def _self_test(health):
    """Run and print the self-test; exit with 1 if it fails."""
    _heading("self-test")
    found, worst, seconds = health.self_test()
    for name, expected in health.EXPECTED.items():
        text = f"{name.replace('_', ' '):16} {found[name]:12.5f}   expected {expected:12.5f}"
        out.print(f"  {escape(text)}")
    passed = worst <= health.TOLERANCE
    out.print(
        f"  {'[green]passed[/green]' if passed else '[red]FAILED[/red]'}: largest difference {worst:.1e}"
        f" (allowed {health.TOLERANCE:g}); {health.TEST_DURATION:g} s simulated in {seconds:.2f} s"
    )
    if not passed:
        raise typer.Exit(1)
