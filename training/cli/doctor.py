"""Implements fowt doctor: checks versions, optional packages, the kernel cache and a short run."""

from typing import Annotated

import typer
from rich.markup import escape

from fowt_env.errors import InputError
from fowt_env.training.cli import requirements
from fowt_env.training.cli.console import command, out


@command()
def doctor(test: Annotated[bool, typer.Option("--test/--no-test", help="Run the self-test.")] = True):
    """Check this installation.

    Reports versions, optional parts and the kernel cache, and compares a short run with known results.

    Examples:
    fowt doctor  # everything; the self-test may compile kernels, up to a minute
    fowt doctor --no-test  # versions, optional parts and the cache only

    [bold]Exit code[/bold]: 0 if the versions fit and the self-test, unless skipped, passes; 1 if not.
    """
    packages = requirements.versions()
    _heading("versions")
    for package in packages:
        version = package.version or "missing"
        state = version if package.fits else f"[red]{version}[/red], required: {escape(package.needed)}"
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
            )  # imports numba, which other commands' help does not need
        except ImportError as error:  # raised by numba, e.g. for a NumPy that is too new
            faults = [str(error)]
    if requirements.installed("ipykernel") and not requirements.installed("ipywidgets"):
        _advise('Jupyter has no ipywidgets, which progress bars need: pip install "fowt-env[notebook]"')
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
    """Print each extra with its packages, and how to install missing ones."""
    for extra, packages in extras.items():
        if any(package.version is None for package in packages):
            state = "[yellow]missing[/yellow]"
        elif all(package.fits for package in packages):
            state = "[green]installed[/green]"
        else:
            state = "[yellow]wrong version[/yellow]"
        names = ", ".join(map(_named, packages))
        advice = "" if "green" in state else f': pip install "{requirements.DISTRIBUTION}[{extra}]"'
        out.print(f"  {extra:14} {state}  {escape(names + advice)}")
    usual = [parts for name, parts in extras.items() if name not in "docs hydro".split()]  # as `all` has them
    if any(package.version is None for parts in usual for package in parts):
        out.print(
            escape(f'  all without torch, Ray and toolboxes: pip install "{requirements.DISTRIBUTION}[all]"')
        )


def _named(package):
    """Return name and version, with the required version if it differs."""
    if package.version is None or package.fits:
        return f"{package.name} {package.version or 'missing'}"
    return f"{package.name} {package.version} (required: {package.needed})"


def _self_test(health):
    """Run and print the self-test; exit with 1 if it fails."""
    _heading("self-test")
    values, worst, seconds = health.self_test()
    for name, expected in health.EXPECTED.items():
        text = f"{name.replace('_', ' '):16} {values[name]:12.5f}   expected {expected:12.5f}"
        out.print(f"  {escape(text)}")
    passed = worst <= health.TOLERANCE
    out.print(
        f"  {'[green]passed[/green]' if passed else '[red]FAILED[/red]'}: largest difference {worst:.1e}"
        f" (allowed {health.TOLERANCE:g}); {health.TEST_DURATION:g} s simulated in {seconds:.2f} s"
    )
    if not passed:
        raise typer.Exit(1)
