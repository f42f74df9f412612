"""The command fowt as tests call it, in this process."""

from typer.testing import CliRunner

from fowt_env.training.cli import app as cli


def fowt(*arguments, code=0):
    """(stdout, stderr) of a command that must end with the exit code, and never with a traceback."""
    result = CliRunner().invoke(cli.app, list(arguments), env={"COLUMNS": "200", "NO_COLOR": "1"})
    assert result.exit_code == code, (
        f"{result.exit_code}\n{result.stdout}\n{result.stderr}\n{result.exception!r}"
    )
    assert "Traceback" not in result.stderr
    return result.stdout, result.stderr
