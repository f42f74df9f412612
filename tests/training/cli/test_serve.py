"""What fowt connect serve refuses before it listens; tests/examples runs it with its clients."""

import pytest
from command_line import fowt

from fowt_env.errors import InputError
from fowt_env.training.cli.serve import parse_address


def test_an_address_has_a_host_and_a_port():
    assert parse_address("127.0.0.1:5500") == ("127.0.0.1", 5500)
    assert parse_address("[::1]:0") == ("::1", 0)
    for text in ("5500", ":5500", "localhost:", "localhost:65536", "localhost:-1", "localhost:a"):
        with pytest.raises(InputError, match="listen = "):
            parse_address(text)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--listen 5500", "listen = '5500': must be HOST:PORT"),
        ("--factor fast", "factor = 'fast': must be positive, or inf"),
        ("--factor 0", "factor = 0"),
        ("--deadline 2", "deadline = 2"),
        ("--hold 0", "hold = 0"),
        ("--then feathr", "'feather'"),
        ("--out run.xls", "run.xls"),
        ("--protocol tpc --duration 1 --control-dt 0.1", "'tcp'"),
        ("--channels RotSped --listen 127.0.0.1:0 --duration 1 --control-dt 0.1", "'RotSpeed'"),
        ("--dt 0.03 --duration 1 --control-dt 0.1", "dt = 0.03 s does not divide"),
    ],
)
def test_a_wrong_option_is_one_line_that_names_it(words, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    stderr = fowt("connect", "serve", *words.split(), code=2)[1]
    assert message in stderr.strip().splitlines()[-1]
    assert not list(tmp_path.iterdir())
