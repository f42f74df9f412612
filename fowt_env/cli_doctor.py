"""`fowt doctor`: is this installation whole, what is missing, and does it give the right figures?"""

from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from fowt_env.errors import InputError

DOCTOR_EXAMPLES = """[bold]Examples[/bold]

[cyan]fowt doctor[/cyan]  all of it; the self-test compiles kernels if it must, up to a minute

[cyan]fowt doctor --no-test[/cyan]  versions, optional parts and the cache alone

[bold]Exit code[/bold]: 0 if the self-test gives its figures (or was left out), 1 if not."""

out = Console()


def doctor(
    test: Annotated[bool, typer.Option("--test/--no-test", help="Run the self-test.")] = True,
):
    """Check this installation: versions, optional parts, kernel cache, a short run with known figures."""
    from fowt_env import health  # numba and what it needs, which other commands' help can do without

    _print_versions(health)
    _print_extras(health)
    _print_cache(health.cache_state())
    if test and not _self_test(health).passed:
        raise typer.Exit(1)


def _heading(text):
    out.print(f"[bold]{text}[/bold]")


def _print_versions(health):
    _heading("versions")
    for package in health.versions():
        out.print(f"  {package.name:14} {package.version or '[red]missing[/red]'}", highlight=False)
    out.print(f"  {escape(health.machine())}", highlight=False, soft_wrap=True)


def _print_extras(health):
    _heading("optional parts")
    try:
        extras = health.optional_parts()
    except InputError as error:
        out.print(f"  [yellow]{escape(str(error))}[/yellow]", soft_wrap=True, highlight=False)
        return
    for extra, packages in extras.items():
        missing = [package.name for package in packages if package.version is None]
        names = ", ".join(f"{package.name} {package.version or 'missing'}" for package in packages)
        state = "[green]found[/green]" if not missing else "[yellow]missing[/yellow]"
        advice = f': pip install "{health.DISTRIBUTION}[{extra}]"' if missing else ""
        out.print(f"  {extra:14} {state}  {escape(names + advice)}", highlight=False, soft_wrap=True)


def _print_cache(state):
    _heading("kernel cache")
    kernels = f"{state.megabytes:.1f} MB of compiled kernels" if state.compiled else "nothing compiled yet"
    others = f", {state.others} folders of other versions" if state.others else ""
    out.print(f"  {escape(str(state.folder))}: {kernels}{others}", highlight=False, soft_wrap=True)
    if state.advice:
        out.print(f"  [yellow]{escape(state.advice)}[/yellow]", highlight=False, soft_wrap=True)


def _self_test(health):
    """SelfTest, printed."""
    _heading("self-test")
    result = health.self_test(lambda text: out.print(f"  [yellow]{text}[/yellow]", highlight=False))
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
