"""SSP files: written and read back, run by another tool, nested systems, parameter bindings, bad input."""

import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import ParameterSet, read_ssd, read_ssv

from orchestrator.building.build import ensure_built
from orchestrator.cli import main
from orchestrator.errors import ConnectionMismatchError, FmuError, InputError, ScenarioError
from orchestrator.fmi.instances import fmu_instance
from orchestrator.master.algorithms import GaussSeidel, Jacobi
from orchestrator.master.signals import Constant, Sine, Step
from orchestrator.master.system import SignalSource, System
from orchestrator.paired.experiment import Experiment
from orchestrator.paired.scenario import scenario_of_pair
from orchestrator.scenarios.scenario import Scenario, simulate
from orchestrator.scenarios.ssp.read import open_ssp
from orchestrator.scenarios.ssp.write import write_ssp


@pytest.fixture(scope="module")
def fmus() -> dict[str, Path]:
    return ensure_built()


@pytest.fixture(scope="module")
def scenario(fmus) -> Scenario:
    return replace(scenario_of_pair(Experiment(), fmus, 0.02, 0.5), stop=0.3)


@pytest.fixture(scope="module")
def package(scenario, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("ssp") / "paired.ssp"
    write_ssp(path, scenario)
    return path


def test_what_is_written_reads_back_as_the_same_run(scenario, package) -> None:
    with open_ssp(package) as again:
        assert again.algorithm == GaussSeidel(1e-3)
        assert again.stop == 0.3
        assert again.system.execution_order()[:3] == ("plant", "estimator", "controller")
        found, expected = simulate(again), simulate(scenario)
    for name in expected.names:
        np.testing.assert_array_equal(found[name], expected[name])


@pytest.mark.parametrize("stated", [None, 1e-8])
def test_how_exactly_fmus_solve_is_kept(scenario, tmp_path, stated) -> None:
    instances = tuple(replace(i, solver_tolerance=stated) for i in scenario.system.instances)
    write_ssp(tmp_path / "s.ssp", replace(scenario, system=replace(scenario.system, instances=instances)))
    with zipfile.ZipFile(tmp_path / "s.ssp") as archive:
        text = archive.read("SystemStructure.ssd").decode()
    assert f'relativeTolerance="{stated or 1e-4}"' in text  # OMSimulator hands 0 to FMUs where it is left out
    with open_ssp(tmp_path / "s.ssp") as again:
        assert {i.solver_tolerance for i in again.system.instances} == {stated}


def test_fmpy_runs_it_to_the_same_bits(package) -> None:
    values = ParameterSet(name="all")
    with zipfile.ZipFile(package) as archive:
        files = [name for name in archive.namelist() if name.endswith(".ssv")]
    for file in files:
        for parameter in read_ssv(str(package), resource=file).parameters:
            parameter.name = f"{Path(file).stem}.{parameter.name}"
            values.parameters.append(parameter)
    theirs = simulate_ssp(str(package), stop_time=0.3, step_size=1e-3, parameter_set=values)
    with open_ssp(package, simultaneous=True) as again:
        assert again.algorithm == Jacobi(1e-3)
        ours = simulate(again)
    for name in ("plant.theta_l", "twin_plant.theta_m", "controller.u", "estimator.T_l_hat"):
        # FMPy takes a first step with all inputs at zero: its row after step n is the true row at the start of step n.
        np.testing.assert_array_equal(theirs[name][:300], ours[name][:300])


def test_files_follow_the_schemas_and_repeat(scenario, package, tmp_path: Path) -> None:
    assert len(read_ssd(str(package), validate=True).system.elements) == 6
    again = tmp_path / "again.ssp"
    write_ssp(again, scenario)
    assert again.read_bytes() == package.read_bytes()


def test_what_ssp_cannot_say_is_refused(fmus, scenario, tmp_path: Path) -> None:
    system = System((fmu_instance("plant", fmus["Drivetrain"]),), (), (SignalSource("plant.u", Sine(1.0, 1.0)),))
    with pytest.raises(ScenarioError, match=r"\$\.sources\[0\]: must be constant"):
        write_ssp(tmp_path / "a.ssp", replace(scenario, system=system))
    connections = tuple(replace(c, quantum=1e-3) for c in scenario.system.connections)
    with pytest.raises(ScenarioError, match="quantum: must be 0"):
        write_ssp(tmp_path / "a.ssp", replace(scenario, system=replace(scenario.system, connections=connections)))
    assert not list(tmp_path.iterdir())


# Files of others -------------------------------------------------------------------------------------------------

HEAD = """<?xml version="1.0"?>
<ssd:SystemStructureDescription name="n" version="1.0"
 xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
 xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"
 xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
 xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping">
"""
NESTED = """<ssd:System name="outer">
 <ssd:Connectors><ssd:Connector name="torque" kind="input"><ssc:Real/></ssd:Connector></ssd:Connectors>
 <ssd:ParameterBindings><ssd:ParameterBinding prefix="drive."><ssd:ParameterValues>
  <ssv:ParameterSet version="1.0" name="p"><ssv:Parameters>
   <ssv:Parameter name="plant.alpha"><ssv:Real value="2" unit="deg"/></ssv:Parameter>
  </ssv:Parameters></ssv:ParameterSet>
 </ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>
 <ssd:Elements>
  <ssd:System name="drive">
   <ssd:Connectors>
    <ssd:Connector name="u" kind="input"><ssc:Real/></ssd:Connector>
    <ssd:Connector name="angle" kind="output"><ssc:Real/></ssd:Connector>
   </ssd:Connectors>
   <ssd:Elements>
    <ssd:Component name="plant" source="resources/Drivetrain.fmu">
     <ssd:Connectors>
      <ssd:Connector name="u" kind="input"><ssc:Real/></ssd:Connector>
      <ssd:Connector name="theta_m" kind="output"><ssc:Real/></ssd:Connector>
     </ssd:Connectors>
     <ssd:ParameterBindings><ssd:ParameterBinding>
      <ssd:ParameterValues><ssv:ParameterSet version="1.0" name="p"><ssv:Parameters>
       <ssv:Parameter name="size"><ssv:Real value="1"/></ssv:Parameter>
       <ssv:Parameter name="kind"><ssv:Enumeration value="nordin"/></ssv:Parameter>
      </ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues>
      <ssd:ParameterMapping><ssm:ParameterMapping version="1.0">
       <ssm:MappingEntry source="size" target="alpha"/>
       <ssm:MappingEntry source="kind" target="backlash_model"/>
      </ssm:ParameterMapping></ssd:ParameterMapping>
     </ssd:ParameterBinding></ssd:ParameterBindings>
    </ssd:Component>
   </ssd:Elements>
   <ssd:Connections>
    <ssd:Connection startConnector="u" endElement="plant" endConnector="u">
     <ssc:LinearTransformation factor="3" offset="1"/></ssd:Connection>
    <ssd:Connection startElement="plant" startConnector="theta_m" endConnector="angle"/>
   </ssd:Connections>
  </ssd:System>
  <ssd:Component name="estimator" source="resources/KalmanEstimator.fmu">
   <ssd:Connectors>
    <ssd:Connector name="theta_m" kind="input"><ssc:Real/></ssd:Connector>
    <ssd:Connector name="theta_m_hat" kind="output"><ssc:Real/></ssd:Connector>
   </ssd:Connectors>
  </ssd:Component>
 </ssd:Elements>
 <ssd:Connections>
  <ssd:Connection startConnector="torque" endElement="drive" endConnector="u"/>
  <ssd:Connection startElement="estimator" startConnector="theta_m" endElement="drive" endConnector="angle"/>
 </ssd:Connections>
</ssd:System>
<ssd:DefaultExperiment startTime="0" stopTime="0.05"/>
</ssd:SystemStructureDescription>
"""


def pack(folder: Path, fmus: dict[str, Path], structure: str = NESTED, **more: bytes) -> Path:
    path = folder / "theirs.ssp"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", HEAD + structure)
        for name in ("Drivetrain", "KalmanEstimator"):
            archive.write(fmus[name], f"resources/{name}.fmu")
        for name, content in more.items():
            archive.writestr(name, content)
    return path


def test_nested_systems_bindings_mappings_and_transformations(fmus, tmp_path: Path) -> None:
    with open_ssp(pack(tmp_path, fmus), {"torque": Constant(4.0)}, step=1e-3) as found:
        assert [i.name for i in found.system.instances] == ["drive/plant", "estimator"]
        start = found.system.instances[0].start
        assert start == {"alpha": pytest.approx(np.deg2rad(2.0)), "backlash_model": "nordin"}
        assert [(c.source, c.target) for c in found.system.connections] == [
            ("drive/plant.theta_m", "estimator.theta_m")
        ]
        assert len(simulate(found).time) == 51


def test_outer_inputs_reach_through_with_their_transformation(fmus, tmp_path: Path) -> None:
    with open_ssp(pack(tmp_path, fmus), {"torque": Constant(4.0)}, step=1e-3) as found:
        result = simulate(replace(found, record=("drive/plant.u",)))
    assert result.values[0, -1] == 13.0


CONTROLLER = """<ssd:System name="root">
 <ssd:Connectors><ssd:Connector name="angle" kind="input"><ssc:Real/></ssd:Connector></ssd:Connectors>
 <ssd:Elements>
  <ssd:Component name="controller" source="resources/LqrController.fmu">
   <ssd:Connectors>
    <ssd:Connector name="theta_l_hat" kind="input"><ssc:Real/></ssd:Connector>
    <ssd:Connector name="u" kind="output"><ssc:Real/></ssd:Connector>
   </ssd:Connectors>
  </ssd:Component>
 </ssd:Elements>
 <ssd:Connections>
  <ssd:Connection startConnector="angle" endElement="controller" endConnector="theta_l_hat"/>
 </ssd:Connections>
</ssd:System>
<ssd:DefaultExperiment startTime="0" stopTime="0.01"/>
</ssd:SystemStructureDescription>
"""


def test_what_is_fed_in_at_a_communication_point_holds_from_there_on(fmus, tmp_path: Path) -> None:
    path = pack(tmp_path, fmus, CONTROLLER, **{"resources/LqrController.fmu": fmus["LqrController"].read_bytes()})
    with open_ssp(path, {"angle": Step(0.003, 1.0)}, step=1e-3) as found:
        assert found.system.has_feedthrough(
            "controller.theta_l_hat"
        )  # a sampled-data block would be given what comes next
        torque = simulate(found)["controller.u"]
    assert not np.any(torque[:4])
    assert torque[4] != 0.0


@pytest.mark.parametrize(
    ("change", "error", "expected"),
    [
        (('endConnector="angle"/>', 'endConnector="angel"/>'), ConnectionMismatchError, "'angel' is none"),
        (('name="alpha"', 'name="alhpa"'), None, ""),
        (('target="alpha"', 'target="alhpa"'), ScenarioError, "did you mean 'alpha'"),
        (('unit="deg"', 'unit="N.m"'), ScenarioError, "does not measure what rad does"),
        (("resources/Drivetrain.fmu", "../Drivetrain.fmu"), ScenarioError, "must be a file of the archive"),
        (("resources/Drivetrain.fmu", "SystemStructure.ssd"), FmuError, "intact zip archive"),
        (('kind="input"', 'kind="inputt"'), ScenarioError, "must follow SystemStructureDescription.xsd"),
        (('name="theta_m_hat"', 'name="theta_x"'), ConnectionMismatchError, "must be a variable of KalmanEstimator"),
        (('startTime="0" stopTime="0.05"', 'startTime="1" stopTime="0"'), ScenarioError, "`stop` must be"),
        (("</ssd:System>", ""), ScenarioError, "well-formed"),
    ],
)
def test_what_is_wrong_is_named(fmus, tmp_path: Path, change, error, expected: str) -> None:
    path = pack(tmp_path, fmus, NESTED.replace(*change))
    if error is None:
        assert change[0] not in NESTED
        return
    with pytest.raises(InputError) as caught, open_ssp(path, step=1e-3) as found:
        simulate(found)
    assert type(caught.value) is error
    assert expected in str(caught.value)


def test_archives_that_are_none_or_lead_outside(fmus, tmp_path: Path) -> None:
    (tmp_path / "a.ssp").write_bytes(b"no zip")
    for path, expected in (
        (tmp_path / "a.ssp", "`ssp` must be an intact zip archive"),
        (tmp_path / "none.ssp", "`ssp` must exist"),
        (pack(tmp_path, fmus, **{"../evil": b"x"}), "must lie within the archive"),
    ):
        with pytest.raises(ScenarioError, match=expected), open_ssp(path):
            pass


def test_commands(fmus, tmp_path: Path, capsys) -> None:
    assert main(["ssp", "export", "--alpha", "0.01", "--out", str(tmp_path / "e")]) == 0
    assert sorted(p.name for p in (tmp_path / "e").iterdir()) == ["paired.ssp", "report.html", "ssp.json"]
    words = ["ssp", "run", str(tmp_path / "e" / "paired.ssp"), "--stop", "0.1", "--out", str(tmp_path / "r")]
    assert main(words) == 0
    assert "plant.theta_l" in capsys.readouterr().out
    assert (tmp_path / "r" / "ssp.csv").read_text().count("\n") == 102
    assert main(["ssp", "run", str(tmp_path / "none.ssp"), "--out", str(tmp_path / "x")]) == 2
    assert main(["ssp", "run", "--out", str(tmp_path / "x")]) == 2
    assert main(["ssp", "export", "--alpha", "-1", "--out", str(tmp_path / "x")]) == 2
    assert capsys.readouterr().err.count("\n") == 3
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["run", "."], "must be an archive, but . is a directory"),
        (["run", "a.ssp", "--alpha", "0.1"], "`--alpha` must be left out of `ssp run`"),
        (["run", "--scenario", "a.toml"], "`--scenario` must be left out of `ssp run`"),
        (["export", "a.toml"], "must be given a scenario by --scenario"),
        (["export", "--jacobi"], "`--jacobi` must be left out of `ssp export`"),
        (["export", "--scenario", "a.toml", "--alpha", "0.1"], "`--alpha` must be left out of `ssp export --scenario`"),
    ],
)
def test_words_that_do_not_fit_the_action(tmp_path: Path, capsys, words: list[str], expected: str) -> None:
    assert main(["ssp", *words, "--out", str(tmp_path / "x")]) == 2
    assert expected in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


def test_a_file_that_ssp_cannot_say_is_named(fmus, tmp_path: Path, capsys) -> None:
    file = tmp_path / "moved.toml"
    file.write_text(
        f"""
stop = 0.01
record = ["plant.theta_m"]
[master]
algorithm = "jacobi"
step = 1e-3
[instances.plant]
fmu = {str(fmus["Drivetrain"])!r}
[[sources]]
to = "plant.u"
kind = "sine"
amplitude = 1.0
frequency = 1.0
""",
        encoding="utf-8",
    )
    assert main(["ssp", "export", "--scenario", str(file), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert said.splitlines()[-1] == f"error: {file}: $.sources[0]: must be constant to be written as SSP, but varies"


def test_a_single_fmu_without_connections(tmp_path: Path) -> None:
    scenario = tmp_path / "alone.toml"
    scenario.write_text(
        'stop = 0.01\nrecord = ["plant.theta_m"]\n[master]\nalgorithm = "jacobi"\nstep = 1e-3\n'
        '[instances.plant]\nfmu = "Drivetrain"\n[[sources]]\nto = "plant.u"\nkind = "constant"\nvalue = 3.0\n'
    )
    assert main(["ssp", "export", "--scenario", str(scenario), "--out", str(tmp_path / "out")]) == 0
    assert main(["ssp", "run", str(tmp_path / "out" / "alone.ssp"), "--out", str(tmp_path / "run")]) == 0
