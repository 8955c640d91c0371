"""FMUs with faults that a host meets away from start values: the plant with one fault, its cause and its rule.

One line for each: versions of FMI, interfaces, the fault in C (``-``: none), the rule that is meant, and what the
description has otherwise.
"""

from dataclasses import dataclass
from pathlib import Path

from tests.support.plant import build_plant

_TABLE = """
[values never move]
2 3 | CS | drop_parameter    | value.kept
2 3 | CS | drop_start        | value.kept
2 3 | ME | drop_text         | value.kept
2 3 | CS | drop_truth        | value.kept
2 3 | CS | drop_truth_input  | value.kept
2 3 | ME | drop_whole        | value.kept
2 3 | CS | drop_item         | value.kept
2 3 | CS | drop_whole_input  | value.lags
2 3 | CS | drop_input        | value.kept
2 3 | CS | tunable_ignored   | value.lags
2 3 | CS | input_lags        | value.lags
2 3 | CS | rounded           | value.kept
2 3 | CS | negated           | value.kept
2 3 | CS | clipped           | value.kept
2 3 | CS | short_text        | value.kept
3   | CS | first_element     | value.kept
3   | ME | last_element      | value.kept
3   | CS | elements_reversed | value.kept
2 3 | CS | start_lost        | value.kept
2 3 | ME | parameter_lost    | value.kept
2 3 | CS | calculated_default | value.calculated
2 3 | CS | calculated_late   | value.stale
2 3 | CS | output_stale      | value.stale
2 3 | CS | dead_parameter    | dependency.superfluous
2 3 | CS | dead_input        | dependency.superfluous
2 3 | CS | single            | value.kept
2 3 | CS | saturated         | value.lags
2 3 | CS | late_only         | value.kept
2 3 | CS | once_set          | value.lags
2 3 | CS | shared_value      | instances.interference
2 3 | CS | next_to           | value.kept
2 3 | CS | truth_sticks      | value.lags
2 3 | CS | inputs_cleared    | value.kept
2 3 | CS | start_blended     | value.kept
2 3 | CS | early_only        | value.kept
2 3 | ME | derived_early     | value.stale
2 3 | CS | clipped_far       | value.kept
2 3 | CS | text_plain        | value.kept
2 3 | CS | tunable_late      | value.lags
2 3 | CS | tunable_refused   | value.lags
2 3 | CS | dead_parameter    | dependency.superfluous | Initial der(v)=-

[reset after nothing was changed]
2 3 | CS | keep_parameter    | run.reset
2 3 | CS | keep_tunable      | run.reset
2 3 | ME | keep_text         | run.reset
2 3 | CS | keep_whole        | run.reset
2 3 | CS | keep_whole_input  | run.reset
2 3 | CS | keep_item         | run.reset
2 3 | CS | keep_truth        | run.reset
2 3 | CS | keep_truth_input  | run.reset
2 3 | CS | keep_input        | run.reset
2 3 | ME | keep_second_input | run.reset
2 3 | CS | keep_integrator   | run.reset
2 3 | CS | keep_switch       | run.reset
2 3 | CS | keep_count        | run.reset
3   | CS | keep_array        | run.reset
3   | CS | keep_size         | run.reset
3   | CS | keep_ticks        | run.reset | clock=decimal
2 3 | CS | keep_start        | run.reset
2 3 | CS | reset_once        | run.reset
2 3 | CS | keep_speed        | run.reset
2 3 | ME | keep_when_switched | run.reset
2 3 | CS | reset_initialising | run.reset
2 3 | CS | reset_leaks       | resources.instance-leak

[state restored, not looked at]
2 3 | CS | restored_output   | state.restore
2 3 | CS | restored_other    | state.restore
2 3 | CS | restored_switch   | state.restore
2 3 | CS | lose_input        | state.restore
2 3 | CS | lose_tunable      | state.restore
2 3 | CS | lose_whole_input  | state.restore
2 3 | ME | lose_truth_input  | state.restore
2 3 | CS | lose_switch       | state.restore
2 3 | CS | lose_count        | state.restore
2 3 | CS | lose_integrator   | state.restore
2 3 | CS | lose_time         | state.time
3   | CS | lose_ticks        | state.restore | clock=decimal
2 3 | CS | bytes_input       | state.serialise
2 3 | CS | bytes_text        | state.serialise
2 3 | CS | bytes_whole       | state.serialise
2 3 | CS | bytes_parameter   | state.serialise
2 3 | CS | clear_inputs      | state.restore
2 3 | ME | lose_speed        | state.restore
2 3 | CS | add_count         | state.restore
2 3 | CS | start_anew        | state.restore
2 3 | CS | restored_local    | state.restore
2 3 | CS | state_in_place    | state.status
2 3 | CS | bytes_pointer     | state.portable
2 3 | CS | bytes_overrun     | state.serialise

[dependencies declared, never perturbed]
2 3 | CS | -                 | dependency.missing | Output y=x
2 3 | ME | -                 | dependency.missing | Output y=x
2 3 | ME | -                 | dependency.missing | Output y=u
2 3 | ME | -                 | dependency.missing | Output y=
2 3 | CS | -                 | dependency.missing | Output o=
2 3 | ME | -                 | dependency.missing | Derivative der(v)=u x v j on
2 3 | ME | -                 | dependency.missing | Derivative der(v)=u w x v on
2 3 | ME | -                 | dependency.missing | Derivative der(x)=;Derivative kinds der(x)=
2 3 | CS | hidden_feed       | dependency.missing
2 3 | CS | -                 | dependency.initial | Initial y=x
2 3 | CS | -                 | dependency.initial | Initial c=
2 3 | CS | -                 | dependency.initial | Initial z=v
2 3 | CS | -                 | dependency.initial | Initial der(v)=u w x v d i m b j on
2 3 | CS | -                 | dependency.kind    | Output kinds y=dependent constant
2 3 | ME | -                 | dependency.kind    | Output kinds y=constant fixed
2 3 | ME | -                 | dependency.kind    | Output kinds z=constant dependent
2 3 | ME | -                 | dependency.kind    | Derivative kinds der(v)=constant dependent dependent fixed dependent dependent
2 3 | ME | -                 | dependency.kind    | Derivative kinds der(v)=constant constant dependent dependent dependent dependent
2 3 | ME | feeds_at_times    | dependency.missing
2 3 | CS | feeds_switched    | dependency.missing
2 3 | ME | rate_of_integral  | dependency.missing
2 3 | ME | feeds_unswitched  | dependency.missing
2 3 | ME | -                 | dependency.kind    | Output kinds y=dependent tunable
2 3 | ME | -                 | dependency.kind    | Output kinds y=dependent discrete
3   | ME | -                 | dependency.missing | Indicator z1=v

[derivatives]
2 3 | ME | at_start          | derivative.value | directional
2 3 | ME | at_rest           | derivative.value | directional
2 3 | ME | without_feed      | derivative.value | directional
2 3 | CS | without_feed      | derivative.value | directional
2 3 | ME | feed_sign         | derivative.value | directional
2 3 | ME | state_sign        | derivative.value | directional
2 3 | ME | without_state     | derivative.value | directional
2 3 | ME | without_product   | derivative.value | directional
2 3 | ME | linearised        | derivative.value | directional
2 3 | ME | wrong_output      | derivative.value | directional
2 3 | ME | seed_ignored      | derivative.value | directional
2 3 | ME | second_seed       | derivative.value | directional
3   | ME | at_start          | derivative.value | adjoint
3   | ME | second_seed       | derivative.value | adjoint
3   | ME | adjoint_state     | derivative.adjoint | both
2 3 | ME | asked_alone       | derivative.value | directional
3   | ME | asked_alone       | derivative.value | adjoint
2 3 | CS | -                 | derivative.value | step flags=maxOutputDerivativeOrder="2"

[model exchange]
2 3 | ME | -                 | states.order    | attributes der(x)=derivative="v";attributes der(v)=derivative="x"
2 3 | ME | states_order      | states.order
2 3 | ME | states_order_in   | states.order
2 3 | ME | state_not_set     | states.order
2 3 | ME | state_variable_stale | states.order
2 3 | ME | rates_order       | states.rates
2 3 | ME | rate_named        | states.rates
2 3 | ME | rate_wrong        | states.rates
2 3 | ME | nominals_order    | states.nominal-differs
2 3 | ME | nominals_others   | states.nominal-differs
2 3 | ME | event_silent      | event.states-changed
2 3 | ME | event_jump        | event.states-changed
2 3 | ME | near_wall         | event.reinit    | attributes v=start="0" nominal="2"
2 3 | CS ME | interfaces     | interfaces.differ
2 3 | ME | small_ignored     | states.order
2 3 | ME | rates_late        | states.rates
2 3 | ME | output_cached     | value.stale
2 3 | ME | rates_by_steps    | states.history
2 3 | ME | quiet_count       | event.outside
2 3 | ME | quiet_jump        | event.states-changed
2 3 | CS ME | count_in_steps | interfaces.differ

[promised, never called]
2   | CS | interpolation_refused | promise.refused | step flags=canInterpolateInputs="true"
2   | CS | interpolation_second  | promise.refused | step flags=canInterpolateInputs="true"
2 3 | CS | category_refused      | log.refused
2 3 | ME | second_category       | log.refused
2 3 | CS | logging_refused       | log.refused
2 3 | CS | logging_off_refused   | log.refused
2 3 | CS | second_order_refused  | promise.refused | step flags=maxOutputDerivativeOrder="2"
2 3 | CS | slopes_refused        | derivative.status | step flags=maxOutputDerivativeOrder="1"
3   | CS | evaluate_refused      | promise.refused | clock=decimal;evaluate
3   | ME | evaluate_refused      | promise.refused | evaluate
3   | CS | fraction_refused      | promise.refused | clock=fraction
3   | CS | fraction_wrong        | clock.interval-value | clock=fraction

[values]
2 3 | CS | item_zero         | value.item
2 3 | CS | item_beyond       | value.item
2 3 | CS | item_start        | value.item
2 3 | ME | item_negative     | value.item
2 3 | CS | item_switch       | value.item
2 3 | CS | item_of_parameter | value.item
2 3 | CS | truth_seven       | value.boolean
2 3 | CS | truth_bits        | value.boolean
2 3 | ME | truth_later       | value.boolean
2 3 | CS | truth_of_parameter | value.boolean
3   | CS | binary_long       | value.binary-size
3   | ME | binary_later      | value.binary-size
2 3 | CS | text_latin        | value.text
2 3 | CS | text_later        | value.text
2 3 | CS | truth_minus       | value.boolean
2 3 | CS | text_shared       | value.batch

[life cycle]
2 3 | CS | ended_get         | ended.get
2 3 | ME | ended_real        | ended.get
2 3 | CS | ended_truth       | ended.get
2 3 | CS | ended_text        | ended.get
2 3 | CS | reset_ended       | run.reset
2 3 | CS | fixed_accepted    | misuse.set-fixed
2 3 | ME | fixed_accepted    | misuse.set-fixed
2 3 | CS | fixed_whole_accepted | misuse.set-fixed
2 3 | CS | fixed_truth_accepted | misuse.set-fixed
2 3 | CS | constant_accepted | misuse.set-fixed
2 3 | CS | token_prefix      | misuse.guid
2 3 | CS | token_suffix      | misuse.guid
2 3 | ME | token_case        | misuse.guid
2 3 | CS | token_short       | misuse.guid
2 3 | CS | token_length      | misuse.guid
2 3 | CS | token_contained   | misuse.guid
2 3 | CS | chatty            | log.off
2 3 | ME | chatty_start      | log.off
2 3 | CS | chatty_late       | log.off
2 3 | CS | start_ignored     | start.time
2 3 | ME | start_zero        | start.time
2 3 | CS | start_refused     | start.time
2 3 | CS | start_negative    | start.time
2 3 | CS | clock_at_zero     | start.time
2 3 | CS | step_after_end    | misuse.step-after-end
3   | CS | last_before       | step.last-time
3   | CS | ends_early        | run.skipped

[own step inside]
2 3 | CS | own_step          | steps.internal | step=0.015
2 3 | CS | own_step          | steps.internal | step=0.015;fixed steps
2 3 | CS | own_coarse        | steps.internal | step=0.02
2 3 | CS | own_coarse        | steps.internal | step=0.04
2 3 | CS | own_fine          | steps.internal | step=0.01
2 3 | CS | own_sampled       | steps.internal | step=0.02
2 3 | CS | own_slow          | steps.internal | step=0.02
2 3 | CS | own_behind        | steps.internal | step=0.015
2 3 | CS | own_drift         | steps.internal | step=0.015
2 3 | CS | own_round         | steps.internal | step=0.015
2 3 | CS | time_runs         | steps.time
"""  # noqa: E501
_SHORT = {
    "directional": {
        "2": {"flags": 'providesDirectionalDerivative="true"'},
        "3": {"flags": 'providesDirectionalDerivatives="true"'},
    },
    "adjoint": {"3": {"flags": 'providesAdjointDerivatives="true"'}},
    "both": {"3": {"flags": 'providesDirectionalDerivatives="true" providesAdjointDerivatives="true"'}},
    "evaluate": {"3": {"flags": 'providesEvaluateDiscreteStates="true"'}},
    "fixed steps": {"2": {"fixed steps": ""}, "3": {"fixed steps": ""}},
}


@dataclass(frozen=True)
class BrokenPlant:
    """A plant with one fault: its cause, the rule that is meant, and how it is made."""

    cause: str
    version: str
    interfaces: str
    fault: str
    rule: str
    changes: tuple[tuple[str, str], ...]

    @property
    def name(self) -> str:
        """A name that no other has."""
        more = " ".join(f"{key}={value}" for key, value in self.changes)
        return f"{self.version} {self.interfaces} {self.fault} {more}".strip()

    @property
    def clock(self) -> str:
        """What clock the plant has; empty: none."""
        return dict(self.changes).get("clock", "")

    def build(self, path: Path) -> Path:
        """Build it at ``path`` and return that."""
        return build_plant(path, self.version, self.interfaces, self.fault.strip("-"), dict(self.changes))


def broken_plants() -> list[BrokenPlant]:
    """All of them."""
    found = []
    cause = ""
    for line in filter(None, _TABLE.splitlines()):
        if line.startswith("["):
            cause = line.strip("[]")
            continue
        versions, interfaces, fault, rule, *more = (cell.strip() for cell in line.split("|"))
        for version in versions.split():
            changes: dict[str, str] = {}
            for change in more[0].split(";") if more else ():
                changes |= _SHORT[change][version] if change in _SHORT else dict([change.split("=", 1)])
            found.append(BrokenPlant(cause, f"{version}.0", interfaces, fault, rule, tuple(changes.items())))
    return found
