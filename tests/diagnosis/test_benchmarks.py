"""The benchmarks' judge: what counts as right, allowed and wrong, under which grade, and what harm is."""

from dataclasses import replace
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from benchmarks.ablation import RuleCount, count_rule, paired_table
from benchmarks.harm import SEEN, falsify, harmed, missed, seen_part, simulated_effects
from benchmarks.judging import Row, Truth, grade_table, judge, size_line
from benchmarks.measured import truth_of
from benchmarks.simulated import Counts, simulated_tasks
from benchmarks.verdicts import GRADES, Estimate, NamedEffect, Outcome
from orchestrator.diagnosis.selection.grading import GRADE_RULES, highest_grade
from tests.support.hidden_effects import MACHINES, Ways, none_case, single_case

FRICTION = {"torque": Estimate(2.0, 1.5, 2.5)}
PAGE = Path(__file__).resolve().parents[2] / "docs" / "ablation.md"


def named(**grades: str) -> Outcome:
    """Return an outcome with effects, ``name__site=grade``, each with a torque of 1.5 to 2.5."""
    return Outcome({name.replace("__", "@"): NamedEffect(grade, FRICTION) for name, grade in grades.items()})


def row_of(outcome: Outcome, truth: Truth) -> Row:
    """Return the row of an outcome."""
    return Row("key", "group", "kind", outcome, judge(outcome, truth))


def test_a_name_is_right_by_its_label_its_name_or_its_family() -> None:
    truth = Truth((("coulomb_friction@load", "stribeck_friction"),))
    right = (named(coulomb_friction__load="likely"), named(stribeck_friction__motor="likely"))
    relative = Outcome({"quadratic_drag@load": NamedEffect("likely", {}, ("coulomb_friction@load",))})
    assert all(row_of(one, truth).is_right() for one in (*right, relative))
    assert not row_of(named(coulomb_friction__motor="likely"), truth).is_right()


def test_a_possible_name_neither_finds_nor_is_wrong() -> None:
    truth = Truth((("gravity_load",),))
    row = row_of(named(gravity_load__load="possible", backlash__shaft="possible"), truth)
    assert row.judgement.found == ("possible",)
    assert not row.is_right()
    assert row.wrong() == []
    assert row.wrong(GRADES) == ["backlash@shaft"]


def test_a_wrong_name_spoils_a_record_that_is_found() -> None:
    row = row_of(named(gravity_load__load="certain", backlash__shaft="likely"), Truth((("gravity_load",),)))
    assert row.judgement.found == ("certain",)
    assert row.wrong() == ["backlash@shaft"]
    assert not row.is_right()


def test_the_best_grade_counts_of_two_names_of_one_effect() -> None:
    outcome = named(coulomb_friction__motor="possible", coulomb_friction__load="certain")
    assert judge(outcome, Truth((("coulomb_friction",),))).found == ("certain",)


def test_what_no_reference_could_find_is_shown_apart() -> None:
    reference = {"told": {}, "allowed": ["spring_load"], "excluded": ["quadratic_drag"]}
    outcome = named(spring_load__load="likely", quadratic_drag__load="likely", backlash__shaft="likely")
    verdicts = judge(outcome, truth_of(reference)).verdicts
    assert verdicts == {"spring_load@load": "allowed", "quadratic_drag@load": "wrong", "backlash@shaft": "untested"}


@given(st.floats(0.1, 10.0), st.floats(0.0, 1.0))
def test_a_size_is_within_its_interval_widened_by_the_error_of_the_reference(value: float, error: float) -> None:
    truth = Truth((("coulomb_friction",),), sizes={"coulomb_friction": {"torque": (value, error)}})
    ((_, _, off, inside),) = judge(named(coulomb_friction__motor="certain"), truth).sizes
    assert inside == (1.5 - 2.0 * error <= value <= 2.5 + 2.0 * error)
    assert abs(off - (2.0 - value) / value) < 1e-9


def test_the_table_counts_names_by_grade_and_leaves_allowed_ones_out_of_the_share() -> None:
    truth = Truth((("gravity_load",),), ("spring_load",))
    rows = [
        row_of(named(gravity_load__load="certain", spring_load__load="certain"), truth),
        row_of(named(quadratic_drag__load="certain"), truth),
    ]
    assert "| certain | 3 | 1 | 1 | 1 | 0 | 50.0 % |" in grade_table(rows)
    assert size_line(rows) == "sizes: none"


def test_records_of_a_benchmark_are_told_apart_and_go_round_the_machines() -> None:
    tasks = simulated_tasks(Counts(none=4, single=60, double=30), 1, Ways())
    assert len({task.key for task in tasks}) == len(tasks) == 94
    assert {task.ways.machine for task in tasks} == set(MACHINES)


def test_sizes_go_with_the_machine() -> None:
    assert Ways().sized({"Fc_m": 1.0}) == {"Fc_m": 1.0}
    servo = Ways("servo").sized({"Fc_m": 1.0, "delay": 0.03, "rip_n": 6.0})
    assert servo["Fc_m"] < 0.5  # its torques are
    assert (servo["delay"], servo["rip_n"]) == (0.03, 6.0)


def test_a_true_name_predicts_the_unseen_part_and_a_false_one_does_harm() -> None:
    case = single_case("gravity", 17, 10.0, Ways("press"))
    linear = {name: Estimate(value, value, value) for name, value in case.truth["linear"].items()}
    sizes = {"amplitude": case.truth["effects"]["grav"], "phase": case.truth["effects"]["grav_ph"]}
    values = {name: Estimate(value, value, value) for name, value in sizes.items()}
    outcome = Outcome({"gravity_load@load": NamedEffect("certain", values)}, linear)
    true, false = simulated_effects(outcome.names), simulated_effects(falsify(outcome.names))
    assert true is not None
    assert false is not None
    without, right, wrong = (missed(case, outcome, effects) for effects in ({}, true, false))
    assert right < 1.5  # times the noise, rounding to counts included
    assert right < without < wrong
    rows = [row_of(replace(outcome, misfit={"unseen": (without, one)}), Truth()) for one in (right, wrong)]
    assert harmed(rows) == (1, 2)


def test_a_name_that_the_simulator_does_not_have_is_not_run() -> None:
    assert simulated_effects({"hardening_stiffness@shaft": NamedEffect("certain", {})}) is None


def test_the_diagnosis_gets_the_first_part_alone() -> None:
    case = none_case(3, 10.0)
    part = seen_part(case)
    assert part.size == round(SEEN * case.record.size)
    assert (part.theta_m == case.record.theta_m[: part.size]).all()


def test_the_ablation_counts_the_names_whose_grade_would_rise_without_a_rule() -> None:
    def row(label: str, *broken: str) -> Row:
        outcome = Outcome({label: NamedEffect(highest_grade(broken).word, {}, lowered_by=broken)})
        return replace(row_of(outcome, Truth((("gravity_load",),))), key=f"{label} {broken}")

    rows = [
        row("gravity_load@load", "sure size"),
        row("gravity_load@load", "sure size", "inertia seen"),
        row("backlash@shaft", "sure size"),
        row("backlash@shaft", "sure size", "size"),
        row("backlash@shaft", "enough share"),
    ]
    assert count_rule("sure size", rows) == RuleCount("sure size", records=2, wrong=1, right=1)
    assert count_rule("size", rows) == RuleCount("size", records=1, wrong=1, right=0)
    assert count_rule("inertia seen", rows) == RuleCount("inertia seen", records=0, wrong=0, right=0)


def test_the_page_of_the_ablation_has_the_rules_as_they_are() -> None:
    table = PAGE.read_text(encoding="utf-8").partition("\n## ")[0]
    cells = [[cell.strip() for cell in line.split("|")[1:5]] for line in table.splitlines() if line.startswith("| ")]
    rules = [[rule.name, rule.statistic, rule.setting and f"`{rule.setting}`", rule.reason] for rule in GRADE_RULES]
    assert sorted(cells[1:]) == sorted(rules)


def test_a_clean_record_that_is_said_to_lack_something_is_not_right() -> None:
    def clean(verdict: str, trust: str) -> Row:
        outcome = Outcome({"torque_ripple@motor": NamedEffect("possible", {})}, verdict=verdict, trust=trust)
        return Row("none::1", "none", "none", outcome, judge(outcome, Truth()))

    assert clean("parameters", "green").is_right()
    assert not clean("unknown", "red").is_right()
    assert not clean("effects", "red").is_right()
    assert not replace(clean("unknown", "red"), group="unknown").is_false_alarm()


def test_two_builds_are_compared_on_the_records_of_both() -> None:
    truth = Truth((("coulomb_friction@motor",),))
    before = row_of(named(coulomb_friction__motor="possible", input_delay__actuator="likely"), truth)
    after = row_of(named(coulomb_friction__motor="certain"), truth)
    table = paired_table([before, replace(before, key="alone")], [after])
    assert "| 1 records | before | after | more | fewer |" in table
    assert "| effects named | 0 | 1 | 1 | 0 |" in table
    assert "| *likely*, wrong | 1 | 0 | 0 | 1 |" in table
    assert "| *certain*, right | 0 | 1 | 1 | 0 |" in table
