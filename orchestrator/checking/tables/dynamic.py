"""The rules of what is run: a stage per probe, and `run` for what may happen in any of them.

See ``rules`` for the columns.
"""

DYNAMIC = """
[run]
limits.time | E | * | * | no call takes longer than the time limit | look for an endless loop; raise the limit for a slow model
limits.total | I | * | * | all probes are done within the total time | raise the total limit, or make DefaultExperiment shorter
limits.memory | E | * | * | memory stays below the memory limit | look for a leak; raise the limit for a large model
limits.output | E | * | * | printed text and files stay small | print only when logging is on
run.crash | E | * | * | no call ends the process | run the call named under a debugger
run.failed | E | * | * | the checks can be carried out | report this with the FMU
run.not-executed | E | * | * | the FMU is executed, unless that is not asked for | check it where its binaries run, or ask for the static checks only
run.skipped | I | * | * | all checks can be carried out | mend the other findings first

[load]
load.library | E | 2.3 | 2.5.1.4 | the library loads | see the loader's message; link what is missing
load.version | E | 2.1.4 | 2.2.5 | GetVersion returns the version of the description | return fmi2Version or fmi3Version
load.platform | E | 2.1.4 | - | fmi2GetTypesPlatform returns default | return fmi2TypesPlatform

[life cycle]
run.instantiate | E | 2.1.5 | 2.3.1 | instantiation succeeds | see the messages of the FMU
run.status | E | 4.2.4 | 2.3 | every call of a normal life cycle returns OK or Warning | see the messages of the FMU
run.pending | E | 4.2.2 | - | fmi2Pending only with canRunAsynchronuously | return when the step is done, or set the flag
run.warning | W | 2.1.3 | 2.2.4 | calls of a normal life cycle return OK, not Warning | see the message; every host goes on after it, and not every host shows it
run.logged-error | W | 2.1.3 | 2.2.4 | what is logged as an error comes with a status of an error | return an error, or log it as a warning
run.python-exception | W | * | * | no call leaves an exception of Python in the thread | call PyErr_Clear before the function returns; the next call may fail for it
value.not-finite | E | 2.2.7 | 2.4.7.5 | outputs are finite | look for a division by zero or a missing initialisation
value.out-of-range | W | 2.2.7 | 2.2.7.3 | outputs stay within min and max | correct the bounds or the model
value.start | W | 2.2.7 | 2.4.7.5 | start values of the XML are those of the binary | generate both from one source
value.string | E | 2.1.7 | 2.2.7.2 | strings and binaries are not null | return "" instead
value.item | E | 2.2.7 | 2.4.7.5 | enumerations are items of their type | return the value of an item
value.boolean | E | 2.1.2 | 2.2.7.2 | Booleans are true or false, 1 or 0 | return the result of a comparison, not a count or a mask
value.binary-size | E | - | 2.4.7.5 | binaries have at most maxSize bytes | shorten them, or correct maxSize
value.text | E | 2.1.2 | 2.2.7.2 | strings are UTF-8 | encode them before they are returned
step.discarded | W | 4.2.2 | 4.2.1 | steps of the size that is asked for are done | many importers end the run there: do shorter steps inside, or state a stepSize that works
step.last-time | E | - | 4.2.1 | lastSuccessfulTime lies in the step | return the time that was reached
step.no-progress | E | - | 4.2.1 | a step gets on | return early only after an event that is new
step.early-return | E | - | 4.1.3 | fmi3DoStep returns early only where the flags and earlyReturnAllowed allow it | set mightReturnEarlyFromDoStep, or go on to the end of the step
event.not-used | E | - | 4.2.1 | no event is announced where event mode is not used | handle it inside the step
event.endless | E | 3.2.2 | 2.3.5 | the discrete states settle after a few updates | say that nothing is left to do when it is so
event.next-time | E | 3.2.2 | 2.3.5 | the next event is in the future | return the time of the next event, or say that there is none
event.without-cause | W | - | 2.3.5 | an event changes something | refresh event indicators when event mode is left
states.count | E | - | 2.4.8 | the number of states is that of ModelStructure | list every state, or correct the count
states.nominal | E | 3.2.2 | 3.2.1 | nominal values of states are positive | return 1.0 where nothing is known
indicators.count | E | - | 2.4.8 | the number of event indicators is that of ModelStructure | list every event indicator, or correct the count
event.states-changed | E | 3.2.2 | 2.3.5 | an event that changes states says so | set valuesOfContinuousStatesChanged when states have changed
event.reinit | E | 2.2.7 | 2.4.7.5 | an event changes only states that have reinit | write reinit="true" at the state
clock.interval-value | E | - | 2.2.8.4 | intervals and qualifiers of clocks are valid, and those of constant clocks as described | return what the description says
clock.deactivation | E | - | 2.2.8.2 | output clocks are inactive after the update of the discrete states | deactivate them in fmi3UpdateDiscreteStates
partition.preemption | E | - | 5.2.1 | preemption is unlocked as often as it is locked | call unlockPreemption on every way out

[inputs]
run.input-refused | W | 2.1.7 | 2.2.7.3 | inputs within their bounds are accepted | state the bounds in min and max
run.moved-crash | W | 2.1.7 | 2.2.7.3 | values within the limits of the description do not end the process | refuse such a value, or state min and max

[determinism]
run.inexact | W | * | * | runs that must be equal are so bit for bit, not only to a thousandth of the range | save and reset the memory of the solver too
run.determinism | W | * | * | two equal runs are equal | seed random numbers, initialise memory

[setting]
value.set | E | 2.1.7 | 2.3.2 | start values can be set before initialisation, and change nothing | accept what the XML says can be set
value.set-initial | W | 2.1.7 | 2.3.2 | variables with initial exact accept their start value before initialisation | accept it, or write initial="calculated"

[values]
value.kept | E | 2.1.7 | 2.2.7.2 | a value that is set is there | store the value, every element of it, where it is used and read
value.batch | E | 2.1.7 | 2.2.7.2 | values that are read in one call are those that are read one by one | go through all value references, and keep each text in a place of its own
value.lags | W | 2.1.7 | 2.2.7.2 | inputs and tunable parameters that are set at a communication point are there | store the value when it is set, not with the next step
value.stale | W | 2.2.7 | 2.3.3 | what is read follows what was set before | compute values when they are read, or when something is set
value.calculated | W | 2.2.7 | 2.4.7.4 | calculated parameters follow the parameters that they depend on | compute them when initialisation mode is left

[instances]
instances.second | E | 2.1.5 | 2.4.2 | a second instance can be made | set canBeInstantiatedOnlyOncePerProcess, or remove global state
instances.interference | E | 2.1.5 | 2.2.1 | instances do not influence one another | move global variables into the instance

[reset]
run.reset | E | 2.1.6 | 2.3.1 | a reset returns the instance to its first state | restore every variable, hidden ones too

[state]
state.status | E | 2.1.8 | 2.2.7.4 | the state functions work as the flags promise | implement them, or clear the flag
state.restore | E | 2.1.8 | 2.2.7.4 | a restored state continues as before | save every variable and clock, hidden ones too, by value
state.serialise | E | 2.1.8 | 2.2.7.4 | a serialised state continues as before, also in a new instance | serialise every variable
state.portable | W | 2.1.8 | 2.2.7.4 | a serialised state is usable in another process, as one that was stored in a file is | serialise what pointers lead to, not the pointers
state.time | W | 2.1.8 | 2.2.7.4 | a restored state has its time | save the time too
state.free | W | 2.1.8 | 2.2.7.4 | freeing a state sets it to null | set the pointer to NULL

[variable steps]
steps.variable | W | 4.3.1 | 4.4 | results hardly depend on the communication step | integrate over the step given, or clear canHandleVariableCommunicationStepSize

[inner steps]
steps.internal | W | 4.2.2 | 4.2.1 | communication steps are multiples of the steps inside | end the last step inside at the communication point, or state a stepSize that is a multiple

[time]
steps.time | W | 4.2.2 | 4.2.1 | the independent variable is not later than the communication point | take the time from the arguments of the step

[dependencies]
dependency.missing | E | 2.2.8 | 2.4.8 | what reacts to a known at once lists it among its dependencies | add it; hosts order their calls by that list
dependency.initial | W | 2.2.8 | 2.4.8 | what reacts to a known in initialisation mode lists it in InitialUnknowns | add it; hosts initialise loops by that list
dependency.kind | E | 2.2.8 | 2.4.8 | factors are as dependenciesKind says | write dependent, or leave dependenciesKind out
dependency.superfluous | I | 2.2.8 | 2.4.8 | dependencies that are stated are seen | see whether the value is used; list dependencies without it where it is none of them

[states]
states.order | E | 3.2.1 | 3.2.1 | states stand in the order of ModelStructure, by the attribute derivative | correct the order, or the attribute derivative
states.rates | E | 3.2.2 | 3.2.1 | derivatives of states are those of their variables, in the order of ModelStructure | compute both from one place
states.nominal-differs | W | 3.2.2 | 3.2.1 | nominal values of states are those of the description | generate both from one source
states.history | W | 3.2.1 | 3.2.1 | between events, derivatives follow time, states and inputs alone | compute them from what was set last; change what is remembered in event mode
event.outside | W | 2.2.7 | 2.4.7.4 | in model exchange, discrete variables change in event mode only | change them in event mode; ask for it by an event indicator, nextEventTime or enterEventMode
states.slope | I | 2.2.7 | 2.4.7.5 | a variable with the attribute derivative is the derivative of that state | correct the variable, or the attribute derivative

[derivatives]
derivative.status | E | 2.1.9 | 2.2.11 | derivatives are given as the flags promise | implement the function, or clear the flag
derivative.value | W | 2.1.9 | 2.2.11 | derivatives are those of small changes | differentiate what is computed
derivative.adjoint | E | - | 2.2.11 | adjoint derivatives are the directional ones transposed | compute both from one matrix

[interfaces]
interfaces.differ | W | * | * | co-simulation and model exchange of one FMU give the same outputs | generate both from one model, with the same parameters

[intermediate update]
intermediate.unexpected | E | - | 4.2.2 | intermediateUpdate is called in fmi3DoStep, by FMUs that say so | set providesIntermediateUpdate, or do not call it
intermediate.missing | W | - | 4.4 | an FMU that provides intermediate updates calls them | call intermediateUpdate, or clear the flag
intermediate.time | E | - | 4.2.2 | intermediate updates lie in the step, and none before a finished one | call intermediateUpdate with intermediateStepFinished for accepted times only
intermediate.access | E | - | 4.2.2 | variables with intermediateUpdate can be read, then set, in an update | accept the calls that the arguments of the callback allow
intermediate.early-return | E | - | 4.1.3 | a step ends early when an update asks for it | return early, or clear canReturnEarlyAfterIntermediateUpdate

[clocks]
clock.inactive-change | E | - | 2.2.8.3 | clocked variables change only while their clock is active | compute them in the model partition of the clock

[configuration]
configuration.status | E | - | 2.3.6 | structural parameters can be set in configuration mode, and arrays have the size that follows | accept the calls, and resize the arrays
configuration.value | E | - | 2.3.6 | structural parameters keep what was set | store the value

[reference]
reference.result | E | * | * | the reference result is reproduced | correct the model, or write the reference again
reference.not-run | I | * | * | the reference result can be reproduced in reasonable time | shorten the result

[memory]
resources.instance-leak | W | * | * | memory does not grow with instances made and freed, or reset | free what is allocated at instantiation, in the reset too
resources.step-leak | W | * | * | memory does not grow with steps | free what is allocated in a step

[promises]
promise.refused | E | 2.1.5 | 2.4.2 | what a flag or a list promises can be called | implement the function, or clear the flag
log.refused | W | 2.1.5 | 2.3.1 | SetDebugLogging takes the categories that are declared | accept them, and return OK
promise.ignored | W | 4.2.1 | - | derivatives of inputs have an effect with canInterpolateInputs | use them, or clear the flag
promise.dependencies | W | - | 2.2.9 | per-element dependencies are those of ModelStructure | generate both from one source

[end]
ended.get | W | 4.2.4 | 2.3.8 | values can be read after the end | allow the functions in the state terminated

[silence]
log.off | W | 2.1.5 | 2.3.1 | nothing is logged where logging is off | ask loggingOn before the logger is called

[another start]
start.time | W | 2.1.6 | 2.3.2 | an experiment can begin at any time | take the start time from the arguments of the setup

[misuse]
misuse.guid | W | 2.1.5 | 2.3.1 | a wrong guid or token is refused | compare it at instantiation
misuse.crash | W | * | * | misuse neither ends the process nor hangs it | check the arguments and the state of the instance
misuse.step-before-init | W | 4.2.4 | 4.2 | a step before initialisation is refused | return an error
misuse.negative-step | W | 4.2.4 | 4.2.1 | a negative step is refused | return an error
misuse.step-after-end | W | 4.2.4 | 4.2 | a step after the end is refused | return an error
misuse.value-reference | W | 2.1.7 | 2.2.7.2 | unknown value references are refused | return an error
misuse.set-fixed | I | 2.2.7 | 2.4.7.4 | fixed parameters and constants are not set between steps | return an error
misuse.value-count | W | - | 2.2.7.2 | a number of values that is not that of the variables is refused | compare nValues with the sizes of the variables
misuse.set-output | W | - | 2.2.7.2 | outputs cannot be set at communication points | return an error
misuse.event-mode | W | - | 4.2 | event mode is refused where it is not used | return an error

[afterwards]
files.written | W | * | * | the FMU writes no files of its own | write only where a parameter says so
files.changed | W | * | * | the FMU leaves its own files alone | write to a temporary folder
process.left | W | * | * | no process outlives the FMU | end child processes when the instance is freed
"""  # noqa: E501
