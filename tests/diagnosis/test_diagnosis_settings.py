"""Settings of a diagnosis: complete, described, read from TOML, written into the result, all of them in use."""

import re
from pathlib import Path

import msgspec
import numpy as np
import pytest

from orchestrator.cli import main
from orchestrator.diagnosis.fit.fitting import split
from orchestrator.diagnosis.settings import DiagnosisSettings, FitSettings, SearchSettings
from orchestrator.errors import ScenarioError
from orchestrator.shared.settings import as_tables, described, read_settings, settings_of
from tools.settings_page import PAGE, page

ROOT = Path(__file__).resolve().parents[2]


def test_defaults_pass_their_own_bounds() -> None:
    settings = DiagnosisSettings()
    assert settings_of(as_tables(settings), DiagnosisSettings) == settings


def test_every_setting_says_why() -> None:
    for name, _, why in described(DiagnosisSettings):
        assert len(why.split()) >= 3, name


def test_every_setting_is_used() -> None:
    code = "\n".join(
        path.read_text() for path in (ROOT / "orchestrator" / "diagnosis").rglob("*.py") if path.name != "settings.py"
    )
    code += (ROOT / "orchestrator" / "diagnosis" / "settings.py").read_text().partition("def levels")[2]
    dead = [name for name, _, _ in described(DiagnosisSettings) if not re.search(rf"\.{name.split('.')[-1]}\b", code)]
    assert not dead


def test_no_threshold_lies_about_in_the_room() -> None:
    """Numbers other than units, halves and guards against a division by zero belong to the settings."""
    allowed = {"0.0", "0.5", "1.0", "2.0", "4.0", "100.0", "-1.0", "0.1"}
    shown = {"figures.py", "settings.py", "probe_settings.py"}  # looks, and the settings themselves
    arithmetic = {"STEADY", "SHORTEST_ONSET", "SMOOTHED", "AMPLITUDES"}  # of arithmetic, no thresholds
    room = ROOT / "orchestrator" / "diagnosis"
    # Tables of starts; formats of files, and what files may hold; a fact of the normal distribution.
    measures = {"bank", "binding", "draft", "mapping", "noise", "reading", "runner"}
    measuring = {room / "blackbox" / f"{name}.py" for name in measures}
    for path in sorted(set(room.rglob("*.py")) - measuring):
        if path.name in shown:
            continue
        text = re.sub(r'""".*?"""|#.*', "", path.read_text(), flags=re.DOTALL)
        numbers = set(re.findall(r"(?<![\w.\[{:])\d+\.\d+(?:e-?\d+)?", text))
        assert numbers <= allowed, f"{path.name}: {sorted(numbers - allowed)}"
        constants = set(re.findall(r"^([A-Z_]+) = \d", text, re.MULTILINE)) - arithmetic
        assert not constants or path.name == "outcome.py", path.name


def test_a_file_changes_what_it_names(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text("[search]\npenalty = 7\n[verdict.remainder]\nhats = 5\n")
    settings = read_settings(path, DiagnosisSettings)
    assert settings.search.penalty == 7.0
    assert settings.verdict.remainder.hats == 5
    assert msgspec.structs.replace(settings.search, penalty=5.0) == SearchSettings()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[search]\npenalti = 1", "unknown field `penalti`"),
        ("[search]\npenalty = -1", "`search.penalty` is wrong: expected `float` >= 0.0"),
        ('[search]\npenalty = "a"', "`search.penalty` is wrong: expected `float`, got `str`"),
        ("[search]\npenalty = inf", "`search.penalty` must be finite, but is inf"),
        ("[search]\npenalty = nan", "penalty"),
        ("[fit]\nfitted = 0.8", "`fit.fitted` must be at least 0.05 and less than `fit.looked_at`"),
        ("search = 3", "`search` is wrong"),
        ("[search", "must be TOML in UTF-8"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "s.toml"
    path.write_text(text)
    with pytest.raises(ScenarioError) as caught:
        read_settings(path, DiagnosisSettings)
    assert said in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_command_refuses_wrong_settings(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "s.toml"
    path.write_text("[search]\npenalti = 1\n")
    record = ROOT / "docs" / "examples" / "machine.csv"
    assert main(["diagnose", str(record), "--settings", str(path), "--out", str(tmp_path / "out")]) == 2
    assert "penalti" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_parts_follow_the_settings() -> None:
    settings = DiagnosisSettings(fit=FitSettings(fitted=0.25, looked_at=0.5))
    parts = split([1000], settings)[0]
    assert (parts.fitted, parts.validated, parts.held_out) == (slice(10, 250), slice(250, 500), slice(500, 1000))


def test_the_ladder_of_noise_is_even_in_the_logarithm() -> None:
    levels = np.array(DiagnosisSettings().levels)
    assert levels[0] == pytest.approx(3.0)
    assert levels[-1] == pytest.approx(1e-5)
    assert np.allclose(np.diff(np.log(levels)), np.log(levels[1] / levels[0]))


def test_the_page_lists_what_the_code_holds() -> None:
    assert PAGE.read_text() == page(), "run `python -m tools.settings_page`"
